"""What the two MJX engines share: physics as a pytree, control steps, writes, snapshots. Pure functions under JAX.

A batch is MJX data whose arrays begin with the world axis. Kinematics are computed for every body in every step, so
positions, sleep and a few more arrays are all of a world's state: replacing a world replaces just these.
"""

from __future__ import annotations

import abc
import copy
import dataclasses
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int
from mujoco import mjx

from ig2mj.engine.base import GATHERED, Write
from ig2mj.engine.controls import check_shape, clip
from ig2mj.engine.health import Health
from ig2mj.engine.layout import ModelLayout, make_layout
from ig2mj.engine.mjx.contacts import Contacts, larger_forces, no_forces, touching_units, without_ignored
from ig2mj.engine.mjx.copying import MjxCopies
from ig2mj.engine.mjx.execution import TracedExecution
from ig2mj.engine.mjx.physics import STATE_FIELDS, MjxPhysics, all_units, fresh, mujoco_of, uncommitted
from ig2mj.engine.mjx.view import Moved, ViewPlan, make_view, plan_view
from ig2mj.engine.mjx.writing import after_release, apply_write, reaches, trees_joined, with_islands
from ig2mj.engine.model_fields import MOVING, POSES, ModelFields, check_written, given, merged, own_fields
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.native.sleep import FULLY_AWAKE
from ig2mj.engine.packed_rows import PackedRows
from ig2mj.engine.scene_engine import SceneEngine
from ig2mj.engine.snapshot import Snapshot, fitted, make_snapshot
from ig2mj.engine.speed_limits import SpeedLimits
from ig2mj.engine.view import Array, PhysicsView
from ig2mj.errors import EngineError
from ig2mj.process import entry_point
from ig2mj.process.gc_pause import Compiled, Traced
from ig2mj.scene.scene import Scene


@entry_point
class MjxEngine(TracedExecution, MjxCopies, SceneEngine, abc.ABC):
    """The `Engine` protocol on MJX; subclasses choose the implementation. See `ig2mj.engine.base`.

    Contacts of the view are those of the last physics step, of positions 1/120 s before the poses, as in iGibson.
    """

    name: str
    pure = True
    live = reproducible = tracks_changes = False
    renderer = ""
    cannot_ignore: str = ""
    frame_cuts: Sequence[Any] = ()
    unrolled = True
    """Substeps are written out one after the other: no copies at a loop's border, but as often compiled."""

    def __init__(
        self,
        scene: Scene,
        num_worlds: int = 1,
        *,
        initial: Snapshot | None = None,
        **options: Any,
    ):
        """Makes an engine.

        Args:
          scene, num_worlds, options: see `SceneEngine`.
          initial: where `reset` starts every world, without the world axis; None: the scene's initial state.

        Raises:
          EngineError: an argument is out of range, or MJX cannot run the scene.
        """
        super().__init__(scene, num_worlds, **options)
        self.host_model = self._host_model(scene.model)
        self.layout: ModelLayout = make_layout(self.host_model, self.tables)
        self.plan: ViewPlan = plan_view(self.host_model, self.tables, self.layout, self.boxes)
        # C MuJoCo's start: all engines begin alike, and MJX need not compile a forward pass.
        same = {name: getattr(self, name) for name in ("timestep", "touch_tolerance", "boxes", "model_fields")}
        self._initial, self._first_view = NativeEngine(scene, **same).first_world(initial)
        self._speed_limits = SpeedLimits(self.host_model, self.tables.body_agent)
        self._pyramidal = self.host_model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL
        try:
            self.model = uncommitted(self._put_model(self.host_model))
            self._template = uncommitted(self._put_data(self.host_model, self._host_data()))
        except (NotImplementedError, ValueError) as e:
            raise EngineError(f"MJX ({self.name}) cannot run scene '{scene.name}': {e}") from e
        # One program each, not hundreds of little ones; and what several programs contain is traced once.
        self._first = Compiled(self._start_all)
        self._row = jax.jit(lambda physics, world: jax.tree.map(lambda a: a[world], self.snapshot(physics)))
        self._gathered = PackedRows(lambda physics, tree: (self.snapshot(physics), tree))
        self._view, self._placed = jax.jit(self._make_view), jax.jit(self._kinematics)
        self._mapped = jax.jit(self._map, static_argnums=0)

    # What the implementations differ in.

    @abc.abstractmethod
    def _put_model(self, model: mujoco.MjModel) -> mjx.Model: ...

    @abc.abstractmethod
    def _put_data(self, model: mujoco.MjModel, data: mujoco.MjData) -> mjx.Data: ...

    @abc.abstractmethod
    def _contacts(self, data: mjx.Data) -> Contacts: ...

    @abc.abstractmethod
    def _efc_force(self, data: mjx.Data) -> Float[Array, "W N"]: ...

    @abc.abstractmethod
    def _tree_asleep(self, data: mjx.Data) -> Int[Array, "W T"]: ...

    @abc.abstractmethod
    def _with_sleep(self, data: mjx.Data, asleep: Int[Array, "W T"], awake: Bool[Array, "W T"]) -> mjx.Data: ...

    def _replaced(self, data: mjx.Data, chosen: Bool[Array, "W"]) -> mjx.Data:
        """The data with a note that positions of these worlds were replaced, where an engine needs one."""
        return data

    @abc.abstractmethod
    def _overflow(self, data: mjx.Data) -> Int[Array, "W"]: ...

    @abc.abstractmethod
    def _act(self, act: Any, model: mjx.Model, data: mjx.Data, ignored: Bool[Array, "H O"] | None) -> mjx.Data:
        """A function of MJX on one world, with the contacts that are ignored dropped."""

    # The protocol.

    @abc.abstractmethod
    def prepare_devices(self, devices: Sequence[Any]) -> None: ...

    @abc.abstractmethod
    def pending_reset_program(self) -> Traced | None: ...

    def reset(self) -> MjxPhysics:
        """All worlds at the initial state."""
        return self._first(self._template, self._initial)

    def first_world(self) -> tuple[Snapshot, PhysicsView]:
        """What `reset` makes of one world, by C MuJoCo; see `Engine.first_world`."""
        return self._initial, self._first_view

    def step(self, physics: MjxPhysics, ctrl: Float[Array, "W nu"] | None = None) -> tuple[MjxPhysics, PhysicsView]:
        """One control step of every world; see `Engine.step`."""
        data = fresh(physics).data
        wrong_controls = physics.wrong_controls
        if ctrl is not None:
            check_shape(ctrl, self.num_worlds, self.host_model.nu)
            clipped, wrong = clip(jnp.asarray(ctrl, jnp.float32), data.ctrl)
            data, wrong_controls = data.replace(ctrl=clipped), wrong_controls | wrong

        def substep(carry: Any, _: Any) -> tuple[Any, None]:
            data, forces, overflow, _ = carry
            awake = self._tree_asleep(data) < 0
            data = self._mapped(mjx.step, self.model, data, physics.fields, physics.ignored)
            made = self._contacts(data), self._efc_force(data)
            forces = larger_forces(forces, *made, self.layout, self.tables, self._pyramidal)
            data = data.replace(qvel=self._speed_limits.limited(data.qvel))
            return (data, forces, overflow | self._overflow(data), awake), None

        carry = (data, no_forces(self.tables, self.num_worlds), physics.overflow, self._tree_asleep(data) < 0)
        if self.unrolled:
            for _ in range(self.substeps):
                carry, _ = substep(carry, None)
        else:
            carry, _ = jax.lax.scan(substep, carry, length=self.substeps)
        data, (link_force, finger_force), overflow, awake = carry
        touching = self._touching(data, physics.touching, awake)
        data = self._placed(data, _poses(physics.fields))
        physics = dataclasses.replace(
            physics,
            data=data,
            touching=touching,
            link_force=link_force,
            finger_force=finger_force,
            overflow=overflow,
            wrong_controls=wrong_controls,
        )
        return physics, self.view(physics)

    def view(self, physics: MjxPhysics) -> PhysicsView:
        """The view of the present state."""
        return self._view(fresh(physics))

    def time(self, physics: MjxPhysics) -> Float[Array, "W"]:
        """Simulated seconds since each world's reset."""
        return fresh(physics).data.time

    def write(self, physics: MjxPhysics, write: Write) -> MjxPhysics:
        """Applies a change; see `Engine.write`.

        Changes of constraints and of ignored contacts alone cost next to nothing, since no position depends on them.
        Everything else costs a forward pass of all worlds where any world is written to.
        """
        data, old = fresh(physics).data, given(physics.fields)
        asleep = jnp.asarray(self._tree_asleep(data))
        qpos, qvel, woken = apply_write(self.layout, self.host_model, data.qpos, data.qvel, write)
        eq_active, ignored = after_release(self.layout, write, data.eq_active, physics.ignored)
        check_written(write.model_fields, self.model_fields, self.host_model, self.num_worlds)
        fields = jax.tree.map(
            lambda a, old: jnp.asarray(a, old.dtype), merged(physics.fields, write.model_fields), physics.fields
        )
        eq_data, written = given(fields)["eq_data"], given(write.model_fields)
        woken |= trees_joined(self.layout, (data.eq_active, old["eq_data"]), (eq_active, eq_data))
        for name, array in written.items():
            if name in MOVING[1:]:
                woken |= (getattr(fields, name) != old[name]).any(tuple(range(1, np.ndim(array))))[:, None]
        changed = woken.any(1) | (eq_active != data.eq_active).any(1) | (eq_data != old["eq_data"]).any((1, 2))
        touching = physics.touching
        if write.ignored_contacts is not None:
            if self.cannot_ignore:
                raise EngineError(f"contacts cannot be ignored: {self.cannot_ignore}")
            ignored = jnp.asarray(write.ignored_contacts, bool)
        if ignored is not physics.ignored:
            woken |= reaches((ignored != physics.ignored).any(1), self.layout.object_trees)
            changed |= (ignored != physics.ignored).any((1, 2))
            touching = without_ignored(
                self._contacts(data),
                self.layout,
                self.tables,
                self.touch_tolerance,
                touching,
                physics.ignored,
                ignored,
            )
        woken = with_islands(asleep, woken)
        data = self._with_sleep(
            data.replace(qpos=qpos, qvel=qvel, eq_active=eq_active),
            jnp.where(woken, FULLY_AWAKE, asleep),
            (asleep < 0) | woken,
        )
        physics = dataclasses.replace(
            physics,
            data=data,
            fields=fields,
            ignored=ignored,
            touching=touching,
            link_force=jnp.where(changed[:, None, None], 0.0, physics.link_force),
            finger_force=jnp.where(changed[:, None, None], 0.0, physics.finger_force),
        )
        return physics if write.moves_nothing else jax.lax.cond(changed.any(), self._refresh, lambda p: p, physics)

    def snapshot(self, physics: MjxPhysics) -> Snapshot:
        """All worlds as a snapshot with the world axis."""
        data, count = fresh(physics).data, self.layout.num_object_units
        fields = {name: getattr(data, name) for name in STATE_FIELDS}
        fields["eq_active"] = fields["eq_active"].astype(bool)
        return make_snapshot(
            fields | {"eq_data": physics.fields.eq_data, "tree_asleep": self._tree_asleep(data)},
            self.layout.scene_sizes,
            data.time,
            physics.touching[:, :count, :count],
            physics.touching[:, count:, :count],
            physics.ignored,
            dataclasses.replace(physics.fields, eq_data=None),
        )

    def export(self, physics: MjxPhysics, world: int) -> Snapshot:
        """One world as a snapshot in numpy arrays of its own."""
        if not 0 <= world < self.num_worlds:
            raise EngineError(f"there is no world {world}: this engine has {self.num_worlds}")
        return jax.tree.map(np.array, self._row(fresh(physics), world))

    def gather(self, physics: MjxPhysics, tree: Any, worlds: Sequence[int]) -> Callable[[], tuple[Snapshot, Any]]:
        """See `Engine.gather`: up to 1,024 worlds by one call, compiled for each of `GATHERED`."""
        begun: list[tuple[int, Callable[[], Any]]] = []
        for first in range(0, len(worlds), GATHERED[-1]):
            chosen = list(worlds[first : first + GATHERED[-1]])
            size = next(s for s in GATHERED if s >= len(chosen))
            index = np.array([*chosen, *[chosen[0]] * (size - len(chosen))], np.int32)
            begun.append((len(chosen), self._gathered.begin(index, fresh(physics), tree)))

        def finish() -> tuple[Snapshot, Any]:
            found = [jax.tree.map(lambda a, count=count: a[:count], wait()) for count, wait in begun]
            return found[0] if len(found) == 1 else jax.tree.map(lambda *parts: np.concatenate(parts), *found)

        return finish

    def load(self, physics: MjxPhysics, snapshot: Snapshot, mask: Bool[Array, "W"] | None = None) -> MjxPhysics:
        """Replaces worlds by snapshots; see `Engine.load`. Raises EngineError where it is of another scene."""
        snapshot = fitted(snapshot, self._initial, self.num_worlds, self.scene.name)
        chosen = jnp.ones(self.num_worlds, bool) if mask is None else jnp.asarray(mask, bool)
        batched = snapshot.time.ndim == 1

        def put(new: Any, old: Array) -> Array:
            new = jnp.asarray(new).astype(old.dtype)
            shape = (-1,) + (1,) * (old.ndim - 1)
            return jnp.where(chosen.reshape(shape), new if batched else new[None], old)

        data = fresh(physics).data
        fields = {name: put(snapshot.whole(name), getattr(data, name)) for name in STATE_FIELDS}
        data = data.replace(**fields, time=put(snapshot.time, data.time))
        asleep = put(snapshot.tree_asleep, self._tree_asleep(data))
        data = self._replaced(self._with_sleep(data, asleep, asleep < 0), chosen)
        own = jax.tree.map(put, merged(snapshot.model_fields, ModelFields(snapshot.eq_data)), physics.fields)
        return dataclasses.replace(
            physics,
            data=self._placed(data, _poses(own)),
            fields=own,
            ignored=put(snapshot.agents.ignored_contacts, physics.ignored),
            touching=put(all_units(snapshot), physics.touching),
            link_force=jnp.where(chosen[:, None, None], 0.0, physics.link_force),
            finger_force=jnp.where(chosen[:, None, None], 0.0, physics.finger_force),
            overflow=jnp.where(chosen, 0, physics.overflow),
            wrong_controls=physics.wrong_controls & ~chosen,
        )

    def health(self, physics: MjxPhysics) -> Health:
        """What went wrong in each world; see `ig2mj.engine.health`."""
        data = fresh(physics).data
        velocity = data.qvel[:, self.layout.object_linear_dofs]
        return Health(
            overflow=physics.overflow,
            finite=jnp.isfinite(data.qpos).all(1) & jnp.isfinite(data.qvel).all(1),
            top_speed=jnp.sqrt(jnp.square(velocity).sum(-1).max(1, initial=0.0)),
            wrong_controls=physics.wrong_controls,
        )

    def to_mujoco(self, physics: MjxPhysics, world: int) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """A copy of a world in MuJoCo's own structures; contacts and forces in it are of its present positions."""
        return mujoco_of(self.export(physics, world), self.host_model, self.tables)

    # Stages.

    def _start_all(self, template: mjx.Data, initial: Snapshot) -> MjxPhysics:
        """Every world at `initial`, which has no world axis; the rest of the data is the template's."""
        worlds, tables = self.num_worlds, self.tables
        link_force, finger_force = no_forces(tables, worlds)
        spread = jax.vmap(lambda ctrl: template.replace(ctrl=ctrl))
        units = self.layout.num_units
        physics = MjxPhysics(
            data=spread(jnp.tile(template.ctrl, (worlds, 1))),
            fields=jax.tree.map(
                lambda a: jnp.tile(a, (worlds, *[1] * a.ndim)),
                own_fields(self.host_model, ("eq_data", *self.model_fields)),
            ),
            ignored=jnp.zeros((worlds, len(tables.hand_body), tables.num_objects), bool),
            touching=jnp.zeros((worlds, units, units), bool),
            link_force=link_force,
            finger_force=finger_force,
            overflow=jnp.zeros(worlds, jnp.int32),
            wrong_controls=jnp.zeros(worlds, bool),
        )
        return self.load(physics, initial)

    def _make_view(self, physics: MjxPhysics) -> PhysicsView:
        data = physics.data
        return make_view(
            self.plan,
            Moved(data.qpos, data.qvel, data.xpos, data.xquat, data.xanchor, data.xaxis),
            self._tree_asleep(data) < 0,
            physics.touching,
            physics.link_force,
            physics.finger_force,
            data.eq_active.astype(bool),
        )

    def _kinematics(self, data: mjx.Data, poses: dict[str, Array]) -> mjx.Data:
        """Body poses of the present positions. `poses`: fields of `POSES` of each world, where it has its own."""
        return jax.vmap(lambda own, d: mjx.kinematics(self.model.replace(**own), d))(poses, data)

    def _refresh(self, physics: MjxPhysics) -> MjxPhysics:
        """Everything derived, of the present positions."""
        data = self._mapped(mjx.forward, self.model, physics.data, physics.fields, physics.ignored)
        touching = self._touching(data, physics.touching, self._tree_asleep(data) < 0)
        return dataclasses.replace(physics, data=data, touching=touching)

    def _map(
        self, act: Any, model: mjx.Model, data: mjx.Data, fields: ModelFields, ignored: Bool[Array, "W H O"]
    ) -> mjx.Data:
        """A function of MJX on every world. The model comes as an argument, so that a program holds it only once."""
        of_world = {name: array for name, array in given(fields).items() if name in MOVING and array.size}
        if ignored.size:
            of_world["ignored"] = ignored
        if not of_world:
            return jax.vmap(lambda d: act(model, d))(data)

        def one(fields: dict[str, Array], d: mjx.Data) -> mjx.Data:
            own = model.replace(**{name: array for name, array in fields.items() if name != "ignored"})
            return self._act(act, own, d, fields.get("ignored"))

        return jax.vmap(one)(of_world, data)

    def _touching(
        self, data: mjx.Data, remembered: Bool[Array, "W U U"], tree_awake: Bool[Array, "W T"]
    ) -> Bool[Array, "W U U"]:
        """`tree_awake`: as the step that made the contacts began; what woke in it is awake now."""
        tree = self.layout.unit_tree
        fresh_tree = tree_awake | (self._tree_asleep(data) < 0)
        fresh = (
            fresh_tree[:, np.maximum(tree, 0)] & (tree >= 0)
            if self.host_model.ntree
            else jnp.zeros((remembered.shape[0], len(tree)), bool)
        )
        return touching_units(self._contacts(data), self.layout, self.touch_tolerance, remembered, fresh)

    def _host_model(self, model: mujoco.MjModel) -> mujoco.MjModel:
        own = copy.copy(model)
        own.opt.timestep = self.timestep
        return own

    def _host_data(self) -> mujoco.MjData:
        model, data = self.host_model, mujoco.MjData(self.host_model)
        if model.nkey:
            mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_forward(model, data)
        return data


def _poses(fields: ModelFields) -> dict[str, Array]:
    """Those of `POSES` that worlds have for themselves."""
    return {name: array for name, array in given(fields).items() if name in POSES}
