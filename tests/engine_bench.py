"""The bench scene on an engine, with its functions jitted once and shared by all tests of a run."""

from __future__ import annotations

import copy
import functools
import pathlib
from typing import Any

import bench_scene
import jax
import numpy as np

import ig2mj
from ig2mj.engine.base import Engine, Write
from ig2mj.engine.registry import make_engine
from ig2mj.engine.snapshot import Snapshot
from ig2mj.scene.scene import Scene


class Bench:
    """An engine of a few worlds of a scene; `step`, `write`, `load` and `view` as the engine's, jitted where pure."""

    def __init__(self, scene: Scene, name: str, num_worlds: int, **options: Any):
        self.scene = scene
        self.engine: Engine = make_engine(name, scene, num_worlds, **options)
        self._wrap = jax.jit if self.engine.pure else (lambda function: function)
        self.step, self.write = self._wrap(self.engine.step), self._wrap(self.engine.write)
        self.load, self.view = self._wrap(self.engine.load), self._wrap(self.engine.view)
        physics = self.engine.reset()
        self.first: Snapshot = self.engine.export(physics, 0)
        self._blank = physics

    @property
    def num_worlds(self) -> int:
        return self.engine.num_worlds

    def fresh(self, row: Snapshot | None = None) -> Any:
        """All worlds at a snapshot of one world; None: at the scene's start."""
        if row is None:
            return self.engine.reset() if not self.engine.pure else self._blank
        return self.load(self._blank if self.engine.pure else self.engine.reset(), self.every(row))

    def every(self, row: Snapshot) -> Snapshot:
        """The snapshot in every world, so that `load` is compiled for one shape only."""
        return jax.tree.map(lambda a: np.repeat(np.asarray(a)[None], self.num_worlds, axis=0), row)

    def run(self, physics: Any, steps: int, ctrl: np.ndarray | None = None) -> tuple[Any, Any]:
        """Takes control steps; gives physics and the last view."""
        view = None
        for _ in range(steps):
            physics, view = self.step(physics, ctrl)
        return physics, view

    @functools.cached_property
    def physics_step(self) -> Any:
        """A single physics step of 1/120 s; of the MJX engines (compiled when first asked for)."""
        single = copy.copy(self.engine)
        single.substeps = 1
        return self._wrap(single.step)

    def teleport(self, name: str, pos: Any, quat: Any = (1, 0, 0, 0), worlds: Any = None) -> Write:
        """A write that puts an object somewhere, in the worlds given (all)."""
        count, index = len(self.scene.object_names), self.scene.object_index(name)
        chosen = np.ones(self.num_worlds, bool) if worlds is None else np.isin(np.arange(self.num_worlds), worlds)
        mask = np.zeros((self.num_worlds, count), bool)
        mask[:, index] = chosen
        at, turn = np.zeros((self.num_worlds, count, 3), np.float32), np.zeros((self.num_worlds, count, 4), np.float32)
        at[:, index], turn[..., 0] = pos, 1
        turn[:, index] = quat
        return Write(object_mask=mask, object_pos=at, object_quat=turn)

    def switch(self, on: dict[str, Any]) -> Write:
        """A write of `eq_active`: by weld, the worlds where it is on."""
        active = np.zeros((self.num_worlds, self.scene.model.neq), bool)
        for name, worlds in on.items():
            active[list(worlds), self.scene.model.equality(name).id] = True
        return Write(eq_active=active)

    def index(self, name: str) -> int:
        return self.scene.object_index(name)

    def z(self, view: Any, name: str) -> np.ndarray:
        """Heights [W] of an object's frame."""
        return np.asarray(view.object_pos)[:, self.index(name), 2]

    def touches(self, view: Any, one: str, other: str) -> np.ndarray:
        """[W] whether two objects touch."""
        touching = np.asarray(view.touching)
        a, b = self.index(one), self.index(other)
        assert (touching[:, a, b] == touching[:, b, a]).all()
        return touching[:, a, b]

    def awake(self, view: Any, name: str) -> np.ndarray:
        """[W] whether an object is awake."""
        return np.asarray(view.awake)[:, self.index(name)]


@functools.cache
def bench_home(folder: pathlib.Path, small: bool, **flags: str) -> Scene:
    """The bench scene, loaded; with its hand unless it is the small one."""
    name = "_".join(["small" if small else "bench", *flags.values()])
    written = bench_scene.write_bench(folder / name, small, **flags)
    return ig2mj.load_scene(written, [] if small else [bench_scene.add_pusher])


@functools.cache
def bench(folder: pathlib.Path, name: str, num_worlds: int = 2, small: bool = True) -> Bench:
    """The bench on an engine; made once."""
    return Bench(bench_home(folder, small), name, num_worlds)
