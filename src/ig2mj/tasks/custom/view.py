"""`TaskView`: what functions of a task read: all worlds by name, the goal, and what was measured.

Axes: W worlds, L literals of the goal, n numbers of an action.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping

import jax.numpy as jnp
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array
from ig2mj.errors import Ig2mjError
from ig2mj.geometry.poses import length, quat_rotate_inverse
from ig2mj.predicates.compile import CompiledExpression, GoalStatus
from ig2mj.predicates.logic import Expression
from ig2mj.tasks.scene_view import SceneView


@dataclasses.dataclass(frozen=True, eq=False, kw_only=True)
class TaskView(SceneView):
    """All worlds after a step, for functions of a task. Every array begins with the world axis; every method is pure.

    Attributes:
      goal: `holds` [W], `fraction` [W] and `literals` [W, L] of the goal expression; L is 0 where there is none.
      action: [W, n] of the step, -1..1; zeros at the start of an episode.
      now: what `measure` gave after this step, by name; empty in `measure` itself.
      before: the same after the step before; None at the start of an episode.
      time_left: share of the episode, 1..0; in `observe` alone, else None.
    """

    goal: GoalStatus
    action: Float[Array, "W n"]
    now: Mapping[str, Array] = dataclasses.field(default_factory=dict)
    before: Mapping[str, Array] | None = None
    time_left: Float[Array, "W"] | None = None
    compiled: Callable[[Expression | str], CompiledExpression] | None = dataclasses.field(default=None, repr=False)

    @property
    def num_worlds(self) -> int:
        """W."""
        return int(self.view.object_com.shape[0])

    def true(self, expression: Expression | str) -> Bool[Array, "W"]:
        """Whether an expression holds, such as "(inside mug_0 fridge_0)".

        Raises:
          UnknownNameError, ArityError, ExpressionError: it does not fit the scene.
        """
        if self.compiled is None:
            raise Ig2mjError("this view evaluates no expressions")
        return jnp.asarray(self.compiled(expression).status(self.states, self.view).holds)

    def distance(self, one: str, other: str) -> Float[Array, "W"]:
        """m between two objects' centres of mass."""
        return length(jnp.asarray(self.com(one)) - jnp.asarray(self.com(other)))

    def reach(self, name: str, hand: int = 0) -> Float[Array, "W"]:
        """m between an acting hand and an object's centre of mass."""
        return length(jnp.asarray(self.hand_pos(hand)) - jnp.asarray(self.com(name)))

    def in_base(self, pos: Float[Array, "W 3"]) -> Float[Array, "W 3"]:
        """A point of the world in the frame of the robot's base."""
        return quat_rotate_inverse(jnp.asarray(self.base_quat()), jnp.asarray(pos) - jnp.asarray(self.base_pos()))

    def falls(self, potential: str) -> Float[Array, "W"]:
        """How much a measure has fallen since the step before: the reward of its decrease."""
        if self.before is None or potential not in self.now:
            raise Ig2mjError(f"'{potential}' is not what `measure` gives ({', '.join(self.now) or 'nothing'})")
        return jnp.asarray(self.before[potential]) - jnp.asarray(self.now[potential])

    def zeros(self) -> Float[Array, "W"]:
        """A zero for every world."""
        return jnp.zeros(self.num_worlds, jnp.float32)
