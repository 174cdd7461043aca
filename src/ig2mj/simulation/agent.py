"""`Agent`: a robot of a `Simulation` that carries out primitives: `simulation.agent.do("grasp", "apple_0")`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from ig2mj.agents.base import Controller
from ig2mj.engine.snapshot import Snapshot
from ig2mj.engine.view import PhysicsView
from ig2mj.errors import EngineError
from ig2mj.planning.facts import Facts
from ig2mj.planning.physics import PhysicsRung
from ig2mj.planning.steps import Outcome, PlanningError, make_step
from ig2mj.process import entry_point
from ig2mj.scene.scene import Scene
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates
from ig2mj.worlds.batch import Batch

if TYPE_CHECKING:
    from ig2mj.simulation.simulation import Simulation


class SimulationStage:
    """Lets the physics rung act in a simulation, with one robot; the others keep their controls."""

    def __init__(self, simulation: Simulation, agent: int = 0):
        self._simulation, self.agent = simulation, agent
        self._seen: tuple[Batch, PhysicsView] | None = None  # the view, and the batch that it is of
        controllers = simulation.core.controllers
        self.controller: Controller = next(c for c in controllers if c.agent == agent)
        before = sum(c.action_size for c in controllers if c.agent < agent)
        self._own = slice(before, before + self.controller.action_size)

    @property
    def scene(self) -> Scene:
        return self._simulation.scene

    @property
    def model(self) -> StateModel:
        return self._simulation.state_model

    @property
    def num_worlds(self) -> int:
        return 1

    @property
    def view(self) -> PhysicsView:
        batch = self._simulation._batch
        if self._seen is None or self._seen[0] is not batch:
            self._seen = batch, self._simulation.view
        return self._seen[1]

    @property
    def states(self) -> ExtendedStates:
        return self._simulation.states

    def snapshot(self, world: int) -> Snapshot:
        return self._simulation.engine.export(self._simulation.physics, world)

    def act(self, action: Float[np.ndarray, "W n"]) -> None:
        robots = self._simulation.robots
        whole = np.zeros(len(robots.action_names), np.float32)
        whole[self._own] = action[0]
        robots.act(whole)

    @property
    def by_friction(self) -> bool:
        return self._simulation.core.grasping is None

    def ended(self, world: int) -> str | None:
        return None


@entry_point
class Agent:
    """One robot of a simulation.

    Attributes:
      name: of the robot. rung: what carries out its primitives.
    """

    def __init__(self, simulation: Simulation, name: str):
        """
        Raises:
          PlanningError: motion of this robot cannot be planned.
        """
        self._simulation, self.name = simulation, name
        number = simulation.scene.tables.agent_names.index(name)
        self.rung = PhysicsRung(SimulationStage(simulation, number), seed=simulation._seed)

    def __repr__(self) -> str:
        return f"Agent('{self.name}' in '{self._simulation.scene.name}')"

    @property
    def facts(self) -> Facts:
        """What holds now, for `ig2mj.planning.TaskPlanner`."""
        return self.rung.facts(0)

    def do(self, primitive: str, *arguments: str) -> Outcome:
        """Carries out a primitive by the robot's actions; takes simulated time.

            outcome = simulation.agent.do("grasp", "apple_0")
            outcome.done, outcome.reason

        Args:
          primitive: a name of `ig2mj.planning.PRIMITIVES`. arguments: names of objects and rooms.

        Returns:
          How it ended; `reason` is "" for success, else a key of `ig2mj.planning.REASONS`.

        Raises:
          UnknownNameError: no such primitive, object or room. PlanningError: too many or few arguments, or hands hold
          by friction alone.
        """
        step = make_step(primitive, arguments)
        self.rung.check(step)
        if self._simulation.core.grasping is None and primitive not in ("navigate_to", "toggle_on", "toggle_off"):
            raise PlanningError(
                f"'{primitive}' needs hands that take hold of things: Simulation(..., grasping='assisted')"
            )
        self.rung.begin(0, step)
        return self.rung.advance()[0]


def only_agent(simulation: Simulation) -> Agent:
    """The robot of a simulation that has one. Raises EngineError: it has none, or several."""
    names = list(simulation.scene.tables.agent_names)
    if not names:
        raise EngineError("the scene was loaded without robots (add one with load_scene(..., agents=[...]))")
    if len(names) > 1:
        raise EngineError(f"the scene has {len(names)} robots: name one, such as simulation.robots['{names[0]}']")
    return simulation.robots[names[0]]
