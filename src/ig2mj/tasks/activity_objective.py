"""The objective of the paper's activities: a goal expression, rewards as of `Reward`, ground truth to observe."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.geometry.poses import quat_rotate_inverse, relative_pose
from ig2mj.predicates.compile import GoalStatus
from ig2mj.scene.scene import Scene
from ig2mj.states.model import StateModel
from ig2mj.states.particles import NUM_PARTICLES
from ig2mj.states.world import ExtendedStates
from ig2mj.tasks.points import locator
from ig2mj.tasks.reward import TERMS, ActivityMeasures, Reward
from ig2mj.tasks.task import Task

DEGREES = 100.0
"""Celsius that are 1 in `privileged_state`."""


class ActivityObjective:
    """See `ig2mj.tasks.objective.Objective`. Attributes: reward: the terms and what they are made of."""

    terms = TERMS

    def __init__(self, task: Task, robot: str, scene: Scene, model: StateModel):
        """Raises UnknownNameError, AbilityError: the task does not fit the scene."""
        self.reward = Reward(task, robot, scene, model)
        self._objects = np.array([scene.object_index(name) for name in task.objects_of_interest], int)
        self._ends = [locator(end, scene, model) for _, end in task.points(robot)]
        self.vectors = {"privileged_state": privileged_names(task, robot)}
        lifts = len(self.reward.hands) > 1 and bool(task.objects_of_interest)
        self.outcomes = ("success_in_hand", *(("lifted_by_all",) if lifts else ())) if len(self.reward.hands) else ()

    def measure(
        self,
        view: PhysicsView,
        states: ExtendedStates,
        status: GoalStatus,
        row: Int[Array, "W"] | None,
        before: ActivityMeasures | None = None,
        action: Float[Array, "W n"] | None = None,
    ) -> ActivityMeasures:
        return self.reward.measure(view, states, status, before)

    def rewards(self, before: ActivityMeasures, now: ActivityMeasures) -> dict[str, Float[Array, "W"]]:
        return self.reward.terms(before, now)

    def ended(self, now: ActivityMeasures, status: GoalStatus) -> tuple[Bool[Array, "W"], Bool[Array, "W"]]:
        """Success ends an episode; there is no failure."""
        holds = jnp.asarray(status.holds)
        return holds, holds

    def info(self, view: PhysicsView, now: ActivityMeasures, status: GoalStatus) -> dict[str, Array]:
        by_all, success = self.reward.holding(view).all(1), jnp.asarray(status.holds)
        found = {
            "success_in_hand": success & by_all,
            "goal_progress": jnp.asarray(status.fraction, jnp.float32),
            "held": now.held,
        }
        if now.lift is not None:
            found |= {
                "held_by_all": by_all,
                "off_floor": now.lift.off_floor,
                "lifted_by_all": success & now.lift.by_all,
            }
        return found

    def observe(
        self,
        view: PhysicsView,
        states: ExtendedStates,
        now: ActivityMeasures,
        status: GoalStatus,
        time_left: Float[Array, "W"],
    ) -> dict[str, Float[Array, "W n"]]:
        """`privileged_state`: hands and objects in the frame of the robot's base, states, distances, the goal."""
        agent, worlds = view.agent, view.object_com.shape[0]
        base_pos, base_quat = jnp.asarray(agent.base_pos)[:, :1], jnp.asarray(agent.base_quat)[:, :1]

        def moving(pos: Array, quat: Array, speed: Array) -> Float[Array, "W n 10"]:
            place, turn = relative_pose(base_pos, base_quat, jnp.asarray(pos), jnp.asarray(quat))
            return jnp.concatenate([place, turn, quat_rotate_inverse(base_quat, jnp.asarray(speed))], axis=-1)

        hands, objects = self.reward.hands, self._objects
        of_hands = moving(agent.hand_pos[:, hands], agent.hand_quat[:, hands], agent.hand_linvel[:, hands])
        of_objects = moving(view.object_com[:, objects], view.object_quat[:, objects], view.object_linvel[:, objects])
        scalars = [
            jnp.asarray(states.max_temperature)[:, objects] / DEGREES,
            jnp.asarray(states.wetness)[:, objects],
            jnp.asarray(states.sliced)[:, objects],
            jnp.asarray(states.toggled_on)[:, objects],
        ]
        ends = []
        for locate in self._ends:
            pos, there = locate(view, states)
            own = quat_rotate_inverse(base_quat[:, 0], pos - base_pos[:, 0])
            ends.append(jnp.where(there[:, None], own, 0.0))
        columns = [
            of_hands.reshape(worlds, -1),
            of_objects.reshape(worlds, -1),
            *[jnp.asarray(s, jnp.float32) for s in scalars],
            *ends,
            now.distances,
            self.reward.holding(view).astype(jnp.float32),
            now.stains[:, None] / NUM_PARTICLES,
            jnp.asarray(status.fraction, jnp.float32)[:, None],
            time_left[:, None],
        ]
        return {"privileged_state": jnp.concatenate(columns, axis=1)}


def privileged_names(task: Task, robot: str) -> tuple[str, ...]:
    """What each number of `privileged_state` means."""
    hands = [f"hand_{h}" for h in task.acts(robot).hands]
    moving = [*(f"pos_{a}" for a in "xyz"), *(f"quat_{a}" for a in "wxyz"), *(f"velocity_{a}" for a in "xyz")]
    objects, distances = task.objects_of_interest, range(len(task.distances))
    return (
        *(f"{hand}_{n}" for hand in hands for n in moving),
        *(f"{obj}_{n}" for obj in objects for n in moving),
        *(f"{obj}_{n}" for n in ("max_temperature", "wetness", "sliced", "toggled_on") for obj in objects),
        *(f"end_{d}_{a}" for d in distances for a in "xyz"),
        *(f"distance_{d}" for d in distances),
        *(f"{hand}_holds" for hand in hands),
        *("stains", "goal_progress", "time_left"),
    )
