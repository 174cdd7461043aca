"""`PlannedExpert`: the planner as the expert of an environment's worlds.

    expert = expert_of(ig2mj.make("activity/installing_a_fax_machine", worlds=4, engine="native"))
    state = env.reset(0)
    state = env.step_autoreset(state, expert(state))

It plans for whatever holds in the state that it is shown, and its program ends its phases by what it sees, so that
another agent may act in its place: the action that it returns is what the planner would do next. It has a memory, the
plan and the program of each world, so it is called with every state in turn, once, and is no part of a compiled
program.

Axes: W worlds, n numbers of the environment's action.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float

from ig2mj.engine.view import Array
from ig2mj.envs.environment import Environment, EnvState
from ig2mj.envs.planning_stage import EnvironmentStage
from ig2mj.errors import EngineError
from ig2mj.planning.physics import PhysicsRung, check_robot
from ig2mj.planning.solver import Solving
from ig2mj.planning.steps import PlanningError
from ig2mj.planning.task_planner import TaskPlanner

AGAIN = 50
"""Agent steps, 5 s, after which a world is planned for again where no plan has reached the goal."""


class PlannedExpert:
    """See the module's text.

    Attributes:
      given_up: [W] worlds whose present plan ended without the goal. They get actions that leave everything as it is,
        until their episode ends or, `AGAIN` steps later, the planner begins again.
      noisy: [n] numbers of the action that noise may be added to: all but the eye's and the hands' switches.
    """

    def __init__(self, env: Environment, seed: int = 0):
        """
        Args:
          env: with a goal; its action has every number of the robot's (`whole_actions`). seed: of random streams.

        Raises:
          PlanningError: motion of the robot cannot be planned. EngineError: there is no goal, the action lacks numbers,
          or worlds differ in their models.
        """
        rules = env.core.rules
        if rules is None or rules.goal is None:
            raise EngineError(f"{env.task.name} has no goal to plan for")
        check_robot(env.robot)
        self._stage, self._goal, self._seed = _Observed(env), rules.goal, seed
        self._parts: tuple[PhysicsRung, Solving] | None = None  # made with the first state
        self._map = env.action_map
        names = env.action_names
        self._resets = [k for k, n in enumerate(names) if n.endswith("_reset")]
        self._triggers = [k for k, n in enumerate(names) if n.endswith("_trigger")]
        switches = ("_reset", "_trigger", "gripper", "_suction")
        self.noisy = np.array([not n.endswith(switches) and not n.startswith("eye_") for n in names])
        count = env.num_worlds
        self.given_up = np.zeros(count, bool)
        self._since, self._episodes, self._begun = np.zeros(count, int), 0, np.zeros(count, bool)

    @property
    def planned(self) -> int:
        """Steps of the longest first plan of the present episodes."""
        return 0 if self._parts is None else self._parts[1].planned

    def _ended(self, world: int, result: object) -> None:
        self.given_up[world], self._since[world] = True, 0

    def __call__(self, state: EnvState, beliefs: object = None) -> Float[Array, "W n"]:
        """The planner's actions.

        Args:
          state: of the environment. Episodes that begin there are planned for from what holds in it.
        """
        self._stage.observe(state)
        if self._parts is None:
            rung = PhysicsRung(self._stage, self._seed)
            planner = TaskPlanner(rung.domain, self._goal)
            self._parts = rung, Solving(planner, rung, worlds=(), ended=self._ended)
        rung, solving = self._parts
        begins = np.asarray(state.batch.world.step) == 0
        new = begins | ~self._begun
        for world in np.flatnonzero(new):
            rung.restart(int(world), self._episodes)
            self._episodes += 1
        outcomes = rung.follow()
        solving.take({world: outcome for world, outcome in outcomes.items() if not self.given_up[world]})
        self._since += 1
        for world in np.flatnonzero(new | (self.given_up & (self._since >= AGAIN))):
            self.given_up[world], self._since[world] = False, 0
            try:
                solving.begin(int(world))
            except PlanningError:  # what was dropped or broken makes the goal impossible
                self._ended(int(world), None)
        self._begun[:] = True
        action = np.asarray(rung.command(), np.float32)
        own = self._map
        return self._steady(np.clip(action[:, own.places] / own.scale, -1.0, 1.0).astype(np.float32), state)

    def _steady(self, action: Float[np.ndarray, "W n"], state: EnvState) -> Float[np.ndarray, "W n"]:
        """The same action, with switches that stay where they are far from where they switch: what is learned from it
        need not be 0 to the last digit. A trigger adds up to 0 or 1, and a reset counts above 0."""
        for k in self._resets:
            action[:, k] = np.where(action[:, k] > 0, 1.0, -1.0)
        pulled = getattr(state.batch.controllers[0], "trigger", None)
        for hand, k in enumerate(self._triggers):
            stays = np.where(np.asarray(pulled)[:, hand] > 0.5, 1.0, -1.0)
            action[:, k] = np.where(action[:, k] == 0, stays, action[:, k])
        return action


class _Observed(EnvironmentStage):
    """Worlds in which another agent acts."""

    def __init__(self, env: Environment):
        super().__init__(env, ends=False)

    def act(self, action: Float[np.ndarray, "W m"]) -> None:
        raise AssertionError("another agent acts")

    def ended(self, world: int) -> str | None:
        """None: the environment ends episodes."""
        return None


def is_planned(env: Environment) -> bool:
    """Whether the planner can be the expert of an environment's task: it has a goal and all numbers of the action."""
    rules, names = env.core.rules, env.action_names
    whole = all(n in names for n in env.core.controllers[0].action_names)
    return rules is not None and rules.goal is not None and whole
