"""What ran on a GPU in an update, by kind, from times that are known."""

from __future__ import annotations

import contextlib
import json

import jax
import kernel_times
import learner_kernels
import pytest

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


def test_kinds_waiting_and_pauses_of_an_update(written):
    found = learner_kernels.shares(written)
    ms = 1e-3 / 2  # of two updates, from microseconds
    assert found["collectives"] == pytest.approx(28 * ms)
    assert found["of collectives: waiting"] == pytest.approx(12 * ms), "the shorter took 8 us, so the longer waited 12"
    assert found["the worlds (Warp)"] == pytest.approx(10 * ms)
    assert found["matrices, convolutions"] == pytest.approx(30 * ms)
    assert found[learner_kernels.OTHER] == pytest.approx(10 * ms)
    assert found["both"] == pytest.approx(2_080 * ms)
    assert found["busy"] == pytest.approx(68 * ms) and found["idle"] == pytest.approx(2_012 * ms)
    assert found["idle, under 5 us"] == pytest.approx(2 * ms) and found["idle, 5 to 50 us"] == pytest.approx(10 * ms)
    assert found["idle, over 1 ms"] == pytest.approx(2_000 * ms) and found["launches"] == 2.5


def test_kernels_that_differ_most_come_first(written):
    other = json.loads(json.dumps(written))
    other["kernels"]["loop_add_fusion"]["total"] = 1.0
    del other["kernels"]["warp: _step"]
    rows = learner_kernels.differences([written, other], 2)
    assert [row[0] for row in rows] == ["loop_add_fusion", "warp: _step"]
    assert rows[1][1:] == ["0.0050", "0.0000"]
