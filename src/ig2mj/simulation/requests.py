"""Carries out drawn requests to primitives (`ig2mj.planning.requests`) in one home, each from the home's start.

A request is *prepared* if what must hold first could be sampled and taken into the hands, and states among it still
hold then: water does not stay in a glass that lies on its side. It *has a solution* if the rung that is measured
carries it out, or the symbolic rung does from the same state (the sampler finds a state in which the primitive's
condition holds) and hands could: what is grasped is of a category that hands take hold of and, in physics, some part
of what is acted on, or of where it is placed, is within a hand's reach of floor that the robot could drive to if
nothing loose stood there, whatever is in between.
"""

from __future__ import annotations

import contextlib
import functools
import json
import signal
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

import jax
import numpy as np

from ig2mj.agents.registry import make_robot
from ig2mj.envs.planning_stage import DOORS_SETTLE
from ig2mj.errors import AbilityError, StateError
from ig2mj.planning.domain import Domain
from ig2mj.planning.facts import Facts
from ig2mj.planning.kinematic import SETTLE, KinematicRung
from ig2mj.planning.kinematic_stage import KinematicStage
from ig2mj.planning.motion_planner import MotionPlanner
from ig2mj.planning.physics import PhysicsRung
from ig2mj.planning.requests import MEASURED, Request, RequestSource, added_to
from ig2mj.planning.rung import Rung
from ig2mj.planning.spots import out_of_reach
from ig2mj.planning.starts import open_doors, start_place
from ig2mj.planning.steps import Outcome, PlanningError, Step
from ig2mj.planning.symbolic import SymbolicRung
from ig2mj.process import entry_point
from ig2mj.sampling.budget import Budget
from ig2mj.sampling.conditions import Condition
from ig2mj.sampling.many import make_sampler
from ig2mj.sampling.query import SceneQuery
from ig2mj.sampling.row import Row
from ig2mj.scene.paths import shipped_homes
from ig2mj.scene.scene import load_scene
from ig2mj.simulation.robots import put_row
from ig2mj.simulation.simulation import Simulation

RUNGS = ("symbolic", "kinematic", "physics")
"""Rungs that can be measured."""

PLACED, LATTICE = 4, 5
"""States in which a placement holds that are sampled until one of them is within a hand's reach; points along each axis
of an object's box, of which one has to be."""

WHERE_IT_IS = ("navigate_to", "grasp", "open", "close", "toggle_on", "toggle_off", "wipe", "scrub")
"""Primitives that act on their first argument where it is."""

DRAWS, WORK = 20, 400
"""Draws until a home has something that can be asked; units of sampling what must hold first."""

CRASHED = "crashed"
"""Reason of a request that raised an error, next to `ig2mj.planning.REASONS`."""


def home_of(primitive: str, number: int, seed: int) -> str:
    """The home in which a request is drawn."""
    homes = shipped_homes()
    return homes[int(_stream(primitive, number, seed).integers(len(homes)))]


def _stream(primitive: str, number: int, seed: int, part: int = 0) -> np.random.Generator:
    return np.random.default_rng([seed, MEASURED.index(primitive), number, part])


@entry_point
def measure(home: str, rung: str, robot: str, seed: int, requests: Sequence[Sequence[Any]], seconds: float) -> bytes:
    """Results of requests in one home, as a JSON list; a job of `ig2mj.cluster`.

    Args:
      rung: one of `RUNGS`. requests: (primitive, number). seconds: wall time of one.
    """
    with jax.default_device(jax.local_devices(backend="cpu")[0]):
        bench = _bench(home, rung, robot, seed)
        return json.dumps([_measured(bench, primitive, number, seconds) for primitive, number in requests]).encode()


def _measured(bench: RequestBench, primitive: str, number: int, seconds: float) -> dict[str, Any]:
    row: dict[str, Any] = {"primitive": primitive, "number": number, "home": bench.home, "arguments": []}
    row |= {"prepared": False, "solution": False, "reason": "", "detail": "", "attempts": 0}
    row |= {"time": 0.0, "planning": 0.0, "processor": 0.0}
    try:
        with _time_limit(seconds):
            return {**row, **bench.run(primitive, number)}
    except TimeoutError:
        return {
            **row,
            "prepared": True,
            "solution": True,
            "reason": "timeout",
            "detail": f"{seconds:.0f} s of wall time",
        }
    except Exception as e:  # one request must not end the run
        detail = f"{type(e).__name__}: {e}"
        return {**row, "prepared": True, "solution": True, "reason": CRASHED, "detail": detail}


@functools.lru_cache(maxsize=1)
def _bench(home: str, rung: str, robot: str, seed: int) -> RequestBench:
    return RequestBench(home, rung, robot, seed)


class RequestBench:
    """A home with what `added_to` names and a robot, in which requests are carried out one after another.

    Attributes:
      home: its name.
    """

    def __init__(self, home: str, rung: str, robot: str = "humanoid", seed: int = 0):
        """
        Raises:
          UnknownNameError: no such home or robot. PlanningError: the robot's motion cannot be planned.
        """
        if rung not in RUNGS:
            raise PlanningError(f"requests cannot be measured on the {rung} rung ({', '.join(RUNGS)} can)")
        self.home, self._seed = home, seed
        own = set(load_scene(home).object_names)
        added = added_to(own)
        bare = load_scene(home, objects=added)
        self._sampler = make_sampler(bare)
        self._own_start = self._sampler.start
        body: Any = make_robot(robot)
        self._domain = Domain.of_robot(self._sampler.model, body)
        wholes = np.flatnonzero(bare.tables.object_part_of < 0)
        kit = [name for o in wholes if (name := bare.tables.object_names[o]) not in own]
        self._source = RequestSource(self._domain, kit)
        self._simulation, self._stage = None, None
        if rung == "symbolic":
            return
        x, y = start_place(bare, self._sampler.query.view, ())
        scene = load_scene(home, agents=[body.at(x, y, 0.0)], objects=added)
        self._query, self._planner = SceneQuery(scene), MotionPlanner(scene)
        if rung == "physics":
            self._simulation = Simulation(scene, seed=seed, grasping="assisted")
            own = self._simulation.agent.rung
            own.step()  # compiles, in no request's time
            self._body = own.body
        else:
            self._stage = KinematicStage(scene)

    def run(self, primitive: str, number: int) -> dict[str, Any]:
        """Draws a request and carries it out; see the module's text."""
        rng = _stream(primitive, number, self._seed, 1)
        drawn = (self._source.draw(primitive, rng) for _ in range(DRAWS))
        request = next((r for r in drawn if r is not None), None)
        if request is None:
            return {"detail": "the home has nothing that it could be asked of"}
        found: dict[str, Any] = {"arguments": list(request.step.arguments)}
        row, why = self._start(request, rng)
        if row is None:
            return {**found, "detail": why}
        rung = self._rung(row, request.step, number)
        symbolic, possible = self._solution(row, request, rung, number)
        for name in request.taken:
            taken = _outcome(rung, Step("grasp", (name,)))
            if not taken.done:
                return {**found, "detail": f"grasp {name}: {taken.reason}: {taken.detail}"}
        if lost := next((c for c in request.before if not c.is_placement and not _true(rung.facts(0), c)), None):
            return {**found, "detail": f"{lost} does not last until the primitive begins"}
        began = time.process_time()
        outcome = _outcome(rung, request.step)
        return {
            **found,
            "prepared": True,
            "symbolic": symbolic,
            "solution": possible or outcome.done,
            "reason": outcome.reason,
            "detail": outcome.detail,
            "attempts": outcome.attempts,
            "time": round(outcome.time, 2),
            "planning": round(outcome.planning, 4),
            "processor": round(time.process_time() - began, 3),
        }

    def _start(self, request: Request, rng: np.random.Generator) -> tuple[Row | None, str]:
        """A state in which everything holds that must hold first, or why there is none."""
        sampler = self._sampler
        physics, states = self._own_start
        sampler.query.load(physics)
        sampler.start_from(physics, states)
        facts = Facts(self._domain, states, sampler.query.view)
        placed = {c.arguments[0] for c in request.before if c.is_placement}
        shut = [c for n in request.taken if n not in placed for c in facts.containers(n) if self._domain.opens(c)]
        said = {c.arguments[0] for c in request.before if c.predicate == "open"}
        before = [*request.before, *(Condition("open", (c,)) for c in dict.fromkeys(shut) if c not in said)]
        if not before:
            return Row(physics, states), ""
        rejected: Counter[str] = Counter()
        try:
            row = sampler.sample(before, rng, Budget(WORK), rejected, keep=True)
        except (StateError, AbilityError) as e:
            return None, str(e)
        return row, ", ".join(f"{reason} ({count})" for reason, count in rejected.most_common(2))

    def _rung(self, row: Row, step: Step, number: int) -> Rung:
        """What is measured, in a state."""
        if self._simulation is not None:
            return self._physics(self._simulation, row, step, number)
        return self._symbolic(row, number) if self._stage is None else self._kinematic(self._stage, row, step, number)

    def _symbolic(self, row: Row, number: int, again: int = 0) -> SymbolicRung:
        """`again`: number of the try, for other random streams."""
        seed = self._seed + 1_000_003 * again
        return SymbolicRung(self._domain, self._sampler, [(row.physics, row.states)], seed, number)

    def _solution(self, row: Row, request: Request, rung: Rung, number: int) -> tuple[bool, bool]:
        """Whether the symbolic rung carries a request out, and whether hands could: see the module's text."""
        step = request.step
        if not self._carried_out(first := self._symbolic(row, number), request).done:
            return False, False
        if step.primitive == "grasp" and not self._domain.graspable(step.object):
            return True, False
        places = step.primitive.startswith("place_")
        if not isinstance(rung, PhysicsRung) or not (places or step.primitive in WHERE_IT_IS):
            return True, True
        farther = out_of_reach(rung.world(0), [self._domain.index(n) for n in self._domain.loose])
        for again in range(PLACED if places else 1):
            acted = first if not again else self._symbolic(row, number, again)
            if not again or self._carried_out(acted, request).done:
                low, high = (np.asarray(v, float) for v in acted.facts(0).box(step.object))
                shares = np.stack(np.meshgrid(*[np.linspace(0.0, 1.0, LATTICE)] * 3), axis=-1).reshape(-1, 3)
                if np.isfinite(farther(low + shares * (high - low))).any():
                    return True, True
        return True, False

    def _kinematic(self, stage: KinematicStage, row: Row, step: Step, number: int) -> KinematicRung:
        query, physics = self._sampler.query, row.physics
        write = open_doors(self._sampler.query.scene, step.arguments)
        if write is not None:
            query.load(physics)
            query.write(write)
            query.settle(SETTLE)
            physics = query.save()
        start = [(physics, row.states)]
        options = {"query": self._query, "planner": self._planner}
        return KinematicRung(self._domain, stage, self._sampler, start, self._seed, number, **options)

    def _physics(self, simulation: Simulation, row: Row, step: Step, number: int) -> PhysicsRung:
        simulation.reset()
        put_row(simulation, row)
        write = open_doors(simulation.scene, step.arguments)
        if write is not None:
            simulation._write(write)
            engine = simulation.engine
            simulation.step(count=round(DOORS_SETTLE / (engine.substeps * engine.timestep)))
        stage = simulation.agent.rung.stage
        return PhysicsRung(stage, self._seed, number, self._query, self._planner, self._body)

    def _carried_out(self, rung: Rung, request: Request) -> Outcome:
        """The outcome on a rung; of a grasp that comes before it, if that fails."""
        for step in [*(Step("grasp", (name,)) for name in request.taken), request.step]:
            outcome = _outcome(rung, step)
            if not outcome.done:
                return outcome
        return Outcome()


def _true(facts: Facts, condition: Condition) -> bool:
    return facts.holds(condition.predicate, *condition.arguments) == condition.value


def _outcome(rung: Rung, step: Step) -> Outcome:
    rung.begin(0, step)
    return rung.advance()[0]


@contextlib.contextmanager
def _time_limit(seconds: float) -> Iterator[None]:
    """Raises TimeoutError in this thread after so much wall time, where the system has such a timer."""
    if not hasattr(signal, "SIGALRM") or not np.isfinite(seconds):
        yield
        return

    def end(*_: object) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, end)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
