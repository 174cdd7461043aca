"""`Stage`: the interface of worlds in which a robot carries out primitives.

Axes: W worlds, n numbers of a robot's action.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import jax
import numpy as np
from jaxtyping import Float

from ig2mj.agents.base import ACTION_PERIOD, Controller
from ig2mj.engine.base import Engine, Write
from ig2mj.engine.snapshot import Snapshot, fitted
from ig2mj.engine.view import PhysicsView
from ig2mj.predicates.compile import CompiledExpression
from ig2mj.scene.scene import Scene
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates
from ig2mj.worlds.core import Core
from ig2mj.worlds.pool import Pool
from ig2mj.worlds.rules import Rules
from ig2mj.worlds.worlds import controllers_of, grasping_of


@runtime_checkable
class Stage(Protocol):
    """See the module's text.

    Attributes:
      scene: with its robots. model: of its states. controller: of the robot that acts. agent: its number.
    """

    @property
    def scene(self) -> Scene: ...

    @property
    def model(self) -> StateModel: ...

    @property
    def controller(self) -> Controller: ...

    @property
    def agent(self) -> int: ...

    @property
    def num_worlds(self) -> int: ...

    @property
    def by_friction(self) -> bool:
        """Whether hands hold by friction alone, so that no constraint says what they hold."""
        ...

    @property
    def view(self) -> PhysicsView:
        """Of the present physics."""
        ...

    @property
    def states(self) -> ExtendedStates:
        """Of the present worlds."""
        ...

    def snapshot(self, world: int) -> Snapshot:
        """Physics of one world, without the world axis."""
        ...

    def act(self, action: Float[np.ndarray, "W n"]) -> None:
        """An agent step of 1/10 s: the robot's action in its controller's units; other robots stay as they are."""
        ...

    def ended(self, world: int) -> str | None:
        """Why a world's episode is over, in words, "" for success; None while it goes on."""
        ...


class CoreStage:
    """Worlds of an engine of their own; one robot acts.

    Attributes:
      core, batch: what steps the worlds, and their present state. agent: number of the robot.
    """

    def __init__(
        self,
        scene: Scene,
        engine: Engine,
        grasping: str = "assisted",
        starts: Pool | None = None,
        goal: CompiledExpression | None = None,
        agent: int = 0,
    ):
        """
        Args:
          scene: with the robot. engine: of this scene. grasping: see `ig2mj.Worlds`.
          starts: of the bare scene, the first row for the first world and so on; None: the scene's own start.
          agent: number of the robot that acts; others stay as they are.
        """
        self.scene = scene
        rules = Rules.of_scene(scene)
        rules = rules if goal is None else rules.with_goal(goal)
        self.model = rules.model
        controllers = controllers_of(scene, ACTION_PERIOD)
        self.agent = agent
        self.controller = next(c for c in controllers if c.agent == agent)
        before = sum(c.action_size for c in controllers if c.agent < agent)
        self._own = slice(before, before + self.controller.action_size)
        self._size = sum(c.action_size for c in controllers)
        self.core = Core(engine, rules, None, controllers, grasping_of(engine, grasping), True)
        self._steps = max(1, round(ACTION_PERIOD / (engine.substeps * engine.timestep)))
        self.restart(starts)

    @property
    def num_worlds(self) -> int:
        return self.core.engine.num_worlds

    @property
    def by_friction(self) -> bool:
        return self.core.grasping is None

    @property
    def view(self) -> PhysicsView:
        return self.batch.world.view

    @property
    def states(self) -> ExtendedStates:
        return self.batch.world.states

    def snapshot(self, world: int) -> Snapshot:
        return self.core.engine.export(self.batch.world.physics, world)

    def restart(self, starts: Pool | None = None) -> None:
        """All worlds at the scene's start, or as `load`; robots at theirs."""
        self.batch = self.core.start(0)
        if starts is not None:
            self.load(starts)

    def load(self, starts: Pool) -> None:
        """Puts the household of each world into the state of a row; robots stay at their start."""
        rows = starts.rows(np.arange(self.num_worlds) % starts.size)
        one = self.core.engine.export(self.batch.world.physics, 0)
        physics = fitted(rows.physics, one, self.num_worlds, self.scene.name)
        self.batch = self.core.load(self.batch, physics, rows.states)

    def write(self, write: Write) -> None:
        """Changes physics of all worlds; of one world, the change is made in all of them."""
        count = self.num_worlds
        whole = jax.tree.map(lambda a: np.broadcast_to(np.asarray(a), (count, *np.shape(a)[1:])), write)
        self.batch = self.core.write(self.batch, whole)

    def act(self, action: Float[np.ndarray, "W n"]) -> None:
        whole = np.zeros((len(action), self._size), np.float32)
        whole[:, self._own] = action
        self.batch, _ = self.core.repeat_action_fn(self.batch, whole, self._steps)

    def ended(self, world: int) -> str | None:
        return None
