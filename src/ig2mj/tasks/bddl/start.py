"""The start of a bound activity, sampled: initial states in which everything that its definition says holds.

What `tasks.bddl.binding` adds to a home stands outside the house. An addition that the activity wants in a room, and
for which no condition says where, is put on the floor of that room.
"""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Sequence
from typing import Any

import jax
import numpy as np

from ig2mj.callbacks import ProgressCallback, no_progress
from ig2mj.predicates.compile import compile_expression
from ig2mj.predicates.host_queries import HostQueries
from ig2mj.sampling import many
from ig2mj.sampling.conditions import Condition, read_conditions
from ig2mj.sampling.many import Sampled
from ig2mj.sampling.query import SceneQuery
from ig2mj.scene.manifest import Manifest
from ig2mj.scene.scene import Scene, load_scene
from ig2mj.states.model import StateModel
from ig2mj.states.world import ExtendedStates, WorldState
from ig2mj.tasks.bddl.binding import Binding, BindingError, bind
from ig2mj.tasks.bddl.goal import conditions
from ig2mj.tasks.bddl.vocabulary import Activity
from ig2mj.tasks.bddl.words import sentences
from ig2mj.worlds.pool import Pool


@dataclasses.dataclass(frozen=True)
class SampledStart:
    """Initial states of an activity.

    Attributes:
      sampled: the rows and the counted reasons. reached: numbers of rows of the pool in which the goal holds already.
    """

    sampled: Sampled
    reached: tuple[int, ...]


@dataclasses.dataclass(frozen=True)
class RowStatus:
    """How far the goal of an activity is reached in one state.

    Attributes:
      holds: it is reached. fraction: share of it. missing: its conditions that are false, in words, over the activity's
      names. explanation: the same over the scene's names, with the numbers behind.
    """

    holds: bool
    fraction: float
    missing: tuple[str, ...]
    explanation: str


def fitting(activity: Activity, homes: Sequence[Manifest]) -> tuple[list[Binding], dict[str, list[str]]]:
    """Bindings in the homes that fit, those that add least (tools left out) first; of the other homes the reasons."""
    bound: list[Binding] = []
    errors: dict[str, list[str]] = {}
    for manifest in homes:
        try:
            bound.append(bind(activity, manifest))
        except BindingError as e:
            errors[manifest.name] = list(e.reasons)
    return sorted(bound, key=lambda b: len(b.additions) - len(b.tools)), errors


def start_conditions(binding: Binding, scene: Scene) -> list[Condition]:
    """What must hold at the start, of the scene's objects.

    Left out are conditions of absent agents, that a fixed object is on the floor of the room where it stands, and that
    there is none of a substance yet.

    Raises:
      StateError: a condition is neither a predicate nor the negation of one.
    """
    read = dict.fromkeys(read_conditions(conditions(binding).init))

    def is_given(c: Condition) -> bool:
        if c.predicate != "on_floor" or not c.value:
            return False
        entry = scene.object(c.arguments[0])
        return entry.fixed and (c.arguments[1] in entry.rooms or c.arguments[1] not in scene.tables.room_names)

    found = [c for c in read if not is_given(c) and c.predicate != "present"]
    placed = {c.arguments[0] for c in found if c.is_placement and c.value}
    requested = [
        (binding.objects[name], room) for name, room in binding.rooms.items() if binding.objects[name] in binding.added
    ]
    requested += [(tool, room or scene.object_names[0]) for tool, room in binding.tools.items()]
    return [*found, *(Condition("on_floor", (new, room)) for new, room in requested if new not in placed)]


def load_bound(binding: Binding, home: str | os.PathLike | None = None, added: Sequence[str] = ()) -> Scene:
    """The scene of a binding, with its additions.

    Args:
      home: where it lies; default: the shipped one of that name. added: further objects (see `load_scene`).
    """
    return load_scene(binding.home if home is None else home, objects=(*binding.requested, *added))


HOMES = 3
"""Homes that are tried in turn, those that add least first: what is added may find no room in the first."""


def first_that_works(
    bound: Sequence[Binding], seed: int = 0, home: str | os.PathLike | None = None, seconds: float = float("inf")
) -> tuple[Binding, Scene]:
    """Of bindings in several homes the first of which one initial state can be sampled; the very first where none can.

    Args:
      bound: at least one, the best first. seed: of the state. home: see `load_bound`. seconds: wall time for each home.
    """
    first: tuple[Binding, Scene] | None = None
    for binding in bound[:HOMES]:
        scene = load_bound(binding, home)
        first = first or (binding, scene)
        if len(bound) == 1 or sample_start(binding, scene, 1, seed, seconds_per_row=seconds).sampled.complete:
            return binding, scene
    if first is None:
        raise ValueError("no binding")
    return first


def sample_start(
    binding: Binding,
    scene: Scene,
    count: int,
    seed: int = 0,
    *,
    jobs: int = 1,
    seconds_per_row: float = float("inf"),
    progress: ProgressCallback = no_progress,
    **options: Any,
) -> SampledStart:
    """Samples initial states of an activity.

    Args:
      scene: as `load_bound` gives it. The others: as of `ig2mj.sampling.many.sample`, which also says what is raised.
    """
    requested = [c.expression for c in start_conditions(binding, scene)]
    done = many.sample(
        scene, requested, count, seed, jobs=jobs, seconds_per_row=seconds_per_row, progress=progress, **options
    )
    return SampledStart(done, () if done.pool is None else rows_where_goal_holds(binding, scene, done.pool))


class GoalCheck:
    """Whether the goal of a bound activity holds in a sampler's world."""

    def __init__(self, binding: Binding, query: SceneQuery, model: StateModel):
        self.query = query
        self.goal = conditions(binding).compile_goal(model)

    def holds(self, states: ExtendedStates) -> bool:
        """In the world as it is now, with the given extended states."""
        return bool(np.asarray(self.goal(world_of(self.query, states)))[0])


def rows_where_goal_holds(binding: Binding, scene: Scene, pool: Pool) -> tuple[int, ...]:
    """Numbers of the rows in which the activity is done before it begins."""
    query = SceneQuery(scene)
    check = GoalCheck(binding, query, StateModel.of_manifest(scene.tables, scene.manifest))
    return tuple(n for n in range(pool.size) if check.holds(load_row(query, pool, n)))


def row_status(binding: Binding, scene: Scene, pool: Pool, row: int) -> RowStatus:
    """How far the goal is reached in a row of a pool."""
    query = SceneQuery(scene)
    model = StateModel.of_manifest(scene.tables, scene.manifest)
    world = world_of(query, load_row(query, pool, row))
    bound, questions = conditions(binding), HostQueries.of(model)
    said = binding.activity.goal
    true = [compile_expression(model, part, bound.groups, questions=questions)(world)[0] for part in bound.goal]
    goal = bound.compile_goal(model)
    return RowStatus(
        holds=bool(goal(world)[0]),
        fraction=float(goal.fraction(world)[0]),
        missing=tuple(sentences([part for part, holds in zip(said, true, strict=True) if not holds])),
        explanation=goal.explain(world),
    )


def load_row(query: SceneQuery, pool: Pool, row: int) -> ExtendedStates:
    """Puts the world into a row of a pool; its extended states."""
    one = pool.rows(np.array([row]))
    query.load(jax.tree.map(lambda a: np.asarray(a[0]), one.physics))
    return one.states


def world_of(query: SceneQuery, states: ExtendedStates) -> WorldState:
    """A sampler's world as predicates read it."""
    nothing = np.zeros(1, np.int32)
    key, time = np.zeros((1, 2), np.uint32), np.zeros(1, np.float32)
    return WorldState(None, query.view, states, key=key, step=nothing, time=time)
