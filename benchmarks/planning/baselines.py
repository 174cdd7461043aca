"""Agents that the planner is compared with, on the same start states: `activities.py --agent NAME`.

| agent | what it does |
|---|---|
| `planner` | plans, and plans again after every step |
| `random` | carries out random primitives on the objects that the goal names, as many as the planner may |
| `no_retries` | carries out the first plan in order, each step once, each primitive with one try |
| `igibson` | plans as `planner`, with iGibson 2.0's settings for motion (see `igibson_settings`) |
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any
from unittest.mock import patch

import numpy as np

from ig2mj.planning import cleaning, grasping, moves, opening, placing, primitives, pushing, switching, treatments
from ig2mj.planning.clearance import straight
from ig2mj.planning.domain import Domain
from ig2mj.planning.facts import Facts
from ig2mj.planning.free_floor import FreeFloor, Point
from ig2mj.planning.grounding import ground_steps
from ig2mj.planning.hand_search import connect
from ig2mj.planning.moves import Primitive
from ig2mj.planning.problem import Problem
from ig2mj.planning.stances import behind_wall
from ig2mj.planning.steps import Outcome, Step
from ig2mj.planning.task_planner import TaskPlan, TaskPlanner
from ig2mj.planning.world import PlannedWorld, Stance

AGENTS = ("planner", "random", "no_retries", "igibson")

PRIMITIVES_OF_IGIBSON = ("navigate_to", "grasp", "place_on_top", "place_inside", "open", "close")
"""Of `StarterSemanticActionPrimitives` (iGibson 2.0, action_primitives/starter_semantic_action_primitives.py)."""

BASE_ITERATIONS, HAND_ITERATIONS, RESTARTS = 100, 50, 2
"""Of its RRT-Connect, for the base and for the hand."""

BASE_CLEARANCE, BASE_STRIDE, HAND_STRIDE = 0.05, 0.05, 0.05
"""m: room that its base keeps, and by which trees grow at once."""

STANCES = 60
"""Random positions of the base about an object that it looks at."""


class _Wrapped(TaskPlanner):
    """A planner for the same goal. Its plans are those of another agent."""

    def __init__(self, planner: TaskPlanner):
        self.inner, self.domain, self.goal = planner, planner.domain, planner.goal


class RandomPlanner(_Wrapped):
    """Each step is a random primitive."""

    def __init__(self, planner: TaskPlanner, problem: Problem, seed: int):
        super().__init__(planner)
        self.steps = list(ground_steps(planner.domain, problem))
        self.rng = np.random.default_rng(seed)
        self._known: dict[int, tuple[object, int]] = {}

    def plan(self, facts: Facts, failed: Any = None, *memory: Any) -> TaskPlan:
        found = self.inner.plan(facts)
        if found.done:
            return found
        count = self._known.setdefault(id(failed), (failed, len(found.steps)))[1]
        chosen = self.steps[int(self.rng.integers(len(self.steps)))]
        return TaskPlan((chosen, *[chosen] * max(count - 1, 0)), found.missing, found.required)


class FirstPlan(_Wrapped):
    """The steps of the first plan, one after another, each once."""

    def __init__(self, planner: TaskPlanner):
        super().__init__(planner)
        self._left: dict[int, tuple[object, list[Step]]] = {}

    def plan(self, facts: Facts, failed: Any = None, *memory: Any) -> TaskPlan:
        found = self.inner.plan(facts)
        if id(failed) not in self._left:
            self._left[id(failed)] = failed, list(found.steps)
            return found
        left = self._left[id(failed)][1]
        left[:] = left[1:]
        return found if found.done else TaskPlan(tuple(left), found.missing, found.required)


def planner_of(agent: str, planner: TaskPlanner, problem: Problem, seed: int) -> TaskPlanner:
    """What chooses an agent's steps."""
    if agent == "random":
        return RandomPlanner(planner, problem, seed)
    if agent == "no_retries":
        return FirstPlan(planner)
    return TaskPlanner(Domain(problem.model, 1), planner.goal) if agent == "igibson" else planner


@contextlib.contextmanager
def settings_of(agent: str) -> Iterator[None]:
    """How an agent's primitives plan and try."""
    with contextlib.ExitStack() as stack:
        if agent in ("no_retries", "igibson"):
            for module in (grasping, opening, placing, pushing, switching, treatments):
                stack.enter_context(patch.object(module, "ATTEMPTS", 1))
            stack.enter_context(patch.object(cleaning, "TRIES", 1))
            stack.enter_context(patch.object(primitives, "BROUGHT_OUT", ()))
        if agent == "igibson":
            stack.enter_context(igibson_settings())
        yield


@contextlib.contextmanager
def igibson_settings() -> Iterator[None]:
    """iGibson 2.0's settings for motion: six primitives, one hand, one try.

    The base stands at the first of 60 random positions about the object that is free; base and hand follow what
    RRT-Connect finds within 100 and 50 iterations and two restarts. Two things differ from iGibson: the hand turns
    where it starts, so that its way is searched over positions, and motion is carried out in physics, not set.
    """
    with contextlib.ExitStack() as stack:
        stack.enter_context(patch.object(FreeFloor, "way", _base_way))
        for module in (cleaning, grasping, opening, placing, primitives, pushing):
            stack.enter_context(patch.object(module, "stances", _random_stances))
        for module in (moves, cleaning, grasping, opening, placing):
            stack.enter_context(patch.object(module, "hand_path", _hand_path))
        lacking = {name: _lacking for name in primitives.ACTIONS if name not in PRIMITIVES_OF_IGIBSON}
        stack.enter_context(patch.dict(primitives.ACTIONS, lacking))
        yield


def _lacking(world: PlannedWorld, step: Step) -> Primitive:
    """A primitive that iGibson does not have."""
    yield from ()
    return Outcome("not_true_after", f"iGibson's primitives have no {step.primitive}")


def _base_way(self: FreeFloor, start: Point, goal: Point) -> np.ndarray | None:
    """In place of `FreeFloor.way`."""
    one, two = np.asarray(start, float), np.asarray(goal, float)
    shape = np.array(self.free.shape) - 1

    def free(a: np.ndarray, b: np.ndarray) -> bool:
        count = int(np.linalg.norm(b - a) / (BASE_STRIDE / 2)) + 2
        cells = np.clip(self.occupancy.cells(np.linspace(a, b, count)), 0, shape)
        there = tuple(np.moveaxis(cells, -1, 0))
        near = np.linalg.norm(np.linspace(a, b, count) - one, axis=1) < 0.2  # it may start close to something
        return bool((near | (self.free[there] & (self.spare[there] >= BASE_CLEARANCE))).all())

    middles = self.occupancy.middles(np.argwhere(self.free))
    low, high = middles.min(0), middles.max(0)
    for seed in range(RESTARTS + 1):
        way = connect(free, one, two, low, high, stride=4 * BASE_STRIDE, samples=BASE_ITERATIONS, seed=seed)
        if way is not None:
            return np.array(way)
    return None


def _random_stances(
    world: PlannedWorld,
    hand: int,
    point: np.ndarray,
    floor: FreeFloor,
    away: float,
    most: int = 10,
    held: Any = None,
    before: Any = None,
) -> Iterator[Stance]:
    """In place of `ig2mj.planning.stances.stances`."""
    obstacles = world.obstacles()
    for _ in range(STANCES):
        angle, apart = world.rng.uniform(-np.pi, np.pi), world.rng.uniform(0.2, world.body.reach)
        xy = point[:2] + apart * np.array([np.cos(angle), np.sin(angle)])
        cell = np.clip(floor.occupancy.cells(xy[None])[0], 0, np.array(floor.free.shape) - 1)
        if not floor.free[tuple(cell)] or floor.spare[tuple(cell)] < BASE_CLEARANCE:
            continue
        if behind_wall(world, obstacles, xy, point):
            continue
        stance = Stance((float(xy[0]), float(xy[1])), float(np.arctan2(*(point[:2] - xy)[::-1])))
        if world.reaches(hand, stance, point):
            yield stance


def _hand_path(
    obstacles: Any,
    spheres: np.ndarray,
    start: np.ndarray,
    goal: np.ndarray,
    entries: Any = (),
    spare: float = 0.0,
    search: bool = False,
    follows: Any = None,
) -> list[np.ndarray] | None:
    """In place of `ig2mj.planning.moves.hand_path`."""

    def free(a: np.ndarray, b: np.ndarray) -> bool:
        return straight(obstacles, spheres, a, b)

    if spare > 0.0:  # what is put down comes to right above its place first
        over = goal + moves.OVER * moves.UP
        way = _hand_path(obstacles, spheres, start, over, follows=follows)
        return None if way is None else [*way, goal]
    low, high = np.minimum(start, goal) - 0.5, np.maximum(start, goal) + 0.5
    for seed in range(RESTARTS + 1):
        way = connect(free, start, goal, low, high, stride=4 * HAND_STRIDE, samples=HAND_ITERATIONS, seed=seed)
        if way is not None and (follows is None or follows(way[1:])):
            return way[1:]
    return None
