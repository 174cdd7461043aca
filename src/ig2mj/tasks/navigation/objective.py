"""Measures, rewards, ends and observations of navigation tasks (iGibson's tasks).

The potential is the remaining distance, along the floor or in a straight line (m), or how far furniture stands open.
The reward of a step is the decrease of the potential, plus `success_reward` where the goal is reached, plus
`collision_reward` where the robot touches something that is not the ground. Where the potential is not defined, off the
map of the free floor, it keeps its last value.

Axes: W worlds, P rows of the pool.
"""

from __future__ import annotations

import jax.numpy as jnp
import mujoco
import numpy as np
from flax import struct
from jaxtyping import Bool, Float, Int

from ig2mj.agents.turtlebot import BASE_RADIUS
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import length, quat_rotate_inverse
from ig2mj.predicates.compile import GoalStatus
from ig2mj.scene.scene import Scene
from ig2mj.states.world import ExtendedStates
from ig2mj.tasks.navigation.floor import look_up
from ig2mj.tasks.navigation.starts import NavigationStarts
from ig2mj.tasks.navigation.task import NavigationTask
from ig2mj.tasks.task import GROUND

CLOSED = 0.05
"""Share of its range up to which a joint counts as closed."""

BESIDE = 0.003
"""m between two TurtleBots that touch."""


@struct.dataclass
class NavigationMeasures:
    """Measures of every world.

    Attributes:
      row: of the pool, with which the episode began. potential: see the module's text. ahead: the next point of the
        way on the floor, world x and y, m.
      reached: the goal is. hit: the robot touches what is not the ground. fallen: below the floor.
      start: the potential, or the way on the floor, at the start. pos: of the base, m. travelled: m since the start.
      collisions: steps with a hit since the start.
    """

    row: Int[Array, "W"]
    potential: Float[Array, "W"]
    ahead: Float[Array, "W 2"]
    reached: Bool[Array, "W"]
    hit: Bool[Array, "W"]
    fallen: Bool[Array, "W"]
    start: Float[Array, "W"]
    pos: Float[Array, "W 2"]
    travelled: Float[Array, "W"]
    collisions: Int[Array, "W"]


class NavigationObjective:
    """See the module's text and `ig2mj.tasks.objective.Objective`."""

    def __init__(self, task: NavigationTask, scene: Scene, starts: NavigationStarts):
        """`starts`: of this task in this scene."""
        self._task, self._floor, tables = task, starts.floor, scene.tables
        self._goals, self._fields, self._shortest = starts.goals, starts.fields, starts.shortest
        self._ground = np.isin(np.array(tables.object_categories), GROUND)
        self._hand = int(np.flatnonzero(tables.hand_agent == 0)[0]) if task.goal == "reach" else -1
        strewn = scene.additions[: len(task.objects)]
        self._loose = np.array([scene.object_index(a.name) for a in strewn], int)
        free = _free_address(scene)
        self._height = -np.inf if free is None else float(starts.pool.physics.whole("qpos")[0, free + 2])
        opened = np.isin(np.array(tables.object_categories)[tables.openable_object], task.opened)
        self._joints = np.flatnonzero(opened)
        kinds = [_joint_type(scene, int(tables.openable_qposadr[j])) for j in self._joints]
        slides = np.array(kinds, int) == int(mujoco.mjtJoint.mjJNT_SLIDE)
        self._weights = np.where(slides, task.prismatic_weight, task.revolute_weight).astype(np.float32)
        self._closed = tables.openable_closed[self._joints].astype(np.float32)
        self._slack = CLOSED * np.abs(tables.openable_open[self._joints] - self._closed)
        self._furniture = tables.openable_object[self._joints]
        self._names = [f"{scene.object_names[o]}_{n}" for n, o in enumerate(self._furniture)]
        closing = task.goal == "close"
        self.outcomes: tuple[str, ...] = ()
        self.terms: tuple[str, ...] = ("potential",) if closing else ("potential", "collision", "success")
        privileged = (
            *(() if closing else ("goal_x", "goal_y", "goal_z", "way_left", "ahead_x", "ahead_y")),
            *("velocity_x", "velocity_y", "yaw_rate", "collision"),
            *((f"eef_to_goal_{a}" for a in "xyz") if task.goal == "reach" else ()),
            *(f"{scene.object_names[o]}_{a}" for o in self._loose for a in "xyz"),
            *(f"other_{k}_{a}" for k in range(task.others) for a in "xyz"),
            *(f"{name}_opening" for name in self._names),
            *(f"{name}_{a}" for name in self._names for a in "xyz"),
            "time_left",
        )
        self.vectors: dict[str, tuple[str, ...]] = {"privileged_state": privileged}
        if not closing:
            names = ("goal_distance", "goal_angle", "linear_velocity", "angular_velocity")
            reach = ("goal_height", "eef_x", "eef_y", "eef_z") if task.goal == "reach" else ()
            self.vectors["task_obs"] = (*names, *reach)

    def measure(
        self,
        view: PhysicsView,
        states: ExtendedStates,
        status: GoalStatus,
        row: Int[Array, "W"] | None,
        before: NavigationMeasures | None = None,
        action: Float[Array, "W n"] | None = None,
    ) -> NavigationMeasures:
        row = jnp.asarray(row if before is None else before.row)
        base = jnp.asarray(view.agent.base_pos)[:, 0]
        pos, goal = base[:, :2], jnp.asarray(self._goals)[row]
        floor = self._floor
        way, ahead = look_up(jnp.asarray(self._fields), row, pos, floor.origin, floor.resolution)
        hit = self._hit(view)
        if self._task.goal == "close":
            opening = self._opening(view)
            now = (opening * self._weights).sum(1)
            reached = jnp.all(opening <= self._slack, axis=1)
        else:
            tip = pos if self._hand < 0 else jnp.asarray(view.agent.hand_pos)[:, self._hand]
            straight = jnp.asarray(length(tip - goal[:, : tip.shape[1]]))
            now = way if self._task.geodesic else straight
            reached = straight < self._task.tolerance
        zero = jnp.zeros_like(row)
        fallen = base[:, 2] < self._height - self._task.fall
        if before is None:
            start = now if self._task.goal == "close" else jnp.asarray(self._shortest)[row]
            now = jnp.where(jnp.isfinite(now), now, start)
            nothing = zero.astype(bool)
            return NavigationMeasures(
                row, now, ahead, nothing, nothing, nothing, start, pos, zero.astype(jnp.float32), zero
            )
        now = jnp.where(jnp.isfinite(now), now, before.potential)
        travelled = before.travelled + length(pos - before.pos)
        collisions = before.collisions + hit.astype(jnp.int32)
        return NavigationMeasures(row, now, ahead, reached, hit, fallen, before.start, pos, travelled, collisions)

    def goal(self, now: NavigationMeasures) -> Float[Array, "W 3"] | None:
        """Where the goal is, world frame, m; None where furniture is to be closed."""
        return None if self._task.goal == "close" else jnp.asarray(self._goals)[now.row]

    def rewards(self, before: NavigationMeasures, now: NavigationMeasures) -> dict[str, Float[Array, "W"]]:
        task = self._task
        terms = {
            "potential": task.potential_weight * (before.potential - now.potential),
            "collision": task.collision_reward * now.hit.astype(jnp.float32),
            "success": task.success_reward * now.reached.astype(jnp.float32),
        }
        return {name: terms[name] for name in self.terms}

    def ended(self, now: NavigationMeasures, status: GoalStatus) -> tuple[Bool[Array, "W"], Bool[Array, "W"]]:
        """Success at the goal; failure after too many collisions, or below the floor. Closing furniture has no
        success: its episodes go on, so that what was closed must stay closed."""
        success = now.reached if self._task.goal != "close" else jnp.zeros_like(now.reached)
        return success, success | now.fallen | (now.collisions > self._task.max_collisions)

    def info(self, view: PhysicsView, now: NavigationMeasures, status: GoalStatus) -> dict[str, Array]:
        """ "spl": success weighted by the length of the way (Anderson et al. 2018), for tasks of going to a point."""
        progress = jnp.where(now.reached, 1.0, 1.0 - now.potential / jnp.maximum(now.start, 1e-6))
        found = {"goal_progress": jnp.clip(progress, 0.0, 1.0), "collisions": now.collisions, "reached": now.reached}
        if self._task.goal == "point":
            found["spl"] = now.reached * now.start / jnp.maximum(jnp.maximum(now.start, now.travelled), 1e-6)
        return found

    def observe(
        self,
        view: PhysicsView,
        states: ExtendedStates,
        now: NavigationMeasures,
        status: GoalStatus,
        time_left: Float[Array, "W"],
    ) -> dict[str, Float[Array, "W n"]]:
        """`task_obs`, as iGibson's: the goal in polar coordinates (m, rad) of the base's frame, speed forwards (m/s)
        and to the left (rad/s); to reach, also the goal's height and the gripper, in that frame. `privileged_state`:
        all in the base's frame, m, m/s, rad/s."""
        task, agent = self._task, view.agent
        base, quat = jnp.asarray(agent.base_pos)[:, 0], jnp.asarray(agent.base_quat)[:, 0]
        goal = jnp.asarray(self._goals)[now.row]

        def own(point: Array) -> Float[Array, "W 3"]:
            return quat_rotate_inverse(quat, point - base)

        velocity = quat_rotate_inverse(quat, jnp.asarray(agent.base_linvel)[:, 0])
        turning = quat_rotate_inverse(quat, jnp.asarray(agent.base_angvel)[:, 0])[:, 2]
        place, columns, found = own(goal), [], {}
        if task.goal != "close":
            ahead = own(jnp.concatenate([now.ahead, base[:, 2:]], axis=1))[:, :2]
            columns += [place, now.potential[:, None], ahead]
            polar = [length(place[:, :2]), jnp.arctan2(place[:, 1], place[:, 0]), velocity[:, 0], turning]
            if self._hand >= 0:
                hand = jnp.asarray(agent.hand_pos)[:, self._hand]
                polar += [place[:, 2], *own(hand).T]
            found["task_obs"] = jnp.stack(polar, axis=1)
        columns += [velocity[:, :2], turning[:, None], now.hit[:, None].astype(jnp.float32)]
        if self._hand >= 0:
            columns.append(place - own(jnp.asarray(agent.hand_pos)[:, self._hand]))
        com = jnp.asarray(view.object_com)
        columns += [own(com[:, k]) for k in self._loose]
        columns += [own(jnp.asarray(agent.base_pos)[:, 1 + k]) for k in range(task.others)]
        if len(self._joints):
            columns.append(self._opening(view))
            columns += [own(com[:, k]) for k in self._furniture]
        found["privileged_state"] = jnp.concatenate([*columns, time_left[:, None]], axis=1)
        return found

    def _hit(self, view: PhysicsView) -> Bool[Array, "W"]:
        touching = (jnp.asarray(view.agent.touching)[:, 0] & ~self._ground).any(1)
        if not self._task.others:
            return touching
        pos = jnp.asarray(view.agent.base_pos)[:, :, :2]
        return touching | (length(pos[:, 1:] - pos[:, :1]) <= 2 * BASE_RADIUS + BESIDE).any(1)

    def _opening(self, view: PhysicsView) -> Float[Array, "W n"]:
        return jnp.abs(jnp.asarray(view.joint_pos)[:, self._joints] - self._closed)


def _free_address(scene: Scene) -> int | None:
    """Of the first robot's base in qpos; None: it is bolted to the floor."""
    joint = int(scene.model.body_jntadr[scene.tables.agent_body[0]])
    return None if joint < 0 else int(scene.model.jnt_qposadr[joint])


def _joint_type(scene: Scene, address: int) -> int:
    return int(scene.model.jnt_type[np.flatnonzero(scene.model.jnt_qposadr == address)[0]])
