"""`Frame`: the complete state of worlds, and what each of its numbers belongs to.

Axes: W worlds, L literals of the goal.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct
from jaxtyping import Bool, Int, UInt

from ig2mj.engine.base import Engine
from ig2mj.engine.snapshot import Snapshot
from ig2mj.engine.view import Array
from ig2mj.envs.environment import Environment, EnvState
from ig2mj.scene.scene import Scene
from ig2mj.states.world import ExtendedStates
from ig2mj.worlds.draw import Draw
from ig2mj.worlds.plugin_states import plugin_defaults


@struct.dataclass
class Frame:
    """State of all worlds at one instant; the world axis is the first of every array.

    Attributes:
      physics, states: of the worlds. controllers: state of the robots' controllers. grasps: what hands hold.
      measures: quantities of the task's reward. goal: truth of each literal of the goal.
      key: random key of the episode. step: control steps since its start. flags: `ig2mj.worlds.guards.Flag`.
      draw: what was drawn for the episode.
    """

    physics: Snapshot
    states: ExtendedStates
    controllers: tuple[Any, ...]
    grasps: Any
    measures: Any
    goal: Bool[Array, "W L"]
    key: UInt[Array, "W 2"]
    step: Int[Array, "W"]
    flags: Int[Array, "W"]
    draw: Draw = Draw()


def frame_of(engine: Engine, state: EnvState) -> Frame:
    """The frame of an environment's state; arrays stay on the engine's device."""
    return Frame(engine.snapshot(state.batch.world.physics), *_besides_physics(state))


def _besides_physics(state: EnvState) -> tuple[Any, ...]:
    batch, world = state.batch, state.batch.world
    remembered = (world.states, batch.controllers, batch.grasps, state.measures)
    return (*remembered, state.status.literals, world.key, world.step, batch.flags, batch.draw)


class FrameRows:
    """Frames of an environment as arrays on the host, for `RunWriter`.

    Attributes:
      own: names and places of the arrays that each world gives separately; batched: names of those with a world axis.
        Together they are `names_of(frame_of(...))`, in its order.
    """

    def __init__(self, engine: Engine, worlds: Sequence[int], like: EnvState):
        """`worlds`: indices of the recorded worlds. `like`: any state."""
        self._engine, self._worlds = engine, list(worlds)
        names = names_of(frame_of(engine, like))
        cuts = engine.frame_cuts
        self.own, self.batched = dict(zip(names, cuts, strict=False)), names[len(cuts) :]

    def __call__(self, state: EnvState) -> tuple[list[list[np.ndarray]], list[Any]]:
        """Pieces of each recorded world, and arrays of all worlds; they are not changed later. Where a step uses up
        the arrays of the one before, they are copied."""
        own, batched = self._engine.frame(state.batch.world.physics, self._worlds)
        return own, [*batched, *self._engine.kept(jax.tree.leaves(_besides_physics(state)))]

    def rows(self, state: EnvState) -> list[list[np.ndarray]]:
        """The same, as all arrays of each recorded world."""
        own, batched = self(state)
        arrays, found = [np.asarray(array) for array in batched], []
        for k, w in enumerate(self._worlds):
            found.append([cut(own[k][cut.piece][None])[0, ...] for cut in self.own.values()])
            found[k] += [array[w, ...] for array in arrays]
        return found


def resumed(env: Environment, frame: Frame, rows: Int[np.ndarray, "W"], used: EnvState | None = None) -> EnvState:
    """An environment's state that continues from a frame of all its worlds, as if it had never stopped.

    Args:
      rows: of the pool, with which the worlds' episodes began.
      used: a state of this environment that is no longer stepped. Its worlds are reused, which takes a fraction of the
        time of new ones.
    """
    batch = env.core.start() if used is None else used.batch
    batch = dataclasses.replace(
        batch, controllers=jax.tree.map(jnp.asarray, frame.controllers)
    )  # the view depends on camera poses
    batch = env.core.load(batch, frame.physics, jax.tree.map(jnp.asarray, frame.states))
    seconds = jnp.float32(env.core.engine.substeps * env.core.engine.timestep)
    step = jnp.asarray(frame.step)
    world = dataclasses.replace(batch.world, key=jnp.asarray(frame.key), step=step, time=step * seconds)
    batch = dataclasses.replace(
        batch,
        world=world,
        grasps=jax.tree.map(jnp.asarray, frame.grasps),
        flags=jnp.asarray(frame.flags),
        draw=jax.tree.map(jnp.asarray, frame.draw),
    )
    state = env.resume(batch, rows)
    return dataclasses.replace(state, measures=jax.tree.map(jnp.asarray, frame.measures))


def names_of(tree: Any) -> list[str]:
    """Names of a pytree's leaves, with slashes: "physics/scene/qpos"."""
    found = jax.tree_util.tree_flatten_with_path(tree)[0]
    return [jax.tree_util.keystr(keys, simple=True, separator="/") for keys, _ in found]


class Labels:
    """Names what a number of a frame belongs to: an object, a joint, a hand."""

    def __init__(self, scene: Scene):
        """Reads names from the compiled model."""
        self._scene, model = scene, scene.model
        self._objects = list(scene.object_names)
        joint_of = [model.joint(int(j)).name for j in model.dof_jntid]
        widths = {0: 7, 1: 4}
        qpos = [model.joint(j).name for j in range(model.njnt) for _ in range(widths.get(int(model.jnt_type[j]), 1))]
        trees = ["" for _ in range(model.ntree)]
        for body in range(model.nbody - 1, 0, -1):
            if model.body_treeid[body] >= 0:
                trees[model.body_treeid[body]] = model.body(body).name
        equalities = [model.equality(e).name for e in range(model.neq)]
        actuators = [model.actuator(a).name for a in range(model.nu)]
        whole = {"qpos": qpos, "qvel": joint_of, "qacc_warmstart": joint_of, "tree_asleep": trees}
        self._whole = whole | {"eq_active": equalities, "eq_data": equalities, "ctrl": actuators}
        self._hands = [model.body(int(b)).name for b in scene.tables.hand_body]

    def __call__(self, field: str, index: tuple[int, ...], shape: tuple[int, ...]) -> str:
        """Name for the number at `index` of a field of one world with this `shape`; "" without one."""
        name, first = field.rpartition("/")[2], index[0] if index else 0
        if field.startswith("physics/") and name in self._whole:
            names = self._whole[name]
            at = first + (len(names) - shape[0] if "/agents/" in field else 0)
            return names[at] if at < len(names) else ""
        if name == "ignored_contacts":
            return f"{self._hands[first]}, {self._objects[index[1]]}"
        if field.startswith("states/") and shape and shape[0] == len(self._objects):
            return self._objects[first]
        if field.startswith("grasps/") and shape and shape[0] == len(self._hands):
            return self._hands[first]
        return ""


@dataclasses.dataclass(frozen=True)
class Difference:
    """The first number that differs. `world`: of the batch. `frame`: of the run. `owner`: an object, joint or hand."""

    run: str
    frame: int
    field: str
    owner: str
    index: tuple[int, ...]
    recorded: float
    found: float

    def __str__(self) -> str:
        of = f" of {self.owner}" if self.owner else ""
        at = f"[{', '.join(map(str, self.index))}]" if self.index else ""
        values = f"{self.recorded!r} is recorded, {self.found!r} came out"
        return f"{self.run}, frame {self.frame}: {self.field}{at}{of}: {values}"


def plugin_columns(initial: ExtendedStates | None, recorded: Collection[str]) -> dict[str, np.ndarray]:
    """Arrays [1, ...] of plug-ins' states that a recording lacks, as worlds begin with them, by name.

    Args:
      initial: states of a world at its start. recorded: names of the recording's arrays of the world.
    """
    every = {name.replace(".", "/"): rows for name, rows in plugin_defaults(initial, 1).items()}
    return {name: rows for name, rows in every.items() if name not in recorded}


def first_difference(
    labels: Labels,
    run: str,
    frame: int,
    names: list[str],
    recorded: list[np.ndarray],
    found: list[np.ndarray],
    left_out: Collection[str] = (),
) -> Difference | None:
    """Of two frames of one world, compared byte by byte but for arrays `left_out`; None where they are the same."""
    for name, a, b in zip(names, recorded, found, strict=True):
        if name in left_out:
            continue
        if a.shape == b.shape and a.dtype == b.dtype and a.tobytes() == b.tobytes():
            continue
        if a.shape != b.shape:
            return Difference(run, frame, name, "", (), float(a.size), float(b.size))
        raw = [np.ascontiguousarray(x).reshape(-1).view(np.uint8).reshape(max(x.size, 1), -1) for x in (a, b)]
        if a.dtype != b.dtype:
            return Difference(run, frame, f"{name} ({a.dtype}, here {b.dtype})", "", (), 0.0, 0.0)
        place = int(np.flatnonzero((raw[0] != raw[1]).any(1))[0])
        index = tuple(int(i) for i in np.unravel_index(place, a.shape)) if a.shape else ()
        owner = labels(name, index, a.shape)
        return Difference(run, frame, name, owner, index, float(a[index]), float(b[index]))
    return None


def stacked(rows: list[list[np.ndarray]]) -> list[np.ndarray]:
    """Arrays with a world axis, from those of each world."""
    return [np.stack(each) for each in zip(*rows, strict=True)]
