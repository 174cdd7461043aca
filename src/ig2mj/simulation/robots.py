"""`RobotsOfWorld`: the robots of a `Simulation`, by names."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ig2mj.agents.base import ACTION_PERIOD
from ig2mj.engine.base import whole_number
from ig2mj.engine.view import PhysicsView
from ig2mj.errors import ActionError, EngineError, UnknownNameError
from ig2mj.process import entry_point
from ig2mj.sampling.row import Row
from ig2mj.worlds.hands import Held

if TYPE_CHECKING:
    from ig2mj.simulation.agent import Agent
    from ig2mj.simulation.simulation import Simulation


@entry_point
class RobotsOfWorld:
    """Robots of one world. What they remember and hold is part of the simulation's batch."""

    def __init__(self, simulation: Simulation):
        """Those of the simulation's scene."""
        self._simulation, self._core = simulation, simulation.core
        engine = simulation.engine
        self._steps = max(1, round(ACTION_PERIOD / (engine.substeps * engine.timestep)))
        self._agents: dict[str, Agent] = {}

    @property
    def controllers(self) -> tuple[Any, ...]:
        """What each controller remembers."""
        return self._simulation._batch.controllers

    @property
    def held(self) -> Held:
        """What hands hold, None where by friction alone."""
        return self._simulation._batch.grasps

    def __getitem__(self, name: str) -> Agent:
        """A robot by its name. Raises UnknownNameError; PlanningError: its motion cannot be planned."""
        names = self._simulation.scene.tables.agent_names
        if name not in names:
            raise UnknownNameError("robot", name, names)
        if name not in self._agents:
            from ig2mj.simulation.agent import Agent

            self._agents[name] = Agent(self._simulation, name)
        return self._agents[name]

    @property
    def action_names(self) -> tuple[str, ...]:
        """What each number of an action means, all robots one after the other."""
        return tuple(name for c in self._core.controllers for name in c.action_names)

    @property
    def action_low(self) -> np.ndarray:
        """[n] least values of an action, in the controllers' units: m and rad of a move in 1/10 s, or shares."""
        return self._core.controls.low

    @property
    def action_high(self) -> np.ndarray:
        """[n] greatest values of an action."""
        return self._core.controls.high

    def act(self, action: Any = None, count: int = 1, **named: float | int) -> PhysicsView:
        """Lets the robots act for 1/10 s, `count` times.

            simulation.robots.act(right_hand_z=0.05)

        Args:
          action: [n] of all robots one after the other, in the controllers' units; None: zeros. Numbers beyond
            `action_low` and `action_high` are clipped, as in `Environment.step`.
          named: numbers of the action by name, put into it.

        Returns:
          The view afterwards.

        Raises:
          EngineError: the scene has no robots. ActionError: another shape or name, or a number that is not finite.
        """
        names = self.action_names
        if not self._core.controllers:
            raise EngineError("the scene was loaded without robots (add them with load_scene(..., agents=[...]))")
        try:
            row = np.zeros(len(names)) if action is None else np.array(action, np.float64)
        except (TypeError, ValueError):
            raise ActionError(f"an action is of real numbers, not {action!r}") from None
        if row.shape != (len(names),):
            raise ActionError(f"an action of this scene's robots has shape {(len(names),)}, not {row.shape}")
        for name, number in named.items():
            if name not in names:
                raise ActionError(f"no number of an action is named '{name}' (names: {', '.join(names)})")
            row[names.index(name)] = number
        if not np.isfinite(row).all():
            raise ActionError("an action is of finite numbers")
        row = np.clip(row, self.action_low, self.action_high).astype(np.float32)
        simulation = self._simulation
        for _ in range(whole_number("count", count, 0)):
            simulation.batch, ctrl = self._core.act(simulation.batch, row[None])
            simulation.step(np.asarray(ctrl, np.float64)[0], self._steps)
        return simulation.view

    @property
    def holding(self) -> dict[str, str | None]:
        """Object that each hand holds by a constraint, by the name of the hand's body."""
        tables, model = self._simulation.scene.tables, self._simulation.scene.model
        hands: dict[str, str | None] = {model.body(int(b)).name: None for b in tables.hand_body}
        if self.held is not None:
            for hand, body, on in zip(hands, np.asarray(self.held.body)[0], np.asarray(self.held.held)[0], strict=True):
                hands[hand] = tables.object_names[tables.graspable_object[body]] if on else None
        return hands


def put_row(simulation: Simulation, row: Row) -> None:
    """Replaces the world by a sampled one: hands hold what it contains, controllers keep their states."""
    simulation.physics = simulation.engine.load(simulation.physics, row.physics)
    simulation._put(states=row.states)
