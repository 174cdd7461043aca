"""What a training says on the terminal."""

from __future__ import annotations

from ig2mj.learn.log import Log

ROW = {"seconds": 12.0, "env_steps": 64000, "steps_per_second": 5000.0, "updates_per_second": 40.0}
SHARES = {"learner_share": 0.25, "simulator_share": 0.75}


def test_before_an_episode_has_ended_losses_are_shown(capsys):
    log = Log(None, minutes=10.0)
    log.row({**ROW, **SHARES, "return": None, "success": None, "actor_loss": 0.5, "critic_loss": 1.25, "copied": 0.1})
    line = capsys.readouterr().err
    assert "12.0 of 600 s" in line and "actor_loss 0.5  critic_loss 1.25" in line
    assert " -" not in line and "copied" not in line


def test_after_an_episode_return_and_success_are_shown(capsys):
    Log(None).row({**ROW, **SHARES, "return": 1.5, "success": 0.5, "actor_loss": 0.5})
    line = capsys.readouterr().err
    assert "return 1.500  success 50.0%" in line and "actor_loss" not in line


def test_cloning_says_how_many_updates_and_which_losses(capsys):
    Log(None, minutes=1.0).row({**ROW, "env_steps": 1200, "steps_per_second": None, "success": None, "actor_loss": 0.5})
    line = capsys.readouterr().err
    assert "12.0 of 60 s  1,200 updates  actor_loss 0.5" in line and "steps/s" not in line
