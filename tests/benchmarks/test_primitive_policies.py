"""Policies over primitives: the network learns a table, and the planner demonstrates what reaches the goal."""

import numpy as np
import pytest

import ig2mj
from benchmarks.planning import primitive_policies
from benchmarks.planning.primitive_policies import Policy, Steps, demonstrations, labelled
from ig2mj.planning.steps import PlanningError


def test_the_network_learns_what_depends_on_two_facts_together():
    facts = np.array([[a, b, c] for a in (0, 1) for b in (0, 1) for c in (0, 1)], np.float32)
    action = (facts[:, 0] + facts[:, 1]).astype(int) % 2 + 2 * facts[:, 2].astype(int)
    policy = Policy.learned(facts, action, 4, seed=0)
    assert [policy(row) for row in facts] == action.tolist()


@pytest.mark.slow
def test_a_policy_that_has_learned_the_planners_steps_reaches_the_goal():
    env = ig2mj.make("goal/small_home (inside apple_0 fridge_0)", action_space="primitives", rung="symbolic")
    steps = demonstrations(env, 2, seed=0)
    facts, action, episode = steps.arrays()
    names = [str(env.actions[k]) for k in action[episode == 0]]
    assert names == ["open fridge_0", "grasp apple_0", "place_inside apple_0 fridge_0"]
    policy = Policy.learned(facts, action, len(env.actions), seed=0)
    seen = labelled(env, policy, 1, seed=5, first=2)
    assert seen.action == action[episode == 0].tolist() and set(seen.episode) == {2}


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--activities", "installing_a_moden"], "near matches: installing_a_modem"),
        (["--activities"], "expected at least one argument"),
        (["--episodes", "0"], "--episodes 0: at least 1"),
        (["--demonstrations", "1"], "--demonstrations 1: at least 2"),
    ],
)
def test_wrong_arguments_are_refused_before_processes_start(arguments, reason, capsys):
    with pytest.raises(SystemExit, match="2"):
        primitive_policies.main(arguments)
    assert reason in capsys.readouterr().err


def test_a_planner_that_reaches_no_goal_is_no_teacher(monkeypatch):
    monkeypatch.setattr(primitive_policies, "make", lambda *a, **k: None)
    monkeypatch.setattr(primitive_policies, "demonstrations", lambda *a: Steps())
    with pytest.raises(PlanningError, match="0 of 3 plans reach the goal"):
        primitive_policies.train("installing_a_modem", "bc", 3, 0)
