"""Settings of the process: none on import, all by functions of `ig2mj.process`, and what the user decided stands."""

from __future__ import annotations

import gc
import os
import pathlib
import re
import subprocess
import sys
import threading

import pytest
import warp as wp

import ig2mj.process
from ig2mj.errors import EngineError
from ig2mj.process import prepare_warp, quiet_warp, settings
from ig2mj.process.gc_pause import SELDOM, Compiled, GcPause, collect_seldom

STATE = """
import jax, warp as wp, gc, os
def state():
    o = ("jax_compilation_cache_dir", "jax_persistent_cache_min_compile_time_secs", "jax_cpu_enable_async_dispatch")
    return [*(getattr(jax.config, n, None) or jax.config._read(n) for n in o), wp.config.log_level,
            wp.config.kernel_cache_dir, wp.ScopedCapture.__enter__, wp.Stream.__del__, gc.isenabled(), dict(os.environ)]
"""


def in_a_process_of_its_own(code: str, **environment: str) -> str:
    whole = {**os.environ, "JAX_PLATFORMS": "cpu", **environment}
    return subprocess.run(
        [sys.executable, "-c", STATE + code], capture_output=True, text=True, env=whole, check=True
    ).stdout.strip()


def test_importing_changes_nothing(tmp_path):
    code = "before = state(); import ig2mj, ig2mj.process, ig2mj.worlds, ig2mj.simulation; print(state() == before)"
    assert in_a_process_of_its_own(code, IG2MJ_CACHE_DIR=str(tmp_path)) == "True"


def test_what_the_user_decided_stands(tmp_path):
    code = (
        "from ig2mj import process\n"
        "jax.config.update('jax_compilation_cache_dir', '/theirs'); wp.config.log_level = wp.LOG_DEBUG\n"
        "before = state(); print(process.prepare_jax()); process.run_programs_inline(); process.prepare_warp()\n"
        "after = state(); print(after[:5] == before[:5], after[7:] == before[7:])"
    )
    chosen = {"JAX_CPU_ENABLE_ASYNC_DISPATCH": "1", "WARP_CACHE_PATH": str(tmp_path), "IG2MJ_CACHE_DIR": str(tmp_path)}
    assert in_a_process_of_its_own(code, **chosen).splitlines() == ["/theirs", "True True"]


@pytest.mark.parametrize(
    ("theirs", "after"),
    [
        ("", "--xla_gpu_temp_buffer_use_separate_color=true"),
        ("--xla_dump_to=there", "--xla_dump_to=there --xla_gpu_temp_buffer_use_separate_color=true"),
        ("--xla_gpu_temp_buffer_use_separate_color=false", "--xla_gpu_temp_buffer_use_separate_color=false"),
    ],
)
def test_scratch_memory_stays_where_the_user_did_not_decide(monkeypatch, theirs, after):
    monkeypatch.setenv("XLA_FLAGS", theirs)
    settings.keep_scratch_in_place()
    settings.keep_scratch_in_place()
    assert os.environ["XLA_FLAGS"] == after


def test_products_are_left_to_cublas_where_the_user_did_not_decide(monkeypatch):
    for theirs, after in (
        ("--a=1", "--a=1 --xla_gpu_enable_triton_gemm=false"),
        ("--xla_gpu_enable_triton_gemm=true", "--xla_gpu_enable_triton_gemm=true"),
    ):
        monkeypatch.setenv("XLA_FLAGS", theirs)
        settings.leave_products_to_cublas()
        settings.leave_products_to_cublas()
        assert os.environ["XLA_FLAGS"] == after


@pytest.mark.parametrize("setting", ["keep_scratch_in_place", "leave_products_to_cublas"])
def test_xla_knows_its_options(setting):
    code = f"from ig2mj import process; process.{setting}(); print(jax.jit(lambda x: x + 1)(1))"
    assert in_a_process_of_its_own(code, XLA_FLAGS="") == "2"


def test_no_other_module_changes_the_process(repository: pathlib.Path):
    """Options of JAX and Warp, environment variables and other libraries' classes; tests of sources, line by line."""
    setters = re.compile(
        r"jax\.config\.update|os\.environ\[[^\]]*\] *=[^=]|os\.environ\.setdefault|os\.putenv"
        r"|wp\.config\.\w+ *=[^=]|wp\.config\.\w+, |gl_context\.\w+ *=|wp\.Stream\.\w+ *=|gc\.(disable|set_threshold)"
    )
    found = {
        file.relative_to(repository).as_posix()
        for folder in ("src", "converters", "homes")
        for file in (repository / folder).rglob("*.py")
        if setters.search(file.read_text(encoding="utf-8"))
    }
    assert found == {f"src/ig2mj/process/{name}.py" for name in ("settings", "warp_repairs", "gc_pause")}


def test_warp_is_quiet_inside_the_block_only():
    level = wp.config.log_level
    with quiet_warp():
        assert wp.config.log_level >= wp.LOG_WARNING
    assert wp.config.log_level == level


def test_one_process_draws_with_one_backend(monkeypatch):
    monkeypatch.setattr(settings, "_gl", "egl")
    settings.use_gl("egl")
    with pytest.raises(EngineError, match="already renders with egl"):
        settings.use_gl("osmesa")
    assert ig2mj.process.used_gl() == "egl"


def test_the_collector_rests_while_any_thread_is_in_a_block():
    rest, inside, leave = GcPause(), threading.Event(), threading.Event()

    def other() -> None:
        rest.begin()
        inside.set()
        leave.wait()
        rest.end()

    assert gc.isenabled()
    thread = threading.Thread(target=other)
    thread.start()
    inside.wait()
    rest.begin()
    assert not gc.isenabled()
    rest.end()
    assert not gc.isenabled(), "the other thread is still in"
    leave.set()
    thread.join()
    assert gc.isenabled()


def test_a_collector_that_the_user_switched_off_stays_off():
    gc.disable()
    try:
        rest = GcPause()
        rest.begin()
        rest.end()
        assert not gc.isenabled()
    finally:
        gc.enable()


@pytest.mark.slow
def test_nothing_is_collected_while_warp_captures():
    """On a CPU a capture is a recording; the repair is the same."""
    prepare_warp()
    wp.init()
    seen = []

    class Cycle:
        def __init__(self) -> None:
            self.itself = self

        def __del__(self) -> None:
            seen.append("collected")

    gc.collect()
    with wp.ScopedCapture(device="cpu"):
        Cycle()
        junk = [[k] for k in range(100_000)]  # enough for the collector to run, were it on
        assert not gc.isenabled() and not seen
    del junk
    assert gc.isenabled()
    gc.collect()
    assert seen == ["collected"]
    with pytest.raises(ZeroDivisionError), wp.ScopedCapture(device="cpu"):
        _ = 1 / 0
    assert gc.isenabled()


def test_a_compiled_function_is_traced_while_the_collector_rests():
    seen = []

    def doubled(x):
        seen.append(gc.isenabled())
        return 2 * x

    compiled = Compiled(doubled, static_argnums=0)
    assert (compiled(3), compiled(3), seen, gc.isenabled()) == (6, 6, [False], True)
    assert compiled._cache_size() == 1 and compiled.lower(4).compile()() == 8


def test_commands_collect_garbage_seldom_unless_thresholds_were_chosen():
    chosen = gc.get_threshold()
    try:
        gc.set_threshold(900, 9, 9)
        collect_seldom()
        assert gc.get_threshold() == (900, 9, 9)
        gc.set_threshold(700, 10, 10)
        collect_seldom()
        assert gc.get_threshold() == SELDOM
    finally:
        gc.set_threshold(*chosen)
