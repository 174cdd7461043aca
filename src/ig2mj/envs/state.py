"""`EnvState`: everything of an environment that changes from step to step.

Axis: W worlds.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from flax import struct
from jaxtyping import Bool, Float, Int, UInt

from ig2mj.engine.view import Array, PhysicsView, length
from ig2mj.predicates.compile import GoalStatus
from ig2mj.sensors.base import SensorMemory
from ig2mj.states.world import ExtendedStates
from ig2mj.tasks.objective import Measures
from ig2mj.worlds.batch import Batch
from ig2mj.worlds.draw import Draw


def metrics_of(info: Mapping[str, Array]) -> dict[str, Array]:
    """The entries of `EnvState.info` that `EnvState.metrics` has."""
    return {name: array for name, array in info.items() if name.startswith("reward/") or name == "success"}


@struct.dataclass
class EnvState:
    """All worlds of an environment.

    Attributes:
      batch: of the core. obs: observations by name. reward: of the last step.
      terminated: success or failure ended the episode. truncated: the horizon or a guard did; never both.
      info: "success"; "steps" of the episode; "reward/..." of each term; "bad_actions" (numbers of the last action that
        were not finite); "flags" (`guards.Flag`); and the task's own. Of activities: "goal_progress" (share of the
        goal's literals), "held" (the first object is in an acting hand), "success_in_hand" (success while the first
        object is in all acting hands); where two hands act also "held_by_all" (all of them hold it), "off_floor"
        (it touches no floor) and "lifted_by_all" (success, and all of them held it when it last left the floor).
      measures: values that rewards are differences of. status: of the task's goal.
      bad_actions: non-finite numbers of actions that were replaced by 0, since the first reset.
      memory: what sensors keep of the last reading; None if no sensor needs it.
    """

    batch: Batch
    obs: dict[str, Array]
    reward: Float[Array, "W"]
    terminated: Bool[Array, "W"]
    truncated: Bool[Array, "W"]
    info: dict[str, Any]
    measures: Measures
    status: GoalStatus
    bad_actions: Int[Array, "W"]
    memory: SensorMemory | None = None

    @property
    def done(self) -> Bool[Array, "W"]:
        """The episode is over."""
        return self.terminated | self.truncated

    @property
    def draw(self) -> Draw:
        """What was drawn for the worlds' episodes (`ig2mj.Randomize`)."""
        return self.batch.draw

    @property
    def metrics(self) -> dict[str, Array]:
        """Of `info` what trainers log: "success", and each reward term as "reward/...", [W]."""
        return metrics_of(self.info)

    def __repr__(self) -> str:
        """Shapes only: nothing is read, so that it is quick and works for a stale state."""
        physics = getattr(getattr(self.batch, "world", None), "physics", None)
        stale = ", stale" if getattr(physics, "is_stale", bool)() else ""
        obs = self.obs.items() if isinstance(self.obs, dict) else ()
        shapes = (f"{name} {getattr(a, 'dtype', '?')}{list(getattr(a, 'shape', ()))}" for name, a in obs)
        return f"EnvState({length(self.reward)} worlds{stale}; obs: {', '.join(shapes)})"


@struct.dataclass
class StepContext:
    """What rewards, ends of episodes and observations of a step are computed from.

    Attributes:
      view, states: of the worlds. controllers: states of the robots' controllers. flags: `guards.Flag` of each world.
      control_steps: of the episode, so far. action: of the step; None at the start of episodes.
      draw: noise that was drawn for the episodes. key: theirs, where observations have noise.
    """

    view: PhysicsView
    states: ExtendedStates
    controllers: tuple[Any, ...]
    flags: Int[Array, "W"]
    control_steps: Int[Array, "W"]
    action: Float[Array, "W n"] | None = None
    draw: Draw = Draw()
    key: UInt[Array, "W 2"] | None = None

    @classmethod
    def of(cls, batch: Batch, action: Array | None = None) -> StepContext:
        """Of the worlds of a batch."""
        world = batch.world
        noise = Draw(noise=batch.draw.noise)
        key = None if noise.noise is None else world.key
        return cls(world.view, world.states, batch.controllers, batch.flags, world.step, action, noise, key)


@struct.dataclass
class SeenState:
    """Results of a step that are computed after physics, in one program."""

    obs: dict[str, Array]
    reward: Float[Array, "W"]
    terminated: Bool[Array, "W"]
    truncated: Bool[Array, "W"]
    info: dict[str, Array]
    measures: Measures
    status: GoalStatus
