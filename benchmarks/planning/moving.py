"""`SomebodyElse`: moves an object that a plan still needs, once, in the middle of the plan."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ig2mj.engine.writes import teleports
from ig2mj.envs.planning_stage import EnvironmentStage
from ig2mj.planning.physics import PhysicsRung
from ig2mj.planning.solver import StepRecord
from ig2mj.planning.spots import spots_for
from ig2mj.planning.task_planner import TaskPlan
from ig2mj.states.relations.rooms import rooms_of


class SomebodyElse:
    """Puts an object onto the floor of the room where it is, or of another one: before the step in the middle of the
    first plan, or before the first later one at which an object that is still needed is in no hand.

    Attributes:
      moved: name of the object; "": none yet.
    """

    def __init__(self, stage: EnvironmentStage, rung: PhysicsRung, seed: int):
        """`stage`: of one world. `seed`: of the choice among objects and places."""
        self._stage, self._rung = stage, rung
        self._rng, self._first, self.moved = np.random.default_rng([seed, 1]), 0, ""

    def see(self, plan: TaskPlan, records: Sequence[StepRecord]) -> str:
        """Looks at a new plan; what is done, in words, "" for nothing."""
        self._first = self._first or len(plan.steps)
        if self.moved or 2 * (len(records) + 1) < self._first or not plan.steps:
            return ""
        world = self._rung.world(0)
        domain, held = world.domain, world.held
        objects = domain.model.tables.object_names
        left = dict.fromkeys(step.object for step in plan.steps)
        loose = [n for n in left if n in objects and not domain.fixed(n) and n not in held]
        self._rng.shuffle(loose)
        for name in loose:
            for room in self._rooms(name):
                spot = next(iter(spots_for(world, "on_floor", name, room)), None)
                if spot is None:
                    continue
                write = teleports(len(objects), domain.index(name), spot.pos, spot.quat)
                self._stage.write(write)
                self.moved = name
                return f"somebody puts {name} onto the floor of {room}"
        return ""

    def _rooms(self, name: str) -> list[str]:
        """The room in which an object is first, then others at random."""
        world = self._rung.world(0)
        tables = world.domain.model.tables
        rooms, own = list(tables.room_names), rooms_of(tables, world.view, world.domain.index(name))
        self._rng.shuffle(rooms)
        return sorted(rooms, key=lambda room: room not in own)
