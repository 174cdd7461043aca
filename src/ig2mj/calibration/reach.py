"""What a floating hand can push from where: a free start, and a map of the ways that lead from object to object.

Worked out on the host from a settled scene, before the hand is added to it, and checked with MuJoCo's own collision
detection: a box around the hand's geoms is moved along each way. Everything that is fixed is in the way (walls, closed
cabinets, table tops), and so is what is too heavy to be shoved aside.

The map's nodes are the palm's places at the objects, a station next to each of them, and a grid of free places in the
rooms; its ways are straight and free. What lies behind a closed door is not on it.

Axes: M loose objects, N reachable ones, K nodes: first the N places at them, then the rest.
"""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
from jaxtyping import Float, Int
from scipy import sparse
from scipy.sparse import csgraph

from ig2mj.agents.floating_hand import add_floating_hand
from ig2mj.engine.native.settle import settle
from ig2mj.engine.snapshot import Snapshot
from ig2mj.errors import EngineError
from ig2mj.sampling.perturbation import loose_objects
from ig2mj.sampling.query import SceneQuery
from ig2mj.scene.scene import Scene
from ig2mj.scene.tables import SceneTables

RANGE = 1.5
"""Metres: longer ways between two objects or stations are not looked for; the grid is there for them."""

GRID, GRID_HEIGHTS = 0.6, (0.5, 1.3)
"""Metres between neighbours of the grid, and their heights over each floor."""

TO_GRID = 1.2
"""Metres from a station within which its neighbours on the grid are looked for."""

HEAVY = 5.0
"""Kilograms from which a loose object is in the way, like furniture."""

SAMPLE = 0.04
"""Metres between the places of a way that are checked."""

MEETS = 0.01
"""Metres by which the box of palm and fingers must reach into an object's box for the hand to have arrived."""

LEVEL = 0.05
"""Metres in height from the palm's place at an object within which it must arrive: with fingers, not with its back."""

FINGER_DEPTH, OVER_SUPPORT = 0.03, 0.01
"""Metres: the fingertips sweep this far under an object's centre, but no closer than this to what it lies on."""

ASIDE, LIFT, ABOVE = (0.3, 0.5), 0.15, 0.4
"""Metres: stations lie this far from an object and this much above the palm's place there, in one of eight directions;
where none of these is free, straight above it."""

BEYOND = 0.2
"""Metres behind an object that should be free where there is a choice: objects are pushed there."""

OPEN = 1.2
"""Metres that can be seen in one of ten directions, at least, from a start: it is in no closed cabinet."""

NEARNESS = 0.6
"""Metres. A way this much longer is taken e times less often."""

FAR = 1.0
"""Metres. An object this much further from a start counts e times less."""


@dataclasses.dataclass(frozen=True, eq=False)
class Reach:
    """Where the hand starts and what it can push; constants of `ig2mj.calibration.pushing`.

    Attributes:
      start: world position of the hand at zero controls, m: the node `start_node`.
      objects: the reachable ones. over: palm over each one's centre of mass, m.
      first: row of `objects` that is nearest to the start.
      nodes: the palm's places, m; the first N are those at the objects, as the scene settled.
      hop: the next node on the way from a node to an object (from itself: to its station); -1: there is no way.
      choice: cumulative probabilities of the next object, by the present one.
    """

    start: Float[np.ndarray, "3"]
    start_node: int
    first: int
    objects: Int[np.ndarray, "N"]
    over: Float[np.ndarray, "N"]
    nodes: Float[np.ndarray, "K 3"]
    hop: Int[np.ndarray, "K N"]
    choice: Float[np.ndarray, "N N"]


def find_reach(scene: Scene, settled: Snapshot | None = None) -> Reach:
    """The start with the most loose objects near that can be reached from it, and the ways between them.

    Args:
      scene: without agents.
      settled: its resting state; None: it is settled here.

    Raises:
      EngineError: the scene has an agent already, or a hand can get at none of its loose objects.
    """
    if len(scene.tables.agent_body):
        raise EngineError(f"scene '{scene.name}' has an agent: look for a hand's start in the scene without it")
    search = _Search(scene, settled if settled is not None else settle(scene))
    place = search.com + search.over[:, None] * np.array([0.0, 0.0, 1.0])
    loose = loose_objects(scene.tables)
    stations = {int(o): s for o in loose if (s := _station(search, int(o), place[o])) is not None}
    nothing = f"in scene '{scene.name}' there is no loose object that a hand can get at"
    if not stations:
        raise EngineError(nothing)
    objects, station = np.array(list(stations), int), np.array(list(stations.values()))
    nodes = np.concatenate([place[objects], station, _grid(search, scene.tables, station)])
    ways = _ways(search, objects, nodes)

    length, before = csgraph.dijkstra(ways.T, return_predecessors=True, indices=np.arange(len(objects)))
    length, hop = length.T, before.T  # [K, N]: to each object, and the node after this one on the way there
    hop[np.arange(len(objects)), np.arange(len(objects))] = len(objects) + np.arange(len(objects))
    between = length[: len(objects)]
    _, group = csgraph.connected_components(np.isfinite(between), directed=True, connection="strong")
    beside = length[len(objects) : 2 * len(objects)]
    same = group[:, None] == group
    score = (np.exp(-beside / FAR) * same).sum(1)
    order = np.argsort(-score, kind="stable")
    first = next((int(k) for k in order if not search.enclosed(station[k])), None)
    if first is None:
        raise EngineError(nothing)

    kept = np.flatnonzero(same[first])
    weight = np.exp(-between[np.ix_(kept, kept)] / NEARNESS)
    np.fill_diagonal(weight, 1.0 if len(kept) == 1 else 0.0)
    used = np.concatenate([kept, np.arange(len(objects), len(nodes))])
    number = np.full(len(nodes) + 1, -1)
    number[used] = np.arange(len(used))
    return Reach(
        start=station[first],
        start_node=int(number[len(objects) + first]),
        first=int(np.flatnonzero(kept == first)[0]),
        objects=objects[kept],
        over=search.over[objects[kept]],
        nodes=nodes[used],
        hop=number[np.maximum(hop[np.ix_(used, kept)], -1)],
        choice=np.cumsum(weight / weight.sum(1, keepdims=True), axis=1),
    )


def hand_box(thumb: bool = True) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """Corners of the box around an open hand's collision geoms, with or without the thumb's, from its palm, m."""
    spec = mujoco.MjSpec()
    add_floating_hand(spec, pos=(0, 0, 0))
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    names = [model.body(int(b)).name for b in model.geom_bodyid]
    solid = [g for g in np.flatnonzero(model.geom_contype != 0) if thumb or "thumb" not in names[g]]
    center, half = model.geom_aabb[solid, :3], model.geom_aabb[solid, 3:]
    turn = data.geom_xmat[solid].reshape(-1, 3, 3)
    middle = data.geom_xpos[solid] + np.einsum("gij,gj->gi", turn, center)
    extent = np.einsum("gij,gj->gi", np.abs(turn), half)
    return (middle - extent).min(0), (middle + extent).max(0)


class _Search:
    """The settled scene with a box of the hand's size in it, to be put anywhere and asked whether it hits anything."""

    def __init__(self, scene: Scene, settled: Snapshot):
        tables = scene.tables
        query = SceneQuery(scene)
        query.load(settled)
        view = query.view
        self.com = np.array(view.object_com[0], np.float64)
        self.low, self.high = np.array(view.aabb_low[0], np.float64), np.array(view.aabb_high[0], np.float64)
        self.hand_low, self.hand_high = hand_box()
        self._fingers = hand_box(thumb=False)
        clear = np.minimum(OVER_SUPPORT, (self.high - self.low)[:, 2] / 2)
        self.over = np.maximum(-FINGER_DEPTH, self.low[:, 2] + clear - self.com[:, 2]) - self.hand_low[2]
        self._middle = (self.hand_high + self.hand_low) / 2
        self._probe = query.probe((self.hand_high - self.hand_low) / 2)
        self._light = np.isin(np.arange(tables.num_objects), loose_objects(tables)) & (tables.object_mass <= HEAVY)

    def hits(self, place: np.ndarray, light_too: bool = False) -> bool:
        """Whether the hand's box, palm at `place`, touches what is in the way (or a light loose object)."""
        return self._probe.touches(place + self._middle, None if light_too else self._light)

    def leads(self, start: np.ndarray, end: np.ndarray, thing: int | None = None) -> bool:
        """Whether the straight way is free to its end, or to where the fingers have reached into an object's box."""
        count = max(2, int(np.ceil(np.linalg.norm(end - start) / SAMPLE)) + 1)
        places = start + np.linspace(0, 1, count)[:, None] * (end - start)
        if thing is not None:
            low, high = self.low[thing], self.high[thing]
            depth = np.minimum(places + self._fingers[1], high) - np.maximum(places + self._fingers[0], low)
            met = (depth >= np.minimum(MEETS, (high - low) / 2)).all(1) & (np.abs(places - end)[:, 2] <= LEVEL)
            if not met.any():
                return False
            places = places[: int(np.argmax(met)) + 1]
        return not any(self.hits(place) for place in places[::-1])

    def enclosed(self, place: np.ndarray) -> bool:
        """Whether nearly all there is to see from a place is close, as in a closed cabinet."""
        distance, _ = self._probe.rays(place, np.random.default_rng(0).normal(size=(60, 3)))
        return bool((distance > OPEN).mean() < 0.1)


def _station(search: _Search, thing: int, place: np.ndarray) -> np.ndarray | None:
    """A free place next to an object from which it can be reached, or None."""
    found = None
    for aside in ASIDE:
        for angle in np.linspace(0, 2 * np.pi, 8, endpoint=False):
            side = np.array([np.cos(angle), np.sin(angle), 0.0])
            reach = aside + 0.5 * float(np.abs(side) @ (search.high - search.low)[thing])
            station = place + reach * side + np.array([0.0, 0.0, LIFT])
            if search.hits(station, light_too=True) or not search.leads(station, place, thing):
                continue
            if search.leads(place, place - BEYOND * side):
                return station
            found = station if found is None else found
    above = place + np.array([0.0, 0.0, ABOVE])
    if found is None and not search.hits(above, light_too=True) and search.leads(above, place, thing):
        return above
    return found


def _grid(search: _Search, tables: SceneTables, station: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "G 3"]:
    """Free places over the floors, around all stations."""
    floors = np.flatnonzero(tables.object_is_floor)
    heights = search.high[floors, 2] if len(floors) else search.low[~tables.object_parked, 2].min(keepdims=True)
    low, high = station[:, :2].min(0) - GRID, station[:, :2].max(0) + GRID
    x, y = (np.arange(a, b, GRID) for a, b in zip(low, high, strict=True))
    levels = (np.unique(np.round(heights, 2))[:, None] + GRID_HEIGHTS).ravel()
    places = np.stack(np.meshgrid(x, y, levels, indexing="ij"), axis=-1).reshape(-1, 3)
    return places[[not search.hits(place, light_too=True) for place in places]]


def _ways(search: _Search, objects: Int[np.ndarray, "N"], nodes: Float[np.ndarray, "K 3"]) -> sparse.csr_array:
    """Lengths [K, K] (m) of the free straight ways from node to node."""
    count = len(objects)
    place, rest = nodes[:count], nodes[count:]
    length = sparse.lil_array((len(nodes), len(nodes)))

    def both(i: int, j: int) -> None:
        length[i, j] = length[j, i] = np.linalg.norm(nodes[i] - nodes[j])

    for i in range(count):
        both(i, count + i)  # a station is there because this way is free
    close = np.linalg.norm(rest[:, None] - rest, axis=-1)
    for a in range(len(rest)):
        limit = np.where(
            np.arange(len(rest)) < count, RANGE if a < count else 0.0, TO_GRID if a < count else 1.01 * GRID
        )
        for b in np.flatnonzero((close[a] <= limit) & (np.arange(len(rest)) > a)):
            if search.leads(rest[a], rest[b]):
                both(count + a, count + int(b))
    apart = np.linalg.norm(place[:, None] - place, axis=-1)
    for i in range(count):
        if search.hits(place[i]):
            continue
        for j in np.flatnonzero(apart[i] <= RANGE):
            if i != j and search.leads(place[i], place[j], int(objects[j])):
                length[i, int(j)] = apart[i, j]
    return length.tocsr()
