"""Open: iGibson's rules with a worked example, paper tables A.1 and A.5, and a bug that is not copied."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hand_world import HandWorld, Item

from ig2mj.states.definitions import open as opened

HINGE = (0.0, 1.57)
HOME = HandWorld(
    Item("microwave", abilities={"openable": {}}, joints=[HINGE]),
    Item("cabinet", abilities={"openable": {}}, joints=[(0.0, 0.4), (0.5, -0.5)]),  # the second closes at its upper end
    Item("door", abilities={"openable": {}}, joints=[(0.0, 1.0)], both_sides=True),
    Item("jar", abilities={"openable": {}}),
    Item("chair", joints=[(0.0, 1.0)]),
)


_sample = jax.jit(opened.sample_open, static_argnums=(0, 3), static_argnames="fully")


def _open(joints: list[float], compat: str = "paper") -> list[bool]:
    value = opened.is_open(HOME.model(compat=compat), jnp.asarray([joints], jnp.float32))
    return value[0].tolist()


@pytest.mark.parametrize(("q", "is_open"), [(0.0, False), (0.078, False), (0.079, True), (1.57, True), (np.nan, False)])
def test_a_hinge_of_0_to_1_57_opens_above_0_0785(q, is_open):
    assert _open([q, 0, 0.5, 0, 0])[0] == is_open


def test_table_a1_the_threshold_itself_is_closed():
    assert not _open([np.float32(0.05 * 1.57), 0, 0.5, 0, 0])[0]


def test_table_a1_any_relevant_joint_opens_the_object():
    assert _open([0, 0.0, 0.5, 0, 0])[1] is False
    assert _open([0, 0.021, 0.5, 0, 0])[1] is True
    assert _open([0, 0.0, 0.44, 0, 0])[1] is True


def test_the_annotated_end_is_the_closed_one_also_at_the_upper_limit():
    for compat in ("paper", "igibson"):
        assert _open([0, 0.0, 0.46, 0, 0], compat)[1] is False
        assert _open([0, 0.0, -0.5, 0, 0], compat)[1] is True


def test_what_opens_to_both_sides_is_open_between_them_in_igibsons_code():
    ends = {q: (_open([0, 0, 0.5, q, 0])[2], _open([0, 0, 0.5, q, 0], "igibson")[2]) for q in (0.0, 0.5, 1.0)}
    assert ends == {0.0: (False, False), 0.5: (True, True), 1.0: (True, False)}


def test_objects_without_joints_or_without_the_ability_are_never_open():
    assert _open([1.57, 0.4, -0.5, 0.5, 1.0])[3:] == [False, False]


@pytest.mark.parametrize("compat", ["paper", "igibson"])
@pytest.mark.parametrize("value", [True, False])
def test_table_a5_sampled_joints_make_open_true_or_false(value, compat):
    model = HOME.model(compat=compat)
    start = jnp.tile(jnp.asarray([0.0, 0.0, 0.5, 0.0, 0.7]), (50, 1))
    everything = jnp.ones((50, 5), bool)
    joints, moved = _sample(model, start, everything, value, jax.random.key(3))
    state = np.asarray(opened.is_open(model, joints))
    assert (state[:, :3] == value).all()
    low, high = np.array([0, 0, -0.5, 0]), np.array([1.57, 0.4, 0.5, 1.0])
    assert ((joints[:, :4] >= low) & (joints[:, :4] <= high)).all()
    assert not moved[:, 4].any() and (joints[:, 4] == 0.7).all()


def test_table_a5_a_random_subset_of_the_joints_is_opened():
    model = HOME.model()
    start = jnp.tile(jnp.asarray([0.0, 0.0, 0.5, 0.0, 0.0]), (200, 1))
    _, moved = _sample(model, start, jnp.ones((200, 5), bool), True, jax.random.key(0))
    pairs = np.asarray(moved[:, 1:3])
    assert pairs.any(axis=1).all()
    both, first, second = pairs.all(axis=1), pairs[:, 0] & ~pairs[:, 1], ~pairs[:, 0] & pairs[:, 1]
    assert 70 < both.sum() < 130  # sizes one and two are equally likely
    assert first.sum() > 20 and second.sum() > 20


def test_each_joint_keeps_its_own_direction():
    model = HOME.model()
    start = jnp.tile(jnp.asarray([0.0, 0.0, 0.5, 0.0, 0.0]), (60, 1))
    joints, moved = _sample(model, start, jnp.ones((60, 5), bool), True, jax.random.key(1))
    second = np.asarray(joints[:, 2])[np.asarray(moved[:, 2])]
    assert len(second) and (second < 0.45).all()  # towards its own open end


def test_fully_open_is_at_the_end():
    model = HOME.model()
    joints, _ = _sample(model, jnp.zeros((1, 5)), jnp.ones((1, 5), bool), True, jax.random.key(0), fully=True)
    assert np.allclose(joints[0, :4], [1.57, 0.4, -0.5, 1.0])
    joints, _ = _sample(model, joints, jnp.ones((1, 5), bool), False, jax.random.key(0), fully=True)
    assert np.allclose(joints[0, :4], [0, 0, 0.5, 0], atol=1e-6)
