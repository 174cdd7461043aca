"""Which arrays lie elsewhere, for which Warp captures a CUDA graph again (`benchmarks/harness/captures.py`)."""

from __future__ import annotations

import types

import pytest
import warp as wp


@pytest.fixture
def moves(monkeypatch):
    from benchmarks.harness.captures import FfiCallable, Moves

    monkeypatch.setattr(FfiCallable, "__init__", FfiCallable.__init__)  # given back afterwards
    return Moves()


def test_a_capture_tells_what_moved_since_the_last_one_of_the_same_call(moves):
    args = [types.SimpleNamespace(name=name) for name in ("mass", "unused", "pose", "nothing")]
    call = types.SimpleNamespace(input_args=args, array_input_indices=[0, 2, 3], array_output_indices=[0])
    moves.note("step", {"ip": [100, 200, None], "op": [300], "call_id": 1, "self": call})
    moves.note("step", {"ip": [100, 200, None], "op": [300], "call_id": 2, "self": call})  # nothing to compare with
    moves.note("step", {"ip": [100, 264, None], "op": [364], "call_id": 1, "self": call})
    first, other, again = moves.rows
    assert "moved" not in first and "moved" not in other
    assert again["moved"] == 2 and again["moved_by"] == [[64, 2, ["pose", "output 0"]]]
    assert again["arrays"] == 4 and again["inputs"] == 3


def test_it_listens_where_warp_keeps_its_graphs(moves):
    def doubled(given: wp.array(dtype=float), out: wp.array(dtype=float)):
        pass

    call = wp.jax_callable(doubled, num_outputs=1)

    def callback(self, ip, op, call_id, key):  # with the names of Warp's own
        self.captures[key] = object()

    callback(call, [1], [2], 7, "a")
    callback(call, [1], [2], 7, "a")  # kept again, which is no capture
    callback(call, [1], [10], 7, "b")
    assert [row.get("moved") for row in moves.rows] == [None, 1]
    assert "doubled" in moves.rows[1]["call"] and len(call.captures) == 2
