"""Settings of environments: one frozen object, overrides by name, and near matches for what is misspelt."""

from __future__ import annotations

import dataclasses
import inspect
import typing

import gymnasium
import pytest

import ig2mj
from ig2mj.engine.mjx.engine import MjxEngine
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.scene_engine import SceneEngine
from ig2mj.engine.warp.engine import WarpEngine
from ig2mj.envs.config import EngineOptions, EnvConfig, Overrides, current_names
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.sensors.base import SensorOptions

SMALL = {"engine": "native", "pool_size": 2, "threads": 1}


def test_the_default_of_a_task_has_its_robot_and_its_grasping():
    cooking, driving = ig2mj.default_config("CookingMeat"), ig2mj.default_config("ig2mj/PointNavigation-v0")
    assert (cooking.robot, cooking.grasping, cooking.worlds) == ("humanoid", "mitten", 1)
    assert (driving.robot, driving.grasping) == ("turtlebot", "physical")
    with pytest.raises(UnknownNameError, match="near matches: CookingMeat"):
        ig2mj.default_config("CookingMeet")


def test_every_field_can_be_overridden_and_every_option_of_an_engine_too():
    """The types that checkers see are those of the objects."""
    fields = {f.name for f in dataclasses.fields(EnvConfig)}
    of_make = {"homes"}  # of several environments, each with a configuration of its own
    assert fields | set(EngineOptions.__annotations__) | of_make == set(Overrides.__annotations__)
    taken: set[str] = set()
    for engine in (SceneEngine, NativeEngine, MjxEngine, WarpEngine):
        taken |= {p.name for p in inspect.signature(engine).parameters.values() if p.kind is p.KEYWORD_ONLY}
    assert taken == set(EngineOptions.__annotations__)
    documented = EnvConfig.__doc__
    assert all(f"{name}: " in documented for name in fields)


def test_overrides_of_parts_are_merged():
    config = EnvConfig().override({"sensors": {"width": 64}, "threads": 2}, sensors={"height": 32}, worlds=4)
    assert config.sensors == SensorOptions(height=32) and config.engine_options == {"threads": 2}
    config = config.override({"engine_options": {"substeps": 8}, "sensors": {"width": 16}})
    assert (config.sensors.width, config.sensors.height) == (16, 32)
    assert config.engine_options == {"threads": 2, "substeps": 8} and config.worlds == 4
    assert config.override(sensors=SensorOptions()).sensors == SensorOptions()
    with pytest.raises(dataclasses.FrozenInstanceError):
        config.worlds = 3  # type: ignore[misc]


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"wrolds": 3}, "no option of make is named 'wrolds'; near matches: worlds"),
        ({"engine_options": {"treads": 1}}, "near matches: threads"),
        ({"sensors": {"widht": 3}}, "near matches: width"),
        ({"graph_mode": "WARP"}, "no option of make with the native engine is named 'graph_mode'"),
    ],
)
@pytest.mark.parametrize("form", ["mapping", "overrides", "keywords"])
def test_a_misspelt_option_names_the_near_match(overrides, message, form):
    given: dict[str, typing.Any] = {
        "mapping": {"config": {**SMALL, **overrides}},
        "overrides": {"config": EnvConfig(engine="native"), "config_overrides": overrides},
        "keywords": {"engine": "native", **overrides},
    }[form]
    with pytest.raises(UnknownNameError, match=message):
        ig2mj.make("PointNavigation", **given)


def test_what_is_no_mapping_is_refused():
    with pytest.raises(EngineError, match="sensors = 3"):
        EnvConfig().override(sensors=3)
    with pytest.raises(EngineError, match="engine_options = 3"):
        EnvConfig().override(engine_options=3)


def test_an_old_name_works_and_names_the_new_one():
    with pytest.warns(FutureWarning, match="'mixed' is now 'augment_starts'"):
        assert EnvConfig().override(mixed=5).augment_starts == 5
    with (
        pytest.warns(FutureWarning, match="'paper_rl' is now 'relaxed_thresholds'") as warned,
        pytest.raises(EngineError, match="relaxed_thresholds for PointNavigation"),
    ):
        ig2mj.make("PointNavigation", engine="native", paper_rl=True)
    assert warned[0].filename == __file__, "where Python shows it"
    assert current_names({"paper_rl": False, "split": "train"}) == {"relaxed_thresholds": False, "split": "train"}


def test_a_config_is_made_with_the_same_names_as_make_takes():
    with pytest.warns(FutureWarning, match="'paper_rl' is now 'relaxed_thresholds'.*removed in 0.3") as warned:
        assert EnvConfig(paper_rl=True).relaxed_thresholds  # pyright: ignore[reportCallIssue]
    assert warned[0].filename == __file__
    with pytest.raises(UnknownNameError, match="near matches: pool_size"):
        EnvConfig(pol_size=4)  # pyright: ignore[reportCallIssue]
    with pytest.raises(EngineError, match="threads is an option of the engine"):
        EnvConfig(threads=4)  # pyright: ignore[reportCallIssue]


def test_names_of_other_libraries_for_the_number_of_worlds_are_understood():
    with pytest.raises(UnknownNameError, match=r"near matches: worlds$"):
        ig2mj.make("PointNavigation", num_envs=4)  # pyright: ignore[reportCallIssue]
    with pytest.raises(EngineError, match=r"gymnasium.make_vec\(..., num_envs=4\)"):
        gymnasium.make("ig2mj/PointNavigation-v0", worlds=4)
    with pytest.raises(EngineError, match="takes num_envs"):
        gymnasium.make_vec("ig2mj/PointNavigation-v0", num_envs=2, worlds=4)


@pytest.mark.slow
def test_all_forms_make_the_same_environment_and_it_can_be_made_again():
    options = {"robot": "turtlebot", "worlds": 2, "period": 1 / 30, "observations": "proprioception", **SMALL}
    config = ig2mj.default_config("PointNavigation").override(options)
    made = [
        ig2mj.make("PointNavigation", options),
        ig2mj.make("PointNavigation", config),
        ig2mj.make("PointNavigation", {"worlds": 8}, config_overrides={"worlds": 5}, **options),
        ig2mj.make(
            "PointNavigation",
            "turtlebot",
            2,
            "native",
            **{k: v for k, v in options.items() if k not in ("robot", "worlds", "engine")},
        ),
    ]
    made.append(ig2mj.make(made[0].task.name, made[0].config))
    made.append(ig2mj.make(made[0].task.name, made[0].config.by_name()))
    for env in made:
        assert env.config == made[0].config
        assert (env.num_worlds, env.period, env.task.horizon) == (2, 1 / 30, 1500)
        assert list(env.observation_spaces) == ["proprioception"] and env.core.engine.name == "native"
        assert env.default_config == ig2mj.default_config("PointNavigation")
        assert env.mj_model is env.scene.model
    assert made[0].config.engine_options == {"threads": 1}


def test_a_horizon_is_in_agent_steps_whatever_the_period():
    env = ig2mj.make("PointNavigation", {**SMALL, "horizon": 7, "period": 1 / 30})
    assert env.task.horizon == env.config.horizon == 7
    assert env.with_horizon(9).config.horizon == 9
    with pytest.raises(EngineError, match="observations = 3: names of observations"):
        ig2mj.make("PointNavigation", {**SMALL, "observations": 3})
    with pytest.raises(EngineError, match="horizon = 0"):
        ig2mj.make("PointNavigation", {**SMALL, "horizon": 0})
