"""What `ig2mj solve` refuses, in one line with the reason and what to do."""

import pytest

from ig2mj.cli import call

GOAL = "(on_top apple pan)"


@pytest.mark.parametrize(
    ("arguments", "line"),
    [
        (["(on_top aple pan)"], "no object is named 'aple'; near matches: apple"),
        (["(on_tpo apple pan)"], "no predicate is named 'on_tpo'; near matches: on_top"),
        (["(on_top stove pan)"], "the goal cannot become true: (on_top stove pan) is false, and 'stove' is fixed"),
        (["(on_top apple"], "close every bracket"),
        ([], "give a goal"),
        ([GOAL, "--robot", "turtlebot"], "a robot without hands cannot change a household"),
        ([GOAL, "--robot", "humanid"], "no robot is named 'humanid'; near matches: humanoid"),
        ([GOAL, "--split", "held"], "no split is named 'held'; near matches: held_out"),
        ([GOAL, "--seconds", "0"], "--seconds 0: must be above 0"),
        ([GOAL, "--worlds", "0"], "--worlds 0: at least one is needed"),
        ([GOAL, "--record", "/nowhere/runs.h5"], "the folder /nowhere does not exist"),
        ([GOAL, "--record", "runs.h5", "--rung", "symbolic"], "use --rung physics"),
        ([GOAL, "--video", "runs.avi"], "is not a video format that can be written"),
        ([GOAL, "--out", "/proc/results.jsonl"], "/proc/results.jsonl: cannot be written"),
    ],
)
def test_what_cannot_be_done_is_refused_in_one_line(tiny_home_folder, capsys, arguments, line):
    assert call(["solve", str(tiny_home_folder), *arguments]) == 2
    error = capsys.readouterr().err.splitlines()[-1]
    assert error.startswith("error: ") and line in error


def test_recordings_without_a_plan_have_no_video_of_it(tmp_path, capsys):
    out = ["--out", str(tmp_path / "strip.jpg")]
    assert call(["demos", "video", "demonstrations/GraspingBook.h5", *out]) == 2
    assert "was not recorded by a planner" in capsys.readouterr().err
    assert call(["demos", "video", "runs.h5", "--speed", "0", *out]) == 2
    assert "--speed is above 0" in capsys.readouterr().err


def test_an_interruption_names_only_files_that_are_there(tiny_home_folder, tmp_path, capsys, monkeypatch):
    from ig2mj.cli import solve

    def interrupted(*_):
        raise KeyboardInterrupt
        yield

    monkeypatch.setattr(solve, "_physical", interrupted)
    call(["solve", str(tiny_home_folder), GOAL, "--record", str(tmp_path / "runs.h5")])
    error = capsys.readouterr().err
    assert "0 of 1 episodes are done" in error and "holds what was done" not in error
