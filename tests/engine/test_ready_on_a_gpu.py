"""What an engine does on a GPU before its first step, on a machine that has none."""

from __future__ import annotations

import concurrent.futures
import gc
import threading
from collections.abc import Iterator
from typing import Any

import jax
import jaxtyping
import pytest
import warp as wp
from gpu_stand_in import ARCHITECTURE, Memory, gpu_of_jax, gpu_of_warp

from ig2mj.engine.warp import ahead, kernels, tiles
from ig2mj.engine.warp.engine import WarpEngine
from ig2mj.engine.warp.patches import scratch
from ig2mj.errors import EngineError
from ig2mj.process import prepare_warp
from ig2mj.process.compilation import XLA_EVENT
from ig2mj.process.together import TOGETHER
from ig2mj.worlds.core import Core
from ig2mj.worlds.rules import Rules


@pytest.fixture
def engine(tiny_home, monkeypatch) -> WarpEngine:
    """Knows the launches of a GPU; each time it is asked it takes and gives back a kilobyte."""
    engine = WarpEngine(tiny_home, 2)
    there = ahead.launches_on_gpu(engine)[:6]

    def launches(counter: scratch.Counter) -> list[kernels.Launch]:
        counter.deallocate(counter.allocate(1000), 1000)
        return there

    monkeypatch.setattr(engine, "launches", launches)
    return engine


@pytest.fixture
def loaded(monkeypatch) -> list:
    """Of each module that is to be loaded the device and the number of threads; of tiles the architecture."""
    noted = []
    monkeypatch.setattr(wp, "force_load", lambda on, modules, block_dim, max_workers: noted.append((on, block_dim)))
    monkeypatch.setattr(tiles, "builder", lambda launches, architecture, workers: lambda: noted.append(architecture))
    return noted


@pytest.fixture
def gpu(monkeypatch) -> wp.Device:
    gpu = gpu_of_warp(Memory())
    monkeypatch.setattr(wp, "get_cuda_device", lambda number: {0: gpu}[number])
    monkeypatch.setattr(scratch, "_arenas", {})
    return gpu


@pytest.mark.parametrize("beforehand", [True, "meanwhile"])
def test_an_engine_gets_ready_on_a_gpu(engine, loaded, gpu, beforehand):
    engine._get_ready(gpu_of_jax(), beforehand)
    memory = gpu.default_allocator
    kernels.load(engine.launches(scratch.Counter(memory)), gpu)  # begins when the others have ended
    block = engine._scratch
    assert block >= 2 * 1000 and memory.taken[1] == block, "memory for two worlds is taken"
    assert loaded.count(ARCHITECTURE) == 2
    assert all(item[0] is gpu for item in loaded if isinstance(item, tuple))


@pytest.fixture
def held(engine, loaded, gpu, monkeypatch) -> Iterator[threading.Event]:
    """The kernels of this engine are being loaded until this is set."""
    go = threading.Event()
    monkeypatch.setattr(wp, "force_load", lambda *_, **__: go.wait(60))
    engine._get_ready(gpu_of_jax(), "meanwhile")
    yield go
    go.set()
    concurrent.futures.wait([engine.loading], 60)


@pytest.mark.slow
def test_worlds_do_not_start_before_the_kernels_are_there(engine, held, monkeypatch):
    events: list[str] = []
    first = engine._first
    monkeypatch.setattr(engine, "_first", lambda *arguments: (events.append("run"), first(*arguments))[1])
    run = threading.Thread(target=engine.reset)
    run.start()
    run.join(0.3)
    assert run.is_alive() and not events and not engine.loading.done()
    assert not gc.isenabled(), "the collector would look through all that was imported, and worlds are to start"
    held.set()
    run.join(60)
    assert events == ["run"] and engine.loading.result() > 0


@pytest.mark.slow
def test_programs_are_compiled_while_kernels_are_loaded(engine, held, monkeypatch):
    core = Core(engine, Rules.of_scene(engine.scene))
    compiled: list[str] = []

    def note(event: str, duration_secs: float, **about: str | int) -> None:
        if event in (XLA_EVENT, TRACE_EVENT):
            compiled.append(f"{event.split('_')[0].split('/')[-1]} {about.get('fun_name')}")

    jax.monitoring.register_event_duration_secs_listener(note)
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)  # shapes stand where annotations ask for arrays
    wait = engine._wait_for_kernels
    monkeypatch.setattr(engine, "_wait_for_kernels", lambda: (compiled.append("waits"), held.set(), wait()))
    batch = core.start()
    before = compiled[: compiled.index("waits")]
    assert sorted(name for name in before if name in PROGRAMS) == sorted(PROGRAMS)
    compiled.clear()
    core._step.trace(core.start(1), None)
    assert not set(compiled) & {*PROGRAMS, "jaxpr step_fn"}, "the calls find what was compiled"
    assert engine.pending_reset_program() is None and batch.number.shape == (2,)


PROGRAMS = ("backend jit(_start_all)", "backend jit(start_fn)", "backend jit(step_fn)")
TRACE_EVENT = "/jax/core/compile/jaxpr_trace_duration"


@pytest.mark.parametrize("beforehand", [True, "meanwhile"])
def test_a_broken_kernel_is_reported_before_anything_runs(engine, loaded, gpu, monkeypatch, beforehand):
    def fail(*_: Any, **__: Any) -> None:
        raise RuntimeError("CUDA kernel build failed with error code 6\nlog")

    monkeypatch.setattr(wp, "force_load", fail)
    monkeypatch.setattr(engine, "_first", lambda *_: pytest.fail("runs without its kernels"))
    message = f"kernels of scene '{engine.scene.name}' cannot .* error code 6$"
    if beforehand is True:
        with pytest.raises(EngineError, match=message):
            engine._get_ready(gpu_of_jax(), beforehand)
    else:
        engine._get_ready(gpu_of_jax(), beforehand)
    for _ in range(2):
        with pytest.raises(EngineError, match=message):
            engine.reset()
    assert not kernels.AWAITED


def test_one_engines_failure_is_not_the_others(engine, loaded, gpu, monkeypatch):
    fine = wp.force_load
    monkeypatch.setattr(wp, "force_load", lambda *_, **__: 1 // 0)
    engine._get_ready(gpu_of_jax(), "meanwhile")
    failed = engine.loading
    concurrent.futures.wait([failed], 60)
    monkeypatch.setattr(wp, "force_load", fine)
    engine._get_ready(gpu_of_jax(), "meanwhile")  # as another one would
    assert engine.loading is not failed and engine.loading.result(60) > 0
    assert isinstance(failed.exception(), ZeroDivisionError)


def test_a_second_engine_begins_when_the_first_has_ended(engine, held, monkeypatch):
    first, asked = engine.loading, []
    monkeypatch.setattr(engine, "launches", lambda counter: asked.append(first.done()) or [])
    other = threading.Thread(target=engine._get_ready, args=(gpu_of_jax(), "meanwhile"))
    other.start()
    other.join(0.3)
    assert other.is_alive() and not asked
    held.set()
    other.join(60)
    assert asked == [True]


def test_engines_of_a_block_are_made_without_waiting_for_each_others_kernels(engine, loaded, gpu, monkeypatch):
    monkeypatch.setattr("ig2mj.engine.warp.engine.own_device", gpu_of_jax)
    with TOGETHER.block():
        engine._get_ready(gpu_of_jax(), "meanwhile")
        first = engine.loading
        engine._get_ready(gpu_of_jax(), "meanwhile")  # as another one would
        engine.load_also(engine.launches(scratch.Counter(gpu.default_allocator))[:1])
        every = [first, engine.loading, *engine.loading_of_others]
        assert len(every) == 3 and not loaded and not any(loading.done() for loading in every)
    counts = {loading.result(60) for loading in every}
    assert counts == {len([item for item in loaded if isinstance(item, tuple)])}, "each module is loaded once"


def test_worlds_may_start_inside_the_block(engine, loaded, gpu):
    with TOGETHER.block():
        engine._get_ready(gpu_of_jax(), "meanwhile")
        engine.load_also([])
        engine._wait_for_kernels()  # as `reset` does
        assert engine.loading.done() and engine.loading_of_others[0].done()


@pytest.mark.slow
def test_an_interrupted_wait_can_be_repeated(engine, held, monkeypatch):
    def interrupted(loading: Any, scene: str) -> int:
        raise KeyboardInterrupt

    with monkeypatch.context() as during, pytest.raises(KeyboardInterrupt):
        during.setattr(kernels, "loaded", interrupted)
        engine.reset()
    held.set()
    assert engine.reset() is not None


@pytest.mark.slow
def test_tiles_are_made_in_processes_of_their_own(tmp_path, monkeypatch):
    prepare_warp()
    wp.init()
    folder = tmp_path / wp.config.version
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(folder))
    monkeypatch.setattr(tiles, "tiles_of", lambda launches: [tiles._cholesky(4, 32)])
    tiles.builder([], ARCHITECTURE)()
    made = [file for file in (folder / "lto").rglob("*.lto") if not file.name.endswith("_fatbin.lto")]
    assert len(made) == 1


def test_tiles_are_made_for_what_warp_compiles_for(loaded):
    prepare_warp()
    for gpu in (gpu_of_warp(Memory()), gpu_of_warp(Memory(), newer_driver=True)):
        kernels.load([], gpu)
        assert gpu.get_cuda_compile_arch() in loaded
    oldest = wp.get_device("cpu").runtime.default_ptx_arch
    made = [architecture for architecture in loaded if not isinstance(architecture, tuple)]
    assert made == [ARCHITECTURE, min(ARCHITECTURE, oldest)]
