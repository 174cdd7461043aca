"""Episode files and what is reported of their axes."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ig2mj.envs.experts import expert_of
from ig2mj.envs.rollout import play
from ig2mj.errors import EngineError, InputError, PolicyServerError, UnknownNameError
from ig2mj.learn.axes import AxisResult, evaluate_axes
from ig2mj.learn.episode_draws import OF_AXIS, SETS, EpisodeDraws
from ig2mj.learn.episodes import (
    AXES,
    EVERY,
    FORMAT_VERSION,
    Episodes,
    find_episodes,
    make_episodes,
    parse_axes,
    shipped_episodes,
)
from ig2mj.learn.stages import stages


def test_names_of_axes_are_checked():
    assert parse_axes("all") == EVERY and parse_axes("physics") == ("nominal", "physics")
    with pytest.raises(UnknownNameError, match=r"'light'.*lights"):
        parse_axes("light")
    with pytest.raises(EngineError, match="no axis is named"):
        parse_axes(" , ")


def test_rates_have_intervals_and_no_episode_has_none():
    found = AxisResult("lights", [True, True, False, False], [1.0, 1.0, 0.5, 0.0]).as_dict()
    assert found["success_rate"] == 0.5 and found["q"] == 0.625 and found["episodes"] == 4
    assert 0.1 < found["success_low"] < 0.2 and 0.8 < found["success_high"] < 0.9
    assert AxisResult("lights", [], []).as_dict()["success_rate"] is None


@pytest.mark.slow
def test_what_was_played_before_a_server_failed_is_kept(cooking_meat):
    calls = []

    def act(state):
        calls.append(1)
        if len(calls) > 2:
            raise PolicyServerError("gone")
        return np.zeros((2, *cooking_meat.action_space.shape), np.float32)

    played = play(cooking_meat.with_horizon(2), act, 4, in_order=True, seeds=[7, 8, 9, 10])
    assert played.success == [False, False] and str(played.failed) == "gone"
    assert len(played.q) == 2 and all(0 <= q < 1 for q in played.q)


def test_factors_come_in_sets_and_all_else_is_of_the_episode():
    arrays = {"mass": np.arange(SETS)[:, None], "noise": np.arange(100) / 100, "instruction": np.arange(100)}
    draws = EpisodeDraws(arrays, {"fetch": np.zeros((100, 3))})
    found = draws.values(("physics", "sensor_noise", "robot_start"), [0, SETS + 1], "fetch")
    assert found["mass"].ravel().tolist() == [0, 1] and "instruction" not in found
    np.testing.assert_allclose(found["noise"], [0.0, (SETS + 1) / 100], atol=1e-6)
    assert found["robot_start"].shape == (2, 3)
    assert "robot_start" not in draws.values(("robot_start",), [0], "humanoid")


@pytest.mark.slow
def test_shipped_episodes_have_every_axis_and_values_of_each():
    files = {name: Episodes.load(file) for name, file in shipped_episodes().items()}
    assert files["CookingMeat"].count == 200
    for name, episodes in files.items():
        assert episodes.header["format_version"] == FORMAT_VERSION, name
        assert set(EVERY) - set(episodes.axes) <= {"homes"}, name
        assert ("homes" in episodes.axes) == bool(episodes.homes), name
        drawn = {field for axis in AXES for field in OF_AXIS.get(axis, ())}
        assert set(episodes.draws.arrays) == drawn and set(episodes.draws.robots) == set(episodes.header["robots"])
        used = {model for models in episodes.draws.models for model in models}
        assert used <= set(episodes.axes["objects"]["objects"]["models"]), name


@pytest.mark.slow
def test_a_file_has_all_of_its_episodes_and_a_change_shows(tmp_path):
    made = make_episodes("GraspingBook", 3)
    made.save(tmp_path / "book.npz")
    back = Episodes.load(find_episodes(tmp_path / "book.npz"))
    assert back.count == 3 and back.header == made.header and set(back.axes) <= set(EVERY)
    assert {"humanoid", "fetch"} <= set(back.header["robots"])
    dataclasses.replace(back, seeds=(1, 2, 3)).save(tmp_path / "other.npz")
    with pytest.raises(InputError, match="hash does not fit"):
        Episodes.load(tmp_path / "other.npz")
    dataclasses.replace(back, seeds=(1, 2)).save(tmp_path / "short.npz")
    with pytest.raises(InputError, match="has not 2 rows"):
        Episodes.load(tmp_path / "short.npz")
    assert [part.home for part in back.parts("homes", 3)] == list(back.homes)[:3]
    assert [part.numbers for part in back.parts("homes", 3)] == [(0,), (1,), (2,)]


@pytest.mark.slow
def test_the_values_of_a_file_are_played_whatever_the_seeds_say():
    """Noise, masses, the model and the robot's pose are those of the file; an expert reaches its goal elsewhere."""
    made = make_episodes("GraspingBook", 2)
    draws = dataclasses.replace(made.draws, arrays={**made.draws.arrays, "noise": np.array([0.25, 0.5], np.float16)})
    own = dataclasses.replace(made, draws=draws, seeds=(1, 2))
    (stage,) = stages(own, ["all"], 2)
    env = stage.environment({"worlds": 2, "engine": "native", "observations": "proprioception"})
    state = stage.start(env, "all", [0, 1])
    np.testing.assert_allclose(np.asarray(state.draw.noise), [0.25, 0.5])
    names = [env.scene.object_names[int(row[0])] for row in np.asarray(state.draw.models)]
    entries = {entry.name: f"{entry.category}/{entry.model}" for entry in env.scene.manifest.objects}
    assert [[entries[name]] for name in names] == list(made.draws.models)
    np.testing.assert_allclose(np.asarray(state.draw.robot_start), draws.robots["humanoid"], atol=1e-6)
    fields = env.core.engine.snapshot(state.batch.world.physics).model_fields
    own_mass = np.asarray(fields.body_mass) / np.maximum(env.scene.model.body_mass, 1e-9)
    book = [env.scene.model.body(name).id for name in names]
    number = [env.scene.object_index(name) for name in names]
    np.testing.assert_allclose(own_mass[[0, 1], book], draws.arrays["mass"][[0, 1], number].astype(float), rtol=2e-3)
    played = evaluate_axes(own, ["object_poses", "homes"], 2, _expert, {"worlds": 2, "engine": "native"})
    assert [result.success for result in played.results] == [[True, True], [True, True]]


def _expert(env):
    expert = expert_of(env)
    return lambda state: np.asarray(expert(state))
