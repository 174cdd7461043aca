"""`Planned`: a robot in a home that carries out primitives, and plans for the goal, live in the page. See `Source`.

Worlds of other sources have no robot that carries out primitives.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Protocol, runtime_checkable

import mujoco
import numpy as np

from ig2mj.agents.base import ACTION_PERIOD
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.errors import Ig2mjError
from ig2mj.planning.domain import Domain
from ig2mj.planning.physics import PhysicsRung
from ig2mj.planning.problem import Problem
from ig2mj.planning.solver import EpisodeResult, Solving, StepRecord
from ig2mj.planning.stage import CoreStage
from ig2mj.planning.starts import open_doors, scene_with_robot
from ig2mj.planning.steps import PRIMITIVES, Outcome, make_step
from ig2mj.planning.supplies import held_substances
from ig2mj.planning.task_planner import TaskPlan, TaskPlanner
from ig2mj.predicates.compile import CompiledExpression
from ig2mj.scene.scene import Scene
from ig2mj.states.model import StateModel
from ig2mj.web.shots import Shot, shot_of
from ig2mj.web.sources import live
from ig2mj.worlds.pool import Pool

AHEAD = 12
"""Steps of a plan that are shown before they are carried out."""

KEPT = 8
"""Steps that are shown after they were carried out."""


@dataclasses.dataclass(frozen=True)
class PlanReport:
    """What a page shows of a plan; replaced as a whole, so that any thread may read it.

    Attributes:
      rows: number, step as text, status ("done", "now", "" or the reason of a failure), and more about it.
      held: names of what the robot holds. busy: a primitive is carried out. solving: a plan is.
      note: how the last request ended, or why it was refused.
    """

    rows: tuple[tuple[int, str, str, str], ...] = ()
    held: tuple[str, ...] = ()
    busy: bool = False
    solving: bool = False
    note: str = ""


@runtime_checkable
class Requests(Protocol):
    """A source whose robot carries out primitives. Its methods are called in the thread that simulates.

    Attributes: report: of the plan. offered: for an object, texts of buttons and requests, `None` for what is held.
    """

    @property
    def report(self) -> PlanReport: ...

    def offered(self, name: str) -> dict[str, tuple[str, ...]]: ...

    def ask(self, words: Sequence[str]) -> None:
        """Begins a primitive: its name and arguments."""
        ...

    def solve(self) -> None:
        """Begins the plan for the goal."""
        ...

    def stop(self) -> None:
        """Ends plan and primitive."""
        ...


class Planned:
    """See the module's text, `ig2mj.web.sources.Source` and `Requests`."""

    num_worlds, period = 1, ACTION_PERIOD

    def __init__(
        self,
        problem: Problem,
        robot: str = "humanoid",
        *,
        split: str = "held_out",
        rows: int = 1,
        seed: int = 0,
        goal: bool = True,
        doors_open: bool = True,
    ):
        """
        Args:
          rows: start states of an activity. goal: the problem's goal is shown and can be solved.
          doors_open: doors between rooms that the problem does not name stand open.

        Raises:
          UnknownNameError: no such robot. PlanningError: the robot's motion cannot be planned.
        """
        self._pool: Pool | None = problem.pool(split, rows)
        self.scene: Scene = scene_with_robot(problem, robot, self._pool)
        self._stage = CoreStage(self.scene, NativeEngine(self.scene, 1), starts=self._pool)
        self.model: StateModel = self._stage.model
        self.goal: CompiledExpression | None = problem.goal_in(self.model) if goal else None
        self.rows = self._pool.size if self._pool is not None and self._pool.size > 1 else 0
        self._doors = open_doors(self.scene, problem.named) if doors_open else None
        self._seed, self._begun = seed, 0
        self._planner: TaskPlanner | None = None
        self._solving: Solving | None = None
        self._records: list[StepRecord] = []
        self._plan: TaskPlan | None = None
        self._result: EpisodeResult | None = None
        self.report = PlanReport()
        self._start(None)

    def _start(self, row: int | None) -> None:
        """The world at its start."""
        stage = self._stage
        stage.restart(None if self._pool is None else self._pool.rows(np.array([row or 0])))
        if self._doors is not None:
            stage.write(self._doors)
        self._rung = PhysicsRung(stage, self._seed, self._begun)
        self._begun += 1
        self._planner = None if self.goal is None else TaskPlanner(self._rung.domain, self.goal)
        self._forget()
        self.report = PlanReport()

    def _forget(self) -> None:
        self._solving, self._plan, self._result, self._records = None, None, None, []

    # As a source.

    def step(self) -> None:
        outcomes = self._rung.step()
        for outcome in outcomes.values():
            self._heard(outcome)
        if self._solving is not None and outcomes:
            self._solving.take(outcomes)
            if self._solving.done:
                (self._result,) = self._solving.results
                self._solving = None
        if outcomes or self.report.busy:
            self._write()

    def reset(self, world: int, row: int | None = None) -> None:
        self._start(row)

    def shot(self, world: int, jump: bool = False) -> Shot:
        now = self._stage.batch.world
        time = float(np.asarray(now.time)[0])
        engine = self._stage.core.engine
        return shot_of(engine, now.view, now.states, 0, time, jump=jump, period=self.period)

    def mujoco(self, world: int) -> tuple[mujoco.MjModel, mujoco.MjData] | None:
        return live(self._stage.core.engine, self._stage.batch.world.physics, 0)

    # Requests.

    def offered(self, name: str) -> dict[str, tuple[str, ...]]:
        """Requests that an object can be part of, by the texts of their buttons."""
        facts = self._rung.facts(0)
        return offers(self._rung.domain, name, self.report.held, {n: held_substances(facts, n) for n in facts.held})

    def ask(self, words: Sequence[str]) -> None:
        self._result = None
        self._ended("")
        try:
            step = make_step(words[0], words[1:])
            self._rung.begin(0, step)
        except Ig2mjError as e:
            self.report = dataclasses.replace(self.report, note=" ".join(str(e).split()))
            return
        self._write()

    def solve(self) -> None:
        self._ended("")
        if self._planner is None:
            self.report = dataclasses.replace(self.report, note="there is no goal")
            return
        self._forget()
        try:
            self._solving = Solving(self._planner, self._rung, watch=self._watch)
        except Ig2mjError as e:
            self.report = dataclasses.replace(self.report, note=" ".join(str(e).split()))
            return
        if self._solving.done:
            (self._result,), self._solving = self._solving.results, None
        self._write()

    def stop(self) -> None:
        self._ended("stopped")

    def _ended(self, note: str) -> None:
        """All primitives end."""
        self._rung.stop(0)
        self._solving = None
        self._write(note)

    def _watch(self, world: int, plan: TaskPlan, records: Sequence[StepRecord]) -> None:
        self._plan, self._records = plan, list(records)

    def _heard(self, outcome: Outcome) -> None:
        step = self._rung.asked(0)
        if self._solving is None and step is not None:
            self._plan = None
            self._records.append(StepRecord(step, outcome, 0.0))

    def _write(self, note: str | None = None) -> None:
        """Brings the report up to date."""
        running = self._rung.running(0)
        done = self._records[-KEPT:]
        first = len(self._records) - len(done) + 1
        rows = [
            (first + k, str(r.step), r.outcome.reason or "done", r.outcome.detail or f"{r.outcome.time:.1f} s")
            for k, r in enumerate(done)
        ]
        number = len(self._records) + 1
        if running is not None:
            rows.append((number, str(running), "now", f"{self._rung.elapsed(0):.1f} s"))
        if self._plan is not None and self._solving is not None:
            rows += [(number + k, str(s), "", "") for k, s in enumerate(self._plan.steps[1:AHEAD], 1)]
        if note is None and self._result is not None:
            note = "the goal holds" if self._result.success else f"ended: {self._result.ended}"
        held = self._rung.facts(0).held if running is None or not self.report.busy else self.report.held
        self.report = PlanReport(tuple(rows), tuple(held), running is not None, self._solving is not None, note or "")


def offers(
    domain: Domain, name: str, held: Sequence[str], contents: Mapping[str, Sequence[str]] = MappingProxyType({})
) -> dict[str, tuple[str, ...]]:
    """Requests that make sense for an object, by the texts of buttons.

    Args:
      held: names of what the robot holds, the first of which is placed, or used as a tool.
      contents: substances in what it holds.
    """
    found: dict[str, tuple[str, ...]] = {"Go to": ("navigate_to", name)}
    if name in held:
        found["Release"] = ("release", name)
    elif not domain.fixed(name):
        found["Grasp"] = ("grasp", name)
    if domain.opens(name):
        found |= {"Open": ("open", name), "Close": ("close", name)}
    if domain.has(name, "toggleable"):
        found |= {"Switch on": ("toggle_on", name), "Switch off": ("toggle_off", name)}
    tool = next((h for h in held if h != name), None)
    if tool is None:
        return found
    for primitive, words in PLACES.items():
        found[f"Put {tool} {words}"] = (primitive, tool, name)
    if domain.has(tool, "cleaningTool"):
        found |= {f"Wipe with {tool}": ("wipe", name, tool), f"Scrub with {tool}": ("scrub", name, tool)}
    if domain.has(tool, "slicer") and domain.has(name, "sliceable"):
        found[f"Slice with {tool}"] = ("slice", name, tool)
    if domain.has(tool, "soakable") and domain.has(name, "waterSource"):
        found[f"Soak {tool}"] = ("soak", tool, name)
    if tool in domain.fillable and domain.has(name, "waterSource"):
        found[f"Fill {tool}"] = ("fill", tool, name)
    for substance in contents.get(tool, ()):
        found[f"Pour {substance} out of {tool}"] = ("pour", tool, name, substance)
        if tool in domain.sprays:
            found[f"Spray with {substance}"] = ("spray", name, tool, substance)
    if tool in domain.stirrers and domain.contains(name):
        for substance in domain.mixable:
            found[f"Mix {substance} with {tool}"] = ("mix", name, tool, substance)
    if name in domain.attachable(tool):
        found[f"Attach {tool}"] = ("attach", tool, name)
    if domain.has(tool, "cookable") and domain.has(name, "heatSource"):
        found[f"Cook {tool}"] = ("cook", tool, name)
    return {text: words for text, words in found.items() if words[0] in PRIMITIVES}


PLACES = {"place_on_top": "on top", "place_inside": "inside", "place_next_to": "next to", "place_under": "under"}
"""Words of buttons that place what is held."""
