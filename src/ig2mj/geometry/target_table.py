"""The pieces of many objects in one layout, so that a traced index can select the object that rays are tested against:
one compiled program serves every object.

Pieces are sorted by kind and number of half-spaces, as in `ig2mj.geometry.targets`, and within these by object. An
object's pieces of one sort are then a slice, as long as the longest of all objects.

Axes: K objects, B bodies of an object, E pieces.
"""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int

from ig2mj.geometry.poses import AnyArray
from ig2mj.geometry.targets import EntryGroup, RayTargets
from ig2mj.scene.tables import SceneTables

BOX_PLANES = 6
"""Most pieces are boxes. All others share one group, so that programs stay short."""


@dataclasses.dataclass(frozen=True, eq=False)
class TargetTable:
    """Pieces of K objects. Built once per scene.

    Attributes:
      bodies: bodies that each object's pieces ride on, padded with 0. groups: all pieces, sort by sort, each followed
        by room for a slice that begins at the last one; their bodies are positions in the object's row of `bodies`.
      start, count: where each object's pieces begin in each group, and their number. width: the largest number.
    """

    bodies: Int[np.ndarray, "K B"]
    groups: tuple[EntryGroup, ...]
    start: tuple[Int[np.ndarray, "K"], ...]
    count: tuple[Int[np.ndarray, "K"], ...]
    width: tuple[int, ...]

    @classmethod
    def build(cls, tables: SceneTables, objects: Int[np.ndarray, "K"]) -> TargetTable:
        """The pieces of `objects` (indices of the scene's objects)."""
        everything = RayTargets.build(tables, objects, plane_steps=(BOX_PLANES,))
        rows = [np.unique(tables.piece_body[tables.piece_object == o]) for o in objects]
        bodies = np.zeros((len(objects), max(map(len, rows), default=0)), int)
        for row, found in zip(bodies, rows, strict=True):
            row[: len(found)] = found
        groups, start, count, width = [], [], [], []
        for group in everything.groups:
            assert np.all(np.diff(group.pair) >= 0), "entries of one kind stand in the order of their pairs"
            count.append(np.bincount(group.pair, minlength=len(objects)))
            start.append(np.cumsum(count[-1]) - count[-1])
            width.append(int(count[-1].max()))
            riding = np.array([np.searchsorted(rows[k], b) for k, b in zip(group.pair, group.body, strict=True)], int)
            groups.append(_lengthened(dataclasses.replace(group, body=riding), width[-1]))
        return cls(bodies, tuple(groups), tuple(start), tuple(count), tuple(width))

    def of(self, k: Int[Array, ""], planes_at_once: int | None = None) -> tuple[Int[Array, "B"], RayTargets]:
        """The bodies of object number `k`, and its pieces as the target of one pair; their `body` counts those bodies.

        `planes_at_once` as in `rays.clip_line`.
        """
        total, offset = sum(self.width), 0
        groups, slots = [], []
        for group, start, count, width in zip(self.groups, self.start, self.count, self.width, strict=True):
            begin = jnp.asarray(start)[k]
            groups.append(_slice(group, begin, width))
            slots.append(jnp.where(np.arange(width) < jnp.asarray(count)[k], offset + np.arange(width), total))
            offset += width
        joined = jnp.concatenate([jnp.zeros(0, int), *slots])[None]
        return jnp.asarray(self.bodies)[k], RayTargets(1, tuple(groups), joined, planes_at_once)


def _lengthened(group: EntryGroup, width: int) -> EntryGroup:
    """The group with room for `width` more entries at its end."""

    def longer(given: AnyArray, axis: int = 0) -> np.ndarray:
        values = np.asarray(given)
        room = np.repeat(np.take(values, [0], axis=axis), width, axis=axis)
        return np.concatenate([values, room], axis=axis)

    return EntryGroup(
        kind=group.kind,
        pair=np.zeros(len(group.pair) + width, int),
        body=longer(group.body),
        pos=longer(group.pos),
        rotation=longer(group.rotation),
        size=longer(group.size),
        planes=longer(group.planes, axis=2),
    )


def _slice(group: EntryGroup, begin: Int[Array, ""], width: int) -> EntryGroup:
    def part(values: AnyArray, axis: int = 0) -> Array:
        return jax.lax.dynamic_slice_in_dim(jnp.asarray(values), begin, width, axis)

    return EntryGroup(
        kind=group.kind,
        pair=np.zeros(width, int),
        body=part(group.body),
        pos=part(group.pos),
        rotation=part(group.rotation),
        size=part(group.size),
        planes=part(group.planes, axis=2),
    )
