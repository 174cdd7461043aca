"""A home with changes: objects taken out (`changes`), replacements and additions put in (`additions`), and what stood
on a replaced object put down on the new one.
"""

from __future__ import annotations

import dataclasses
import pathlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Sequence

import msgspec
import mujoco
import numpy as np

from ig2mj.errors import Ig2mjError, InputError, without_lines
from ig2mj.scene.additions import Addition, add_objects, read_absolute
from ig2mj.scene.changes import Change, ChangedHome, take_out
from ig2mj.scene.library import LibraryModel
from ig2mj.scene.manifest import Manifest

SECONDS = 5.0
"""Simulated seconds within which what was put down must have come to rest."""
LIFT = 0.001
"""m by which it is put above the surface."""
DROPPED, SLID = 0.05, 0.08
"""m that it may sink and slide until it rests; more, and it has found no support."""
FELL = 0.2
"""m that the middle of a loose replacement may move until it rests: it may fall onto its side."""
OVERLAP = 0.005
"""m by which a replacement may stand in something else."""
DECIMALS = 5
"""Digits behind the point (m, unit quaternion) to which poses are rounded: they are the same on every processor."""
ROUNDS = 4
"""Times that objects without support are taken out, with what stands on them, until all others rest."""

Planned = Sequence[tuple[Addition, LibraryModel]]


@dataclasses.dataclass(frozen=True)
class MergedHome:
    """root: MJCF with absolute paths. manifest: of it. removed: names of the home that are gone. replacements: what
    stands in the place of others, under their names."""

    root: ElementTree.Element
    manifest: Manifest
    removed: tuple[str, ...] = ()
    replacements: tuple[Addition, ...] = ()


def merged_home(file: pathlib.Path, manifest: Manifest, changes: Sequence[Change], planned: Planned) -> MergedHome:
    """A home with changes and additions.

    Args:
      file: its scene.xml. manifest: its manifest; not changed. planned: additions, as of `plan_additions`.

    Raises:
      UnknownNameError: the home has no such object, or there is no such model. InputError: a file is not MJCF.
      Ig2mjError: a replacement stands in something.
    """
    if not changes:
        root = read_absolute(file)
        return MergedHome(root, add_objects(root, manifest, planned))
    model = _compiled(read_absolute(file), file)
    also: set[str] = set()
    for _ in range(ROUNDS):
        root = read_absolute(file)
        changed = take_out(root, manifest, model, changes, also)
        merged = add_objects(root, changed.manifest, [*changed.planned, *planned])
        merged.objects = [
            msgspec.structs.replace(o, rooms=changed.rooms[o.name]) if o.name in changed.rooms else o
            for o in merged.objects
        ]
        moves = changed.planned or changed.dependents
        lost = _put_down(root, _compiled(root, file), merged, changed) if moves else set()
        if not lost:
            break
        also |= lost
    return MergedHome(root, merged, changed.removed, tuple(addition for addition, _ in changed.planned))


def _compiled(root: ElementTree.Element, file: pathlib.Path) -> mujoco.MjModel:
    try:
        return mujoco.MjModel.from_xml_string(ElementTree.tostring(root, encoding="unicode"))
    except ValueError as e:
        raise InputError(file, f"MuJoCo cannot load it: {without_lines(e)}", fix="convert the scene again") from e


def _put_down(root: ElementTree.Element, model: mujoco.MjModel, manifest: Manifest, changed: ChangedHome) -> set[str]:
    """Puts what stood on a replaced object down on the new one, and lets loose replacements come to rest.

    Returns:
      Names of objects that found no support; where there are none, the start in `root` is changed.
    """
    entries = {o.name: o for o in manifest.objects}
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    replaced = [addition.name for addition, _ in changed.planned]
    lifts: dict[str, float] = {}
    for name, under in changed.dependents.items():
        if under not in changed.dependents:
            body = model.body(entries[name].bodies[0]).id
            top = _surface(model, data, entries[under].bodies, data.subtree_com[body][:2], changed.bottoms[name])
            if top is None:
                return {name}
            lifts[name] = top + LIFT - changed.bottoms[name]
        else:
            lifts[name] = lifts[under]
    moving = [*changed.dependents, *(name for name in replaced if not entries[name].fixed)]
    addresses = {n: [_address(model, body) for body in entries[n].bodies] for n in moving}
    for name, lift in lifts.items():
        for at in addresses[name]:
            data.qpos[at + 2] += lift
    _refuse_overlaps(model, data, entries, replaced, moving)
    before, middles = data.qpos.copy(), {}
    mujoco.mj_comPos(model, data)
    for name in replaced:
        middles[name] = data.subtree_com[model.body(entries[name].bodies[0]).id].copy()
    trees = [model.body_treeid[model.body(entries[n].bodies[0]).id] for n in moving]
    for _ in range(round(SECONDS / model.opt.timestep) if moving else 0):
        mujoco.mj_step(model, data)
        if (data.tree_asleep[trees] >= 0).all():
            break
    for name in (n for n in replaced if n in moving):
        body = model.body(entries[name].bodies[0]).id
        fell = float(np.linalg.norm(data.subtree_com[body] - middles[name]))
        if fell > FELL or data.tree_asleep[model.body_treeid[body]] < 0:
            raise Ig2mjError(f"the object in place of '{name}' does not come to rest there: take another one")
    lost = set()
    for name in changed.dependents:
        moved = data.qpos[addresses[name][0] :][:3] - before[addresses[name][0] :][:3]
        if moved[2] < -DROPPED or np.hypot(*moved[:2]) > SLID:
            lost.add(name)
    if not lost:
        _write_start(root, model, entries, moving, data.qpos)
    return lost


def _address(model: mujoco.MjModel, body: str) -> int:
    """Where the position of a free body is in qpos."""
    return int(model.jnt_qposadr[model.body_jntadr[model.body(body).id]])


def _surface(
    model: mujoco.MjModel, data: mujoco.MjData, bodies: Sequence[str], spot: np.ndarray, height: float
) -> float | None:
    """The top of an object over or under a spot that is nearest to a height; None where it has none there."""
    roots = {model.body(body).id for body in bodies}
    down, found = np.array([0.0, 0.0, -1.0]), []
    for geom in range(model.ngeom):
        if int(model.body_rootid[model.geom_bodyid[geom]]) not in roots or not model.geom_contype[geom]:
            continue
        start = np.array([spot[0], spot[1], data.geom_xpos[geom, 2] + model.geom_rbound[geom] + 1.0])
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
            distance = mujoco.mj_rayMesh(model, data, geom, start, down)
        else:
            at, turn, size = data.geom_xpos[geom], data.geom_xmat[geom], model.geom_size[geom]
            distance = mujoco.mju_rayGeom(at, turn, size, start, down, int(model.geom_type[geom]))
        if distance >= 0:
            found.append(float(start[2] - distance))
    return min(found, key=lambda z: abs(z - height), default=None)


def _refuse_overlaps(
    model: mujoco.MjModel, data: mujoco.MjData, entries: dict, replaced: Sequence[str], moving: Iterable[str]
) -> None:
    """Raises Ig2mjError where a replacement stands in the building or another object."""
    mujoco.mj_kinematics(model, data)
    owner = {model.body(body).id: name for name, o in entries.items() for body in o.bodies}
    solid = np.flatnonzero((model.geom_contype != 0) | (model.geom_conaffinity != 0))
    of_geom = {int(g): owner.get(int(model.body_rootid[model.geom_bodyid[g]]), "") for g in solid}
    for name in replaced:
        deepest, other_name = 0.0, ""
        for mine in (g for g, o in of_geom.items() if o == name):
            for other, its in of_geom.items():
                if its in ("", name) or (its in moving and its not in replaced):
                    continue
                apart = np.linalg.norm(data.geom_xpos[mine] - data.geom_xpos[other])
                if apart > model.geom_rbound[mine] + model.geom_rbound[other]:
                    continue
                distance = mujoco.mj_geomDistance(model, data, mine, other, 1.0, None)
                if -distance > deepest:
                    deepest, other_name = -distance, its
        if deepest > OVERLAP:
            raise Ig2mjError(
                f"the object in place of '{name}' stands {100 * deepest:.1f} cm deep in {other_name}: take a smaller "
                f"one, or remove {other_name}"
            )


def _write_start(
    root: ElementTree.Element, model: mujoco.MjModel, entries: dict, names: Iterable[str], qpos: np.ndarray
) -> None:
    """Makes positions of some objects the start."""
    bodies = {body.get("name"): body for body in root.iter("body")}
    values = [key.get("qpos", "").split() for key in root.findall("keyframe/key")]
    for name in names:
        tree = model.body_treeid[model.body(entries[name].bodies[0]).id]
        for joint in np.flatnonzero(model.body_treeid[model.jnt_bodyid] == tree):
            at = int(model.jnt_qposadr[joint])
            free = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE
            given = [f"{v:.9g}" for v in np.round(qpos[at : at + (7 if free else 1)], DECIMALS) + 0.0]
            if free:
                body = bodies[model.body(int(model.jnt_bodyid[joint])).name]
                body.set("pos", " ".join(given[:3]))
                body.set("quat", " ".join(given[3:]))
            for numbers in values:
                if numbers:
                    numbers[at : at + len(given)] = given
    for key, numbers in zip(root.findall("keyframe/key"), values, strict=True):
        if numbers:
            key.set("qpos", " ".join(numbers))
