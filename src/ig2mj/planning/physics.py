"""`PhysicsRung`: primitives carried out by a robot's actions, in all worlds of a stage together.

Worlds plan their programs on the host when they need one; the programs of all worlds are followed in one batch. Worlds
that have nothing to do stand still.
"""

from __future__ import annotations

import collections
import dataclasses
import math
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from ig2mj.agents.base import ACTION_PERIOD
from ig2mj.agents.humanoid.robot import Humanoid
from ig2mj.agents.registry import find_robot
from ig2mj.agents.task_robot import TaskRobot
from ig2mj.planning import execution
from ig2mj.planning.bodies import Body, HandedBody
from ig2mj.planning.body_kinds import body_of
from ig2mj.planning.domain import Domain
from ig2mj.planning.facts import Facts
from ig2mj.planning.motion_planner import MotionPlanner
from ig2mj.planning.moves import Primitive, Program
from ig2mj.planning.primitives import primitive
from ig2mj.planning.senses import FrictionHolds
from ig2mj.planning.stage import Stage
from ig2mj.planning.steps import Outcome, PlanningError, Step, UnsupportedPrimitive
from ig2mj.planning.world import PlannedWorld
from ig2mj.sampling.query import SceneQuery

MOST_STEPS, MOST_STEPS_CLEANING = 3000, 9000
"""Agent steps of one primitive after which it fails with "timeout": 300 s, and 900 s of one that cleans, which presses
its tool at up to 8 places from each of up to 24 stances (`ig2mj.planning.cleaning`)."""

CLEANING = ("wipe", "scrub")
"""Primitives that clean."""


def most_seconds(primitive: str) -> float:
    """Simulated s of a primitive after which it fails with "timeout"."""
    return (MOST_STEPS_CLEANING if primitive in CLEANING else MOST_STEPS) * ACTION_PERIOD


def check_robot(robot: str | TaskRobot) -> None:
    """Raises PlanningError: motion of the hands of a robot cannot be planned."""
    name, body = find_robot(robot)
    hands = body.hand_count if body.hand_rays() else 0
    if not isinstance(body, Humanoid) and not (body.drives and hands == 1):
        several = "has several arms" if body.drives else "has no base that moves"
        lacks = several if hands else "has no hand that holds something" if body.hand_count else "has no hand"
        raise PlanningError(f"motion of the hands of robot '{name}', which {lacks}, cannot be planned (take humanoid)")


class PhysicsRung:
    """Primitives carried out by a robot's actions, in all worlds of a stage together.

    Its methods: `ig2mj.planning.rung.Rung`.

    Attributes:
      stage: the worlds. body: how programs move the robot; one without planned hands carries out `navigate_to`.
      domain: constants. watch: called after every agent step.
    """

    name = "physics"

    def __init__(
        self,
        stage: Stage,
        seed: int = 0,
        first: int | Sequence[int] = 0,
        query: SceneQuery | None = None,
        planner: MotionPlanner | None = None,
        body: Body | None = None,
    ):
        """
        Args:
          seed, first: of random streams: a stream belongs to (seed, number, number of the step). The number of a world
            is first + world, or first[world].
          query, planner, body: a world of the stage's scene to sample spots in, what plans ways there, and how programs
            move the robot; None: new ones.

        Raises:
          PlanningError: the robot has no base that planned ways can move.
        """
        body = body or body_of(stage.scene, stage.controller, stage.agent)
        self.stage, self.body = stage, body
        tables = stage.scene.tables
        links, bodies, count = tables.finger_hand, tables.graspable_object, tables.num_objects
        body.friction = FrictionHolds(links, bodies, count, body.hands) if stage.by_friction else None
        self.domain = Domain(stage.model, len(body.hands), getattr(body, "lifts", math.inf))
        self._planner = planner or MotionPlanner(stage.scene, stage.agent)
        self._query = query
        self._seed = seed
        count = stage.num_worlds
        self._numbers = [first + w for w in range(count)] if isinstance(first, int) else list(first)
        self._running: list[Primitive | None] = [None] * count
        self._asked: list[Step | None] = [None] * count
        self._programs: list[Program] = [[] for _ in range(count)]
        self._carry = execution.begin(self._programs)
        self._count, self._steps, self._planning = [0] * count, [0] * count, [0.0] * count
        self._missed = [collections.Counter[str]() for _ in range(count)]
        self._vain = [dict[str, Any]() for _ in range(count)]
        self._ended: dict[int, Outcome] = {}
        self.watch: Callable[[], None] = lambda: None

    @property
    def num_worlds(self) -> int:
        return self.stage.num_worlds

    def world(self, world: int) -> PlannedWorld:
        """A world as primitives see it."""
        if self._query is None:
            self._query = SceneQuery(self.stage.scene)
        rng = np.random.default_rng([self._seed, self._numbers[world], self._count[world]])
        found = PlannedWorld(self.stage, self.body, self.domain, self._planner, self._query, world, rng)
        found.missed, found.vain = self._missed[world], self._vain[world]
        return found

    def facts(self, world: int) -> Facts:
        return self.world(world).facts

    def check(self, step: Step) -> None:
        """Whether the robot can be asked for a primitive.

        Raises:
          UnknownNameError: no such object or room. UnsupportedPrimitive: the robot lacks what the primitive takes.
        """
        if step.primitive != "navigate_to" and not isinstance(self.body, HandedBody):
            name = self.stage.scene.tables.agent_names[self.stage.agent]
            lacks = "has no hand" if not len(self.body.hands) else "has no hand whose motion can be planned"
            raise UnsupportedPrimitive(f"robot '{name}' {lacks}: '{step.primitive}' takes one (humanoid has two)")
        if step.primitive == "spray" and len(self.body.hands) < 2:
            name = self.stage.scene.tables.agent_names[self.stage.agent]
            raise UnsupportedPrimitive(f"robot '{name}' has one hand: 'spray' takes two (humanoid has two)")
        self.domain.check(step)

    def begin(self, world: int, step: Step) -> None:
        """See `Rung.begin`. Raises as `check`."""
        self.check(step)
        step = self.domain.meant(step)
        self._count[world] += 1
        self._steps[world], self._planning[world] = 0, 0.0
        self._asked[world] = step
        self._running[world] = primitive(self.world(world), step)
        if taken := self._taken(world, step):
            self._end(world, Outcome("no_grasp", taken))
            return
        self._next(world, None)

    def _taken(self, world: int, step: Step) -> str:
        """What another robot holds of what a primitive needs, in words; "" for nothing."""
        tables, held = self.domain.model.tables, np.asarray(self.stage.view.held)[world]
        others = [h for h in range(len(held)) if h not in self.body.hands]
        for name in step.things if step.primitive != "navigate_to" and others else ():
            if name in tables.object_names and (hands := np.flatnonzero(held[others, self.domain.index(name)])).size:
                robot = tables.agent_names[int(tables.hand_agent[others[int(hands[0])]])]
                return f"{name} is held by robot '{robot}' (let it release it first)"
        return ""

    def _next(self, world: int, reason: str | None) -> None:
        """The next program of a world's primitive, or its outcome."""
        running, began = self._running[world], time.process_time()
        assert running is not None
        try:
            program = next(running) if reason is None else running.send(reason)
            while not program:
                program = running.send("")
        except StopIteration as end:
            self._planning[world] += time.process_time() - began
            self._end(world, end.value)
            return
        self._planning[world] += time.process_time() - began
        self._follow(world, program)

    def _follow(self, world: int, program: Program) -> None:
        """A world's program, in place of the present one."""
        program = self.body.prepared(program) if isinstance(self.body, HandedBody) else program
        self._programs[world] = program
        self._carry = execution.begin_some(self._carry, {world: program})

    def _end(self, world: int, outcome: Outcome) -> None:
        self._running[world] = None
        self._follow(world, [])
        seconds = self._steps[world] * ACTION_PERIOD
        self._ended[world] = dataclasses.replace(outcome, time=seconds, planning=self._planning[world])

    def elapsed(self, world: int) -> float:
        """Simulated seconds of a world's present primitive, or of its last one."""
        return self._steps[world] * ACTION_PERIOD

    def _most(self, world: int) -> float:
        """Simulated s that a world's present primitive may take."""
        step = self._asked[world]
        return most_seconds("" if step is None else step.primitive)

    def asked(self, world: int) -> Step | None:
        """The primitive that a world's robot began last; None: there was none."""
        return self._asked[world]

    def running(self, world: int) -> Step | None:
        """What a world's robot carries out; None: nothing."""
        return self._asked[world] if self._running[world] is not None else None

    def ended(self, world: int) -> str | None:
        return self.stage.ended(world)

    def advance(self) -> dict[int, Outcome]:
        """See `Rung.advance`."""
        while not self._ended and any(r is not None for r in self._running):
            self._act()
        return self.take_ended()

    def step(self) -> dict[int, Outcome]:
        """As `advance`, for one agent step, which passes in any case: worlds without a primitive stand still."""
        if not self._ended:
            self._act()
        return self.take_ended()

    def stop(self, world: int) -> None:
        """Ends a world's primitive without an outcome; hands hold what they hold."""
        running, self._running[world] = self._running[world], None
        if running is not None:
            running.close()
            self._follow(world, [])

    def restart(self, world: int, number: int) -> None:
        """Ends what a world's robot does without an outcome: the world begins another episode.

        Args:
          number: of the episode, for its random streams.
        """
        self.stop(world)
        self._ended.pop(world, None)
        self._missed[world].clear()
        self._vain[world].clear()
        self._numbers[world], self._count[world], self._asked[world] = number, 0, None

    def program(self, world: int) -> Program:
        """The program of a world's robot; empty where it has none."""
        return self._programs[world]

    def proceed(self, world: int, reason: str, seconds: float) -> dict[int, Outcome]:
        """Continues after the program of a world has ended in another process (`ig2mj.planning.away`).

        Args:
          reason: why it failed, "" for success. seconds: simulated s that it took.

        Returns:
          The outcome, if the primitive has ended.
        """
        self._steps[world] += round(seconds / ACTION_PERIOD)
        running = self._running[world]
        if running is not None and self.elapsed(world) > self._most(world):
            running.close()
            self._end(world, Outcome("timeout", f"{self._most(world):.0f} s have passed"))
        elif running is not None:
            self._next(world, reason)
        return self.take_ended()

    def take_ended(self) -> dict[int, Outcome]:
        """Outcomes of primitives that have ended and were not taken yet."""
        ended, self._ended = self._ended, {}
        return ended

    def command(self) -> Float[np.ndarray, "W n"]:
        """The robot's action of the next agent step in every world, in its controller's units. The caller takes
        the step and then calls `follow`."""
        action, self._carry = execution.advance(self.body, self.stage.agent, self._carry, self.stage.view)
        return action

    def _act(self) -> None:
        """An agent step of all worlds."""
        self.stage.act(self.command())
        self.watch()
        self._followed()

    def follow(self) -> dict[int, Outcome]:
        """Continues all worlds after the agent step of `command`; gives the outcomes of primitives that have ended."""
        self._followed()
        return self.take_ended()

    def _followed(self) -> None:
        for world, running in enumerate(self._running):
            if running is None:
                continue
            self._steps[world] += 1
            over = self.ended(world)
            if over is not None:
                running.close()
                self._end(world, Outcome("timeout" if over else "", over))
            elif self.elapsed(world) > self._most(world):
                running.close()
                self._end(world, Outcome("timeout", f"{self._most(world):.0f} s have passed"))
            elif not self._carry.running[world]:
                self._next(world, self._carry.reason(world))
