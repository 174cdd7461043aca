"""Policies that ship: loaded by name, installed from a run with a model card, within their sizes."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import ClassVar

import jax
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from small_envs import PointMass

from ig2mj.cli import call
from ig2mj.errors import InputError, PolicyMismatch, UnknownNameError
from ig2mj.learn import shipped
from ig2mj.learn.bc import BC, BCConfig
from ig2mj.learn.evaluate import draws
from ig2mj.learn.perception import Perception
from ig2mj.learn.policies import Policy, depends_of, looks_of, world_of
from ig2mj.learn.running_stats import RunningStats
from ig2mj.sensors.base import SensorOptions, Space

EVALUATION = {
    "split": "held_out",
    "episodes": 1000,
    "success_rate": 0.987,
    "success_low": 0.978,
    "success_high": 0.992,
    "mean_return": 1.5,
    "engine": "native",
    "drawn": False,
}


def made(sizes=(16, 16), **world) -> Policy:
    """An untrained policy, said to be for CookingMeat."""
    env = PointMass(2)
    perception = Perception(env.observation_spaces)
    algorithm = BC(perception, 2, BCConfig(actor_layers=sizes))
    actor, _ = jax.jit(algorithm.imitation.init)(jax.random.PRNGKey(0))
    learner = type("Learner", (), {"actor": actor, "moments": RunningStats.initial(4)})
    said = {"task": "CookingMeat", "robot": "humanoid", "grasping": "mitten", "actions": ["x", "y"], **world}
    depends = depends_of({**world_of(env), **said}, perception)
    command = "ig2mj train CookingMeat --algo bc --out /somewhere/runs/meat --demos /somewhere/meat.h5"
    return Policy.of(algorithm, learner, depends, {"command": command, "seed": 0, "algorithm": "bc"})


@pytest.fixture
def run(tmp_path):
    """A run's folder with its evaluation, and a folder for what ships."""
    folder = tmp_path / "run"
    folder.mkdir()
    policy = made()
    policy.save(folder / "policy.npz")
    evaluation = tmp_path / "evaluation.json"
    evaluation.write_text("a remark\n" + json.dumps({**EVALUATION, "weights": policy.weights_digest}) + "\n")
    (tmp_path / "policies").mkdir()
    return folder, evaluation, tmp_path / "policies"


def test_a_run_becomes_a_policy_that_is_found_by_name(run, monkeypatch):
    folder, evaluation, target = run
    file = shipped.add_policy(folder, evaluation, folder=target)
    assert file.name == "CookingMeat-state.npz"
    loaded = Policy.load(file)
    assert loaded.card["evaluation"]["success_rate"] == 0.987
    assert loaded.weights_digest == made().weights_digest
    assert "somewhere" not in loaded.card["command"] and "--demos meat.h5" in loaded.card["command"]
    page = file.with_suffix(".md").read_text()
    assert "98.7% of 1,000 held-out episodes" in page and "help | none" in page
    monkeypatch.setattr(shipped, "shipped", lambda: {"CookingMeat-state": file})
    assert shipped.find_policy("CookingMeat-state") == file
    assert shipped.find_policy("ig2mj/CookingMeat-state-v0") == file
    for wrong in ("CookingMeat-stat", "ig2mj/CookingMeat-stat-v0"):
        with pytest.raises(UnknownNameError, match="'CookingMeat-stat'; near matches: CookingMeat-state"):
            shipped.find_policy(wrong)


def test_a_name_says_what_is_unusual():
    assert shipped.usual_name(made()) == "CookingMeat-state"
    assert shipped.usual_name(made(robot="fetch", grasping="physical")) == "CookingMeat-fetch-physical-state"
    of_homes = made(robot="fetch")
    of_homes.card["homes"] = ["birch", "cedar"]
    assert shipped.usual_name(of_homes) == "CookingMeat-homes-fetch-state"
    assert shipped.usual_name(made(task="PointNavigation", robot="turtlebot", grasping="physical")) == "PointNavigation"


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"weights": "0"}, "weights: is the evaluation of another policy"),
        ({"split": "train"}, "not of held-out states"),
        ({"episodes": None}, "episodes: is missing"),
    ],
)
def test_an_evaluation_of_something_else_is_refused(run, change, told):
    folder, evaluation, target = run
    found = json.loads(evaluation.read_text().splitlines()[-1]) | change
    evaluation.write_text(json.dumps({k: v for k, v in found.items() if v is not None}))
    with pytest.raises(InputError, match=told):
        shipped.add_policy(folder, evaluation, folder=target)
    assert not list(target.iterdir())


def test_a_file_too_large_is_refused_and_leaves_nothing(run, monkeypatch):
    folder, evaluation, target = run
    for limit, told in (("MOST_BYTES", "a policy may have"), ("MOST_BYTES_OF_ALL", "all policies together")):
        with monkeypatch.context() as patched:
            patched.setattr(shipped, limit, 1000)
            with pytest.raises(InputError, match=told):
                shipped.add_policy(folder, evaluation, folder=target)
        assert not list(target.iterdir())


def test_what_ships_is_within_its_sizes_and_evaluated_on_a_thousand_held_out_episodes():
    files = shipped.shipped((shipped.CHECKOUT,))
    assert sum(file.stat().st_size for file in files.values()) <= shipped.MOST_BYTES_OF_ALL
    for name, file in files.items():
        assert file.stat().st_size <= shipped.MOST_BYTES, name
        policy = Policy.load(file)
        assert policy.card["evaluation"]["episodes"] >= shipped.EPISODES, name
        assert policy.card["digest"] and shipped.usual_name(policy) == name
        assert file.with_suffix(".md").read_text() == shipped.model_card(name, policy)


def test_a_policy_for_another_robot_is_a_mismatch_that_names_the_pair():
    env = PointMass(2)
    with pytest.raises(PolicyMismatch, match="was made for task = CookingMeat; you asked for PointMass"):
        made().check(env, Perception(env.observation_spaces))


def test_the_shell_lists_shows_and_adds(run, monkeypatch, capsys):
    folder, evaluation, target = run
    assert call(["policies", "add", str(folder), "--evaluation", str(evaluation), "--folder", str(target)]) == 0
    assert "CookingMeat-state.npz" in capsys.readouterr().out
    assert call(["policies", "show", str(target / "CookingMeat-state.npz")]) == 0
    assert "# CookingMeat-state" in capsys.readouterr().out
    monkeypatch.setattr(shipped, "shipped", lambda: {"CookingMeat-state": target / "CookingMeat-state.npz"})
    assert call(["policies", "list", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["CookingMeat-state"]["evaluation"]["episodes"] == 1000


@pytest.mark.parametrize("drawn", [False, True])
def test_who_plays_a_policy_draws_its_actions_where_its_success_is_of_drawn_ones(run, capsys, drawn):
    folder, evaluation, ships = run
    said = json.loads(evaluation.read_text().splitlines()[1]) | {"drawn": drawn}
    evaluation.write_text(json.dumps(said))
    assert call(["policies", "add", str(folder), "--evaluation", str(evaluation), "--folder", str(ships)]) == 0
    capsys.readouterr()
    (added,) = ships.glob("*.npz")
    assert draws(Policy.load(added)) == drawn
    assert not draws(made()), "it was not evaluated"


def test_a_card_says_with_which_looks_images_were_seen():
    images = Perception({"rgb": Space((32, 32, 3), np.uint8, 0.0, 255.0)}, "rgbd")
    world = {"task": "Toy", "robot": "dot", "grasping": "mitten", "actions": ["x"], "privileged": []}
    plain, day = depends_of(world, images), depends_of({**world, "looks": "day"}, images)
    assert "looks" not in plain and day == {**plain, "looks": "day"}
    policies = [Policy({"depends": depends}, {}, np.zeros(1), np.ones(1)) for depends in (plain, day)]
    assert [looks_of(policy) for policy in policies] == ["plain", "day"]
    assert looks_of(made()) is None, "a policy that sees no images"
    policies[0].check(Seeing("plain"), images)
    with pytest.raises(PolicyMismatch, match="was made for looks = day; you asked for plain"):
        policies[1].check(Seeing("plain"), images)
    with pytest.raises(PolicyMismatch, match="was made for looks = plain; you asked for day"):
        policies[0].check(Seeing("day"), images)


class Seeing:
    """As much of an environment with images as a policy is compared with."""

    task = SimpleNamespace(name="Toy", code=None)
    robot, grasping, action_names, privileged_names = "dot", "mitten", ("x",), ()
    action_space = Space((1,), np.float32, -1.0, 1.0)
    observation_spaces: ClassVar = {"rgb": Space((32, 32, 3), np.uint8, 0.0, 255.0)}

    def __init__(self, looks: str):
        self.sensor_options = SensorOptions(looks=looks)


def test_a_card_says_in_words_what_differs_between_episodes():
    assert shipped._varied("objects,lights") == "objects, lights"
    given = '{"objects": true, "lights": false,\n"materials": {"colour": [0.5, 1.6]}, "robot_start": {"shift": 0.25}}'
    assert shipped._varied(given) == "objects, materials (colour 0.5 to 1.6), robot_start (shift 0.25)"
