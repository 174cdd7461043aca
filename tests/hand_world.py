"""Worlds made by hand: tables and views without any physics engine, for tests of states and predicates.

    home = HandWorld(Item("stove", abilities={"heatSource": {...}}, links={"heat_source": (0, 0, 0.5)}), Item("fish"))
    model = home.model()
    view = home.view({"fish": (0, 0, 0.6)})

An object is a set of boxes on one body, whose frame is also its centre of mass. Body 0 is the world.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence

import jax
import jax.numpy as jnp
import numpy as np

from ig2mj.engine.view import SCHEMA, PhysicsView, axis_sizes, blank_view, faults, replace_fields
from ig2mj.scene.manifest import InsideEntry
from ig2mj.scene.tables import LinkKind, PieceKind, SceneTables
from ig2mj.states import (
    ExtendedStates,
    PlannedRelations,
    RelationPlan,
    StateModel,
    StateOptions,
    Swap,
    WorldState,
    update,
)
from ig2mj.states.parameters import HalfPose, make_parameters

UNIT_CUBE = (((0.0, 0.0, 0.0), (0.5, 0.5, 0.5)),)
IDENTITY = (1.0, 0.0, 0.0, 0.0)
CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)


@dataclasses.dataclass
class Item:
    """One object. `boxes`: (centre, half size). `links`: kind -> position, or (position, half size) for a box link."""

    name: str
    boxes: Sequence = UNIT_CUBE
    abilities: Mapping = dataclasses.field(default_factory=dict)
    category: str = "thing"
    pos: Sequence[float] = (0.0, 0.0, 0.0)
    quat: Sequence[float] = IDENTITY
    fixed: bool = False
    floor: bool = False
    links: Mapping = dataclasses.field(default_factory=dict)
    joints: Sequence[tuple[float, float]] = ()  # closed end, open end
    both_sides: bool = False
    rooms: Sequence[str] = ()
    parts: Mapping[str, Sequence[float]] = dataclasses.field(default_factory=dict)  # half -> offset
    part_of: str | None = None
    parked: bool = False
    inside: InsideEntry | None = None


def shell(width: float, depth: float, height: float, wall: float = 0.02, top: bool = True) -> tuple:
    """Boxes of a hollow container, closed at the bottom and on four sides, its inside centred at the origin."""
    w, d, h, t = width / 2, depth / 2, height / 2, wall / 2
    boxes = [
        ((0, 0, -h - t), (w, d, t)),
        ((-w - t, 0, 0), (t, d, h)),
        ((w + t, 0, 0), (t, d, h)),
        ((0, -d - t, 0), (w, t, h)),
        ((0, d + t, 0), (w, t, h)),
    ]
    return (*boxes, ((0, 0, h + t), (w, d, t))) if top else tuple(boxes)


class HandWorld:
    """A scene of `Item`s, perhaps with an agent."""

    def __init__(
        self,
        *things: Item,
        rooms: Mapping[str, tuple[float, float]] | None = None,
        fingers: int = 0,
        agent: bool = False,
        fovy: float = np.pi / 2,
        substances: Sequence[str] = (),
    ):
        """`rooms`: instance name -> range of x it spans; the map covers x, y in [-5, 5] at 0.1 m."""
        self.substances = substances
        self.things, self.agent, self.fingers = things, agent or fingers > 0, fingers
        self.index = {t.name: i for i, t in enumerate(things)}
        self.links = [(i, kind, link) for i, t in enumerate(things) for kind, link in t.links.items()]
        self.tables = self._tables(rooms or {}, fovy)
        self._models: dict[tuple, StateModel] = {}

    def model(self, **options) -> StateModel:
        """Constants of the states; `options` are those of `StateOptions`. The same object for the same options."""
        key = tuple(sorted(options.items()))
        if key not in self._models:
            self._models[key] = self._make_model(options)
        return self._models[key]

    def _make_model(self, options: Mapping) -> StateModel:
        parts = [
            HalfPose(self.index[t.name], self.index[half], tuple(map(float, offset)), IDENTITY)
            for t in self.things
            for half, offset in t.parts.items()
        ]
        chosen = StateOptions(**options)
        abilities = [thing.abilities for thing in self.things]
        made = StateModel(self.tables, make_parameters(self.tables, abilities, parts, chosen.compat), chosen)
        if not self.substances:
            return made
        insides = {self.index[t.name]: t.inside for t in self.things if t.inside is not None}
        return made.with_substances(self.substances, insides)

    def view(
        self,
        pos: Mapping[str, Sequence[float]] | None = None,
        *,
        quat: Mapping[str, Sequence[float]] | None = None,
        touching: Sequence[tuple[str, str]] = (),
        joints: Mapping[str, Sequence[float]] | None = None,
        force: Mapping[tuple[str, str], float] | None = None,
        fingers: Sequence[Sequence[float]] = (),
        agent_pos: Sequence[float] = (0.0, 0.0, 0.0),
        eye: tuple[Sequence[float], Sequence[float]] = ((0, 0, 1), IDENTITY),
        held: Sequence[str] = (),
        agent_touches: Sequence[str] = (),
        worlds: int = 1,
    ) -> PhysicsView:
        """A view in which named objects are elsewhere than their `Item` says; `force` is on ("knife", "apple")."""
        at = np.array([(pos or {}).get(t.name, t.pos) for t in self.things], np.float32).reshape(-1, 3)
        turn = np.array([(quat or {}).get(t.name, t.quat) for t in self.things], np.float32).reshape(-1, 4)
        low, high = self._boxes(at, turn)
        owner = self.tables.link_object
        touch = np.zeros((len(self.things),) * 2, bool)
        for a, b in touching:
            touch[self.index[a], self.index[b]] = touch[self.index[b], self.index[a]] = True
        pressed = np.zeros((len(self.links), len(self.things)), np.float32)
        for (a, b), newtons in (force or {}).items():
            pressed[owner == self.index[a], self.index[b]] = newtons
        joint_pos = [q for t in self.things for q in (joints or {}).get(t.name, [j[0] for j in t.joints])]
        of_hand = np.array([[t.name in held for t in self.things]], bool)
        agents = slice(None) if self.agent else slice(0, 0)
        fields = dict(
            object_pos=at,
            object_quat=turn,
            object_com=at,
            aabb_low=low,
            aabb_high=high,
            body_pos=np.concatenate([np.zeros((1, 3)), at]),
            body_quat=np.concatenate([[IDENTITY], turn]),
            link_pos=at[owner] + _rotate(turn[owner], self.tables.link_pos),
            link_quat=turn[owner],
            joint_pos=np.array(joint_pos),
            touching=touch,
            link_force=pressed,
            awake=np.ones(len(self.things), bool),
            held=of_hand[agents],
        )
        of_agent = dict(
            base_pos=np.array([agent_pos])[agents],
            base_quat=np.array([IDENTITY])[agents],
            eye_pos=np.array([eye[0]])[agents],
            eye_quat=np.array([eye[1]])[agents],
            hand_pos=np.array([agent_pos])[agents],
            hand_quat=np.array([IDENTITY])[agents],
            finger_pos=np.array(fingers, float).reshape(-1, 3),
            finger_quat=np.tile(IDENTITY, (len(fingers), 1)),
            touching=np.array([[t.name in agent_touches for t in self.things]], bool)[agents],
        )
        given = fields | {f"agent.{name}": array for name, array in of_agent.items()}
        sizes = axis_sizes(self.tables, worlds) | {"F": len(fingers)}
        view = replace_fields(
            blank_view(sizes), {n: np.repeat(f[None], worlds, axis=0).astype(SCHEMA[n].dtype) for n, f in given.items()}
        )
        assert not faults(view, sizes)
        return jax.tree.map(jnp.asarray, view)

    def _boxes(self, pos: np.ndarray, quat: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        low, high = np.zeros((len(pos), 3)), np.zeros((len(pos), 3))
        for i, t in enumerate(self.things):
            corners = np.concatenate([np.array(c) + CORNERS * np.array(h) for c, h in t.boxes])
            corners = pos[i] + _rotate(np.tile(quat[i], (len(corners), 1)), corners)
            low[i], high[i] = corners.min(axis=0), corners.max(axis=0)
        return low, high

    def _tables(self, rooms: Mapping[str, tuple[float, float]], fovy: float) -> SceneTables:
        things, number = self.things, len(self.things)
        pieces = [(i, np.array(c, float), np.array(h, float)) for i, t in enumerate(things) for c, h in t.boxes]
        low, high = self._boxes(np.zeros((number, 3)), np.tile(IDENTITY, (number, 1)))
        joints = [(i, *j) for i, t in enumerate(things) for j in t.joints]
        kinds = [LinkKind[kind.upper()] for _, kind, _ in self.links]
        boxed = [len(link) == 2 for _, _, link in self.links]
        normals = np.concatenate([np.eye(3), -np.eye(3)])
        room_map = np.zeros((100, 100), int)
        for k, (start, end) in enumerate(rooms.values()):
            room_map[:, round((start + 5) * 10) : round((end + 5) * 10)] = k + 1
        agents = 1 if self.agent else 0
        owner = np.array([i for i, _, _ in pieces], int)
        return SceneTables(
            object_names=tuple(t.name for t in things),
            object_categories=tuple(t.category for t in things),
            object_fixed=np.array([t.fixed for t in things], bool),
            object_root=np.arange(number) + 1,
            object_part_of=np.array([self.index[t.part_of] if t.part_of else -1 for t in things], int),
            object_parked=np.array([t.parked for t in things], bool),
            object_is_floor=np.array([t.floor for t in things], bool),
            object_mass=np.ones(number, np.float32),
            object_bbox=(high - low).astype(np.float32),
            object_bbox_center=((high + low) / 2).astype(np.float32),
            object_both_sides=np.array([t.both_sides for t in things], bool),
            object_rooms=np.array([[r in t.rooms for r in rooms] for t in things], bool).reshape(number, len(rooms)),
            body_object=np.arange(-1, number),
            body_rests=np.zeros(number + 1, bool),
            body_rest_pos=np.zeros((number + 1, 3)),
            body_rest_quat=np.tile(IDENTITY, (number + 1, 1)),
            geom_object=owner,
            openable_object=np.array([i for i, _, _ in joints], int),
            openable_qposadr=np.arange(len(joints)),
            openable_closed=np.array([c for _, c, _ in joints], np.float32),
            openable_open=np.array([o for _, _, o in joints], np.float32),
            link_object=np.array([i for i, _, _ in self.links], int),
            link_kind=np.array(kinds, int),
            link_body=np.array([i + 1 for i, _, _ in self.links], int),
            link_geom=np.array([100 + k if b else -1 for k, b in enumerate(boxed)], int),
            link_pos=np.array(
                [link[0] if b else link for (_, _, link), b in zip(self.links, boxed, strict=True)], np.float32
            ).reshape(-1, 3),
            link_quat=np.tile(np.float32(IDENTITY), (len(self.links), 1)),
            link_half=np.array(
                [link[1] if b else (0, 0, 0) for (_, _, link), b in zip(self.links, boxed, strict=True)], np.float32
            ).reshape(-1, 3),
            piece_geom=np.arange(len(pieces)),
            piece_object=owner,
            piece_body=owner + 1,
            piece_pos=np.array([c for _, c, _ in pieces], np.float32).reshape(-1, 3),
            piece_quat=np.tile(np.float32(IDENTITY), (len(pieces), 1)),
            piece_kind=np.full(len(pieces), PieceKind.POLYHEDRON),
            piece_size=np.array([h for _, _, h in pieces], np.float32).reshape(-1, 3),
            piece_planes=np.array(
                [np.concatenate([normals, np.tile(h, 2)[:, None]], axis=1) for _, _, h in pieces], np.float32
            ).reshape(-1, 6, 4),
            piece_vertices=np.array([CORNERS * h for _, _, h in pieces], np.float32).reshape(-1, 8, 3),
            room_names=tuple(rooms),
            room_types=tuple(name.rsplit("_", 1)[0] for name in rooms),
            room_map=room_map if rooms else np.zeros((0, 0), int),
            room_resolution=0.1,
            agent_names=("agent",) * agents,
            agent_body=np.zeros(agents, int),
            agent_camera=np.zeros(agents, int),
            agent_fovy=np.full(agents, fovy, np.float32),
            body_agent=np.full(number + 1, -1),
            body_hand=np.full(number + 1, -1),
            agent_joint_names=(),
            agent_joint_agent=np.zeros(0, int),
            agent_joint_qposadr=np.zeros(0, int),
            agent_joint_dofadr=np.zeros(0, int),
            actuator_agent=np.zeros(0, int),
            hand_body=np.zeros(agents, int),
            hand_agent=np.zeros(agents, int),
            finger_body=np.zeros(self.fingers, int),
            finger_agent=np.zeros(self.fingers, int),
            finger_hand=np.zeros(self.fingers, int),
            graspable_body=np.flatnonzero([not t.fixed for t in things]) + 1,
            graspable_object=np.flatnonzero([not t.fixed for t in things]),
            graspable_joint=np.full(sum(not t.fixed for t in things), -1),
        )


@functools.lru_cache(maxsize=64)
def stepper(model: StateModel) -> Callable[[ExtendedStates, PhysicsView], tuple[ExtendedStates, Swap]]:
    """`update` of a model, jitted: op by op it would be compiled op by op."""
    return jax.jit(lambda states, view: update(model, states, view))


def answers(plan: RelationPlan, view: PhysicsView) -> PlannedRelations:
    """`plan.evaluate`, jitted."""
    return PlannedRelations(plan, jax.jit(lambda v: plan.evaluate(v).values)(view))


def world_of(view: PhysicsView, states: ExtendedStates) -> WorldState:
    """A world at step 0 with no physics behind it."""
    worlds = view.object_com.shape[0]
    zeros = np.zeros(worlds, np.float32)
    return WorldState(None, view, states, np.zeros((worlds, 2), np.uint32), zeros.astype(np.int32), zeros)


def step(model: StateModel, states: ExtendedStates, view: PhysicsView) -> ExtendedStates:
    """The states after one update."""
    return stepper(model)(states, view)[0]


def _rotate(quat: np.ndarray, v: np.ndarray) -> np.ndarray:
    w, u = quat[:, :1], quat[:, 1:]
    twice = 2 * np.cross(u, v)
    return (v + w * twice + np.cross(u, twice)).astype(np.float32)
