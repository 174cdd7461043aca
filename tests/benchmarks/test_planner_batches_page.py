"""The page of the planner in many worlds holds the last row of each size, and each policy with its interval."""

import json

import benchmarks.planning.batches_page as pages

ROW = {
    "activity": "making_tea",
    "engine": "warp",
    "worlds": 64,
    "processes": 8,
    "episodes": 20,
    "success_rate": 0.9,
    "success_low": 0.7,
    "success_high": 0.97,
    "seconds": 60.0,
    "demonstrations_hour": 1080.0,
    "steps_per_second": 5000.0,
    "planning_share": 0.2,
    "waiting_share": 0.1,
    "planned": 100.0,
    "commit": "abc",
}


def test_a_row_replaces_the_one_of_the_same_size(tmp_path):
    file = tmp_path / "batched.jsonl"
    key = lambda row: (row["activity"], row["engine"], row["worlds"])  # noqa: E731
    pages.take_in([ROW], file, key)
    pages.take_in([{**ROW, "episodes": 30}, {**ROW, "worlds": 256}], file, key)
    lines = pages.read_lines(file)
    assert [line["episodes"] for line in lines] == [30, 20]
    text = pages.page(lines, [])
    assert "| making_tea | warp | 64 | 8 | 30 | 90% (70% to 97%) | 1,080 | 5,000 | 20.0% | 10.0% | 100 of 480 |" in text


def test_policies_come_with_their_curves(tmp_path):
    run = tmp_path / "bc" / "making_tea"
    run.mkdir(parents=True)
    (run / "progress.csv").write_text("seconds,held_out_loss\n1,0.5\n2,0.25\n", encoding="utf-8")
    result = {"episodes": 32, "success_rate": 0.5, "success_low": 0.3, "success_high": 0.7}
    run.with_suffix(".json").write_text(json.dumps(result), encoding="utf-8")
    (row,) = pages.policies_of(tmp_path)
    assert "| making_tea | bc | 32 | 50% (30% to 70%) | 0.50, 0.25 |" in pages.page([], [row])


def test_policies_over_primitives_have_a_table_of_their_own():
    row = {
        "activity": "making_tea",
        "algorithm": "bc, primitives",
        "episodes": 20,
        "success_rate": 0.9,
        "success_low": 0.7,
        "success_high": 0.97,
        "q": 0.95,
        "primitives": 5.25,
        "demonstrations": 100,
        "steps": 400,
        "agreement": [0.98, 1.0],
        "commit": "abc",
    }
    text = pages.page([], [row])
    assert "| making_tea | bc | 100 | 400 | 98.0%, 100.0% | 20 | 90% (70% to 97%) | 0.95 | 5.2 |" in text
    assert "held-out loss" not in text


def test_what_is_written_by_hand_stays(tmp_path, monkeypatch):
    page = tmp_path / "page.md"
    page.write_text(f"# Old\n\n| table |\n\n{pages.OWN}\n\nA note.\n", encoding="utf-8")
    monkeypatch.setattr("sys.argv", ["batches_page", "--results", str(tmp_path), "--page", str(page)])
    for _ in range(2):
        pages.main()
        text = page.read_text(encoding="utf-8")
        assert text.startswith("# The planner") and text.endswith(f"\n\n{pages.OWN}\n\nA note.\n")
        assert "| table |" not in text
