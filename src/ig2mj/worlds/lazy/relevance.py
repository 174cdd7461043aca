"""`Relevance`: whether what moved since the last whole step of the states can matter to them.

A door that swings, a chair that is pushed: neither heats anything, nor opens or closes, nor is under a tap. Where that
can be told from a few numbers the next step is that of temperatures alone. Every answer errs on the safe side: no is
only said where no rounding could turn it into a yes. What is looked at is what each part of a step reads of the view:

| part | reads | matters unless |
|---|---|---|
| switches | fingers, buttons | the same buttons are pressed |
| slicing | forces of links | they are the same |
| water | everything | no drop is out |
| cleaning | what tools touch, poses of both | tools touch the same, and neither has moved |
| heat | sources that are on | the same objects are within their distance; what is in their box rests there |
| open, closed | joints | each is on the same side of its threshold |

Axes: W worlds, O objects, S heat sources, T objects with a temperature, B sources that heat what is inside them,
K buttons.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from ig2mj.engine.view import Array, PhysicsView, read_field
from ig2mj.states.definitions import open, toggled_on
from ig2mj.states.model import StateModel
from ig2mj.states.relations.plan import BOX_SLACK
from ig2mj.states.update import EVENTS
from ig2mj.states.world import ExtendedStates

EXACT = frozenset({"link_force"})
"""Fields of which every change matters."""

KNOWN = frozenset({"toggled_on", "sliced", "water_source", "wetness", "dust", "stain"})
"""States whose updates the table above covers. Where there is another, everything matters."""

STILL = {
    "touching": "tools",
    "awake": "tools",
    "body_pos": "all bodies",
    "body_quat": "all bodies",
    "link_pos": "all links",
    "link_quat": "cleaned links",
    "aabb_low": "boxes",
    "aabb_high": "boxes",
}
"""Fields of the view, and those of their rows whose change can matter to cleaning or to heat."""

MARGIN = 1e-3
"""m by which a place must be clear of a limit; far beyond any rounding within a home."""


class Relevance:
    """The question for one scene's states; `begin` with a whole step, then `same` for views after it."""

    def __init__(self, model: StateModel):
        self._model = model
        p, tables = model.parameters, model.tables
        self._tools = np.asarray(p.tool_object, int)
        self._thermal = np.flatnonzero(p.thermal)
        pieces = [tables.piece_body[tables.piece_object == o] for o in range(tables.num_objects)]
        self._bodies = [np.union1d(np.flatnonzero(tables.body_object == o), own) for o, own in enumerate(pieces)]
        self._links = [np.flatnonzero(tables.link_object == o) for o in range(tables.num_objects)]
        self._covered = {spec.name for spec in EVENTS} <= KNOWN
        self._thresholds = open.thresholds(model), open.other_thresholds(model)
        self._base: dict[str, np.ndarray] = {}
        self._states: ExtendedStates | None = None
        self._dry = self._ready = False

    def begin(self, states: ExtendedStates, view: PhysicsView, reads: Collection[str]) -> None:
        """After a whole step that changed no more than temperatures.

        Args:
          reads: fields of the view that the states depend on.
        """
        self._base = {}
        for name in reads:
            field = read_field(view, name)
            if isinstance(field, np.ndarray):
                self._base[name] = field
        self._states, self._ready = states, False

    def same(self, view: PhysicsView, changed: Collection[str]) -> bool:
        """Whether a whole step would do no more now than temperatures do.

        Args:
          changed: fields that differ from those of the last whole step; all others of its `reads` are the same.
        """
        if not self._covered or not EXACT.isdisjoint(changed):
            return False
        now: dict[str, np.ndarray] = {}
        for name in changed:
            field = read_field(view, name)
            if name not in self._base or not isinstance(field, np.ndarray):
                return False
            now[name] = field
        if not self._ready:
            self._prepare()
        if not self._dry or not self._opens_alike(now):
            return False
        far = self._all_still(now) and self._within_room(now)
        if not far and not (self._cleans_alike(now) and self._heats_alike(now)):
            return False
        return self._switches_alike(now)

    def _prepare(self) -> None:
        """What is looked at, from the states of the last whole step; on the host."""
        states, model = self._states, self._model
        assert states is not None
        self._dry, self._ready = not np.asarray(states.water.active).any(), True
        self._open = self._opened(self._base["joint_pos"]) if "joint_pos" in self._base else None
        p = model.parameters
        on = ~p.heat_requires_toggled_on | np.asarray(states.toggled_on)[:, p.heat_object]
        on = np.flatnonzero((on & (p.heat_requires_inside | (p.heat_link >= 0))).any(0))
        self._near_sources = on[~p.heat_requires_inside[on]]
        self._boxed_sources = np.unique(p.heat_object[on[p.heat_requires_inside[on]]])
        self._reached: Bool[np.ndarray, "W O S"] | None = None
        self._clear_before: Bool[np.ndarray, "T B"] | None = None
        self._pressed: Bool[np.ndarray, "W K"] | None = None
        touched = np.zeros(model.tables.num_objects, bool)
        if len(self._tools) and "touching" in self._base:
            of_tools: np.ndarray = np.any(self._base["touching"][:, self._tools], axis=0)
            touched = np.any(of_tools, axis=0)
            touched[self._tools[np.any(of_tools, axis=1)]] = True
        moved, boxes = np.flatnonzero(touched), self._boxed_sources
        none = np.zeros(0, int)
        self._rows = {
            "tools": self._tools,
            "cleaned bodies": np.concatenate([none, *(self._bodies[o] for o in moved)]),
            "cleaned links": np.concatenate([none, *(self._links[o] for o in moved)]),
            "sources": p.heat_link[self._near_sources],
            "boxes": boxes,
            "bodies of boxes": np.concatenate([none, *(self._bodies[o] for o in boxes)]),
        }
        bodies = np.union1d(self._rows["cleaned bodies"], self._rows["bodies of boxes"])
        links = np.union1d(self._rows["cleaned links"], self._rows["sources"])
        self._rows |= {"all bodies": bodies.astype(int), "all links": links.astype(int)}
        self._bytes: dict[tuple[str, str], bytes] = {}
        self._room: Float[np.ndarray, "T 1"] | None = None

    def _opened(self, joint_pos: np.ndarray) -> list[bytes]:
        """On which side of both thresholds each joint is."""
        near, far = self._thresholds
        sides = (joint_pos > near, joint_pos < near, joint_pos > far, joint_pos < far)
        return [side.tobytes() for side in sides]

    def _opens_alike(self, now: Mapping[str, Array]) -> bool:
        if "joint_pos" not in now:
            return True
        return self._open is not None and self._opened(np.asarray(now["joint_pos"])) == self._open

    def _stays(self, now: Mapping[str, Array], name: str, which: str) -> bool:
        """Whether the rows of that name are the same in a field, bit for bit (NumPy's own comparison is slower)."""
        rows = self._rows[which]
        if name not in now or not len(rows):
            return True
        before = self._bytes.get((name, which))
        if before is None:
            before = self._bytes[name, which] = self._base[name].take(rows, 1).tobytes()
        return now[name].take(rows, 1).tobytes() == before

    def _all_still(self, now: Mapping[str, Array]) -> bool:
        """Whether tools, what they touch, sources and boxes of sources are where they were: the most usual answer, and
        one comparison for each field."""
        return all(self._stays(now, name, STILL[name]) for name in now if name in STILL)

    def _cleans_alike(self, now: Mapping[str, Array]) -> bool:
        if not len(self._tools):
            return True
        for name in ("touching", "awake"):
            if not self._stays(now, name, "tools"):
                return False
        for name in ("body_pos", "body_quat", "link_pos", "link_quat"):
            if not self._stays(now, name, "cleaned bodies" if name.startswith("body") else "cleaned links"):
                return False
        return True

    def _heats_alike(self, now: Mapping[str, Array]) -> bool:
        if self._stays_far(now):
            return True
        if len(self._near_sources) and not now.keys().isdisjoint(("object_com", "link_pos")):
            if self._reached is None:
                before = self._within(self._base.get("object_com"), self._base.get("link_pos"))
                if before is None:
                    return False
                self._reached = before
            within = self._within(*(now.get(name, self._base.get(name)) for name in ("object_com", "link_pos")))
            if within is None or not np.array_equal(within, self._reached):
                return False
        if not len(self._boxed_sources) or now.keys().isdisjoint(
            ("object_com", "aabb_low", "aabb_high", "body_pos", "body_quat")
        ):
            return True
        if self._clear_before is None:
            self._clear_before = self._outside(self._base)
        clear = self._outside({**self._base, **now})
        if clear is None or self._clear_before is None:
            return False
        obj, box = np.nonzero(~(clear & self._clear_before))
        return not len(obj) or self._unmoved(now, self._thermal[obj], np.unique(self._boxed_sources[box]))

    def _stays_far(self, now: Mapping[str, Array]) -> bool:
        """Whether no source has moved, and no warm object as far as it had to before any source's reach began or ended.

        True for most of what moves, and found faster than by looking at each object and source.
        """
        if not self._stays(now, "link_pos", "sources"):
            return False
        for name in ("aabb_low", "aabb_high", "body_pos", "body_quat"):
            if not self._stays(now, name, "boxes" if name.startswith("aabb") else "bodies of boxes"):
                return False
        return self._within_room(now)

    def _within_room(self, now: Mapping[str, Any]) -> bool:
        """Whether no warm object has moved as far as it had to before any source's reach began or ended."""
        if "object_com" not in now:
            return True
        if self._room is None:
            self._room = self._room_of_base()[:, None]
            self._com = self._base["object_com"][:, self._thermal]
        moved: np.ndarray = now["object_com"].take(self._thermal, 1)
        moved -= self._com
        return bool((np.abs(moved, out=moved) <= self._room).all())

    def _room_of_base(self) -> Float[np.ndarray, "T"]:
        """How far each warm object may go along any axis before it can come into, or leave, the reach of a source."""
        room, p = np.full(len(self._thermal), np.inf), self._model.parameters
        com, sources, boxes = self._base["object_com"][:, self._thermal, None], self._near_sources, self._boxed_sources
        if len(sources) and len(room):
            if "link_pos" not in self._base:
                return np.zeros_like(room)
            distance = np.linalg.norm(com - self._base["link_pos"][:, None, p.heat_link[sources]], axis=-1)
            room = np.minimum(room, np.abs(distance - p.heat_distance[sources]).min((0, 2)) / np.sqrt(3))
        if len(boxes) and len(room):
            if any(name not in self._base for name in ("aabb_low", "aabb_high")):
                return np.zeros_like(room)
            low, high = (self._base[name][:, None, boxes] for name in ("aabb_low", "aabb_high"))
            outside = np.maximum(low - com, com - high).max(-1) - BOX_SLACK
            outside[:, self._thermal[:, None] == boxes] = np.inf  # none heats itself
            room = np.minimum(room, outside.min((0, 2)))
        return np.maximum(room - 2 * MARGIN, 0.0)

    def _within(self, com: Array | None, link: Array | None) -> Bool[np.ndarray, "W O S"] | None:
        """Which warm objects are within the distance of each source that is on; None where it is too close to say."""
        if com is None or link is None:
            return None
        p, sources = self._model.parameters, self._near_sources
        offset = com[:, self._thermal, None] - link[:, None, p.heat_link[sources]]
        distance = np.sqrt(np.square(offset).sum(-1))
        beyond = distance - p.heat_distance[sources]
        return beyond <= 0 if (np.abs(beyond) > MARGIN).all() else None

    def _outside(self, fields: Mapping[str, Array]) -> Bool[np.ndarray, "T B"] | None:
        """Which warm objects are in no world in the box of each source that heats what is inside it."""
        if any(name not in fields for name in ("object_com", "aabb_low", "aabb_high")):
            return None
        com, low, high = (np.asarray(fields[name]) for name in ("object_com", "aabb_low", "aabb_high"))
        slack, boxes = BOX_SLACK + MARGIN, self._boxed_sources
        points = com[:, self._thermal, None]
        clear = (points < low[:, None, boxes] - slack) | (points > high[:, None, boxes] + slack)
        return clear.any(-1).all(0) | (self._thermal[:, None] == boxes)

    def _unmoved(self, now: Mapping[str, Array], objects: np.ndarray, boxes: np.ndarray) -> bool:
        """These objects' centres and the bodies of these boxes are where they were."""
        bodies = np.concatenate([self._bodies[o] for o in boxes])
        rows = {"object_com": objects, "aabb_low": boxes, "aabb_high": boxes, "body_pos": bodies, "body_quat": bodies}
        return all(
            name not in now or np.array_equal(now[name].take(chosen, 1), self._base[name].take(chosen, 1))
            for name, chosen in rows.items()
        )

    def _switches_alike(self, now: Mapping[str, Array]) -> bool:
        if "agent.finger_pos" not in self._base or now.keys().isdisjoint(("agent.finger_pos", "link_pos")):
            return True
        if self._pressed is None:
            self._pressed = self._presses(self._base)
        pressed = self._presses({**self._base, **now})
        return pressed is not None and self._pressed is not None and np.array_equal(pressed, self._pressed)

    def _presses(self, fields: Mapping[str, Array]) -> Bool[np.ndarray, "W K"] | None:
        """Which buttons a finger is near enough to press; None where that is too close to say."""
        buttons = np.asarray(fields["link_pos"])[:, self._model.buttons, None]
        offset = np.asarray(fields["agent.finger_pos"])[:, None] - buttons
        beyond = np.sqrt(np.square(offset).sum(-1)) - toggled_on.BUTTON_DISTANCE
        return (beyond <= 0).any(-1) if (np.abs(beyond) > MARGIN).all() else None
