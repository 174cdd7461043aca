"""The placement benchmark leaves a line for each pair, keeps it when it is run again, and makes its table of all."""

from __future__ import annotations

import json

from benchmarks.sampling import placement


def test_pairs_are_measured_once_and_summed_up(tmp_path, capsys):
    args = placement.Args(homes=("small_home",), requests=2, seeds=2, predicates=("on_floor",), out=tmp_path)
    placement.main(args)
    file = tmp_path / "placement" / "on_floor_small_home.jsonl"
    before = file.read_bytes()
    lines = [json.loads(line) for line in before.splitlines()]
    assert len(lines) == 2
    for line in lines:
        assert len(line["made_s"]) + len(line["failed_s"]) == line["seeds"] == 2
        assert line["stayed"] <= len(line["made_s"]) and line["deepest_mm"] <= 2.0
    args.resume = True
    placement.main(args)
    assert file.read_bytes() == before
    row = json.loads((tmp_path / "placement" / "result.json").read_text())["rows"][0]
    assert row["requests"] == 4 and row["samples"] == sum(len(line["made_s"]) for line in lines)
    assert "on_floor" in capsys.readouterr().out


def test_a_pair_that_was_given_up_counts_as_if_every_seed_had_failed():
    given_up = {"pair": ["a", "b"], "seeds": 20, "made_s": [], "failed_s": [1.0, 2.0], "stayed": 0}
    made = {"pair": ["a", "c"], "seeds": 20, "made_s": [0.01] * 20, "failed_s": [], "stayed": 20}
    rest = {"deepest_mm": 0.1, "reasons": {"fell": 2}}
    row = placement.summary("on_top", [given_up | rest, made | rest])
    assert row["success"] == 0.5 and row["requests"] == 40 and row["pairs_that_succeeded"] == 1
    assert row["true_after_5_s"] == 1.0 and row["longest_to_give_up"] == 2.0
