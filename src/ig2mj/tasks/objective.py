"""`Objective`: a task's measures, rewards, ends of episodes and observations, computed after physics.

Axes: W worlds.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.predicates.compile import GoalStatus
from ig2mj.states.world import ExtendedStates

Measures = Any
"""What an objective must know of the previous step: a pytree of arrays that begin with the world axis."""


@runtime_checkable
class Objective(Protocol):
    """The objective of one task for one robot in one scene. Constants only; all methods are pure.

    Attributes:
      terms: names of the terms that the reward is the sum of.
      outcomes: names in `info` of what is reported of an episode when it ends, besides success: booleans [W], whose
        mean over episodes `ig2mj rollout`, `evaluate` and `train` report.
      vectors: observations that it makes, such as "privileged_state", and what each of their numbers means.
    """

    @property
    def terms(self) -> tuple[str, ...]: ...

    @property
    def outcomes(self) -> tuple[str, ...]: ...

    @property
    def vectors(self) -> Mapping[str, tuple[str, ...]]: ...

    def measure(
        self,
        view: PhysicsView,
        states: ExtendedStates,
        status: GoalStatus,
        row: Int[Array, "W"] | None,
        before: Measures | None = None,
        action: Float[Array, "W n"] | None = None,
    ) -> Measures:
        """What is measured now.

        Args:
          status: of the task's goal; empty for a task without a goal expression.
          row: of the pool that the episodes begin with; None after steps. before: of the step before; None at the
            start of episodes. action: of the step; None likewise.
        """
        ...

    def rewards(self, before: Measures, now: Measures) -> dict[str, Float[Array, "W"]]:
        """The step's reward by `terms`."""
        ...

    def ended(self, now: Measures, status: GoalStatus) -> tuple[Bool[Array, "W"], Bool[Array, "W"]]:
        """Whether the task is done, and whether the episode ends, with success or failure."""
        ...

    def info(self, view: PhysicsView, now: Measures, status: GoalStatus) -> dict[str, Array]:
        """Further quantities of every step, "goal_progress" (0..1) among them. The keys are always the same."""
        ...

    def observe(
        self,
        view: PhysicsView,
        states: ExtendedStates,
        now: Measures,
        status: GoalStatus,
        time_left: Float[Array, "W"],
    ) -> dict[str, Float[Array, "W n"]]:
        """All of `vectors`. `time_left`: share of the episode, 1..0."""
        ...
