"""The kernels of a step, compiled side by side before the first step needs them.

MuJoCo Warp has a module for nearly every kernel, and Warp compiles a module when one of its kernels is first launched:
one after the other, on one processor. Here a step is made of which only the launches are written down (`launches_of`);
what they need is then compiled and loaded by as many threads as there are processors (`load`), while the caller
continues (`load_meanwhile`): XLA's programs are compiled in the same time. The caller waits for the end, and gets any
error, before it runs anything on the device (`loaded`).
"""

from __future__ import annotations

import concurrent.futures
import contextlib
import dataclasses
import os
import pathlib
import threading
from collections.abc import Callable, Iterator
from typing import Any

import mujoco
import numpy as np
import warp as wp
from mujoco.mjx.third_party import mujoco_warp
from mujoco.mjx.warp import ffi

from ig2mj.engine.warp import patches, tiles
from ig2mj.engine.warp.hashing import shared_hashes
from ig2mj.engine.warp.patches import scratch
from ig2mj.engine.warp.patches.scope import ScopedReplacement
from ig2mj.engine.warp.profile import EngineProfile
from ig2mj.errors import EngineError
from ig2mj.process.gc_pause import GC_PAUSED
from ig2mj.process.together import TOGETHER
from ig2mj.process.warp_repairs import AWAITED
from ig2mj.process.worker_threads import ENDING, WorkerThreads, spawn

Launch = tuple[wp.Kernel, int]
"""A kernel, and the number of threads of its blocks."""

_TURN = threading.Lock()

DEFAULT_BLOCK = 256
"""Threads of a block unless a launch says how many; Warp's default."""


def launches_of(act: Callable[[], Any]) -> list[Launch]:
    """The kernels that a function of this thread would launch, each once, in the order of their first launch.

    Nothing is launched. What would be launched for nothing (a dimension is 0) is left out, as Warp does not load it
    then. Both branches of a condition are taken, and the body of a loop twice.
    """
    found: dict[Launch, None] = {}

    def launch(kernel: wp.Kernel, dim: Any, *args: Any, block_dim: int = DEFAULT_BLOCK, **kwargs: Any) -> None:
        if np.prod(dim) > 0:
            found[patches.launched(kernel, dim), block_dim] = None

    def launch_tiled(kernel: wp.Kernel, dim: Any, *args: Any, block_dim: int = DEFAULT_BLOCK, **kwargs: Any) -> None:
        if np.prod(dim) > 0:
            found[patches.launched(kernel, dim, tiled=True), block_dim] = None

    def capture_while(condition: Any, while_body: Callable, stream: Any = None, **kwargs: Any) -> None:
        for _ in range(2):  # ours differ in the first
            while_body(**kwargs)

    def capture_if(
        condition: Any, on_true: Any = None, on_false: Any = None, stream: Any = None, **kwargs: Any
    ) -> None:
        for branch in (on_true, on_false):
            if branch is not None:
                branch(**kwargs)

    def suggested(kernel: wp.Kernel, device: Any = None) -> tuple[int, int]:
        return DEFAULT_BLOCK, 1  # the real one compiles the kernel

    noted = ScopedReplacement()
    noted.add(
        {
            (wp, "launch"): launch,
            (wp, "launch_tiled"): launch_tiled,
            (wp, "capture_while"): capture_while,
            (wp, "capture_if"): capture_if,
            (wp, "get_suggested_block_size"): suggested,
        }
    )
    with noted.entered():
        act()
    return list(found)


def launches_of_step(
    model: mujoco.MjModel,
    profile: EngineProfile,
    own: bool,
    warns: int = 0,
    counter: scratch.Counter | None = None,
    put: Any = None,
) -> list[Launch]:
    """The kernels of a step and of a forward pass of one world.

    Args:
      profile: buffer sizes; some kernels are compiled for them. own: with our functions in place of some of MuJoCo
        Warp's (`ig2mj.engine.warp.patches`). warns: the engine's `opt.warn_overflow`.
      counter: of the temporary memory that they need on the present device, which must be a CUDA device.
      put: MuJoCo Warp's model, on any device, where it was made before (`models_put`); its options are changed.
    """
    with patches.counted_quickly(own):
        act = _step_of_one_world(model, profile, warns, put)
    counted = wp.ScopedAllocator(wp.get_device(), counter) if counter else contextlib.nullcontext()
    with patches.engine_kernels() if own else patches.upstream_kernels(), counted, shared_hashes():
        return launches_of(act)


@contextlib.contextmanager
def models_put() -> Iterator[list[Any]]:
    """The models of MuJoCo Warp that this thread makes inside the block; MJX makes one of its own and drops it."""
    made: list[Any] = []
    kept = ScopedReplacement()

    def put_model(*args: Any, **kwargs: Any) -> Any:
        made.append(kept.original(mujoco_warp, "put_model")(*args, **kwargs))
        return made[-1]

    kept.add({(mujoco_warp, "put_model"): put_model})
    with kept.entered():
        yield made


def _step_of_one_world(model: mujoco.MjModel, profile: EngineProfile, warns: int, put: Any) -> Callable[[], None]:
    put = put or mujoco_warp.put_model(model)
    put.opt.warn_overflow = int(warns)  # printing is compiled in or left out
    data = mujoco_warp.make_data(
        model,
        nworld=1,
        naconmax=profile.contacts,
        naccdmax=profile.convex_contacts,
        njmax=profile.constraints,
        nvmax=profile.awake_dofs,
    )

    def act() -> None:
        mujoco_warp.step(put, data)
        mujoco_warp.forward(put, data)

    return act


def load(launches: list[Launch], device: wp.Device | None = None, workers: int | None = None) -> int:
    """Compiles and loads the modules of kernels, side by side.

    Args:
      device: Warp's; None: the present one. workers: threads; None: one for each processor of this process.

    Returns:
      How many modules were loaded.
    """
    loading = load_meanwhile(launches, device, workers)
    TOGETHER.flush()
    return loading.result()


def load_meanwhile(
    launches: list[Launch], device: wp.Device | None = None, workers: int | None = None
) -> concurrent.futures.Future[int]:
    """As `load`, and returns at once. Nothing that needs these kernels may run before `loaded` has returned; a CUDA
    graph that is captured all the same waits for the end.

    Begins at the end of the block of `TOGETHER` that this thread is in, with all other requests of the block, and when
    what was begun before has ended (`wait_for_others`). Python's garbage collector is off until the end: it would visit
    everything that was just imported and made, while programs are still to be traced.
    """
    request = _Request(launches, wp.get_device(device), workers, concurrent.futures.Future())
    TOGETHER.add(_begin, request)
    return request.done


@dataclasses.dataclass(frozen=True)
class _Request:
    """Arguments of `load_meanwhile`, and what it returns."""

    launches: list[Launch]
    device: wp.Device
    workers: int | None
    done: concurrent.futures.Future[int]

    def cancel(self) -> None:
        self.done.cancel()


def _begin(requests: list[_Request]) -> None:
    """Begins to load what is requested, one device after the other."""
    on = {request.device.alias: request.device for request in requests}
    for alias, device in on.items():
        _begin_on(device, [request for request in requests if request.device.alias == alias])


def _begin_on(on: wp.Device, requests: list[_Request]) -> None:
    launches = list(dict.fromkeys(launch for request in requests for launch in request.launches))
    workers = requests[0].workers
    with _TURN:
        wait_for_others()
        by_size = modules_of(launches, one_thread=on.is_cpu)
        # MJX's own has no kernels, but JAX's first call loads it.
        by_size.setdefault(DEFAULT_BLOCK, []).append(wp.get_module(ffi.__name__))
        # Of what Warp itself compiles for: with PTX it may be an older one than the device's own (`Device.arch`).
        architecture = on.get_cuda_compile_arch()
        missing = not_made(launches)
        first = None if architecture is None else tiles.builder(missing, architecture, workers)
        AWAITED.update(request.done for request in requests)
        GC_PAUSED.begin()

    def load_module(module: wp.Module, sizes: list[int]) -> None:
        for size in sizes:
            wp.force_load(on, [module], block_dim=size, max_workers=1)

    def load_all() -> None:
        failure: BaseException | None = None
        try:
            side_by_side(by_size, load_module, workers, first, in_turn=bool(missing))
        except BaseException as e:
            failure = e
        for request in requests:
            if failure is None:
                request.done.set_result(sum(map(len, by_size.values())))
            else:
                request.done.set_exception(failure)
            AWAITED.discard(request.done)
        GC_PAUSED.end()

    spawn(load_all, "ig2mj-kernels")


def wait_for_others() -> None:
    """Returns when what other engines are loading is loaded, or has failed.

    Names of modules are hashes, which change while others are built: no kernels may be made or hashed meanwhile.
    """
    concurrent.futures.wait(list(AWAITED))


def loaded(loading: concurrent.futures.Future[int], scene: str) -> int:
    """What `load_meanwhile` gave, when it has ended: how many modules were loaded.

    Raises:
      EngineError: a module could not be compiled or loaded, or the process ends.
    """
    if not loading.done():
        TOGETHER.flush()  # it may wait for the end of a block of this thread
    try:
        return loading.result()
    except Exception as failure:
        why = next(iter(str(failure).splitlines()), "") or type(failure).__name__
        raise EngineError(f"the kernels of scene '{scene}' cannot be compiled for this GPU: {why}") from failure


def side_by_side(
    by_size: dict[int, list[wp.Module]],
    act: Callable[[wp.Module, list[int]], None],
    workers: int | None,
    first: Callable[[], None] | None = None,
    in_turn: bool = True,
) -> None:
    """Calls `act` for each module with its sizes of blocks, in so many threads (None: one for each processor).

    `in_turn`: not while another program compiles kernels (`alone`).
    The longest come first: kernels of convex pairs, which take half a minute each. Modules with blocks of their own
    size (factorisations) come last, when `first` has ended, which is called alongside the others.
    """
    sizes: dict[wp.Module, list[int]] = {}
    for size, modules in by_size.items():
        for module in modules:
            sizes.setdefault(module, []).append(size)
    convex = [module for module in sizes if "_ccd_" in module.name]
    plain = [module for module in sizes if module not in convex and sizes[module] == [DEFAULT_BLOCK]]
    last = [module for module in sizes if module not in convex and module not in plain]
    turn = alone() if in_turn else contextlib.nullcontext()
    with turn, WorkerThreads(workers or len(os.sched_getaffinity(0)), "ig2mj-kernels") as crew:
        before = [crew.submit(first)] if first else []
        jobs = [crew.submit(act, module, sizes[module]) for module in convex + plain]
        concurrent.futures.wait(before)
        for done in before + jobs + [crew.submit(act, module, sizes[module]) for module in last]:
            done.result()


def not_made(launches: list[Launch]) -> list[Launch]:
    """Those whose module is not in Warp's cache, for any GPU; after `modules_of`."""
    folder = pathlib.Path(wp.config.kernel_cache_dir or "")
    return [launch for launch in launches if not (folder / launch[0].module.get_module_identifier(launch[1])).is_dir()]


def modules_of(launches: list[Launch], one_thread: bool = False) -> dict[int, list[wp.Module]]:
    """The modules of kernels by the number of threads of their blocks, their hashes computed.

    Names in the cache contain a hash of the module. Functions that several modules share change when one of them is
    built, and with them the others' hashes: a module hashed only when others had been built was not found again.

    Args:
      one_thread: on a processor, where all blocks have one thread.
    """
    found: dict[int, dict[wp.Module, None]] = {}
    for kernel, block_dim in launches:
        found.setdefault(block_dim, {})[kernel.module] = None
    with shared_hashes():
        for block_dim, modules in found.items():
            for module in modules:
                module.get_module_hash(1 if one_thread else block_dim)
    return {block_dim: list(modules) for block_dim, modules in found.items()}


@contextlib.contextmanager
def alone() -> Iterator[None]:
    """Programs that start together compile in turn: the others find in the cache what the first has made. At the end of
    the process nobody waits for a turn."""
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError, ImportError):  # where there are no such locks each compiles for itself
            import fcntl

            assert wp.config.kernel_cache_dir is not None  # Warp has begun
            folder = pathlib.Path(wp.config.kernel_cache_dir)
            folder.mkdir(parents=True, exist_ok=True)
            file = stack.enter_context((folder / ".compiling").open("a"))
            while not ENDING.is_set():
                try:
                    fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    break
                except BlockingIOError:
                    ENDING.wait(0.05)
        yield
