"""Rewards as differences of potentials, each term by itself (appendix of the paper).

The potential is  w_goal x literals that hold - w_distance x distances + w_pickup x first object is held
- w_stain x stains that are left;  the reward of a step is its increase. Two faults of iGibson's code are avoided: a
distance that is no longer defined keeps its last value (in iGibson it becomes 0, which counts as a gain), and the
baseline is taken at the reset, so that the first step counts, too.

Axes: W worlds, D distances.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import length
from ig2mj.predicates.compile import GoalStatus
from ig2mj.scene.scene import Scene
from ig2mj.states.definitions.stain import STAIN
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates
from ig2mj.tasks.points import locator
from ig2mj.tasks.task import GROUND, Task

TERMS = ("goal", "distance", "pickup", "stains")


@struct.dataclass
class Lift:
    """How an object left the floor.

    Attributes:
      off_floor: it does not stand on the floor now. by_all: all acting hands held it when it last left the floor.
    """

    off_floor: Bool[Array, "W"]
    by_all: Bool[Array, "W"]

    def after(self, off_floor: Bool[Array, "W"], held_by_all: Bool[Array, "W"]) -> Lift:
        """After another step."""
        leaves = off_floor & ~self.off_floor
        return Lift(off_floor, (leaves & held_by_all) | (~leaves & self.by_all))


@struct.dataclass
class ActivityMeasures:
    """Terms of the potential, in every world.

    Attributes:
      literals: of the goal that hold (their share, where the weights say so). distances: m.
      held: the first object is in an acting hand. stains: that are left.
      lift: of the first object, where two hands act; else None.
    """

    literals: Float[Array, "W"]
    distances: Float[Array, "W D"]
    held: Bool[Array, "W"]
    stains: Float[Array, "W"]
    lift: Lift | None = None


class Reward:
    """The reward of a task for one robot. Pure; constants only."""

    def __init__(self, task: Task, robot: str, scene: Scene, model: StateModel):
        """Raises UnknownNameError, AbilityError: the task does not fit the scene."""
        acts = task.acts(robot)
        self._weights = acts.weights
        self._locate = [(locator(a, scene, model), locator(b, scene, model)) for a, b in task.points(robot)]
        own = np.flatnonzero(scene.tables.hand_agent == 0)
        self.hands = own[np.array(acts.hands, int)]
        first = task.objects_of_interest[:1]
        self._first = scene.object_index(first[0]) if first else None
        self._ground = np.flatnonzero(np.isin(np.array(scene.tables.object_categories), GROUND))
        self._stain_row = None if task.stains_of is None else STAIN.row_of(model, scene.object_index(task.stains_of))

    def measure(
        self, view: PhysicsView, states: ExtendedStates, status: GoalStatus, before: ActivityMeasures | None = None
    ) -> ActivityMeasures:
        """The measures now.

        Args:
          before: of the step before, for distances that are no longer defined; None: those are 0.
        """
        distances = []
        for d, (start, end) in enumerate(self._locate):
            (a, has_a), (b, has_b) = start(view, states), end(view, states)
            last = jnp.zeros(a.shape[0], jnp.float32) if before is None else before.distances[:, d]
            distances.append(jnp.where(has_a & has_b, length(a - b), last))
        share = jnp.asarray(status.fraction, jnp.float32)
        count = 1 if self._weights.share else status.literals.shape[-1]
        stains = jnp.zeros(share.shape[0], jnp.float32)
        if self._stain_row is not None:
            stains = jnp.asarray(states.stain.alive)[:, self._stain_row].sum(-1).astype(jnp.float32)
        held = self.holding(view)
        two = len(self.hands) > 1 and self._first is not None
        lift = self._lift(view, held, None if before is None else before.lift) if two else None
        apart = jnp.stack(distances, axis=-1) if distances else jnp.zeros((share.shape[0], 0), jnp.float32)
        return ActivityMeasures(share * count, apart, jnp.any(held, axis=1), stains, lift)

    def _lift(self, view: PhysicsView, held: Bool[Array, "W H"], before: Lift | None) -> Lift:
        """How the first object left the floor; `before` is of the step before, None at the start of episodes."""
        off_floor = ~jnp.asarray(view.touching)[:, self._first][:, self._ground].any(1)
        return (
            Lift(off_floor, jnp.zeros_like(off_floor))
            if before is None
            else before.after(off_floor, jnp.all(held, axis=1))
        )

    def holding(self, view: PhysicsView) -> Bool[Array, "W H"]:
        """Which acting hands hold the first object."""
        if self._first is None:
            return jnp.zeros((view.held.shape[0], len(self.hands)), bool)
        return jnp.asarray(view.held)[:, self.hands, self._first]

    def terms(self, before: ActivityMeasures, now: ActivityMeasures) -> dict[str, Float[Array, "W"]]:
        """The step's reward by `TERMS`, with weights; their sum is the reward."""
        w = self._weights
        return {
            "goal": w.goal * (now.literals - before.literals),
            "distance": -w.distance * self._approach(before, now),
            "pickup": w.pickup * (now.held.astype(jnp.float32) - before.held.astype(jnp.float32)),
            "stains": -w.stain * (now.stains - before.stains),
        }

    def _approach(self, before: ActivityMeasures, now: ActivityMeasures) -> Float[Array, "W"]:
        """How much the distance that counts has grown, m."""
        change = now.distances - before.distances
        if not self._weights.staged or not change.shape[1]:
            return change.sum(-1)
        later = change[:, 1] if change.shape[1] > 1 else jnp.zeros_like(change[:, 0])
        same = now.held == before.held  # at the change of the stage the two distances have nothing in common
        return jnp.where(same, jnp.where(now.held, later, change[:, 0]), 0.0)
