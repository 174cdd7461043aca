"""Wrong arguments of environments are errors of the user's, in one line, and leave the state that was given usable."""

import copy
import pickle

import jax
import jaxtyping
import numpy as np
import pytest

import ig2mj
from ig2mj.errors import ActionError, EngineError, Ig2mjError, InputError, UnknownNameError

TASK = "PointNavigation"


@pytest.fixture(autouse=True)
def as_users_call(monkeypatch):
    """Without the checks of annotations, which only tests have."""
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)


@pytest.fixture(scope="module")
def env():
    return ig2mj.make(TASK, worlds=2, pool_size=4, engine="native")


@pytest.fixture
def action(env):
    return np.full((2, *env.action_space.shape), 0.5, np.float32)


@pytest.mark.parametrize("mask", [np.ones(3, bool), np.ones((2, 1), bool), [0.5, 1.0], [2, 0], "x", True])
def test_a_wrong_mask_is_refused_and_uses_up_nothing(env, mask):
    state = env.reset(0)
    with pytest.raises(ActionError, match="a mask of worlds"):
        env.reset(state, mask)
    with pytest.raises(ActionError, match="a mask of worlds"):
        env.core.reset(state.batch, mask)
    env.check(state)


@pytest.mark.parametrize("mask", [[True, False], (1, 0), np.array([1, 0])])
def test_a_mask_may_be_a_list_or_whole_numbers(env, mask):
    state = env.reset(env.reset(0), mask)
    assert np.asarray(state.batch.episode).tolist() == [1, 0]


def test_a_mask_needs_a_state(env):
    with pytest.raises(EngineError, match=r"reset\(state, mask\)"):
        env.reset(0, [True, False])


@pytest.mark.parametrize("seed", ["a", None, 1.5, np.float32(1)])
def test_a_seed_is_a_whole_number(env, seed):
    with pytest.raises(EngineError, match="a seed is a whole number"):
        env.reset(seed)


@pytest.mark.parametrize(
    "keys", [jax.random.split(jax.random.key(0), 2), jax.random.split(jax.random.PRNGKey(0), 2), jax.numpy.arange(2)]
)
def test_an_environment_takes_one_key_of_jax(env, keys):
    with pytest.raises(EngineError, match="takes one key or seed for all worlds"):
        env.reset(keys)


@pytest.mark.parametrize("use", [copy.deepcopy, pickle.dumps])
def test_an_environment_is_neither_copied_nor_pickled(env, use):
    with pytest.raises(EngineError, match=r"ig2mj.make makes another one.* env.fork\(state\) copies a state"):
        use(env)
    assert copy.copy(env).core is env.core


@pytest.mark.parametrize("engine", [3, ("native",)])
def test_an_engine_is_a_name_or_an_engine(engine):
    with pytest.raises(EngineError, match="the name of an engine"):
        ig2mj.make(TASK, engine=engine)


@pytest.mark.parametrize("number", ["a", 1.0, True, -1, 99])
def test_a_variant_is_a_number_of_those_there_are(number):
    with pytest.raises(EngineError, match="of GraspingBook: there are 0 to 2"):
        ig2mj.make("GraspingBook", engine="native", variant=number)


@pytest.mark.parametrize("name", ["goal/", "goal/small_home", "goal/small_home (on_top apple_0"])
def test_a_goal_without_brackets_or_home_gets_its_form(name):
    with pytest.raises(Ig2mjError, match=r"a goal is named goal/HOME GOAL, such as .* every bracket closed"):
        ig2mj.make(name, engine="native")


def test_a_number_of_steps_is_given_by_name(tiny_home):
    with pytest.raises(EngineError, match=r"step\(count=30\)"):
        ig2mj.Simulation(tiny_home, states=None).step(30)


@pytest.mark.parametrize("count", [-1, 1.5, "a", True])
def test_a_number_of_steps_is_a_whole_number(tiny_home, count):
    with pytest.raises(EngineError, match="a whole number of at least 0 is needed"):
        ig2mj.Simulation(tiny_home, states=None).step(count=count)


def test_a_urdf_in_the_place_of_a_robot_or_a_scene_is_named_as_such():
    with pytest.raises(EngineError, match=r"UrdfRobot.load\('x.urdf'\), on the command line --robot-urdf x.urdf"):
        ig2mj.make(TASK, robot="x.urdf")
    with pytest.raises(InputError, match="`ig2mj convert object --urdf FILE`"):
        ig2mj.load_scene("x.urdf")


def test_environments_and_simulations_print_what_they_are(env, tiny_home):
    robot = env.robot
    assert repr(env) == f"Environment('{TASK}', robot '{robot}', 2 worlds, engine 'native')"
    assert repr(ig2mj.Simulation(tiny_home, states=None)) == f"Simulation('{tiny_home.name}', engine 'native')"


def test_an_unknown_environment_names_activities_too():
    with pytest.raises(UnknownNameError, match=r"near matches: PointNavigation.*activity/NAME"):
        ig2mj.make("PointNavigatoin")


@pytest.mark.parametrize("count", [2, 3])
def test_a_batch_of_other_worlds_is_refused_and_not_used_up(tiny_home, count):
    worlds = ig2mj.Worlds(tiny_home, 2, engine="native")
    batch, other = worlds.start(), ig2mj.Worlds(tiny_home, count, engine="native")
    with pytest.raises(EngineError, match="of another environment"):
        other.step(batch)
    worlds.core.check(batch)


def test_what_is_no_state_is_refused(env, action):
    with pytest.raises(ActionError, match="takes the state that reset"):
        env.step(None, action)
    with pytest.raises(ActionError, match="not dict"):
        env.step_autoreset(env.reset(0).obs, action)
    for call in (env.fork, env.check, lambda state: env.save(state, "state.npz")):
        with pytest.raises(ActionError, match="not NoneType"):
            call(None)


@pytest.mark.parametrize(("name", "value"), [("home", 3), ("robot", 3)])
def test_what_is_neither_a_home_nor_a_robot_is_refused(name, value):
    with pytest.raises(EngineError, match=f"{name} = 3: "):
        ig2mj.make("PointNavigation", **{name: value})


def test_a_traced_action_is_refused_on_the_native_engine(env, action):
    state = env.reset(0)
    with pytest.raises(ActionError, match="without jit, vmap or scan"):
        jax.vmap(lambda a: env.step(state, a).reward)(np.stack([action, action]))
    env.check(state)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("worlds", "2"),
        ("worlds", 1.5),
        ("worlds", True),
        ("pool_size", "4"),
        ("pool_size", 2.5),
        ("image_size", 17.5),
        ("image_size", 0),
        ("augment_starts", -1),
        ("period", "x"),
        ("sensors", 3),
        ("threads", "a"),
    ],
)
def test_make_names_an_argument_that_is_no_number(name, value):
    with pytest.raises(EngineError, match=f"{name} = "):
        ig2mj.make(TASK, **{"pool_size": 4, "engine": "native", name: value})


def test_worlds_take_whole_numbers_and_pools(tiny_home):
    for count in ("2", 1.5, True, 0):
        with pytest.raises(EngineError, match="num_worlds = "):
            ig2mj.Worlds(tiny_home, count, engine="native")
    with pytest.raises(EngineError, match="load_pool"):
        ig2mj.Worlds(tiny_home, 2, engine="native", pool="pool.npz")


def test_objects_are_names():
    for objects in ([3], [None], [("apple", "plate")], {"apple": 2}):
        with pytest.raises(Ig2mjError, match="objects"):
            ig2mj.load_scene("small_home", objects=objects)
    with pytest.raises(UnknownNameError, match="near matches: apple"):
        ig2mj.load_scene("small_home", objects=["aple"])
