"""Axes that share an environment are played as in environments of their own."""

from __future__ import annotations

import dataclasses

import jax
import numpy as np
import pytest

from ig2mj.engine.model_fields import given, own_fields
from ig2mj.envs.experts import expert_of
from ig2mj.errors import EngineError
from ig2mj.learn.axes import evaluate_axes
from ig2mj.learn.episode_draws import EpisodeDraws
from ig2mj.learn.episodes import EVERY, Episodes, find_episodes, shipped_episodes
from ig2mj.learn.stages import stages

USUAL = tuple(axis for axis in EVERY if axis not in ("objects", "homes", "all"))
HOMES = ("elm", "juniper", "poplar", "willow")


@pytest.fixture(scope="module")
def book() -> Episodes:
    return Episodes.load(find_episodes("GraspingBook"))


def test_all_axes_need_two_environments_and_one_for_each_further_home(book):
    found = stages(book, EVERY, 8)
    assert [(stage.axes, stage.part.home) for stage in found] == [
        (USUAL, None),
        (("objects", "all"), None),
        *((("homes",), home) for home in HOMES),
    ]
    assert set(found[0].settings) == set(USUAL) - {"nominal", "object_poses"}
    assert found[0].options["pool"].size == 2 * book.count, "the usual start states, then those of object_poses"
    assert set(found[1].settings) == {*found[0].settings, "objects"}
    assert [len(stage.part.numbers) for stage in found] == [8, 8, 2, 2, 2, 2]


def test_an_environment_varies_no_more_than_is_played(book):
    (alone,) = stages(book, ["nominal"], 4)
    assert "randomize" not in alone.options and alone.options["pool"].size == book.count
    (poses,) = stages(book, ["object_poses"], 4)
    assert "randomize" not in poses.options and poses.options["pool"] is not None
    np.testing.assert_array_equal(poses.options["pool"].physics.scene.qpos, book.poses.physics.scene.qpos)
    (two,) = stages(book, ["nominal", "lights"], 4)
    assert set(two.options["randomize"]) == {"lights"}


def test_what_a_file_cannot_say_of_all_axes_together_is_played_apart(book):
    by_seeds = dataclasses.replace(book, draws=EpisodeDraws({}, {}))
    assert [stage.axes for stage in stages(by_seeds, ("nominal", "lights"), 4)] == [("nominal",), ("lights",)]
    unknown = stages(book, ("nominal", "lights", "robot_start"), 4, "turtlebot")
    assert [stage.axes for stage in unknown] == [("nominal", "lights"), ("robot_start",)]
    header = {**book.header, "axes": {**book.axes, "lights": {"lights": {**book.axes["lights"]["lights"], "off": 0.5}}}}
    other = stages(dataclasses.replace(book, header=header), ("lights", "nominal", "all"), 4)
    assert [stage.axes for stage in other] == [("lights", "nominal"), ("all",)], "other settings than those of `all`"
    with pytest.raises(EngineError, match="have no axis"):
        stages(dataclasses.replace(book, header={**header, "axes": {}}), ["lights"], 4)


def test_values_of_the_scene_change_nothing(book):
    """Masses, friction, damping, colours and textures to the bit; lights, camera and noise by factors of 1 and 0."""
    stage = stages(book, USUAL, 2)[0]
    starts = stage.environment({"engine": "native", "worlds": 2, "observations": "proprioception"}).core.starts
    made, draw = starts.with_values(np.array([0, 1]), {})
    fields, model = given(made.physics.model_fields), starts._engine.scene.model
    own = given(own_fields(model, fields))
    assert {"body_mass", "dof_M0", "geom_friction", "dof_damping", "geom_rgba", "mat_rgba", "geom_matid"} <= set(fields)
    for name, array in fields.items():
        for row in np.asarray(array):
            np.testing.assert_array_equal(row, own[name], err_msg=name)
    usual = starts._engine.first_world()[0].agents
    np.testing.assert_array_equal(np.asarray(made.physics.agents.qpos), np.tile(usual.qpos, (2, 1)))
    np.testing.assert_array_equal(np.asarray(made.physics.agents.ctrl), np.tile(usual.ctrl, (2, 1)))
    assert (np.asarray(draw.light_colour)[:, :-2] == 1).all() and not np.asarray(draw.light_colour)[:, -2:].any()
    assert not np.asarray(draw.noise).any() and (np.asarray(draw.camera_slope) == 1).all()
    assert not np.asarray(draw.robot_start).any() and not np.asarray(draw.instruction).any()


@pytest.mark.slow
@pytest.mark.parametrize("task", sorted(shipped_episodes()))
def test_colours_of_a_file_belong_to_the_same_materials_whatever_the_models_and_the_robot(task):
    """The file has those of the home with all models and the first robot. CookingMeat has two materials fewer where
    models do not vary, and Fetch one more."""
    episodes = Episodes.load(find_episodes(task))
    first, found = next(iter(episodes.header["robots"])), {}
    for robot in episodes.draws.robots:
        for stage in stages(episodes, ("materials", "all"), 3, robot):
            env = stage.environment({"engine": "native", "robot": robot, "observations": "proprioception"})
            made, _ = episodes.draws.made(env, [2], [2], [0], tuple(episodes.axes[stage.axes[0]]))
            model = env.scene.model
            colour = np.asarray(made.physics.model_fields.mat_rgba)[0, :, :3]
            found[robot, stage.axes] = {model.material(k).name: colour[k] for k in range(model.nmat)}
    every = found[first, ("all",)]
    assert sum((colour != 1).any() for colour in every.values()) > 10
    for name in {name for colours in found.values() for name in colours}:
        colours = [own[name] for own in found.values() if name in own]
        np.testing.assert_array_equal(colours, [colours[0]] * len(colours), err_msg=name)


@pytest.mark.slow
def test_axes_together_are_as_in_environments_of_their_own(book):
    """Positions to the bit; images but for single pixels, since poses of cameras that vary are computed."""
    options = {"engine": "native", "worlds": 2, "image_size": 64, "observations": ("proprioception", "rgb")}
    axes = (*USUAL, "objects", "all")
    together = {axis: end for stage in stages(book, axes, 4) for axis, end in _played(stage, options).items()}
    for axis in axes[:-1]:  # `all` alone varies what the environment does
        (own,) = stages(book, [axis], 4)
        image, qpos, words = _played(own, options)[axis]
        other_image, other_qpos, other_words = together[axis]
        np.testing.assert_allclose(other_qpos, qpos, atol=1e-6, err_msg=axis)
        assert words == other_words, axis
        differ = np.abs(image.astype(int) - other_image.astype(int))
        assert (differ > 2).mean() < 2e-3, axis
    assert together["instructions"][2] != together["nominal"][2] == together["lights"][2]
    shifts = np.abs(together["robot_start"][1] - together["nominal"][1]).max(-1)
    assert (shifts > 1e-3).all() and np.abs(together["lights"][1] - together["nominal"][1]).max() == 0
    assert (together["lights"][0] != together["nominal"][0]).any()


def _played(stage, options):
    """Images, positions and wordings of an axis after three steps."""
    env, found = stage.environment(options), {}
    for axis in stage.axes:
        state = stage.start(env, axis, [1, 3])
        words, rng = env.instruction(state), np.random.default_rng(0)
        for _ in range(3):
            state = env.step(state, rng.uniform(-0.3, 0.3, (2, *env.action_space.shape)).astype(np.float32))
        whole = jax.tree.map(np.asarray, env.core.engine.snapshot(state.batch.world.physics))
        qpos = np.concatenate([whole.scene.qpos, whole.agents.qpos], axis=1)
        found[axis] = np.asarray(state.obs["rgb"]), qpos, words
    return found


@pytest.mark.slow
def test_experts_end_episodes_as_in_environments_of_their_own(book):
    options = {"worlds": 2, "engine": "native", "observations": "proprioception"}
    axes = ["nominal", "object_poses", "physics", "robot_start"]
    together = {r.axis: r for r in evaluate_axes(book, axes, 3, _expert, options).results}
    for axis in axes:
        (alone,) = evaluate_axes(book, [axis], 3, _expert, options).results
        assert (alone.success, alone.q) == (together[axis].success, together[axis].q), axis
        assert len(alone.success) == 3 and any(alone.success)


def _expert(env):
    expert = expert_of(env)
    return lambda state: np.asarray(expert(state))
