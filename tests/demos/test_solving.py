"""Solved episodes are demonstrations: they replay bit for bit, and failed ones are left out."""

import json

import pytest

from ig2mj.cli import call
from ig2mj.demos import Recording, replay
from ig2mj.demos.selection import chosen_runs, left_out
from ig2mj.demos.solving import Episodes, horizon_for
from ig2mj.planning import Domain, TaskPlanner, problem_of
from ig2mj.planning.physics import most_seconds

pytestmark = pytest.mark.slow

GOAL = "(on_top apple pan)"


@pytest.fixture(scope="module")
def solved(tiny_home_folder, tmp_path_factory):
    """Two episodes side by side: file of the recording, results, and the horizon."""
    file = tmp_path_factory.mktemp("solved") / "runs.h5"
    problem = problem_of(str(tiny_home_folder), GOAL)
    planner = TaskPlanner(Domain(problem.model, 2), problem.goal)
    with Episodes(problem, planner, range(2), worlds=2, record=file) as episodes:
        results = dict(episodes.solve())
        horizon = episodes.env.task.horizon
    return file, results, horizon


def test_successes_replay_bit_for_bit_where_they_were_recorded(solved):
    file, results, horizon = solved
    assert [r.success for r in results.values()] == [True, True]
    with Recording(file) as recording:
        assert [(run.world, run.success, run.complete) for run in recording.runs] == [
            (0, True, True),
            (1, True, True),
        ]
        plans = [json.loads(run.attributes["plan"]) for run in recording.runs]
        assert [plan["number"] for plan in plans] == [0, 1]
        assert [s["primitive"] for s in plans[0]["steps"]] == ["grasp", "place_on_top"]
        assert recording.value("made_with", dict)["split"] == "held_out"
        # The horizon follows the plan: two steps.
        assert recording.value("horizon", int) == horizon == round((2 * 120 + 200) / 0.1)
    done = replay(file)
    assert not done.differences and done.runs == 2


def test_metrics_and_exports_read_recordings_of_solved_episodes(solved, tmp_path, capsys):
    file, *_ = solved
    assert call(["demos", "metrics", str(file), "--json", "--settle", "5"]) == 0
    assert call(["demos", "export", str(file), "--out", str(tmp_path / "robomimic.h5")]) == 0
    assert "2 runs of" in capsys.readouterr().out


def test_episodes_that_fail_or_are_interrupted_are_left_out(tiny_home_folder, tmp_path, monkeypatch, capsys):
    from ig2mj.planning.physics import PhysicsRung

    file, count = tmp_path / "runs.h5", [0]
    begin = PhysicsRung.begin

    def interrupted(self, world, step):
        count[0] += 1
        if count[0] == 2:
            raise KeyboardInterrupt
        begin(self, world, step)

    monkeypatch.setattr(PhysicsRung, "begin", interrupted)
    assert call(["solve", str(tiny_home_folder), GOAL, "--record", str(file), "--episodes", "2"]) == 130
    assert f"0 of 2 episodes are done; {file} holds what was done" in capsys.readouterr().err
    monkeypatch.undo()
    with Recording(file) as recording:
        (run,) = recording.runs
        assert run.frames > 10 and not run.success and not run.complete
        assert left_out(recording, chosen_runs(recording)) == "1 incomplete run"
    assert not replay(file).differences


def test_solve_prints_one_line_of_json_and_lines_of_steps(tiny_home_folder, capsys):
    assert call(["solve", str(tiny_home_folder), GOAL, "--json", "--seconds", "0.001"]) == 1
    figures = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert set(figures) == {"success_rate", "q", "episodes", "replans", "seconds", "failures"}
    assert figures["success_rate"] == 0.0 and figures["episodes"] == 1


def test_recorded_plans_become_strips_and_a_page_of_them(solved, tmp_path, capsys):
    from PIL import Image

    file, *_ = solved
    strip = tmp_path / "strip.jpg"
    assert call(["demos", "video", str(file), "--out", str(strip), "--size", "80", "60"]) == 0
    assert "2 primitives" in capsys.readouterr().out
    with Image.open(strip) as image:
        width, height = image.size
    assert height == 60 and width > 5 * 80
    page = tmp_path / "gallery.md"
    assert call(["demos", "gallery", str(file), "--out", str(page)]) == 0
    assert "images/gallery/runs.jpg" in page.read_text() and "2 primitives" in page.read_text()


def test_horizons_of_plans_that_clean_are_as_long_as_cleaning_may_last():
    assert horizon_for(2) == round((2 * 120 + 200) / 0.1)
    assert horizon_for(2, cleaning=1) == round((120 + 900 + 200) / 0.1)
    assert most_seconds("scrub") == 900.0 and most_seconds("grasp") == 300.0
