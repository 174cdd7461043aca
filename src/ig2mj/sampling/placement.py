"""Placing one object: candidates from a rule, tried until one is free, settles, and makes the predicate true.

Beyond iGibson, it checks that the object is supported and penetrates nothing, that the predicate holds after physics
has run, and that everything is then at rest. Every rejection is counted under its reason.

Axes: N candidates.
"""

from __future__ import annotations

import collections
import dataclasses
import itertools
from collections.abc import Callable, Collection, Iterator, Sequence

import numpy as np
from jaxtyping import Bool, Float

from ig2mj.engine.snapshot import Snapshot
from ig2mj.engine.view import PhysicsView
from ig2mj.sampling.budget import Budget
from ig2mj.sampling.bystanders import Bystanders
from ig2mj.sampling.carried import Carried
from ig2mj.sampling.columns import CELL, ColumnWindow
from ig2mj.sampling.drop import Rest, origin, rest_at
from ig2mj.sampling.footprint import Footprint
from ig2mj.sampling.orientations import StableOrientations, tipped
from ig2mj.sampling.possible import possible_origins
from ig2mj.sampling.query import SceneQuery

LIFT = 0.002
"""Metres by which an object is put above where it will rest, so that rounding to cells makes it stand in nothing."""

PENETRATION = 0.001
"""Metres. A candidate that penetrates something by more is lifted, or rejected."""

RESTING_PENETRATION = 0.002
"""Metres. No sampled state stands deeper in anything (at rest, by gravity)."""

SLIPPED = (0.05, 0.08)
"""Metres. An object that moves farther (sideways, downwards) while it settles has not been supported."""

SETTLED_TRIES = 8
"""Candidates of one orientation and level that are let go, before another one is drawn."""

AT_ONCE = 4
"""Candidates that count as one unit of work where the predicate is false before anything is let go."""

FALLS_IN = 4
"""Of loosely supported candidates of which the predicate is false before anything is let go, one in so many is let go
nevertheless: it may fall into the container."""

LIFTS = 3
"""Times that an object that stands in something is lifted by as much as it stands in it."""

DRAWS = 24
"""Orientations tried at most."""

PUSHES, TOUCHING = 6, 0.001
"""Pushes at most against another object, and the gap in metres that is left: well within the tolerance of touching."""

SUPPORT = ("full", "balanced", "loose")
"""How well an object must be supported, the best first (see `ig2mj.sampling.drop`)."""

LOOSE_SPREAD = 0.01
"""Metres. Among loosely supported candidates the lowest are let go first, but for differences of this size."""

FIRST_DRAWS = 9
"""Orientations over which the demand goes down from full support to the least."""

STEPS = 30
"""Control steps of settling that count as one more unit of work."""

AREAS = 8
"""Areas of a rule that are looked at for one orientation."""

RANDOM_CELLS = 96
"""Candidates drawn at random per orientation and level, before many more are looked at."""

MANY_CELLS = 3_000_000
"""Where none of the first will do, as many candidates are looked at as make this number of cells under the object."""

NOWHERE = frozenset(("no surface", "no room", "not supported"))
"""Reasons of candidates that were not even let go. Where `DRAWS` orientations meet no others, none ever will."""

Truth = Callable[[], bool]


@dataclasses.dataclass(frozen=True)
class PlacementArea:
    """Where an object may be put: what a rule (`on_top.py`, `inside.py`, ...) gives.

    Attributes:
      low, high: x and y between which the object's origin comes to lie, metres.
      height: world z from which surfaces are looked for downwards.
      supports: objects that may bear it. contents: further ones, where full support by `supports` is not found.
      allowed: for cells (row, col of the world's grid), whether the object's origin may be there; None: all.
      push_towards: object that the placed one is pushed against before it is let go; -1: none.
      loose: where neither full support nor balance is found, physics may decide where the object comes to rest, as in a
        bowl or a basket; the supports are containers.
      holds_at_once: the predicate does not depend on contact, so that it can be asked before physics.
      lowered: it is asked then where the object comes to rest, `LIFT` below where it is let go.
    """

    low: Float[np.ndarray, "2"]
    high: Float[np.ndarray, "2"]
    height: float
    supports: tuple[int, ...]
    allowed: Callable[[np.ndarray, np.ndarray], np.ndarray] | None = None
    push_towards: int = -1
    loose: bool = False
    holds_at_once: bool = False
    lowered: bool = False
    contents: tuple[int, ...] = ()


Areas = Callable[[Footprint, np.random.Generator], Iterator[PlacementArea]]
"""A rule: areas to try for an object of a given footprint, the likely ones first; may be endless."""


def holding_at_once(areas: Areas) -> Areas:
    """A rule's areas, with the predicate asked before physics, too (`PlacementArea.holds_at_once`, `lowered`)."""

    def asked(shape: Footprint, rng: np.random.Generator) -> Iterator[PlacementArea]:
        for area in areas(shape, rng):
            yield dataclasses.replace(area, holds_at_once=True, lowered=True)

    return asked


Rejections = collections.Counter


@dataclasses.dataclass(frozen=True)
class _Task:
    """What is being placed, and how."""

    object_index: int
    moves: Carried
    truth: Truth
    rng: np.random.Generator
    budget: Budget
    rejected: Rejections
    before: Snapshot
    others: Bystanders
    pushable: Collection[int]
    at_once: Iterator[int] = dataclasses.field(default_factory=lambda: itertools.count(1))


class Placer:
    """Places objects in a `SceneQuery`'s world, one after another."""

    def __init__(self, query: SceneQuery):
        """Binds a world."""
        self.query = query
        self._orientations = StableOrientations(query)

    def place(
        self,
        object_index: int,
        areas: Areas,
        truth: Truth,
        rng: np.random.Generator,
        budget: Budget,
        rejected: Rejections,
        along: int = -1,
        flat: bool = False,
        pushable: Collection[int] = (),
        carried: Sequence[int] = (),
    ) -> bool:
        """Puts an object into an area so that `truth` holds afterwards; leaves the world as it was where it cannot.

        Args:
          areas: see `Areas`. truth: evaluated after the object has settled. rejected: counters that are increased.
          along: an object with whose sides every second orientation is aligned, so that a pillow finds its place in a
            cabinet that it all but fills; -1: all are turned by any angle.
          flat: of its stable orientations, the object takes one in which it is lowest, so that it can bear something.
          pushable: objects that may be moved, so long as `truth` holds.
          carried: objects that go along, since they lie in or on the object, which is only turned about the vertical.
        """
        before = self.query.save()
        moves, others = Carried.now(self.query, object_index, carried), Bystanders(self.query, before)
        task = _Task(object_index, moves, truth, rng, budget, rejected, before, others, pushable)
        container = False
        for draw in range(DRAWS):
            if budget.spent():
                rejected["budget spent"] += 1
                break
            support = SUPPORT[min(draw * len(SUPPORT) // FIRST_DRAWS, len(SUPPORT) - 1)]
            aligned = along if draw % 2 else -1
            quat = self._orientations.draw(object_index, rng, aligned, flat, as_it_is=bool(carried))
            shift = rng.uniform(-CELL / 2, CELL / 2, 2)
            if container and support == "loose" and draw // 2 % 2 and not carried:
                quat = tipped(quat, rng, np.asarray(self.query.view.object_quat[0, aligned]) if aligned >= 0 else None)
            shape = self.query.footprint(object_index, quat, shift)
            if draw == 0:
                container = any(area.loose for area in itertools.islice(areas(shape, np.random.default_rng(0)), 1))
            for area in itertools.islice(areas(shape, rng), AREAS):
                if self._try_area(task, quat, shape, area, support):
                    return True
                if budget.spent():
                    break
        self.query.load(task.before)
        return False

    def _try_area(self, task: _Task, quat: np.ndarray, shape: Footprint, area: PlacementArea, support: str) -> bool:
        if not task.budget.spend():
            return False
        rest = self._candidates(task.moves.all, task.rng, task.rejected, shape, area, support)
        order = task.rng.permutation(len(rest.row))
        if support == "loose":  # deep down, it is more likely to stay
            spread = task.rng.uniform(0.0, LOOSE_SPREAD, len(order))
            order = order[np.argsort(rest.height[order] + spread, kind="stable")]
        for n in order[:SETTLED_TRIES]:
            if not task.budget.spend():
                return False
            pos = origin(shape, int(rest.row[n]), int(rest.col[n]), float(rest.height[n]) + LIFT)
            reason = self._let_go(task, pos, quat, area, support)
            if not reason:
                return True
            task.rejected[reason] += 1
            self.query.load(task.before)
        return False

    def spots(
        self,
        object_index: int,
        areas: Areas,
        quat: Float[np.ndarray, "4"],
        rng: np.random.Generator,
        support: str = "full",
        most: int = AREAS,
        each: int | None = None,
    ) -> Iterator[Float[np.ndarray, "3"]]:
        """Positions of an object's main body in a given orientation (world frame, w-x-y-z) at which it rests in the
        areas of a rule when it is lowered; nothing is moved, and no physics is run.

        Args:
          support: one of `SUPPORT`. most: areas that are looked at. each: positions of an area; None: all.
        """
        shape = self.query.footprint(object_index, quat, rng.uniform(-CELL / 2, CELL / 2, 2))
        for area in itertools.islice(areas(shape, rng), most):
            rest = self._candidates((object_index,), rng, collections.Counter(), shape, area, support)
            for n in rng.permutation(len(rest.row))[:each]:
                yield origin(shape, int(rest.row[n]), int(rest.col[n]), float(rest.height[n]))

    def _candidates(
        self,
        moving: Collection[int],
        rng: np.random.Generator,
        rejected: Rejections,
        shape: Footprint,
        area: PlacementArea,
        support: str,
    ) -> Rest:
        """Candidates that pass the tests on columns; first of a few cells drawn at random, else of many."""
        cells = ColumnWindow.around(area.low, area.high)
        rows, cols = shape.underside.shape
        window = ColumnWindow(cells.row + shape.row, cells.col + shape.col, cells.rows + rows, cells.cols + cols)
        level = self.query.level(window, area.height, without=moving)
        every = np.arange(cells.rows * cells.cols)
        if area.allowed is not None:
            every = every[area.allowed(cells.row + every // cells.cols, cells.col + every % cells.cols)]
        if support == "loose" and area.loose:
            every = every[self._over(shape, cells, area.supports).ravel()[every]]
        many = MANY_CELLS // max(int(shape.covered.sum()), 1)
        few = len(every) <= RANDOM_CELLS
        requested = "balanced" if support == "loose" and not area.loose else support
        supports = area.supports if support == "full" else (*area.supports, *area.contents)
        rest, good = _none(), np.zeros(0, bool)
        for first in (True, False):
            if first and not few:
                chosen = rng.choice(every, RANDOM_CELLS, replace=False)
            else:
                chosen = every
                if len(chosen) > many:
                    possible = possible_origins(level, shape, supports, cells.rows, cells.cols, requested == "full")
                    chosen = chosen[possible.ravel()[chosen]]
                if len(chosen) > many:
                    chosen = rng.choice(chosen, many, replace=False)
            row, col = cells.row + chosen // cells.cols, cells.col + chosen % cells.cols
            rest = rest_at(level, shape, row, col, supports, requested)
            good = {"full": rest.full, "balanced": rest.balanced, "loose": rest.clear}[requested]
            if good.any() or few:
                break
        if not good.any():
            if not len(every) or not np.isin(level.owner, supports).any():
                rejected["no surface"] += 1
            elif not rest.clear.any():
                rejected["no room"] += 1
            else:
                rejected["not supported"] += 1
        return Rest(*(getattr(rest, f.name)[good] for f in dataclasses.fields(Rest)))

    def _over(self, shape: Footprint, cells: ColumnWindow, containers: Sequence[int]) -> Bool[np.ndarray, "R C"]:
        """Cells of the origin where the object's centre of mass is above or below a part of a container: not next to a
        round one, in a corner of its box."""
        col, row = np.rint(shape.centre / CELL).astype(int).tolist()
        window = ColumnWindow(cells.row + row, cells.col + col, cells.rows, cells.cols)
        return np.any([self.query.covered(c, window) for c in containers], axis=0)

    def _let_go(self, task: _Task, pos: np.ndarray, quat: np.ndarray, area: PlacementArea, support: str) -> str:
        """Puts the object there and lets physics settle; the reason why that is no good, or ''."""
        query, placed, moves = self.query, task.object_index, task.moves
        exempt = task.others.touching[placed].copy()  # what lies on it may fall when it is taken away
        exempt[[*moves.all, *task.pushable]] = True
        moves.put(query, pos, quat)
        if area.push_towards >= 0:
            pos = self._pushed(moves, pos, quat, area.push_towards)
        for _ in range(LIFTS):
            deep = query.penetration(*moves.all)
            if deep <= PENETRATION:
                break
            pos = pos + np.array([0.0, 0.0, deep])
            moves.put(query, pos, quat)
        else:
            return "collides"
        loose = support == "loose" and area.loose
        if area.holds_at_once and not self._would_hold(task, pos, quat, area.lowered):
            turn = next(task.at_once)
            if not loose or turn % FALLS_IN:
                task.budget.work += turn % AT_ONCE > 0
                return "predicate false"
        start = np.array(query.view.object_com[0, placed])

        def moved(view: PhysicsView) -> str:
            way = np.asarray(view.object_com[0, placed]) - start
            if not loose and (np.linalg.norm(way[:2]) > SLIPPED[0] or way[2] < -SLIPPED[1]):
                return "fell"
            return "moves others" if (task.others.shoved() & ~exempt).any() else ""

        steps = 0

        def stop(view: PhysicsView) -> bool:
            nonlocal steps
            steps += 1
            return bool(moved(view))

        asleep = query.settle(stop=stop)
        task.budget.work -= steps // STEPS
        if reason := moved(query.view):
            return reason
        if not asleep and (np.asarray(query.view.awake[0, placed]) or task.others.restless().any()):
            return "not at rest"
        if query.penetration(*moves.all) > RESTING_PENETRATION:
            return "stands in something"
        if not task.truth():
            return "predicate false"
        return ""

    def _would_hold(self, task: _Task, pos: np.ndarray, quat: np.ndarray, lowered: bool) -> bool:
        """Whether the predicate holds before physics; `lowered`: see `PlacementArea`. Of two things that lie flat, the
        rays of one may pass above the other where it is let go, and meet it where it rests."""
        if not lowered:
            return task.truth()
        task.moves.put(self.query, pos - np.array([0.0, 0.0, LIFT]), quat)
        holds = task.truth()
        task.moves.put(self.query, pos, quat)
        return holds

    def _pushed(self, moves: Carried, pos: np.ndarray, quat: np.ndarray, other: int) -> Float[np.ndarray, "3"]:
        """The position after the object has been pushed level against another one, until they all but touch."""
        for _ in range(PUSHES):
            distance, towards = self.query.clearance(moves.bearer, other)
            level = np.array([*towards[:2], 0.0])
            if distance <= TOUCHING or np.linalg.norm(level) < 1e-6:
                break
            pos = pos + level / np.linalg.norm(level) * (distance - TOUCHING / 2)
            moves.put(self.query, pos, quat)
        return pos


def _none() -> Rest:
    empty, flags = np.zeros(0, int), np.zeros(0, bool)
    return Rest(empty, empty, np.zeros(0), flags, flags, flags)
