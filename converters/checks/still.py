"""Checks that move nothing: does it compile, has each object its size and its mass, does anything overlap."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Collection, Mapping

import mujoco
import numpy as np

from ig2mj.scene.manifest import Manifest

from ..base.outcome import CheckResult
from ..mjcf.model_index import ModelIndex, geom_box

BOX_TOLERANCE = 0.015
"""Relative, per axis: collision AABB at q = 0 against the requested bounding box."""
BOX_SLACK = 2e-3
"""Metres that are always allowed: thin objects are thickened."""
SOURCE_TOLERANCE, SOURCE_SLACK = 1e-3, 2e-3
"""Relative and in metres: collision AABB against that of the source's meshes. Flat groups are thickened by 1 mm."""
MASS_TOLERANCE = 1e-3
"""Relative: the model's mass of an object against the manifest's."""
PENETRATION_TOLERANCE = 1e-3
"""Metres of overlap at t = 0 that are not listed."""


def awake_copy(model: mujoco.MjModel) -> mujoco.MjModel:
    """A copy in which nothing sleeps: sleeping pairs have no contacts."""
    awake = copy.copy(model)
    awake.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    return awake


def start_data(model: mujoco.MjModel) -> mujoco.MjData:
    """The scene at t = 0: the first keyframe where there is one, else the model's own positions."""
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    return data


def check_compiles(model: mujoco.MjModel) -> CheckResult:
    finite = all(bool(np.all(np.isfinite(x))) for x in (model.qpos0, model.body_mass, model.geom_size, model.geom_pos))
    text = f"{model.nbody} bodies, {model.ngeom} geoms, {model.njnt} joints, {model.nmesh} meshes"
    failures = [] if finite else [{"problem": "the model has numbers that are not finite"}]
    return CheckResult("compiles", finite, text, failures)


@dataclasses.dataclass(frozen=True)
class SourceBox:
    """Size [3] of the box round an object's source shapes, in base axes at joint positions 0, metres; and how far the
    result may be off it, since primitives were fitted, metres."""

    size: np.ndarray
    fit: float = 0.0


def check_boxes(
    model: mujoco.MjModel, manifest: Manifest, index: ModelIndex, sources: Mapping[str, SourceBox]
) -> CheckResult:
    """AABB of each object's collision geoms with all joints at 0, in base-link axes, against the requested bounding box
    and against that of the source's meshes.

    Trees split off at floating joints (pillows) and annotated links (a blade) are left out where that fits better.
    """
    data = mujoco.MjData(model)
    for joints in index.joints:
        data.qpos[model.jnt_qposadr[joints]] = 0.0
    mujoco.mj_kinematics(model, data)
    failures, measured = [], {}
    for number, entry in enumerate(manifest.objects):
        asked = np.array(entry.bounding_box)
        main = index.roots[number][0]
        geoms = np.flatnonzero((index.geom_object == number) & index.solid)
        inner, bare = index.geom_root[geoms] == main, ~index.link[geoms]
        candidates = [geoms[inner & bare], geoms[bare], geoms[inner], geoms]
        sizes = [_extent(model, data, main, some) for some in candidates if len(some)]
        if not sizes:
            measured[entry.name] = {"asked": asked.tolist(), "got": None}
            if entry.category == "ceilings":  # left without, as in BEHAVIOR, unless asked for
                continue
            failures.append({"object": entry.name, "problem": "has no collision geometry", "asked": asked.tolist()})
            continue
        got = min(sizes, key=lambda size: float(np.abs(size / np.maximum(asked, 1e-9) - 1).max()))
        error = got / np.maximum(asked, 1e-9) - 1
        measured[entry.name] = {"asked": asked.tolist(), "got": got.tolist()}
        if np.any(np.abs(got - asked) > np.maximum(BOX_TOLERANCE * asked, BOX_SLACK)):
            worst = int(np.abs(error).argmax())
            problem = f"{'xyz'[worst]} is {got[worst]:.3f} m, asked {asked[worst]:.3f} m"
            failures.append({"object": entry.name, "problem": problem, "asked": asked.tolist(), "got": got.tolist(),
                             "error": float(error[worst])})  # fmt: skip
        if (source := sources.get(entry.name)) is not None:
            measured[entry.name]["source"] = source.size.tolist()
            failures += _off_source(entry.name, sizes, source)
    return _result("bounding_box", failures, measured, len(manifest.objects), "objects have the asked size")


def _off_source(name: str, sizes: list[np.ndarray], source: SourceBox) -> list[dict[str, object]]:
    """The failure, if there is one, of an object whose size is the nearest of `sizes` to its source's."""
    got = min(sizes, key=lambda size: float(np.abs(size - source.size).max()))
    off = got - source.size
    if np.all(np.abs(off) <= SOURCE_SLACK + SOURCE_TOLERANCE * source.size + 2 * source.fit):
        return []
    worst = int(np.abs(off).argmax())
    problem = f"{'xyz'[worst]} is {got[worst]:.4f} m, {source.size[worst]:.4f} m in the source's meshes"
    error = float(off[worst] / max(source.size[worst], 1e-9))
    return [{"object": name, "problem": problem, "source": source.size.tolist(), "got": got.tolist(), "error": error}]


def _extent(model: mujoco.MjModel, data: mujoco.MjData, base: int, geoms: np.ndarray) -> np.ndarray:
    to_base = data.xmat[base].reshape(3, 3).T
    boxes = [
        geom_box(model, g, to_base @ data.geom_xmat[g].reshape(3, 3), to_base @ (data.geom_xpos[g] - data.xpos[base]))
        for g in geoms
    ]
    return np.max([b[1] for b in boxes], axis=0) - np.min([b[0] for b in boxes], axis=0)


def check_mass(model: mujoco.MjModel, manifest: Manifest, index: ModelIndex) -> CheckResult:
    """The mass of each object's bodies against the manifest's, and that every body that can move weighs something."""
    failures, measured = [], {}
    for number, entry in enumerate(manifest.objects):
        bodies = np.flatnonzero(index.body_object == number)
        got = float(model.body_mass[bodies].sum())
        measured[entry.name] = {"asked": entry.mass, "got": got}
        moving = bodies[model.body_weldid[bodies] != 0]
        light = [model.body(b).name for b in moving if not model.body_subtreemass[b] > 0]
        if light:
            failures.append({"object": entry.name, "problem": f"moving bodies without mass: {', '.join(light)}"})
        elif len(moving) and abs(got - entry.mass) > MASS_TOLERANCE * max(entry.mass, 1e-6):
            failures.append({"object": entry.name, "problem": f"weighs {got:.4g} kg, asked {entry.mass:.4g} kg"})
    return _result("mass", failures, measured, len(manifest.objects), "objects have the asked mass")


def check_penetration(model: mujoco.MjModel, index: ModelIndex, allowed: Collection[frozenset[str]]) -> CheckResult:
    """Contacts at t = 0 between different trees that overlap by more than the tolerance, the deepest per pair."""
    model = awake_copy(model)
    data = start_data(model)
    mujoco.mj_fwdPosition(model, data)
    deepest: dict[frozenset[str], float] = {}
    for a, b, depth in deep_pairs(data, index, PENETRATION_TOLERANCE):
        pair = frozenset((index.name(a), index.name(b)))
        deepest[pair] = max(depth, deepest.get(pair, 0.0))
    failures = []
    for pair, depth in sorted(deepest.items(), key=lambda item: -item[1]):
        if pair in allowed:
            continue
        first, *rest = sorted(pair)
        other = rest[0] if rest else first
        problem = f"overlaps {other if rest else 'another part of itself'} by {depth * 1000:.1f} mm"
        failures.append({"object": first, "other": other, "depth": depth, "problem": problem})
    excused = len(deepest) - len(failures)
    text = f"{len(failures)} pair{'' if len(failures) == 1 else 's'} of objects overlap at the start"
    if failures:
        text += f", the deepest by {failures[0]['depth'] * 1000:.1f} mm"
    if excused:
        text += f"; {excused} more are allowed by the source"
    return CheckResult("penetration", not failures, text, failures)


def deep_pairs(data: mujoco.MjData, index: ModelIndex, tolerance: float) -> list[tuple[int, int, float]]:
    """(object, object, metres of overlap) of contacts between different trees, at least one of them an object's."""
    if not data.ncon:
        return []
    geoms, depth = data.contact.geom, -data.contact.dist
    objects, trees = index.geom_object[geoms], index.geom_root[geoms]
    deep = (depth > tolerance) & (trees[:, 0] != trees[:, 1])
    return [(int(a), int(b), float(d)) for (a, b), d in zip(objects[deep], depth[deep], strict=True)]


def _result(name: str, failures: list, measured: dict, count: int, what: str) -> CheckResult:
    failed = len({f["object"] for f in failures})
    return CheckResult(name, not failures, f"{count - failed} of {count} {what}", failures, measured)
