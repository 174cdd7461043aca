"""Recording the last control steps of every world, and dumping one world's for replay.

For debugging: it costs memory for every step kept. `ig2mj view SCENE --dump FILE` plays a dump.

Axes: S steps kept, W worlds, T steps of a dump.
"""

from __future__ import annotations

import functools
import os
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from flax import struct
from jaxtyping import Int

from ig2mj.engine.base import Engine
from ig2mj.engine.snapshot import Snapshot
from ig2mj.engine.view import Array
from ig2mj.errors import InputError
from ig2mj.process import entry_point
from ig2mj.states.world import ExtendedStates
from ig2mj.worlds.archive import build, check_lengths, load_tree, read_arrays, read_header, save_tree
from ig2mj.worlds.batch import Batch

LENGTH = 50
"""Control steps kept by default."""

MODEL = "model"
"""In a dump: MuJoCo's binary form of the model."""


@struct.dataclass
class Frames:
    """Physics and extended states of consecutive control steps; arrays begin with the step axis."""

    physics: Snapshot
    states: ExtendedStates


@struct.dataclass
class RecentSteps:
    """A ring of the last S control steps of all worlds. `written`: steps recorded so far.

    `rings`: the arrays of `Frames`, in the order of its leaves, [S, W, ...]; `kind`: how they make up `Frames`.
    """

    rings: tuple[Array, ...]
    written: Int[Array, ""]
    kind: Any = struct.field(pytree_node=False)

    @property
    def length(self) -> int:
        return self.rings[0].shape[0]


@entry_point
def start_recording(engine: Engine, batch: Batch, length: int = LENGTH) -> RecentSteps:
    """A recording whose first step is the present state."""
    leaves, kind = jax.tree.flatten(_now(engine, batch))
    return record(engine, RecentSteps(_empty(leaves, length), jnp.zeros((), jnp.int32), kind), batch)


@entry_point
def record(engine: Engine, recording: RecentSteps, batch: Batch) -> RecentSteps:
    """Adds the present state, over the oldest one when full. Pure; consumes the recording that it is given."""
    rings = _put(recording.rings, recording.written % recording.length, jax.tree.leaves(_now(engine, batch)))
    return RecentSteps(rings, recording.written + 1, recording.kind)


@functools.partial(jax.jit, static_argnums=1)
def _empty(now: list[Array], length: int) -> tuple[jax.Array, ...]:
    return tuple(jnp.zeros((length, *a.shape), a.dtype) for a in now)


@functools.partial(jax.jit, donate_argnums=0)
def _put(rings: tuple[Array, ...], place: Int[Array, ""], now: list[Array]) -> tuple[jax.Array, ...]:
    return tuple(jnp.asarray(ring).at[place].set(a) for ring, a in zip(rings, now, strict=True))


def frames_of(recording: RecentSteps, world: int) -> Frames:
    """The recorded steps of one world, oldest first: [T, ...]. On the host."""
    written, length = int(recording.written), recording.length
    order = np.arange(max(0, written - length), written) % length
    return jax.tree.unflatten(recording.kind, [np.asarray(ring[:, world])[order] for ring in recording.rings])


def save_dump(
    frames: Frames,
    file: str | os.PathLike,
    scene: str,
    note: dict[str, Any],
    model: mujoco.MjModel | None = None,
) -> None:
    """Writes a dump.

    Args:
      note: world, flags, and whatever helps to understand it.
      model: of the scene with its agents; None: the dump can be loaded, but not replayed.
    """
    binary = np.zeros(0 if model is None else mujoco.mj_sizeModel(model), np.uint8)
    if model is not None:
        mujoco.mj_saveModel(model, None, binary)
    save_tree(file, {"frames": frames, MODEL: binary}, {"kind": "dump", "scene": scene, **note})


def load_dump(file: str | os.PathLike, like: Frames, scene: str) -> tuple[Frames, dict[str, Any]]:
    """Reads a dump of the scene, of the shapes of `like`, to go on from it. Raises InputError."""
    check_dump(file, scene)
    tree, header = load_tree(file, {"frames": like, MODEL: np.zeros(0, np.uint8)}, "frames.")
    return tree["frames"], header


def read_dump(file: str | os.PathLike, scene: str) -> tuple[Snapshot, mujoco.MjModel, dict[str, Any]]:
    """Physics of a dump [T], the model it was recorded with, and the header, to look at. Raises InputError."""
    header = check_dump(file, scene)
    arrays = read_arrays(file, "frames.physics.")
    binary = read_arrays(file, MODEL).get("", np.zeros(0, np.uint8))
    if not len(binary):
        raise InputError(file, "is missing", element=MODEL, fix="record it again")
    if binary.dtype != np.uint8:
        raise InputError(file, f"is of type {binary.dtype}, and not of bytes", element=MODEL, fix="record it again")
    try:
        model = mujoco.MjModel.from_binary_path("dump.mjb", assets={"dump.mjb": binary.tobytes()})
    except ValueError as e:
        raise InputError(file, f"MuJoCo cannot read it: {e}", element=MODEL, fix="use the MuJoCo of the run") from e
    check_lengths(arrays, file)
    _check_parts(arrays, model, file)
    return build(Snapshot, arrays, file), model, header


def _check_parts(arrays: Mapping[str, np.ndarray], model: mujoco.MjModel, file: str | os.PathLike) -> None:
    """Refuses arrays of scene and agents that, put together, are not the model's. Raises InputError."""
    widths = {"qpos": model.nq, "qvel": model.nv, "act": model.na, "ctrl": model.nu, "qacc_warmstart": model.nv}
    widths |= {"eq_active": model.neq, "tree_asleep": model.ntree}
    shapes = {name: (width,) for name, width in widths.items()}
    shapes |= {"eq_data": (model.neq, 12), "mocap_pos": (model.nmocap, 3), "mocap_quat": (model.nmocap, 4)}
    first = {"qacc_warmstart": "qvel", "eq_data": "eq_active", "mocap_quat": "mocap_pos"}
    for name, shape in shapes.items():
        scene, agents = (arrays.get(f"{part}.{name}") for part in ("scene", "agents"))
        twin = arrays.get(f"scene.{first.get(name, name)}")
        if scene is None or agents is None or twin is None:
            raise InputError(file, "is missing", element=f"frames.physics.scene.{name}", fix="record it again")
        fits = scene.ndim == agents.ndim == len(shape) + 1 and scene.shape[:2] == twin.shape[:2]
        fits = fits and (scene.shape[1] + agents.shape[1], *scene.shape[2:]) == shape == (*shape[:1], *agents.shape[2:])
        if not fits:
            problem = f"has shapes {scene.shape} and {agents.shape}, which do not make {('steps', *shape)}"
            raise InputError(file, problem, element=f"frames.physics.scene.{name}", fix="record it again")


def check_dump(file: str | os.PathLike, scene: str) -> dict[str, Any]:
    """The header of a dump of the scene. Raises InputError."""
    header = read_header(file)
    if header.get("kind") != "dump" or header.get("scene") != scene:
        raise InputError(
            file,
            f"is a {header.get('kind')} of scene '{header.get('scene')}', not a dump of '{scene}'",
            fix="give the scene it was dumped from",
        )
    return header


def _now(engine: Engine, batch: Batch) -> Frames:
    return Frames(engine.snapshot(batch.world.physics), batch.world.states)
