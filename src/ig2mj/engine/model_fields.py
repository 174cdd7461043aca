"""`ModelFields`: fields of MuJoCo's model that may differ between the worlds of a batch.

    engine = make_engine("warp", scene, 1024, model_fields=(*MASSES, "geom_friction"))
    fields = dataclasses.replace(with_masses(scene.model, mass), geom_friction=friction)
    physics = engine.write(engine.reset(), Write(model_fields=fields))

Which fields these are is given when an engine is made, since they become part of its physics; worlds then have the
scene's own values until others are written. Parameters of equality constraints, which grasping changes, need not be
named. Batches that name no field pay nothing.

`geom_margin` is none of them: broad phases are planned with it when an engine is made.

Axes: W worlds, B bodies, G geoms, C cameras, M materials, E equality constraints, nv degrees of freedom.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Iterable, Mapping
from typing import Any

import mujoco
import numpy as np
from flax import struct
from jaxtyping import Float, Int

from ig2mj.engine.view import Array
from ig2mj.errors import EngineError, UnknownNameError


@struct.dataclass
class ModelFields:
    """Fields of MuJoCo's model of the same names, with the world axis; None: not given.

    Attributes:
      eq_data: parameters of equality constraints.
      body_mass, body_inertia (kg, kg m2), body_subtreemass, body_invweight0, dof_invweight0, dof_M0: masses, and what
        MuJoCo derives from them; to be made by `with_masses`.
      geom_friction: sliding, torsional, rolling. dof_damping: N s/m or N m s/rad.
      geom_rgba, mat_rgba: colours, 0..1; seen where MuJoCo draws (`Engine.to_mujoco`) and by cameras.
      geom_matid: material of each geom, -1 for none; likewise.
      body_pos, body_quat: poses of bodies in their parents' frames (m, w-x-y-z); of a body without joints that hangs on
        the world, where it stands. For robots: streams of substances meet objects that never move where the scene has
        them.
      cam_pos, cam_quat: poses of cameras in their bodies' frames (m, w-x-y-z).
    """

    eq_data: Float[Array, "*W E 12"] | None = None
    body_mass: Float[Array, "*W B"] | None = None
    body_inertia: Float[Array, "*W B 3"] | None = None
    body_subtreemass: Float[Array, "*W B"] | None = None
    body_invweight0: Float[Array, "*W B 2"] | None = None
    dof_invweight0: Float[Array, "*W nv"] | None = None
    dof_M0: Float[Array, "*W nv"] | None = None
    geom_friction: Float[Array, "*W G 3"] | None = None
    dof_damping: Float[Array, "*W nv"] | None = None
    geom_rgba: Float[Array, "*W G 4"] | None = None
    mat_rgba: Float[Array, "*W M 4"] | None = None
    geom_matid: Int[Array, "*W G"] | None = None
    cam_pos: Float[Array, "*W C 3"] | None = None
    cam_quat: Float[Array, "*W C 4"] | None = None
    body_pos: Float[Array, "*W B 3"] | None = None
    body_quat: Float[Array, "*W B 4"] | None = None


NAMES: tuple[str, ...] = tuple(field.name for field in dataclasses.fields(ModelFields))
"""All fields."""

MASSES = ("body_mass", "body_inertia", "body_subtreemass", "body_invweight0", "dof_invweight0", "dof_M0")
"""Fields that belong together: an engine has all of them or none, and they are written together."""

POSES = ("body_pos", "body_quat")
"""Fields of where bodies hang on their parents."""

MOVING = ("eq_data", *MASSES, "geom_friction", "dof_damping", *POSES)
"""Fields that a physics step reads."""


def given(fields: ModelFields | None) -> dict[str, Any]:
    """Fields that are not None, by name."""
    if fields is None:
        return {}
    return {name: array for name in NAMES if (array := getattr(fields, name)) is not None}


def check_names(names: str | Iterable[str]) -> tuple[str, ...]:
    """Fields besides `eq_data` that an engine is to have for each world, in the order of `NAMES`; a text is one name.

    Raises:
      UnknownNameError: there is no such field. EngineError: some fields of masses, and not all.
    """
    chosen = {names} if isinstance(names, str) else set(names)
    for name in sorted(chosen - set(NAMES)):
        raise UnknownNameError("field of ModelFields", name, NAMES)
    if 0 < len(chosen & set(MASSES)) < len(MASSES):
        raise EngineError(f"masses are changed together: name all of {', '.join(MASSES)} (engine.model_fields.MASSES)")
    return tuple(name for name in NAMES if name in chosen and name != "eq_data")


def own_fields(model: mujoco.MjModel, names: Iterable[str]) -> ModelFields:
    """Fields of a model without the world axis, in float32 or int32."""
    return ModelFields(**{name: np.array(getattr(model, name), dtype_of(name)) for name in names})


def dtype_of(name: str) -> type:
    """Of a field in engines' arrays."""
    return np.int32 if name == "geom_matid" else np.float32


def check_written(fields: ModelFields | None, names: tuple[str, ...], model: mujoco.MjModel, worlds: int) -> None:
    """Raises EngineError where an engine cannot take what is written; works while tracing.

    Args:
      names: fields that the engine has for each world, besides `eq_data`.
    """
    found = given(fields)
    for name, array in found.items():
        if name != "eq_data" and name not in names:
            raise EngineError(
                f"this engine has one {name} for all worlds (make it with model_fields=(..., '{name}'), a name of "
                "ig2mj.engine.model_fields)"
            )
        requested = (worlds, *getattr(model, name).shape)
        if tuple(np.shape(array)) != requested:
            raise EngineError(f"{name} has shape {tuple(np.shape(array))}, this engine takes {requested}")
    if 0 < len(found.keys() & set(MASSES)) < len(MASSES):
        raise EngineError("masses are written together: make them with ig2mj.engine.model_fields.with_masses")


def merged(old: ModelFields, new: ModelFields | None) -> ModelFields:
    """`old` with what `new` gives."""
    return dataclasses.replace(old, **given(new))


def with_masses(
    model: mujoco.MjModel, mass: Float[np.ndarray, "W B"], inertia: Float[np.ndarray, "W B 3"] | None = None
) -> ModelFields:
    """The fields of masses (`MASSES`) for each world, derived ones by MuJoCo on the host.

    Args:
      model: the scene's.
      mass: kg, of every body; positive where the scene's is.
      inertia: kg m2, principal moments; None: the scene's, scaled with the mass.

    Raises:
      EngineError: a shape is wrong, or a mass or moment is not positive.
    """
    mass = np.asarray(mass, float)
    if mass.ndim != 2 or mass.shape[1] != model.nbody:
        raise EngineError(f"masses have shape {mass.shape}, this scene takes (W, {model.nbody})")
    if inertia is None:
        ratio = mass / np.where(model.body_mass > 0, model.body_mass, 1.0)
        inertia = np.where(model.body_mass[:, None] > 0, ratio[..., None], 1.0) * model.body_inertia
    inertia = np.asarray(inertia, float)
    if inertia.shape != (*mass.shape, 3):
        raise EngineError(f"moments of inertia have shape {inertia.shape}, this scene takes (W, {model.nbody}, 3)")
    if not (mass[:, model.body_mass > 0] > 0).all() or not (inertia[:, model.body_mass > 0] >= 0).all():
        raise EngineError("masses and moments of inertia must be positive where the scene's are")
    own, data = copy.copy(model), mujoco.MjData(model)
    rows: list[Mapping[str, np.ndarray]] = []
    for of_bodies, moments in zip(mass, inertia, strict=True):
        own.body_mass[:], own.body_inertia[:] = of_bodies, moments
        mujoco.mj_setConst(own, data)
        rows.append({name: np.array(getattr(own, name), np.float32) for name in MASSES})
    return ModelFields(**{name: np.stack([row[name] for row in rows]) for name in MASSES})
