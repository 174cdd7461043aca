"""The Warp engine: MJX `impl='warp'`. Thousands of worlds on a GPU; on a CPU it runs too, slowly, for parity tests.

Speed comes from sleep and from kernels that cost what is awake (`ig2mj.engine.warp.patches`); buffers
(`ig2mj.engine.warp.profile`) cost memory. Where they do not hold the whole scene awake, worlds start from a settled,
sleeping state.
"""

from __future__ import annotations

import concurrent.futures
import functools
import sys
from collections.abc import Sequence
from typing import Any, Literal

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import warp as wp
from jaxtyping import Bool, Float, Int
from mujoco import mjx

from ig2mj.engine.contact_filter import geom_hands
from ig2mj.engine.health import Usage
from ig2mj.engine.mjx.contacts import Contacts, warp_contacts
from ig2mj.engine.mjx.engine import MjxEngine, MjxPhysics
from ig2mj.engine.mjx.physics import own_device
from ig2mj.engine.native.settle import settle
from ig2mj.engine.snapshot import Snapshot
from ig2mj.engine.view import Array
from ig2mj.engine.warp import kernels, patches
from ig2mj.engine.warp.ignored_contacts import DROP, encode, filter_contacts
from ig2mj.engine.warp.patches import scratch, table
from ig2mj.engine.warp.patches.flags import REPLACED
from ig2mj.engine.warp.profile import EngineProfile, fit, holding, holds_everything, profile_of_scene
from ig2mj.engine.warp.unwritten import unwritten_is_zero
from ig2mj.errors import EngineError
from ig2mj.process import entry_point, prepare_warp
from ig2mj.process.gc_pause import Traced
from ig2mj.process.out_of_memory import is_out_of_memory
from ig2mj.scene.scene import Scene


@entry_point
class WarpEngine(MjxEngine):
    """MJX-Warp behind the `Engine` protocol.

    Attributes:
      profile: sizes of its buffers.
      own_kernels: its programs run our functions in place of some of MuJoCo Warp's (`ig2mj.engine.warp.patches`).
      loading: of its kernels, which may have ended; None: they are not loaded beforehand.
      launches_of_others, loading_of_others: of what reads its worlds (`load_also`).
    """

    name = "warp"
    renderer = "ray caster"

    def __init__(
        self,
        scene: Scene,
        num_worlds: int = 1,
        *,
        profile: EngineProfile | None = None,
        initial: Snapshot | None = None,
        iterations: int | None = None,
        ls_iterations: int | None = None,
        print_overflow: bool = False,
        graph_mode: str | None = None,
        compile_beforehand: bool | Literal["meanwhile"] = "meanwhile",
        **options: Any,
    ):
        """Makes an engine.

        Args:
          scene, num_worlds, initial, options: see `MjxEngine`. Where `initial` is None and the profile does not hold
            everything awake, the scene is settled first with the native engine.
          profile: buffer sizes; None: the file next to the manifest for the scene's agents, else safe sizes.
          iterations, ls_iterations: limits of the solver and of its line search; None: the scene's. Lower limits gain
            little: of 16,384 disturbed worlds nearly all converge at once, and 5 against 100 saved 9 % of a step.
          graph_mode: how CUDA graphs of a step are kept, a name of `warp.JaxCallableGraphMode`: "WARP" captures a step
            again wherever its buffers have other addresses, "WARP_STAGED" copies them to addresses that stay. None:
            MJX's choice, which is "WARP" on a GPU.
          compile_beforehand: on a GPU all kernels of a step are compiled and loaded, side by side. "meanwhile": this
            begins now, and `reset` waits for the end; programs can be compiled meanwhile (`pending_reset_program`);
            True: it is waited for here; False: the first step does it, one after the other.
          print_overflow: let Warp print a line per overflowing world and step. The flags are kept in any case.

        Raises:
          EngineError: see `MjxEngine`; or a kernel cannot be compiled, which otherwise `reset` reports.
        """
        prepare_warp()
        _say_once_if_slow()
        self.own_kernels = patches.for_new_engines()
        sizes = fit(profile, scene.model) if profile else profile_of_scene(scene)
        self.profile = sizes.for_worlds(max(num_worlds, 1))  # a wrong number is refused by `MjxEngine`
        self._print_overflow = print_overflow
        self._graph_mode = wp.JaxCallableGraphMode[graph_mode] if graph_mode else None
        self._iterations = iterations or int(scene.model.opt.iterations)
        self._ls_iterations = ls_iterations or int(scene.model.opt.ls_iterations)
        self._worlds_of_buffers = num_worlds
        if initial is None and not holds_everything(self.profile, scene.model):
            initial = settle(scene)
        super().__init__(scene, num_worlds, initial=initial, **options)
        self._scratch, self._launches = 0, list[kernels.Launch]()
        self.loading: concurrent.futures.Future[int] | None = None
        self.launches_of_others = list[kernels.Launch]()
        self.loading_of_others = list[concurrent.futures.Future[int]]()
        self._has_begun = False
        if own_device().platform == "gpu":  # on processors only some tests make steps
            self._get_ready(own_device(), compile_beforehand)
        self._models_put.clear()

    def _get_ready(self, gpu: Any, compile_beforehand: bool | Literal["meanwhile"]) -> None:
        """Counts and takes the memory that steps need there, and loads their kernels."""
        kernels.wait_for_others()
        device = wp.device_from_jax(gpu)
        counter = scratch.Counter(device.get_allocator())
        with wp.ScopedDevice(device):
            self._launches = self.launches(counter)
        own = self.own_kernels and table.runs("scratch")
        self._scratch = counter.block(self.num_worlds) if own else 0
        self.prepare_devices([gpu])
        if compile_beforehand:
            self.loading = kernels.load_meanwhile(self._launches, device)
        if compile_beforehand is True:
            self._wait_for_kernels()

    def _wait_for_kernels(self) -> None:
        """Raises an EngineError, each time, where they could not be compiled or loaded."""
        for loading in () if self.loading is None else (self.loading, *self.loading_of_others):
            kernels.loaded(loading, self.scene.name)

    def load_also(self, launches: list[kernels.Launch]) -> None:
        """Loads kernels of what reads its worlds, such as a camera, where its own are loaded beforehand; `reset` waits
        for them, too."""
        self.launches_of_others += launches
        if self.loading is not None:
            self.loading_of_others.append(kernels.load_meanwhile(launches, wp.device_from_jax(own_device())))

    def pending_reset_program(self) -> Traced | None:
        """See `Engine.pending_reset_program`."""
        if self.loading is None or self._has_begun:
            return None
        self._has_begun = True
        return self._first.traced(self._template, self._initial)

    def reset(self) -> MjxPhysics:
        """All worlds at the initial state, as soon as the kernels are there that steps from it need.

        Raises:
          EngineError: a kernel could not be compiled or loaded.
        """
        self._wait_for_kernels()
        self._has_begun = True
        return super().reset()

    def prepare_devices(self, devices: Sequence[Any]) -> None:
        """See `Engine.prepare_devices`: takes the memory that steps need (`ig2mj.engine.warp.patches.scratch`).

        Raises:
          EngineError: there is too little for a scene whose buffer sizes nobody has measured.
        """
        for device in devices if self._scratch else ():
            try:
                scratch.reserve(wp.device_from_jax(device), self._scratch)
            except RuntimeError as failure:
                if not (is_out_of_memory(failure) and holds_everything(self.profile, self.scene.model)):
                    raise
                name, needed = self.scene.name, f"{self._scratch / 1e9:,.0f} GB for {self.num_worlds:,} worlds"
                raise EngineError(
                    f"buffers for all that can happen in {name} need {needed}: "
                    f"measure what it needs (ig2mj calibrate {name}), or use fewer worlds"
                ) from failure

    def launches(self, counter: scratch.Counter | None = None) -> list[kernels.Launch]:
        """The kernels of a step, of a forward pass and of the contact filter. `counter`: see `launches_of_step`."""
        warns = int(self.model.opt._impl.warn_overflow)
        put = self._models_put[0] if self._models_put else None
        found = kernels.launches_of_step(self.host_model, self.profile, self.own_kernels, warns, counter, put)
        if self._filters and len(self.tables.hand_body):
            found.append((DROP, 256))  # pyright: ignore[reportArgumentType]
        return found

    def usage(self, physics: MjxPhysics) -> Usage:
        """How full the buffers were in the last physics step."""
        impl = physics.data._impl
        return Usage(impl.nv_awake, impl.nefc, impl.nacon[0], impl.ncollision[0])

    def _host_model(self, model: mujoco.MjModel) -> mujoco.MjModel:
        own = super()._host_model(model)
        own.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP
        own.opt.iterations, own.opt.ls_iterations = self._iterations, self._ls_iterations
        return own

    def _map(self, act: Any, *arguments: Any) -> mjx.Data:
        with patches.traced_with(self.own_kernels), patches.graphs_kept():
            return super()._map(act, *arguments)

    def _act(self, act: Any, model: mjx.Model, data: mjx.Data, ignored: Bool[Array, "H O"] | None) -> mjx.Data:
        if ignored is not None and self._filters:  # see `ig2mj.engine.warp.ignored_contacts`
            model = model.tree_replace({"_impl.pair_adhesion": ignored.reshape(-1).astype(jnp.float32)})
        return act(model, data)

    @property
    def cannot_ignore(self) -> str:  # pyright: ignore[reportIncompatibleVariableOverride]
        """See `Engine.cannot_ignore`."""
        model = self.host_model
        if model.npair or np.any(model.geom_adhesion):
            return f"scene '{self.scene.name}' has <pair> elements or adhesion, whose fields the contact filter takes"
        return ""

    @property
    def _filters(self) -> bool:
        return not self.cannot_ignore

    def _put_model(self, model: mujoco.MjModel) -> mjx.Model:
        with kernels.models_put() as self._models_put:
            put = mjx.put_model(model, own_device(), impl="warp", graph_mode=self._graph_mode)
        if len(self.tables.hand_body) and self._filters:
            filter_contacts()
            code = encode(geom_hands(model, self.tables), self.tables.geom_object, self.tables.num_objects)
            put = put.tree_replace({"_impl.geom_adhesion": jnp.asarray(code)})
        return put if self._print_overflow else put.tree_replace({"opt._impl.warn_overflow": 0})

    def _put_data(self, model: mujoco.MjModel, data: mujoco.MjData) -> mjx.Data:
        worlds = self._worlds_of_buffers
        self.profile = profile = holding(self.profile, data, worlds)
        with unwritten_is_zero(), patches.counted_quickly(self.own_kernels):
            return mjx.put_data(
                model,
                data,
                own_device(),
                impl="warp",
                naconmax=worlds * profile.contacts,
                naccdmax=worlds * profile.convex_contacts,
                njmax=profile.constraints,
                nvmax=profile.awake_dofs,
            )

    def _contacts(self, data: mjx.Data) -> Contacts:
        return warp_contacts(data)

    def _efc_force(self, data: mjx.Data) -> Float[Array, "W N"]:
        return data._impl.efc__force

    def _tree_asleep(self, data: mjx.Data) -> Int[Array, "W T"]:
        return data._impl.tree_asleep

    def _with_sleep(self, data: mjx.Data, asleep: Int[Array, "W T"], awake: Bool[Array, "W T"]) -> mjx.Data:
        # A sleeping tree that is marked awake is woken, with its island, by the next forward pass.
        before = data._impl.tree_awake  # what `ig2mj.engine.warp.patches.resting` noted of trees that sleep stays
        flags = jnp.where(awake, 1, jnp.where(before > 1, before, 0))
        return data.tree_replace({"_impl.tree_asleep": asleep, "_impl.tree_awake": flags.astype(jnp.int32)})

    def _replaced(self, data: mjx.Data, chosen: Bool[Array, "W"]) -> mjx.Data:
        flags = data._impl.tree_awake
        new = jnp.where(chosen[:, None] & (flags != 1), REPLACED, flags)
        return data.tree_replace({"_impl.tree_awake": new.astype(jnp.int32)})

    def _overflow(self, data: mjx.Data) -> Int[Array, "W"]:
        return data._impl.overflow


@functools.cache
def _say_once_if_slow() -> None:
    if jax.default_backend() == "cpu":
        print(
            'ig2mj: no GPU: the Warp engine takes a few steps a second on a processor; engine="native" is fast there',
            file=sys.stderr,
        )
