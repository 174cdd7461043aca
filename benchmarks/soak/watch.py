"""What `soak.py` sees of its worlds: which went wrong, by which object, and what that object touched last.

Axes: W worlds, O objects, G geoms, F floors.
"""

from __future__ import annotations

import dataclasses
from typing import Any

import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Float, Int

from ig2mj.engine.base import Engine
from ig2mj.engine.mjx.contacts import warp_contacts
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.scene.scene import Scene
from ig2mj.worlds import guards

FLAGS = ("overflow", "not_finite", "fell", "outside", "too_fast")
"""What a world counts as, the first that is true. The guards' flags, and `outside`: an object off the house's floors
or below them (`House.lost`)."""

OUTSIDE = 1 << 8
"""Beside `guards.Flag`."""

BEYOND = guards.BELOW_FLOOR
"""Metres off every floor, or below the lowest one's surface, from which an object's centre of mass is outside."""

NEVER = 10**6
"""Control steps since an object was held that never was."""

_BITS = (guards.Flag.OVERFLOW, guards.Flag.NOT_FINITE, guards.Flag.FELL, OUTSIDE, guards.Flag.TOO_FAST)


@dataclasses.dataclass(frozen=True)
class House:
    """A building. Metres, world frame.

    Attributes:
      low, high: box of walls and floors. start: where the hand starts.
      floors: low and high corner of each floor's box.
    """

    low: Float[np.ndarray, "3"]
    high: Float[np.ndarray, "3"]
    start: Float[np.ndarray, "3"]
    floors: Float[np.ndarray, "F 2 3"]

    @classmethod
    def of(cls, scene: Scene, start: Any) -> House:
        model, data = scene.model, scene.start_data()
        categories = np.array(scene.tables.object_categories)
        building = np.flatnonzero(np.isin(categories, ("walls", "floors")))
        geoms = np.flatnonzero(np.isin(scene.tables.geom_object, building) & (model.geom_contype != 0))
        turn = data.geom_xmat[geoms].reshape(-1, 3, 3)
        middle = data.geom_xpos[geoms] + np.einsum("gij,gj->gi", turn, model.geom_aabb[geoms, :3])
        half = np.einsum("gij,gj->gi", np.abs(turn), model.geom_aabb[geoms, 3:])
        boxes = np.stack([middle - half, middle + half], axis=1)
        floors = boxes[categories[scene.tables.geom_object[geoms]] == "floors"]
        return cls(boxes[:, 0].min(0), boxes[:, 1].max(0), np.asarray(start, float), floors)

    def above_floor(self, floor: float = 0.05) -> House:
        """The same house from a little above its lowest floor."""
        return dataclasses.replace(self, low=np.array([*self.low[:2], floor]))

    def lost(self, com: Float[Array, "*n 3"]) -> Float[Array, "*n"]:
        """Metres by which centres of mass are off all floors or below the lowest, whichever is more, less `BEYOND`.

        Above zero is lost: it comes to rest in the house no more. What a hand lifts over the walls, or what flies above
        the floors, comes down on them, and is lost only where it comes down elsewhere.
        """
        place = jnp.asarray(com)[..., None, :]
        low, high = self.floors[:, 0], self.floors[:, 1]
        beside = jnp.maximum(low - place, place - high)[..., :2].max(-1).min(-1)
        below = high[:, 2].min() - place[..., 0, 2]
        return jnp.maximum(beside, below) - BEYOND


@struct.dataclass
class Seen:
    """Of every world in its present episode.

    Attributes:
      flags: when it was first flagged; 0: it never was. object, place, speed: of the object, at that moment (m, m/s).
      touched: geoms that each object touched last, one that stands still and one that moves; -1 none.
      last: those of `object` when its world was flagged.
      since: control steps since a hand let go of each object; 0 while it is held, `NEVER` where it never was.
      hand: that held each object last. free_for, by: those two of `object` when its world was flagged.
    """

    flags: Int[Array, "W"]
    object: Int[Array, "W"]
    place: Float[Array, "W 3"]
    speed: Float[Array, "W"]
    touched: Int[Array, "W O 2"]
    last: Int[Array, "W 2"]
    since: Int[Array, "W O"]
    hand: Int[Array, "W O"]
    free_for: Int[Array, "W"]
    by: Int[Array, "W"]


class Watch:
    """Looks at the worlds of an engine after each control step; `look` is pure where the engine is."""

    def __init__(self, engine: Engine, start: Any):
        scene = engine.scene
        self.engine, self.model, self.tables = engine, scene.model, scene.tables
        self.box = House.of(scene, start)
        self.house = self.box.above_floor()
        self.floor = guards.lowest_support(engine.view(engine.reset()), self.tables.object_fixed)
        self.loose: Bool[np.ndarray, "O"] = ~self.tables.object_fixed & ~self.tables.object_parked
        self._still = np.asarray(self.model.body_weldid)[self.model.geom_bodyid] == 0

    def start(self, physics: Any) -> Seen:
        """Nothing was seen yet."""
        count, objects = self.engine.num_worlds, self.tables.num_objects
        zero, none = jnp.zeros(count, jnp.int32), jnp.full((count, 2), -1, jnp.int32)
        place, touched = jnp.zeros((count, 3), jnp.float32), jnp.full((count, objects, 2), -1, jnp.int32)
        since, hand = jnp.full((count, objects), NEVER, jnp.int32), jnp.zeros((count, objects), jnp.int32)
        speed = jnp.zeros(count, jnp.float32)
        return Seen(zero, zero + 0, place, speed, touched, none, since, hand, zero + NEVER, zero + 0)

    def fresh(self, seen: Seen, physics: Any, mask: Bool[Array, "W"]) -> Seen:
        """The masked worlds begin a new episode."""
        return dataclasses.replace(
            seen,
            flags=jnp.where(mask, 0, seen.flags),
            touched=jnp.where(mask[:, None, None], -1, seen.touched),
            since=jnp.where(mask[:, None], NEVER, seen.since),
        )

    def look(self, seen: Seen, physics: Any, view: PhysicsView, used: Bool[Array, "W O"] | None = None) -> Seen:
        """After a control step. `used`: objects that are not parked now; None: those that the scene does not park."""
        com, velocity = jnp.asarray(view.object_com), jnp.asarray(view.object_linvel)
        loose = self.loose if used is None else used & ~self.tables.object_fixed
        speed = jnp.where(loose, jnp.linalg.norm(velocity, axis=-1), 0.0)
        off = self.box.lost(com)
        away = jnp.where(loose & jnp.isfinite(off), off, -jnp.inf)
        flags = guards.check(self.engine.health(physics), com, np.where(self.loose, self.floor, -np.inf))
        flags = jnp.asarray(flags) | jnp.where((away > 0).any(1), OUTSIDE, 0)
        left = (flags & (OUTSIDE | int(guards.Flag.FELL))) != 0
        culprit = jnp.where(left, away.argmax(1), speed.argmax(1)).astype(jnp.int32)
        touched = self._touched(seen.touched, physics)
        since, hand = _held(seen, view)
        new = (seen.flags == 0) & (flags != 0)
        row = jnp.arange(len(culprit))

        def keep(now: Array, before: Array) -> Array:
            return jnp.where(new.reshape((-1,) + (1,) * (now.ndim - 1)), now, before)

        return Seen(
            flags=keep(flags.astype(jnp.int32), seen.flags),
            object=keep(culprit, seen.object),
            place=keep(com[row, culprit].astype(jnp.float32), seen.place),
            speed=keep(speed[row, culprit].astype(jnp.float32), seen.speed),
            touched=touched,
            last=keep(touched[row, culprit], seen.last),
            since=since,
            hand=hand,
            free_for=keep(since[row, culprit], seen.free_for),
            by=keep(hand[row, culprit], seen.by),
        )

    def _touched(self, before: Int[Array, "W O 2"], physics: Any) -> Int[Array, "W O 2"]:
        """With the contacts of the last physics step; the native engine's are not looked at."""
        if self.engine.name != "warp":
            return before
        contacts, owner = warp_contacts(physics.data), jnp.asarray(self.tables.geom_object)
        geom = jnp.maximum(contacts.geom, 0)
        felt = contacts.valid & (contacts.dist <= 0.0)
        for side in range(2):
            thing, other = owner[geom[:, side]], geom[:, 1 - side]
            world = jnp.where(felt & (thing >= 0), contacts.world, self.engine.num_worlds)
            column = jnp.where(jnp.asarray(self._still)[other], 0, 1)
            before = jnp.asarray(before).at[world, thing, column].set(other.astype(jnp.int32), mode="drop")
        return before

    def report(self, seen: Seen, world: int) -> dict[str, Any]:
        """What happened in a flagged world, for people."""
        flags, thing, since = int(seen.flags[world]), int(seen.object[world]), int(seen.free_for[world])
        kind = next(name for name, bit in zip(FLAGS, _BITS, strict=True) if flags & int(bit))
        return {
            "kind": kind,
            "world": world,
            "object": self.tables.object_names[thing],
            "place": np.asarray(seen.place[world], float).round(2).tolist(),
            "speed": round(float(seen.speed[world]), 1),
            "touched": [self.model.geom(int(g)).name for g in np.asarray(seen.last[world]) if g >= 0],
            **self._holder(int(seen.by[world]), since),
        }

    def _holder(self, hand: int, since: int) -> dict[str, Any]:
        """Who holds or held the object, and for how many control steps it has been free; nothing where no hand did."""
        if since >= NEVER:
            return {}
        return {"held_by": self.model.body(int(self.tables.hand_body[hand])).name, "free_for": since}


def _held(seen: Seen, view: PhysicsView) -> tuple[Int[Array, "W O"], Int[Array, "W O"]]:
    """`Seen.since` and `Seen.hand` after a control step."""
    held = jnp.asarray(view.held)
    if held.shape[1] == 0:
        return seen.since, seen.hand
    now = held.any(1)
    since = jnp.where(now, 0, jnp.minimum(seen.since + 1, NEVER))
    return since, jnp.where(now, held.argmax(1).astype(jnp.int32), seen.hand)
