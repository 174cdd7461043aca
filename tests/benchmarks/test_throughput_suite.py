"""The GPU suite survives what fails, keeps to its time, and its report lets nothing count that does not."""

from __future__ import annotations

import json
import time

import pytest

pytest.importorskip("matplotlib", reason="plots need matplotlib (extra: bench)")

from benchmarks.speed import batch_report as throughput_report
from benchmarks.speed import suite as gpu_suite

ROW = {
    "scene": "made_60",
    "objects": 60,
    "worlds": 1024,
    "case": "disturbed",
    "what": "full",
    "control_steps_per_s": 90_000,
    "ms_per_control_step": 11.4,
    "compile_s": 40.0,
    "first_call_s": 3.0,
    "hand_contact_share": 0.3,
    "moved_objects_per_world": 5.0,
    "awake_dofs_beside_the_hand": 12.0,
    "capacity_overflows": 0,
    "non_finite": 0,
    "peak_device_MB_per_world": 0.6,
    "counts": True,
    "label": "",
    "device": "a GPU",
    "jax": "1",
    "warp": "2",
    "mujoco": "3",
}


def python(name: str, code: str, limit: float = 20.0) -> gpu_suite.Job:
    return gpu_suite.Job(name, ("-c", code), limit)


def test_a_job_that_fails_or_hangs_costs_only_itself(tmp_path, capsys):
    runner = gpu_suite.Runner(tmp_path, tmp_path / "rows.jsonl", 2, 60.0)
    wrote = tmp_path / "good.txt"
    start = time.monotonic()
    runner.run(
        [
            python("hangs", "import time; time.sleep(60)", limit=1.0),
            python("fails", "raise ValueError('out of memory')"),
            python("good", f"open({str(wrote)!r}, 'w').write('done')"),
        ]
    )
    assert time.monotonic() - start < 30
    assert runner.done == ["good"] and wrote.read_text() == "done"
    failed = {row["failed"]: row for row in map(json.loads, (tmp_path / "rows.jsonl").read_text().splitlines())}
    assert failed["hangs"]["why"] == "time limit"
    assert failed["fails"]["why"] == "ended with 1" and "out of memory" in failed["fails"]["tail"][-1]
    assert "FAILED hangs" in capsys.readouterr().out


def test_what_there_is_no_time_for_is_left_out_and_told(tmp_path):
    runner = gpu_suite.Runner(tmp_path, tmp_path / "rows.jsonl", 2, gpu_suite.FEWEST_SECONDS - 1)
    runner.run([python("late", "pass")])
    assert runner.done == []
    assert json.loads((tmp_path / "rows.jsonl").read_text())["why"] == "left out: no time"


def test_the_plan_has_every_case_once_and_what_is_asked_for_first(tmp_path):
    homes = {name: name for name in ("made_20", "made_60", "made_120", "aspen", "birch", "spruce", "alder")}
    jobs = gpu_suite.throughputs(homes, tmp_path, 0)
    assert len({job.name for job in jobs}) == len(jobs)
    asked = {(size, "camera" if what == "camera" else "full") for size, what in throughput_report.ASKED}
    first = {(int(name.split("_")[1]), what) for name, _, what, _ in (j.name.split("-") for j in jobs[:4])}
    assert first == asked
    worlds = {int(w) for job in jobs for w in job.words[job.words.index("--worlds") + 1 : job.words.index("--what")]}
    assert {1, 16, 256, 4096, 16384} <= worlds
    assert {job.name.split("-")[1] for job in jobs} == {"disturbed", "idle"}
    small = gpu_suite.throughputs(homes, tmp_path, 8)
    assert all("16384" not in job.words for job in small)
    order = [job.name for job in gpu_suite.calibrations(homes, tmp_path, 0)]
    assert order == ["made_20", "made_60", "made_120", "aspen", "birch", "spruce", "alder"]


def test_the_report_shows_all_rows_and_lets_only_sound_ones_count(tmp_path):
    rows = [
        ROW,
        ROW | {"worlds": 4096, "control_steps_per_s": 120_000, "counts": False, "non_finite": 2},
        ROW | {"what": "camera", "control_steps_per_s": 30_000},
        ROW | {"case": "idle", "worlds": 2048, "control_steps_per_s": 500_000},
        ROW | {"label": throughput_report.WARM, "compile_s": 8.0},
    ]
    file = tmp_path / "rows.jsonl"
    failure = {"failed": "made_120-idle", "why": "ended with 1", "tail": ["out of memory"]}
    file.write_text("".join(json.dumps(row) + "\n" for row in [*rows, failure]) + '{"scene": "made_6')
    assert len(throughput_report.main(throughput_report.Args((file,), out=tmp_path))) == 5
    folder = tmp_path / "throughput"
    text = (folder / "table.md").read_text()
    assert "| 60 objects | 100,000 | 90,000 | 90% | 1,024 of made_60 | 0.60 |" in text
    assert "120,000 (does not count)" in text and "| 40.0 | 8.0 |" in text and "out of memory" in text
    for plot in ("plot.png", "memory.png"):
        assert (folder / plot).stat().st_size > 5_000
    assert json.loads((folder / "result.json").read_text())["machine"]["what"] == "a GPU"


@pytest.mark.slow
def test_a_newer_row_takes_the_place_of_the_same_case(tmp_path):
    first, second = tmp_path / "a.jsonl", tmp_path / "b.jsonl"
    first.write_text(json.dumps(ROW) + "\n" + json.dumps(ROW | {"worlds": 1}) + "\n")
    second.write_text(json.dumps(ROW | {"control_steps_per_s": 99_000}) + "\n")
    throughput_report.main(throughput_report.Args((first,), out=tmp_path))
    rows = throughput_report.main(throughput_report.Args((second,), out=tmp_path))
    assert [(r["worlds"], r["control_steps_per_s"]) for r in rows] == [(1, 90_000), (1024, 99_000)]
    rows = throughput_report.main(throughput_report.Args((second,), fresh=True, out=tmp_path))
    assert len(rows) == 1


def test_rows_of_nothing_are_an_error(tmp_path):
    (tmp_path / "empty.jsonl").write_text("")
    with pytest.raises(SystemExit, match="there are no rows"):
        throughput_report.main(throughput_report.Args((tmp_path / "empty.jsonl",), out=tmp_path))
