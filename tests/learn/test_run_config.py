"""Files of settings for `ig2mj train --config`, and those of the policies that ship."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ig2mj.agents.base import HandReading
from ig2mj.envs.observations import Space
from ig2mj.envs.registry import find_task
from ig2mj.errors import Ig2mjError, InputError, UnknownNameError
from ig2mj.learn import algorithms
from ig2mj.learn.bc import BCConfig
from ig2mj.learn.dagger import DaggerConfig
from ig2mj.learn.occlusion import OcclusionConfig
from ig2mj.learn.occlusion.projection import CameraProjection
from ig2mj.learn.perception import Perception
from ig2mj.learn.policies import Policy, flat
from ig2mj.learn.ppo import PPOConfig
from ig2mj.learn.run_config import RunSettings, initial_policy, read_run_file, settings_of
from ig2mj.learn.sac import SACConfig
from ig2mj.learn.shipped import CHECKOUT
from ig2mj.tasks.activity_objective import privileged_names
from ig2mj.tasks.task import Task

SIDE = 128

FILES = sorted(CHECKOUT.glob("*.toml"))


def test_every_policy_that_ships_has_a_file_to_train_it_again():
    assert {f.stem for f in CHECKOUT.glob("*.npz")} <= {f.stem for f in FILES}


@pytest.mark.parametrize("file", FILES, ids=lambda f: f.stem)
def test_a_file_that_ships_says_what_a_run_is(file):
    options, changes = read_run_file(file)
    settings, config, occlusion = settings_of(options["algo"], changes)
    algorithms.check_settings(config, occlusion)
    assert options["robot"] in find_task(options["env"]).robots
    assert not SIDE % settings.image_size and (settings.rows is None or options["obs"] == "rgbd")


@pytest.mark.parametrize("name", sorted(f.stem for f in CHECKOUT.glob("*.npz")))
def test_an_actor_made_of_the_settings_has_the_layers_of_the_policy_that_ships(name, monkeypatch):
    """Its environment is known by names and sizes alone, so that nothing is compiled."""
    policy = Policy.load(CHECKOUT / f"{name}.npz")
    depends, memory = policy.card["depends"], policy.card["net"].get("recall", {})
    options, changes = read_run_file(name)
    for key, known in (("env", "task"), ("robot", "robot"), ("grasping", "grasping"), ("obs", "mode")):
        assert options[key] == depends[known]
    settings, config, occlusion = settings_of(options["algo"], changes)
    task = find_task(options["env"])
    hidden = privileged_names(task, options["robot"]) if isinstance(task, Task) else ()
    spaces = {n: Space((size,), np.float32, -np.inf, np.inf) for n, size in depends["vector"].items()}
    if options["obs"] == "rgbd":
        spaces["privileged_state"] = Space((len(hidden),), np.float32, -np.inf, np.inf)
        spaces["rgb"] = Space((SIDE, SIDE, 3), np.uint8, 0.0, 255.0)
        spaces["depth"] = Space((SIDE, SIDE, 1), np.float32, 0.0, 10.0)
    readings = [HandReading(*pair) for pair in zip(memory.get("grips", ()), memory.get("hands", ()), strict=True)]
    env: Any = SimpleNamespace(
        action_space=Space((len(depends["actions"]),), np.float32, -1.0, 1.0),
        privileged_names=hidden,
        horizon=task.horizon,
        core=SimpleNamespace(controllers=[SimpleNamespace(hand_readings=readings)]),
    )
    side, rows = settings.image_size, settings.rows or (0, settings.image_size)
    ahead = CameraProjection(
        (0.0, 0.0, 0.0), ((0.0, 0.0, -1.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), (1.0, 1.0), side, rows
    )
    monkeypatch.setattr(algorithms, "camera_projection", lambda env, perception: ahead)
    monkeypatch.setattr(algorithms, "expert_of", lambda env: lambda state, beliefs=None: jnp.zeros((1, 1)))
    monkeypatch.setattr(algorithms, "start_images", lambda *given: None)
    perception = Perception(spaces, options["obs"], side, settings.rows, hidden)
    algorithm = algorithms.make_algorithm(config, perception, env, expert=settings.expert, occlusion=occlusion)
    made = flat(jax.eval_shape(lambda key: algorithm.init(key).actor, jax.random.PRNGKey(0)))
    own = {n: a.shape for n, a in made.items() if algorithm.actor.acts_on_prediction or not n.startswith("guess/")}
    assert own == {n: w.shape for n, w in policy.weights.items()}
    if memory:
        found = algorithm.memory.card()
        assert {**found, "whole": memory.get("whole", True)} == {**memory, "whole": found["whole"]}


def test_settings_of_a_file_are_overridden_by_later_ones(tmp_path):
    file = tmp_path / "run.toml"
    file.write_text(
        'env = "CookingMeat"\nminutes = 3\n[settings]\nengine = "warp"\nactor_layers = [8, 8]\ngamma = 0.9\n'
    )
    options, changes = read_run_file(file)
    assert options == {"env": "CookingMeat", "minutes": 3.0}
    settings, config, occlusion = settings_of("sac", (*changes, "gamma=0.5", "save_buffer=true"))
    assert settings == RunSettings(engine="warp", save_buffer=True) and occlusion == OcclusionConfig()
    assert config == dataclasses.replace(SACConfig(), actor_layers=(8, 8), gamma=0.5)
    assert settings_of("sac", ())[1].batch_size < settings_of("sac", (), on_gpu=True)[1].batch_size


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("env = ", "is not TOML"),
        ('enf = "CookingMeat"', "near matches: env"),
        ("worlds = true", "worlds"),
        ('minutes = "long"', "minutes"),
        ("settings = 3", "is not a table"),
        ("[settings]\nactor_layers = [[1]]", "actor_layers"),
    ],
)
def test_a_file_that_is_none_is_refused_with_what_is_wrong(text, said, tmp_path):
    file = tmp_path / "run.toml"
    file.write_text(text)
    with pytest.raises((InputError, UnknownNameError), match=said):
        read_run_file(file)
    with pytest.raises(InputError, match="no such file"):
        read_run_file(tmp_path / "none.toml")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("programs=3", "1 or 2"),
        ("gama=0.5", "gamma"),
        ("expert=maybe", "bool"),
        ("image_size=0", "at"),
        ("looks=dusk", "day"),
    ],
)
def test_settings_that_cannot_be_are_refused(change, said):
    with pytest.raises(Ig2mjError, match=said):
        settings_of("sac", (change,))


@pytest.mark.parametrize(
    ("algo", "change", "said"),
    [
        ("sac", "beta_decay=1", "^--set beta_decay: beta_decay is a setting of dagger, not of sac$"),
        ("sac", "alone=1", "'alone' is now 'beta_decay'; beta_decay is a setting of dagger, not of sac"),
        ("dagger", "n_step=3", "n_step is a setting of sac, not of dagger"),
        ("sac", "worlds=8", "worlds is an option, --worlds"),
    ],
)
def test_a_setting_of_another_algorithm_is_named_as_such(algo, change, said):
    with pytest.raises(Ig2mjError, match=said):
        settings_of(algo, (change,))


def test_an_old_name_is_reported_by_the_first_call_only(capsys):
    changes = ("copy=1", "paper_rl=true")
    first, again = settings_of("sac", changes), settings_of("sac", changes, quiet=True)
    assert first == again and first[1].bc_coef == 1 and first[0].relaxed_thresholds
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 2 and "'copy' is now 'bc_coef'; the old name will be removed in 0.3" in said[0]


@pytest.mark.parametrize(
    ("rows", "said"),
    [((80, 128), r"32 rows \(set image_size=128\)"), ((8,), "two numbers"), ((9, 8), "such as image_rows=16,32")],
)
def test_rows_that_an_image_does_not_have_are_refused_with_what_to_set(rows, said):
    with pytest.raises(Ig2mjError, match=said):
        assert RunSettings(image_rows=rows).rows
    assert RunSettings(image_rows=(80, 128), image_size=128).rows == (80, 128)


def test_a_misspelt_file_and_a_missing_first_stage_are_named():
    with pytest.raises(UnknownNameError, match="near matches: CookingMeat"):
        read_run_file("CookinMeat")
    name = "GraspingBook-fetch-physical-sac"
    with pytest.raises(InputError, match=f"`ig2mj train --config {name} --out elsewhere/{name}`"):
        initial_policy(f"elsewhere/{name}")


def test_algorithms_know_nothing_of_learning_under_occlusion_nor_of_experts():
    """They know `ig2mj.learn.protocols`; `algorithms`, `policies` and `run_config` put the parts together."""
    folder = Path(algorithms.__file__).parent
    composing = {"algorithms", "policies", "policy_checks", "run_config"}
    wrong = [
        file.name
        for file in folder.glob("*.py")
        if file.stem not in composing
        and any(
            word in file.read_text()
            for word in ("import ig2mj.learn.occlusion", "from ig2mj.learn.occlusion", "tasks.experts import")
        )
    ]
    assert not wrong


def test_the_guide_has_every_setting():
    page = (CHECKOUT.parent / "docs" / "guide" / "learning.md").read_text()
    configs = RunSettings(), OcclusionConfig(), SACConfig(), PPOConfig(), DaggerConfig(), BCConfig()
    names = {field.name for config in configs for field in dataclasses.fields(config)}
    assert not {name for name in names if f"`{name}`" not in page}


def test_homes_are_a_set_of_homes_or_names_that_exist():
    assert RunSettings(homes="train").varied == {"homes": "train"}
    assert RunSettings(homes=" birch, small_home,").varied == {"homes": ["birch", "small_home"]}
    for homes, near in (("trian", "train"), ("birch,wilow", "willow"), ("train,birhc", "train")):
        with pytest.raises(UnknownNameError, match=near):
            _ = RunSettings(homes=homes).varied
    with pytest.raises(Ig2mjError, match="names no home"):
        _ = RunSettings(homes=" , ").varied
