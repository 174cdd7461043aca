"""Functions of a user's task: what they give counts, and a wrong shape, type or name is refused in one line."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

import ig2mj
from ig2mj.agents.humanoid import Humanoid
from ig2mj.engine.view import axis_sizes, blank_view, replace_fields
from ig2mj.errors import InputError
from ig2mj.predicates.compile import GoalStatus
from ig2mj.states.initial import initial_states
from ig2mj.tasks.activity_objective import ActivityObjective
from ig2mj.tasks.custom.code import TaskCode
from ig2mj.tasks.custom.objective import CustomObjective
from ig2mj.tasks.task import Acts, Task
from ig2mj.worlds.rules import Rules

WORLDS = 2

TASK = Task(
    name="Apple",
    summary="",
    home="tiny",
    objects=(),
    start=(),
    near=(),
    goal="(on_top apple table)",
    objects_of_interest=("apple",),
    distances=(),
    robots={"humanoid": Acts((0.0, -1.0, 0.55), hands=(1,))},
)


@pytest.fixture(scope="module")
def scene(tiny_home_folder):
    return ig2mj.load_scene(tiny_home_folder, agents=[Humanoid().at(0.0, -1.0, 0.0)])


@pytest.fixture(scope="module")
def objective_of(scene):
    rules = Rules.of_scene(scene).with_goal(TASK.goal)
    base = ActivityObjective(TASK, "humanoid", scene, rules.model)

    def make(**functions) -> CustomObjective:
        return CustomObjective(base, TaskCode(name="Apple", **functions), scene, rules, (1,), 7)

    return make


@pytest.fixture(scope="module")
def worlds(scene):
    """View and states of two worlds; the apple is 1 m and 2 m high."""
    view = blank_view(axis_sizes(scene.tables, WORLDS))
    com = np.array(view.object_com)
    com[:, scene.object_index("apple"), 2] = (1.0, 2.0)
    return replace_fields(view, {"object_com": com}), initial_states(Rules.of_scene(scene).model, WORLDS)


def status(holds=False) -> GoalStatus:
    return GoalStatus(np.full(WORLDS, holds), np.full(WORLDS, float(holds), np.float32), np.full((WORLDS, 1), holds))


def stepped(objective, worlds, before=None, holds=False, action=None):
    return objective.measure(*worlds, status(holds), None, before, action)


def started(objective, worlds):
    return objective.measure(*worlds, status(), np.zeros(WORLDS, np.int32))


def height(world):
    return world.com("apple")[:, 2]


def test_a_reward_is_one_term_or_several(objective_of, worlds):
    one = objective_of(reward=height)
    assert one.terms == ("reward",)
    now = stepped(one, worlds, started(one, worlds))
    assert np.asarray(one.rewards(now, now)["reward"]).tolist() == [1.0, 2.0]
    two = objective_of(reward=lambda world: {"a": height(world), "b": world.goal.holds})
    now = stepped(two, worlds, started(two, worlds), holds=True)
    assert two.terms == ("a", "b") and np.asarray(two.rewards(now, now)["b"]).tolist() == [1.0, 1.0]


def test_measures_of_the_step_before_are_there(objective_of, worlds):
    seen = objective_of(measure=lambda world: {"height": height(world)}, reward=lambda world: world.falls("height"))
    before = started(seen, worlds)
    assert np.asarray(before.terms["reward"]).tolist() == [0.0, 0.0]
    view, states = worlds
    lower = replace_fields(view, {"object_com": np.asarray(view.object_com) - np.float32(0.25)})
    now = stepped(seen, (lower, states), before)
    assert np.asarray(seen.rewards(before, now)["reward"]) == pytest.approx([0.25, 0.25])


def test_the_action_is_clipped_and_finite(objective_of, worlds):
    seen = objective_of(reward=lambda world: jnp.square(world.action).sum(1))
    action = np.zeros((WORLDS, 7), np.float32)
    action[0, :2] = (5.0, np.nan)
    now = stepped(seen, worlds, started(seen, worlds), action=action)
    assert np.asarray(now.terms["reward"]).tolist() == [1.0, 0.0]


def test_own_ends_take_the_place_of_the_goal(objective_of, worlds):
    high = objective_of(success=lambda world: height(world) > 1.5)
    now = stepped(high, worlds, started(high, worlds), holds=True)
    assert [np.asarray(a).tolist() for a in high.ended(now, status(True))] == [[False, True], [False, True]]
    low = objective_of(failure=lambda world: height(world) < 1.5)
    now = stepped(low, worlds, started(low, worlds), holds=False)
    assert np.asarray(now.success).tolist() == [False, False] and np.asarray(now.over).tolist() == [True, False]
    never = objective_of(terminated=lambda world: jnp.zeros(world.num_worlds, bool))
    now = stepped(never, worlds, started(never, worlds), holds=True)
    assert np.asarray(now.success).all() and not np.asarray(now.over).any()


def test_observations_have_names_for_their_numbers(objective_of, worlds):
    def extra(world):
        return jnp.ones((world.num_worlds, 2))

    seen = objective_of(
        observe=lambda world: {"apple": world.com("apple"), "left": world.time_left}, observations={"extra": extra}
    )
    assert seen.vectors["privileged_state"] == ("apple_x", "apple_y", "apple_z", "left")
    assert seen.vectors["extra"] == ("extra_0", "extra_1")
    now = stepped(seen, worlds, started(seen, worlds))
    made = seen.observe(*worlds, now, status(), np.full(WORLDS, 0.5, np.float32))
    assert np.asarray(made["privileged_state"])[:, 2:].tolist() == [[1.0, 0.5], [2.0, 0.5]]


def test_a_task_without_objects_and_hands_has_an_objective(scene):
    import dataclasses

    bare = dataclasses.replace(TASK, objects_of_interest=(), robots={"humanoid": Acts((0.0, -1.0, 0.55), hands=())})
    rules = Rules.of_scene(scene).with_goal(bare.goal)
    objective = ActivityObjective(bare, "humanoid", scene, rules.model)
    assert objective.outcomes == () and "stains" in objective.vectors["privileged_state"]


# Bad input.


def refused(objective_of, **functions) -> str:
    with pytest.raises(InputError) as caught:
        objective_of(**functions)
    text = str(caught.value)
    assert "\n" not in text and "test_custom_objective.py" in text
    return text


@pytest.mark.parametrize(
    ("reward", "said"),
    [
        (lambda world: 1.0, "the reward has shape []: one number for each world, [W],"),
        (lambda world: world.com("apple"), "the reward has shape [W, 3]: one number"),
        (lambda world: height(world).sum(), "the reward has shape []: one number"),
        (lambda world: None, "the reward is None (does it return?)"),
        (lambda world: "high", "the reward is of type str"),
        (lambda world: height(world) * 1j, "the reward is of complex64"),
        (lambda world: {"a": world.quat("apple")}, "the term 'a' has shape [W, 4]"),
        (lambda world: {"total": height(world)}, "a term is named 'total'"),
        (lambda world: {}, "the reward's terms have names []"),
        (lambda world: world.com("aple")[:, 2], "no object is named 'aple'; near matches: apple"),
        (lambda world: np.linalg.norm(world.com("apple")), "compute with jax.numpy instead of numpy"),
        (lambda world: 1.0 if height(world)[0] > 1 else 0.0, "jnp.where instead of if"),
        (lambda world: world.falls("height"), "'height' is not what `measure` gives (nothing)"),
        (lambda world: world.true("(on_top apple tabel)"), "no object is named 'tabel'"),
        (lambda world: 1 / 0, "ZeroDivisionError: division by zero"),
    ],
)
def test_a_wrong_reward_is_refused(objective_of, reward, said):
    assert said in refused(objective_of, reward=reward)


def test_other_wrong_functions_are_refused(objective_of):
    assert "is of float32: one boolean" in refused(objective_of, success=height)
    assert "the result has shape [W, 4]" in refused(objective_of, failure=lambda world: world.quat("apple") > 0)
    assert "the observation has shape [W]" in refused(objective_of, observe=height)
    assert "a dict of arrays" in refused(objective_of, measure=height)

    def changing(world):
        return {"x": height(world)} if world.before is None else {"x": world.com("apple")}

    assert "'x' differs in shape or type between the start" in refused(objective_of, measure=changing)


def test_a_line_of_the_file_is_named(objective_of):
    def reward(world):
        fine = height(world)
        return fine + world.com("nothing")[:, 0]

    line = reward.__code__.co_firstlineno + 2
    assert f"reward, line {line}: no object is named 'nothing'" in refused(objective_of, reward=reward)


def test_a_reward_that_is_not_finite_is_refused_by_its_term(objective_of):
    objective = objective_of(reward=lambda world: {"a": height(world), "b": height(world)})
    info = {"reward/a": np.zeros(2), "reward/b": np.array([0.0, np.inf])}
    with pytest.raises(InputError, match="the term 'b' is inf in world 1, and must be finite"):
        objective.refuse_nonfinite(info)
    objective.refuse_nonfinite({**info, "reward/b": np.zeros(2)})


def test_what_is_not_pure_is_found(objective_of, worlds):
    calls = []

    def counting(world):
        calls.append(0)
        return height(world) + len(calls)

    with pytest.raises(AssertionError, match="is not pure"):
        objective_of(reward=counting).check_pure(*worlds, status())
    with pytest.raises(AssertionError, match="depends on other worlds"):
        objective_of(reward=lambda world: height(world) - height(world)[:1]).check_pure(*worlds, status())
    objective_of(reward=height, observe=lambda world: world.com("apple")).check_pure(*worlds, status())
