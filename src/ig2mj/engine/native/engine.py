"""The native engine: C MuJoCo with sleeping, one world or many on a thread pool.

Each world has its own MjData and is stepped by one thread from start to end, so that results are the same, bit for
bit, for any number of threads and of worlds. (`mujoco.batch.Batch` steps as fast, but gives neither contacts nor a way
to put a saved sleep state back; both are needed here.)

After a control step positions, contacts and boxes belong to one instant: `mj_step` leaves derived quantities one
physics step behind, so a control step is `mj_step2`, three times `mj_step`, `mj_step1`. That costs no more than four
`mj_step`.
"""

from __future__ import annotations

import copy
import dataclasses
import functools
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import jax
import mujoco
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.engine.base import Write, whole_number
from ig2mj.engine.contact_filter import BitLayers
from ig2mj.engine.controls import check_shape
from ig2mj.engine.health import Health
from ig2mj.engine.layout import ModelLayout, make_layout
from ig2mj.engine.model_fields import check_written, given
from ig2mj.engine.native.contacts import ForcePlan
from ig2mj.engine.native.execution import HostExecution
from ig2mj.engine.native.lazy_fields import RAW, LazyPlan
from ig2mj.engine.native.model_slot import ModelSlot
from ig2mj.engine.native.one_world import NativeWorld, Statics
from ig2mj.engine.native.physics import LiveWorlds, NativePhysics
from ig2mj.engine.native.recorded import Cut, Pieces
from ig2mj.engine.native.view_rows import FIELDS, Changed, PoseRows
from ig2mj.engine.native.writing import apply_write
from ig2mj.engine.object_boxes import make_box_table
from ig2mj.engine.saved import SavedPhysics
from ig2mj.engine.scene_engine import SceneEngine
from ig2mj.engine.snapshot import Snapshot, fitted
from ig2mj.engine.speed_limits import SpeedLimits
from ig2mj.engine.view import SCHEMA, Array, PhysicsView, axis_sizes
from ig2mj.errors import EngineError, LostWorldError
from ig2mj.process import prepare_mujoco
from ig2mj.process.processors import available
from ig2mj.scene.scene import Scene


class NativeEngine(HostExecution, SceneEngine):
    """C MuJoCo behind the `Engine` protocol (see `ig2mj.engine.base`).

    Views hold float32 numpy arrays that are not changed afterwards. Where nothing changed since the last view, the same
    object is given again, and an array that did not change is the same array, so that `is` tells what may be skipped.
    """

    name = "native"
    pure = False
    live = reproducible = tracks_changes = True
    renderer = "opengl"

    def __init__(
        self,
        scene: Scene,
        num_worlds: int = 1,
        *,
        threads: int | None = None,
        incremental: bool = True,
        **options: Any,
    ):
        """Makes an engine.

        Args:
          scene, num_worlds, options: see `SceneEngine`.
          threads: how many to step worlds on; None: one per processor, and no more than worlds.
          incremental: work that cannot change anything is skipped, in physics and in the states of the worlds that are
            stepped with this engine (`ig2mj.worlds.incremental`). Results are the same to the bit.

        Raises:
          EngineError: an argument is out of range.
        """
        super().__init__(scene, num_worlds, **options)
        prepare_mujoco()
        if threads is not None:
            whole_number("threads", threads)
        self.incremental = incremental
        self.threads = min(threads or available(), num_worlds)
        self._slots = [ModelSlot(_engine_model(scene.model, self.timestep)) for _ in range(self.threads)]
        model = self._slots[0].model
        self.layout: ModelLayout = make_layout(model, self.tables)
        self._statics = Statics(
            tables=self.tables,
            layout=self.layout,
            poses=PoseRows(
                self.tables,
                self.layout,
                make_box_table(self.boxes, model, self.tables, self.layout),
                np.asarray(model.body_treeid, int),
            ),
            lazy=LazyPlan.build(model, self.tables, self.layout, self.touch_tolerance),
            has_agents=len(self.tables.agent_names) > 0,
            layers=BitLayers(model, self.tables),
            forces=ForcePlan.build(
                self.layout,
                self.tables.geom_object,
                model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL,
                (len(self.tables.finger_body), len(self.tables.graspable_body)),
            ),
            speed_limits=SpeedLimits(model, self.tables.body_agent),
            tolerance=self.touch_tolerance,
            own_fields=self.model_fields,
            substeps=range(self.substeps),
            incremental=incremental,
        )
        self._free_dofs = self.layout.object_linear_dofs
        self._shares = np.array_split(np.arange(num_worlds), self.threads)
        self._pool = ThreadPoolExecutor(self.threads, "ig2mj-native") if self.threads > 1 else None

    @property
    def cannot_ignore(self) -> str:
        """See `Engine.cannot_ignore`."""
        return self._statics.layers.full

    def pending_reset_program(self) -> None:
        """See `Engine.pending_reset_program`."""

    def reset(self) -> NativePhysics:
        """New worlds at the scene's initial state: its first keyframe, else the zero pose; everything awake."""
        live = self._new_worlds()
        live.update(self._run(live, NativeWorld.start))
        return live.current()

    def _new_worlds(self) -> LiveWorlds:
        arrays = self._working_arrays(self.num_worlds)
        worlds = [
            NativeWorld(self._statics, self._slots[share], {n: a[w] for n, a in arrays.items()}, int(w))
            for share, numbers in enumerate(self._shares)
            for w in numbers
        ]
        return LiveWorlds(worlds, arrays, self._statics)

    def first_world(self, initial: Snapshot | None = None) -> tuple[Snapshot, PhysicsView]:
        """What `reset` makes of one world; see `Engine.first_world`.

        Args:
          initial: a snapshot of one world, or of its bare scene, to be there instead.
        """
        physics = self.reset()
        row = self.export(physics, 0)
        if initial is not None:
            row = fitted(initial, row, 1, self.scene.name)
            physics = self.load(physics, row)
        return row, jax.tree.map(lambda a: np.array(a[:1]), self.view(physics))

    @functools.cached_property
    def _start(self) -> Snapshot:
        """World 0 of a reset."""
        rows = {name: array[0] for name, array in self._working_arrays(1).items()}
        world = NativeWorld(self._statics, self._slots[0], rows, 0)
        self._slots[0].put(world.fields)
        world.start()
        return world.save()

    def step(
        self, physics: NativePhysics, ctrl: Float[Array, "W nu"] | None = None
    ) -> tuple[NativePhysics, PhysicsView]:
        """One control step of every world; see `Engine.step`. Raises LostWorldError where a world is no longer finite,
        after the others were stepped, which continue with the same physics and its view."""
        live: Any = physics._live
        if live.generation != physics.generation or live.statics is not self._statics:  # inline: rest takes under 2 us
            live = self._live(physics)
        if ctrl is None:
            if self.num_worlds == 1:  # by far the most frequent case, in which a list would be a fifth of the time
                if live.worlds[0].only_time_passes():
                    live.generation = generation = physics.generation + 1  # `live.changed()`
                    return NativePhysics(live, generation), live.view
                moving = [True]
            else:
                moving = [not world.only_time_passes() for world in live.worlds]
                if not any(moving):
                    return live.changed(), live.view
            changed = self._run(live, lambda w: Changed.NOTHING if w.lost or not moving[w.number] else w.step(None))
        else:
            rows = np.asarray(ctrl, np.float64)
            check_shape(rows, self.num_worlds, self._slots[0].model.nu)
            changed = self._run(live, lambda w: Changed.NOTHING if w.lost else w.step(rows[w.number]))
        view = live.update(changed)
        for world in live.worlds:
            if world.lost:
                raise LostWorldError(world.lost)
        return live.changed(), view

    def view(self, physics: NativePhysics) -> PhysicsView:
        """The view of the present state; the same object as the last one when nothing changed."""
        return self._live(physics).update(Changed.NOTHING)

    def time(self, physics: NativePhysics) -> Float[np.ndarray, "W"]:
        """Simulated seconds since each world's reset."""
        return np.array([world.data.time for world in self._live(physics).worlds])

    def write(self, physics: NativePhysics, write: Write) -> NativePhysics:
        """Applies a change in place, except to worlds that are no longer finite; see `Engine.write`."""
        live = self._live(physics)
        check_written(write.model_fields, self._statics.own_fields, self._slots[0].model, self.num_worlds)
        values = {field.name: getattr(write, field.name) for field in dataclasses.fields(Write)}
        values |= {"model_fields": None} | given(write.model_fields)
        rows = {name: np.asarray(value) for name, value in values.items() if value is not None}
        if "eq_data" in rows:
            rows["eq_data"] = self._in_double_precision(rows["eq_data"])

        def apply(world: NativeWorld) -> int:
            if world.lost:
                return Changed.NOTHING
            return apply_write(world, {name: value[world.number] for name, value in rows.items()})

        live.update(self._run(live, apply))
        return live.changed()

    def _in_double_precision(self, eq_data: np.ndarray) -> np.ndarray:
        """Parameters of constraints [W, E, n] with the compiled numbers where they equal their float32 values.
        Otherwise a write for one hand of one world would change the constraints of all."""
        compiled = self._slots[0].own("eq_data")
        return np.where(eq_data == compiled.astype(np.float32), compiled, eq_data)

    def prepare_devices(self, devices: Sequence[Any]) -> None:
        """Does nothing: worlds are on the processor."""

    def health(self, physics: NativePhysics) -> Health:
        """What went wrong in each world; see `ig2mj.engine.health`. C MuJoCo's buffers grow: nothing overflows."""
        count, worlds = self.num_worlds, self._live(physics).worlds
        velocity = np.empty((count, *self._free_dofs.shape), np.float32)
        positions = np.empty((count, self._slots[0].model.nq))
        wrong, lost = np.zeros(count, bool), np.zeros(count, bool)
        for row, world in enumerate(worlds):
            velocity[row], positions[row] = world.data.qvel[self._free_dofs], world.data.qpos
            wrong[row], lost[row] = world.wrong_controls, bool(world.lost)
        squares = np.einsum("wnk,wnk->wn", velocity, velocity)
        return Health(
            overflow=np.zeros(count, np.int32),
            finite=np.asarray(np.isfinite(positions).all(1) & np.isfinite(velocity).all((1, 2)) & ~lost),
            top_speed=np.sqrt(squares.max(1, initial=0.0)),
            wrong_controls=wrong,
        )

    def snapshot(self, physics: NativePhysics) -> Snapshot:
        """All worlds as a snapshot with the world axis."""
        rows = [world.save() for world in self._live(physics).worlds]
        return jax.tree.map(lambda *arrays: np.stack(arrays), *rows)

    def export(self, physics: NativePhysics, world: int) -> Snapshot:
        """One world as a snapshot in float64 numpy arrays of its own."""
        return self._live(physics).worlds[world].save()

    def gather(self, physics: NativePhysics, tree: Any, worlds: Sequence[int]) -> Callable[[], tuple[Snapshot, Any]]:
        """See `Engine.gather`: copied at once."""
        every = [self.export(physics, world) for world in worlds]
        index = np.asarray(worlds, np.int64)
        rows = (
            jax.tree.map(lambda *arrays: np.stack(arrays), *every),
            jax.tree.map(lambda a: np.asarray(a)[index], tree),
        )
        return lambda: rows

    @functools.cached_property
    def _pieces(self) -> Pieces:
        return Pieces(self._slots[0].model, self.layout, self._statics.own_fields)

    @property
    def frame_cuts(self) -> list[Cut]:
        """See `Engine.frame_cuts`."""
        return self._pieces.cuts

    def frame(self, physics: NativePhysics, worlds: Sequence[int]) -> tuple[list[list[np.ndarray]], list[np.ndarray]]:
        """See `Engine.frame`: as `export`, in a fraction of its time."""
        every = self._live(physics).worlds
        return [self._pieces(every[world]) for world in worlds], []

    def load(self, physics: NativePhysics, snapshot: Snapshot, mask: Bool[Array, "W"] | None = None) -> NativePhysics:
        """Replaces worlds in place; see `Engine.load`. Raises EngineError where the snapshot is of another scene."""
        live = self._live(physics)
        snapshot = jax.tree.map(np.asarray, fitted(snapshot, self._start, self.num_worlds, self.scene.name))
        batched = snapshot.time.ndim == 1
        chosen = np.ones(self.num_worlds, bool) if mask is None else np.asarray(mask, bool)

        def replace(world: NativeWorld) -> int:
            if not chosen[world.number]:
                return Changed.NOTHING
            return world.load(jax.tree.map(lambda a: np.asarray(a[world.number]), snapshot) if batched else snapshot)

        live.update(self._run(live, replace))
        return live.changed()

    # Copies.

    def check(self, physics: NativePhysics) -> None:
        """Raises StaleStateError where the worlds have changed since this handle was returned."""
        self._live(physics)

    def worlds(self, physics: NativePhysics) -> list[NativeWorld]:
        """The worlds of a handle. Raises StaleStateError."""
        return self._live(physics).worlds

    def current(self, physics: NativePhysics) -> NativePhysics:
        """See `Engine.current`."""
        return physics.current()

    def fork(self, physics: NativePhysics) -> NativePhysics:
        """See `Engine.fork`: every `MjData` is copied, so that both go on bit for bit alike."""
        return physics.fork()

    def saved(self, physics: NativePhysics) -> SavedPhysics:
        """See `Engine.saved`."""
        return self._live(physics).saved()

    def restored(self, saved: SavedPhysics) -> NativePhysics:
        """See `Engine.restored`. It goes on bit for bit as the saved physics; of a world that is lost only the poses
        are kept."""
        return self._restored(saved).current()

    def restored_view(self, physics: NativePhysics, saved: SavedPhysics) -> PhysicsView:
        """See `Engine.restored_view`: part of the restored worlds."""
        return self.view(physics)

    def _restored(self, saved: SavedPhysics) -> LiveWorlds:
        fitted(saved.snapshot, self._start, self.num_worlds, self.scene.name)
        live = self._new_worlds()
        live.restore(saved)
        return live

    def _live(self, physics: NativePhysics) -> LiveWorlds:
        live = physics.live(self._restored)
        if live.statics is not self._statics:
            raise EngineError(
                "this state is of another environment or engine: step it there; env.save and env.load take one across"
            )
        return live

    def _working_arrays(self, num_worlds: int) -> dict[str, np.ndarray]:
        """By field of the view; and objects' velocities, and what agents' fields are made of."""
        sizes = axis_sizes(self.tables, num_worlds)
        arrays = {name: np.zeros(SCHEMA[name].shape(sizes), SCHEMA[name].dtype) for name in FIELDS}
        arrays["qvel"] = np.zeros((num_worlds, self._slots[0].model.nv))
        arrays[RAW] = np.zeros((num_worlds, self._statics.lazy.raw.size))
        return arrays

    def to_mujoco(self, physics: NativePhysics, world: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """The live model and data of a world. Do not step them."""
        one = self._live(physics).worlds[world]
        one.model_slot.put(one.fields)
        return one.model, one.data

    def _run(self, live: LiveWorlds, act: Callable[[NativeWorld], int]) -> int:
        """Does something to every world, each share of the worlds on its own thread and with its own model."""

        failures: list[EngineError] = []
        if self._pool is None:
            changed = _act_on(live.worlds, act, failures)
        else:
            shares = [[live.worlds[w] for w in share] for share in self._shares]
            changed = Changed.NOTHING
            for part in self._pool.map(lambda share: _act_on(share, act, failures), shares):
                changed |= part
        if failures:
            live.update(changed)
            raise min(failures, key=str)
        return changed


def _act_on(worlds: list[NativeWorld], act: Callable[[NativeWorld], int], failures: list[EngineError]) -> int:
    """Does something to worlds of one thread; says what changed."""
    changed = Changed.NOTHING
    for world in worlds:
        world.model_slot.put(world.fields)
        try:
            changed |= act(world)
        except EngineError as e:  # the other worlds go on; the caller hears of it when all are done
            failures.append(e)
            changed = Changed.ALL
    return changed


def _engine_model(model: mujoco.MjModel, timestep: float) -> mujoco.MjModel:
    """A copy of the scene's model as the engine runs it: sleeping on, and no silent reset of a world gone wrong."""
    own = copy.copy(model)
    own.opt.timestep = timestep
    own.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP
    own.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET
    return own
