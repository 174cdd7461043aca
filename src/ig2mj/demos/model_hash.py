"""Hashes of a compiled model with its robots: of everything that determines physics, and of everything visible.

Numbers count to single precision, since the last digits of what MuJoCo derives depend on the processor. Names do not
count: neither physics nor images depend on them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Bool, Int

from ig2mj.agents.wrist_cameras import is_wrist_camera

APPEARANCE = ("cam_", "light_", "mat_", "tex_", "skin_", "mesh_", "bvh_", "oct_", "name_", "names_", "text_", "tuple_")
"""Beginnings of the names of arrays that physics does not depend on, or that are derived from others. Meshes count
where a geom that matters has them."""

APPEARANCE_ENDINGS = ("_rgba", "_matid", "_group", "_pathadr", "_bvhadr", "_bvhnum", "_texcoord", "_texcoordadr")

OF_ALL_GEOMS = ("dof_length",)
"""Made by MuJoCo of visual geoms as well. It decides how slow a body must be to fall asleep: where looks change that, a
replay that compares shows it."""

NUMBERS_OF_GEOMS = ("body_geomadr", "body_geomnum", "geom_dataid", "pair_geom1", "pair_geom2", "pair_signature")
"""Arrays that number geoms or meshes, visual ones among them."""

LEFT_OUT = (*OF_ALL_GEOMS, *NUMBERS_OF_GEOMS)

SMALLEST = 1e-12
"""Smaller numbers are rounding errors of zero."""


def physics_hash(model: mujoco.MjModel) -> str:
    """Of all that determines how a model moves."""
    hashed = hashlib.blake2b(digest_size=16)
    kept = _that_matter(model)
    for name, array in _arrays(model):
        if name.startswith(APPEARANCE) or name.endswith(APPEARANCE_ENDINGS) or name in LEFT_OUT:
            continue
        if name in ("wrap_objid", "sensor_objid", "sensor_refid"):
            array = _renumbered(model, name, array, kept)
        _feed(hashed, name, array[kept] if name.startswith("geom_") else array)
    number = np.cumsum(kept) - 1
    for name in ("pair_geom1", "pair_geom2"):
        _feed(hashed, name, number[getattr(model, name)])
    for mesh in model.geom_dataid[kept & np.isin(model.geom_type, _MESHES)]:
        if mesh >= 0:
            _feed_mesh(hashed, model, int(mesh))
    _feed_options(hashed, model.opt)
    _feed(hashed, "meaninertia", np.array(model.stat.meaninertia))
    return hashed.hexdigest()


def appearance_hash(model: mujoco.MjModel) -> str:
    """Of all that cameras, and rays that see what cameras see, meet. Cameras on hands do not count, so that recordings
    made before robots had them can be compared."""
    hashed = hashlib.blake2b(digest_size=16)
    own = np.array([not is_wrist_camera(model.camera(k).name) for k in range(model.ncam)], bool)
    for name, array in _arrays(model):
        if name.startswith("cam_"):
            array = array[own]
        seen = name.startswith(("cam_", "light_", "mat_", "tex_", "skin_", "mesh_", "geom_"))
        seen |= name.startswith(("site_", "body_pos", "body_quat", "qpos0"))
        if seen and not name.endswith(("_pathadr", "_bvhadr", "_bvhnum")):
            _feed(hashed, name, array)
    for part in ("headlight", "map", "quality", "rgba"):
        _feed_options(hashed, getattr(model.vis, part))
    _feed(hashed, "extent", np.array(model.stat.extent))
    return hashed.hexdigest()


def whole_hash(model: mujoco.MjModel) -> str:
    """Of every array of a model and every number of its options: the `model_hash` of recordings of format 2."""
    hashed = hashlib.blake2b(digest_size=16)
    for part in (model, model.opt, model.stat):
        for name in sorted(n for n in dir(part) if not n.startswith("_") and not n.endswith("_pathadr")):
            value = getattr(part, name)
            if isinstance(value, np.ndarray):
                hashed.update(f"{name} {value.dtype} {value.shape}".encode())
                hashed.update(np.ascontiguousarray(value).data)
            elif part is not model and isinstance(value, int | float):
                hashed.update(f"{name} {value!r}".encode())
    hashed.update(model.names)
    return hashed.hexdigest()


_MESHES = (int(mujoco.mjtGeom.mjGEOM_MESH), int(mujoco.mjtGeom.mjGEOM_SDF))
_GEOM_WRAPS = (int(mujoco.mjtWrap.mjWRAP_SPHERE), int(mujoco.mjtWrap.mjWRAP_CYLINDER))


def _arrays(model: mujoco.MjModel) -> Iterator[tuple[str, np.ndarray]]:
    for name in sorted(n for n in dir(model) if not n.startswith("_")):
        value = getattr(model, name)
        if isinstance(value, np.ndarray):
            yield name, value


def _that_matter(model: mujoco.MjModel) -> Bool[np.ndarray, "G"]:
    """Geoms that can touch, or that a pair, a tendon, a sensor or a fluid knows."""
    kept = (model.geom_contype != 0) | (model.geom_conaffinity != 0) | (model.geom_fluid[:, 0] > 0)
    for numbers in (model.pair_geom1, model.pair_geom2, model.wrap_objid[np.isin(model.wrap_type, _GEOM_WRAPS)]):
        kept[numbers] = True
    for kind, numbers in ((model.sensor_objtype, model.sensor_objid), (model.sensor_reftype, model.sensor_refid)):
        kept[numbers[kind == int(mujoco.mjtObj.mjOBJ_GEOM)]] = True
    return kept


def _renumbered(model: mujoco.MjModel, name: str, array: np.ndarray, kept: np.ndarray) -> Int[np.ndarray, "N"]:
    """Numbers of geoms among those that are kept; those of cameras are not counted."""
    kinds = {"wrap_objid": model.wrap_type, "sensor_objid": model.sensor_objtype, "sensor_refid": model.sensor_reftype}
    geoms = np.isin(kinds[name], _GEOM_WRAPS if name == "wrap_objid" else int(mujoco.mjtObj.mjOBJ_GEOM))
    found = array.copy()
    found[geoms] = (np.cumsum(kept) - 1)[array[geoms]]
    if name != "wrap_objid":
        found[kinds[name] == int(mujoco.mjtObj.mjOBJ_CAMERA)] = -1
    return found


def _feed_mesh(hashed: Any, model: mujoco.MjModel, mesh: int) -> None:
    """Corners and faces in the mesh's own frame, and MuJoCo's hull of it."""
    for first, count, array in (
        (model.mesh_vertadr, model.mesh_vertnum, model.mesh_vert),
        (model.mesh_faceadr, model.mesh_facenum, model.mesh_face),
    ):
        _feed(hashed, "mesh", array[first[mesh] : first[mesh] + count[mesh]])


def _feed_options(hashed: Any, part: Any) -> None:
    for name in sorted(n for n in dir(part) if not n.startswith("_")):
        value = getattr(part, name)
        if isinstance(value, np.ndarray | int | float):
            _feed(hashed, name, np.asarray(value))


def _feed(hashed: Any, name: str, array: np.ndarray) -> None:
    if array.dtype.kind == "f":
        array = np.where(np.abs(array) < SMALLEST, 0.0, array).astype(np.float32)
    hashed.update(f"{name} {array.dtype} {array.shape}".encode())
    hashed.update(np.ascontiguousarray(array).tobytes())
