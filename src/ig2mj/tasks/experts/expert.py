"""`Expert`: from the plan of an activity's hands to the actions of the task's own action space.

Axes: W worlds, n numbers of an action.
"""

from __future__ import annotations

from collections.abc import Mapping

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ig2mj.agents.base import ACTION_PERIOD, Robot
from ig2mj.agents.task_robot import HandControl, TaskRobot
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.errors import EngineError
from ig2mj.geometry.poses import quat_conjugate, quat_multiply, quat_rotate, quat_rotate_inverse
from ig2mj.scene.scene import Scene
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates
from ig2mj.tasks.actions import TURN_SPEED
from ig2mj.tasks.experts.motion import HandMotion
from ig2mj.tasks.experts.quarters import quarter_turn, turned_view
from ig2mj.tasks.experts.roles import with_roles
from ig2mj.tasks.experts.sight import Belief, ExpertView
from ig2mj.tasks.task import Task, role_of

TURN_STEP = TURN_SPEED * ACTION_PERIOD
"""rad."""


class Expert:
    """An expert of one task for one robot. Calling it is pure and may be traced.

    Attributes:
      task, robot: what is done by whom. grasping: mode; except with mittens actions have a number for each hand that
        closes it.
    """

    def __init__(self, task: Task, robot: str, scene: Scene, model: StateModel, grasping: str = "mitten"):
        """
        Args:
          scene: with the robot. model: of the scene's states.

        Raises:
          EngineError: the task has no expert, or the robot lacks hands that tasks move.
        """
        if task.expert is None:
            raise EngineError(f"{task.name} has no expert: give its Task one (`expert=`)")
        self.task, self.robot, self.grasping = task, robot, grasping
        self._plan, self._scene, self._model = task.expert, with_roles(scene, task.roles), model
        at_home = {here: name for name, here in task.roles.items()}
        self._objects = tuple(at_home.get(name, name) for name in task.objects_of_interest)
        own = np.flatnonzero(scene.tables.hand_agent == 0)
        body = scene.agents[0]
        if not isinstance(body, TaskRobot) or not body.hand_controls:
            raise EngineError(f"robot '{robot}' has no hands that an expert can move")
        hands = role_of(task, robot, body).hands
        self._hands = tuple(int(own[h]) for h in hands)
        self._controls = tuple(body.hand_controls[h] for h in hands)
        rays = [hand for agent in scene.agents if isinstance(agent, Robot) for hand in agent.hand_rays()]
        self._grips = np.stack([hand.grasp_point for hand in rays]).astype(np.float32)

    def __call__(
        self, view: PhysicsView, states: ExtendedStates, beliefs: Mapping[str, Belief] | None = None
    ) -> Float[Array, "W n"]:
        """The action of every world, -1 to 1.

        Args:
          beliefs: where it takes objects to be, in the frame of the robot's base; None: where they are.
        """
        base = jnp.asarray(view.agent.base_quat)[:, 0]
        if self.task.turned:  # experts see the world as it is in the task's own home
            turn = quarter_turn(-self.task.turned)
            view, base = turned_view(view, turn), quat_multiply(turn, base)
        see = ExpertView(
            view=view,
            states=states,
            scene=self._scene,
            model=self._model,
            hands=self._hands,
            controls=self._controls,
            objects=self._objects,
            grips=self._grips,
            grasping=self.grasping,
            beliefs={self._at_home(n): _of_the_world(base, belief) for n, belief in (beliefs or {}).items()},
        )
        return jnp.concatenate(
            [self._action(base, motion, hand) for motion, hand in zip(self._plan(see), self._controls, strict=True)],
            axis=1,
        )

    def _at_home(self, name: str) -> str:
        """The name that an object has in the task's own home."""
        return next((own for own, here in self.task.roles.items() if here == name), name)

    def _action(self, base: Float[Array, "W 4"], motion: HandMotion, hand: HandControl) -> Float[Array, "W k"]:
        """Of one hand: in the base's frame, slowed down evenly where a number would be beyond 1."""
        parts = [_limited(quat_rotate_inverse(base, motion.move) / (hand.speed * ACTION_PERIOD))]
        parts.append(_limited(quat_rotate_inverse(base, motion.turn) / TURN_STEP))
        if self.grasping != "mitten":
            parts.append(jnp.where(motion.close, -hand.opens, hand.opens)[:, None])
        return jnp.concatenate(parts, axis=1)


def _of_the_world(base: Float[Array, "W 4"], belief: Belief) -> Belief:
    """What is believed in the frame of a base, in the world's."""
    turn = quat_multiply(quat_multiply(base, belief.turn), quat_conjugate(base))
    return Belief(quat_rotate(base, belief.move), turn)


def _limited(v: Float[Array, "W 3"]) -> Float[Array, "W 3"]:
    return jnp.clip(v / jnp.maximum(1.0, jnp.max(jnp.abs(v), axis=1, keepdims=True)), -1.0, 1.0)
