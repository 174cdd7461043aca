"""The objective of a BDDL activity: the share of its goal that holds (iGibson's behavior_task.py).

Axes: W worlds, n objects, H hands.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import relative_pose
from ig2mj.predicates.compile import CompiledExpression, GoalStatus
from ig2mj.scene.scene import Scene
from ig2mj.states.world import ExtendedStates


@struct.dataclass
class GoalProgress:
    """Share of the goal that holds, in every world."""

    share: Float[Array, "W"]


class BddlObjective:
    """See `ig2mj.tasks.objective.Objective`."""

    terms = ("goal",)
    outcomes: tuple[str, ...] = ()

    def __init__(self, objects: tuple[str, ...], goal: CompiledExpression, scene: Scene):
        """`objects`: that the activity is about. `goal`: of the same scene."""
        self._objects = np.array([scene.object_index(name) for name in objects], int)
        self._hands = np.flatnonzero(scene.tables.hand_agent == 0)
        tables, model = scene.tables, scene.model
        self._joints = np.flatnonzero(np.isin(tables.openable_object, self._objects))
        self._shut = tables.openable_closed[self._joints].astype(np.float32)
        self._range = (tables.openable_open - tables.openable_closed)[self._joints].astype(np.float32)
        own = [int(np.flatnonzero(model.jnt_qposadr == a)[0]) for a in tables.openable_qposadr[self._joints]]
        pose = [*(f"pos_{a}" for a in "xyz"), *(f"quat_{a}" for a in "wxyz")]
        held = [f"in_hand_{k}" for k in range(len(self._hands))]
        self.vectors: dict[str, tuple[str, ...]] = {
            "privileged_state": (
                *(f"{name}_{n}" for name in objects for n in pose),
                *(f"{name}_{n}" for name in objects for n in held),
                *(f"{model.joint(number).name}_open" for number in own),
                *(f"holds_{k}" for k in range(len(goal.atoms))),
                *("goal_progress", "time_left"),
            )
        }

    def measure(
        self,
        view: PhysicsView,
        states: ExtendedStates,
        status: GoalStatus,
        row: Int[Array, "W"] | None,
        before: GoalProgress | None = None,
        action: Float[Array, "W n"] | None = None,
    ) -> GoalProgress:
        return GoalProgress(jnp.asarray(status.fraction, jnp.float32))

    def rewards(self, before: GoalProgress, now: GoalProgress) -> dict[str, Float[Array, "W"]]:
        """iGibson's reward: the increase of the share that holds."""
        return {"goal": now.share - before.share}

    def ended(self, now: GoalProgress, status: GoalStatus) -> tuple[Bool[Array, "W"], Bool[Array, "W"]]:
        """Success ends an episode; there is no failure."""
        holds = jnp.asarray(status.holds)
        return holds, holds

    def info(self, view: PhysicsView, now: GoalProgress, status: GoalStatus) -> dict[str, Array]:
        return {"goal_progress": now.share}

    def observe(
        self,
        view: PhysicsView,
        states: ExtendedStates,
        now: GoalProgress,
        status: GoalStatus,
        time_left: Float[Array, "W"],
    ) -> dict[str, Float[Array, "W n"]]:
        """`privileged_state`: poses of the objects in the frame of the robot's base, which hands hold them, how
        far their doors, drawers and lids are open (0 to 1), which literals of the goal are true."""
        agent, worlds = view.agent, view.object_com.shape[0]
        base_pos, base_quat = jnp.asarray(agent.base_pos)[:, :1], jnp.asarray(agent.base_quat)[:, :1]
        com, quat = jnp.asarray(view.object_com)[:, self._objects], jnp.asarray(view.object_quat)[:, self._objects]
        place, turn = relative_pose(base_pos, base_quat, com, quat)
        held = jnp.asarray(view.held)[:, self._hands][:, :, self._objects].swapaxes(1, 2)
        opened = (jnp.asarray(view.joint_pos)[:, self._joints] - self._shut) / self._range
        columns = [
            jnp.concatenate([place, turn], axis=-1).reshape(worlds, -1),
            held.reshape(worlds, -1).astype(jnp.float32),
            opened.astype(jnp.float32),
            jnp.asarray(status.literals).astype(jnp.float32),
            now.share[:, None],
            time_left[:, None],
        ]
        return {"privileged_state": jnp.concatenate(columns, axis=1)}
