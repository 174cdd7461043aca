"""Kernels compiled for a GPU on a machine that may have none."""

from __future__ import annotations

import pathlib

import pytest
import warp as wp

from ig2mj.cli import call
from ig2mj.engine.warp import ahead
from ig2mj.engine.warp.engine import WarpEngine
from ig2mj.errors import EngineError


@pytest.mark.slow
def test_kernels_of_a_step_become_programs_of_a_gpu(tiny_home, tmp_path, monkeypatch):
    engine = WarpEngine(tiny_home, 2)
    there = ahead.launches_on_gpu(engine)
    assert len(there) > 40
    convex = [kernel.key for kernel, _ in there if "ccd_" in kernel.key]
    assert {key.split("__locals__")[0] for key in convex} == {"ig2mj_first_phase", "ig2mj_second_phase"}
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    two = sorted(there, key=lambda launch: len(launch[0].module.kernels))[:2]
    assert ahead.compile_for(two, 90, workers=1) == 2
    made = {p.name: p.stat().st_mtime_ns for p in pathlib.Path(tmp_path).rglob("*.sm90.cubin")}
    assert set(made) == {f"{k.module.get_module_identifier(b)}.sm90.cubin" for k, b in two}
    ahead.compile_for(two, 90, workers=1)
    assert made == {p.name: p.stat().st_mtime_ns for p in pathlib.Path(tmp_path).rglob("*.sm90.cubin")}


@pytest.mark.slow
def test_no_kernel_waits_for_a_tile_while_it_is_written(tiny_home, tmp_path, monkeypatch):
    from warp._src import build

    here, base, folder = [], build._build_lto_base, tmp_path / wp.config.version  # as Warp names it

    def noted(symbol, compile_it, *rest):
        def compile_now(paths):
            here.append(symbol)
            return compile_it(paths)

        return base(symbol, compile_now, *rest)

    folder.mkdir()
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(folder))
    monkeypatch.setattr(build, "_build_lto_base", noted)
    monkeypatch.setattr(build, "build_cuda", lambda source, arch, out, *a, **k: pathlib.Path(out).touch())
    there = ahead.launches_on_gpu(WarpEngine(tiny_home, 2))
    called = [launch for launch in there if launch[0].key.startswith("_loop_kernel")]
    called += [launch for launch in there if "actorize" in launch[0].key and launch not in called]
    assert len(called) > 3
    ahead.compile_for(called, 90, workers=2)
    tiles = [path for path in folder.rglob("*.lto") if path.stat().st_size]
    assert len(tiles) > 6 and here == [], "processes of their own made them"


def test_kernels_are_chosen_as_on_a_gpu():
    class Asked(WarpEngine):
        def __init__(self):
            self.seen, self.launches_of_others = [], []

        def launches(self):
            device = wp.get_device()
            self.seen.append((device.is_cuda, device.is_cpu, device.alias))
            return []

    asked = Asked()
    assert ahead.launches_on_gpu(asked) == []
    assert asked.seen == [(True, False, wp.get_device().alias)]
    assert wp.get_device().is_cuda == wp.is_cuda_available()


def test_architectures_that_are_not_known_are_listed(capsys):
    with pytest.raises(EngineError, match=r"architecture 12; it can for .*80, 86"):
        ahead.check(12)
    assert call(["warm-up", "small_home", "--arch", "90", "--engine", "native"]) == 2
    assert "'native' has none" in capsys.readouterr().err
