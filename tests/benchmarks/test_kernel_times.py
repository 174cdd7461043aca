"""What ran on a GPU, and when nothing did, from times that are known."""

from __future__ import annotations

import contextlib
import json

import jax
import pytest

from benchmarks.harness import kernel_times

US = 1000.0
EVENTS = [
    (0.0, 10 * US, "warp: _step", "Stream 1"),
    (12 * US, 8 * US, "ncclDevKernel_AllReduce_Sum_f32", "Stream 2"),
    (30 * US, 20 * US, "ncclDevKernel_AllReduce_Sum_f32", "Stream 2"),
    (40 * US, 30 * US, "sm90_xmma_gemm_f32", "Stream 1"),
    (2_070 * US, 10 * US, "loop_add_fusion", "Stream 1"),
]


@pytest.fixture
def written(tmp_path, monkeypatch) -> dict:
    monkeypatch.setattr(kernel_times, "_events", lambda folder, marked: EVENTS)
    monkeypatch.setattr(jax.profiler, "trace", lambda folder: contextlib.nullcontext())
    file = tmp_path / "new" / "learner-2-0.json"
    kernel_times.profiled_to(file, lambda: None, steps=2)
    return json.loads(file.read_text())


def test_a_profile_has_each_kernels_time_and_the_pauses_by_their_length(written):
    kernels, gaps = written["kernels"], written["gaps"]
    assert written["steps"] == 2
    reduce = kernels["ncclDevKernel_AllReduce_Sum_f32"]
    assert reduce == {
        "times": 2,
        "total": pytest.approx(28e-6),
        "least": pytest.approx(8e-6),
        "median": pytest.approx(14e-6),
    }
    assert next(iter(kernels)) == "sm90_xmma_gemm_f32", "the longest first"
    assert written["busy"] == pytest.approx(68e-6) and written["idle"] == pytest.approx(2_012e-6)
    assert gaps["under 5 us"] == {"times": 1, "total": pytest.approx(2e-6)}
    assert gaps["5 to 50 us"] == {"times": 1, "total": pytest.approx(10e-6)}
    assert gaps["over 1 ms"] == {"times": 1, "total": pytest.approx(2_000e-6)}
