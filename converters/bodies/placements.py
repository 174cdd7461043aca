"""Which objects of a scene stand where, and which are out of use: wholes and their halves (iGibson's dataset format).

A sliceable object exists as a whole and as its halves. In a cached scene a multiplexer says which of them are in use;
in any other scene the halves named in the whole's metadata are made here, and wait on the parking slab.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..base.description import Instance, ObjectPart, SceneDescription


@dataclasses.dataclass
class Placement:
    """One object that the converted scene holds.

    Attributes:
      instance: what the scene file says of it (made up for halves that the file does not list).
      part_of: of a half: its whole. parts: of a whole: (half, position [3], quaternion w-x-y-z) of each half's base in
        the whole's base frame, scaled.
      parked: out of use.
      scope: BDDL instances bound to it. states: its saved extended states.
    """

    instance: Instance
    part_of: str | None = None
    parts: list[tuple[str, np.ndarray, np.ndarray]] = dataclasses.field(default_factory=list)
    parked: bool = False
    scope: str | None = None
    states: Mapping[str, Any] | None = None

    @property
    def name(self) -> str:
        return self.instance.name


def place_instances(scene: SceneDescription) -> tuple[list[Placement], list[str]]:
    """Placements of all objects and building parts the scene file lists, and warnings.

    Multiplexers and groupers become relations between placements; agents are left to the caller.
    """
    things = [i for i in scene.instances if i.kind in ("object", "building")]
    placements = {i.name: Placement(i, scope=i.object_scope, states=i.states) for i in things}
    groupers = {i.name: i for i in scene.instances if i.kind == "grouper"}
    warnings: list[str] = []
    for owner in (i for i in scene.instances if i.kind == "multiplexer"):
        whole = next((p for p in placements.values() if p.instance.multiplexer == owner.name), None)
        grouper = next((g for g in groupers.values() if g.multiplexer == owner.name), None)
        if whole is None or grouper is None:
            lacks = "whole object" if whole is None else "grouper"
            warnings.append(f"multiplexer '{owner.name}' has no {lacks}: ignored")
            continue
        halves = [p for p in placements.values() if p.instance.grouper == grouper.name]
        _relate(whole, halves, owner, grouper, warnings)
    for name, grouper in groupers.items():
        if not any(i.kind == "multiplexer" and i.name == grouper.multiplexer for i in scene.instances):
            warnings.append(f"grouper '{name}' has no multiplexer: ignored")
    return list(placements.values()), warnings


def _relate(whole: Placement, halves: list[Placement], owner: Instance, grouper: Instance, warnings: list[str]) -> None:
    sliced = owner.current_index >= 1
    if sliced and not halves:
        warnings.append(f"multiplexer '{owner.name}' selects the halves of '{whole.name}', which has none: left whole")
        sliced = False
    whole.parked = sliced
    whole.scope = owner.object_scope or whole.scope
    sub_states = (owner.states or {}).get("sub_states")
    if isinstance(sub_states, Sequence) and sub_states and whole.states is None:
        whole.states = sub_states[0] if isinstance(sub_states[0], Mapping) else None
    offsets = grouper.pose_offsets or []
    for i, half in enumerate(halves):
        half.part_of, half.parked = whole.name, not sliced
        if i < len(offsets):
            whole.parts.append((half.name, np.asarray(offsets[i][0], float), np.asarray(offsets[i][1], float)))
        if isinstance(sub_states, Sequence) and len(sub_states) > 1 and half.states is None:
            half.states = _state_of_part(sub_states[1], i)
    if offsets and len(offsets) != len(halves):
        warnings.append(f"grouper '{grouper.name}' has {len(offsets)} pose offsets for {len(halves)} parts")


def _state_of_part(dump: Any, index: int) -> dict[str, Any] | None:
    """A grouper saves each state as a list with one value per part."""
    if not isinstance(dump, Mapping):
        return None
    return {name: v[index] for name, v in dump.items() if isinstance(v, Sequence) and len(v) > index}


def make_halves(
    whole: Placement, parts: Sequence[ObjectPart], scale: np.ndarray, taken: set[str]
) -> tuple[list[Placement], list[str]]:
    """Halves for a whole whose scene file lists none; parked, at the whole's scale.

    Args:
      parts: of the whole's scaled metadata. scale: of the whole.
      taken: names already used in the scene; the new ones are added.

    Returns:
      the new placements, and warnings.
    """
    made, warnings = [], []
    for i, part in enumerate(parts):
        name = f"{whole.name}_part_{i}"
        if name in taken:
            warnings.append(f"'{name}' exists already and does not belong to '{whole.name}': no half made")
            continue
        taken.add(name)
        instance = Instance(
            name=name,
            category=part.category,
            model=part.model,
            pose=np.eye(4),
            fixed=False,
            scale=np.asarray(scale, dtype=float),
            rooms=list(whole.instance.rooms),
        )
        whole.parts.append((name, np.asarray(part.pos, float), np.asarray(part.quat, float)))
        made.append(Placement(instance, part_of=whole.name, parked=True))
    return made, warnings


def complete_parts(whole: Placement, halves: Sequence[Placement], parts: Sequence[ObjectPart]) -> None:
    """Fills in where the halves sit in the whole from its scaled metadata, where the scene's grouper did not say."""
    known = {name for name, _, _ in whole.parts}
    for half, part in zip(halves, parts, strict=False):
        if half.name not in known:
            whole.parts.append((half.name, np.asarray(part.pos, float), np.asarray(part.quat, float)))
