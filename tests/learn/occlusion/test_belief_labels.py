"""What an actor believes, and an expert that answers as if it were so."""

import dataclasses
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import ig2mj
from ig2mj.envs.experts import expert_of
from ig2mj.learn.occlusion.belief_labels import NEAR, SAME, BeliefAdviser, beliefs_of, errors_of, no_error, true_at
from ig2mj.learn.occlusion.object_memory import ObjectMemory
from ig2mj.learn.privileged_targets import PrivilegedTargets
from ig2mj.tasks.experts.sight import Belief

NAMES = [f"{o}_{n}" for o in ("knife", "apple") for n in ("pos_x", "pos_y", "pos_z", *(f"quat_{c}" for c in "wxyz"))]
WORLDS, OWN = 6, 7  # an actor sees a hand's place and how it is turned, and whether that holds something


def setting() -> tuple[PrivilegedTargets, ObjectMemory, tuple[np.ndarray, np.ndarray]]:
    """Two objects and a hand; mean and deviation of the vector."""
    hidden = PrivilegedTargets(OWN, len(NAMES), NAMES)
    poses = [k for place, turned in hidden.poses.values() for k in (*place, *turned)]
    places = [[int(hidden.plain[k]) for k in place] for place, _ in hidden.poses.values()]
    rng = np.random.default_rng(1)
    scales = rng.normal(size=OWN + 14).astype(np.float32), rng.uniform(0.5, 2, OWN + 14).astype(np.float32)
    return hidden, ObjectMemory(OWN, poses, (6,), (0,), places), scales


def lying(place: np.ndarray, turn: Rotation) -> np.ndarray:
    """Numbers of the vector of an object in every world."""
    return np.concatenate([place, turn.as_quat()[:, [3, 0, 1, 2]]], axis=1).astype(np.float32)


def told(hidden: PrivilegedTargets, scales: Any, vector: np.ndarray) -> np.ndarray:
    """The guess of somebody who knows."""
    return np.asarray(hidden(jnp.asarray(vector), jnp.asarray((vector - scales[0]) / scales[1])))


@pytest.mark.slow
def test_an_actor_is_wrong_by_as_much_as_what_it_remembers():
    hidden, recall, scales = setting()
    rng = np.random.default_rng(0)
    place = rng.uniform(-0.5, 0.5, (2, WORLDS, 3))
    turns = [Rotation.from_quat(rng.normal(size=(WORLDS, 4))) for _ in range(2)]
    off = rng.uniform(-0.02, 0.02, (2, WORLDS, 3))
    wrong = Rotation.from_rotvec(rng.uniform(-0.2, 0.2, (WORLDS, 3)))
    hands = Rotation.from_euler("xyz", rng.uniform(-1, 1, (2, WORLDS, 3)))
    at = rng.uniform(-0.5, 0.5, (2, WORLDS, 3))

    def vector(hand: int, objects: list[np.ndarray]) -> np.ndarray:
        own = np.concatenate([at[hand], hands[hand].as_euler("xyz"), np.full((WORLDS, 1), 1.0)], axis=1)
        return np.concatenate([own, *objects], axis=1).astype(np.float32)

    true = vector(0, [lying(place[0], turns[0]), lying(place[1], turns[1])])
    seen = vector(0, [lying(place[0] + off[0], wrong * turns[0]), lying(place[1] + off[1], turns[1])])
    guess = told(hidden, scales, seen)
    kept = recall.after(recall.blank(WORLDS), np.ones(WORLDS, bool), true[:, :OWN], guess)
    at_first = errors_of(recall, scales, true, guess)
    np.testing.assert_allclose(at_first, np.linalg.norm(off, axis=-1).T, atol=1e-5)
    found = beliefs_of(recall, hidden, scales, true, kept, guess, at_first)
    for k, name in enumerate(("knife", "apple")):
        np.testing.assert_allclose(found[name].move, off[k], atol=1e-5)
    np.testing.assert_allclose(
        Rotation.from_quat(np.asarray(found["knife"].turn)[:, [1, 2, 3, 0]]).as_rotvec(), wrong.as_rotvec(), atol=1e-4
    )
    np.testing.assert_allclose(np.abs(np.asarray(found["apple"].turn)[:, 0]), 1.0, atol=1e-5)

    # the hand has carried the knife off: what is believed of it is off by the same in the hand's frame
    moved = hands[1] * hands[0].inv()
    carried = lying(moved.apply(place[0] - at[0]) + at[1], moved * turns[0])
    later = vector(1, [carried, true[:, OWN + 7 :]])
    found = beliefs_of(recall, hidden, scales, later, kept, rng.normal(size=guess.shape).astype(np.float32), at_first)
    np.testing.assert_allclose(found["knife"].move, moved.apply(off[0]), atol=1e-5)
    np.testing.assert_allclose(found["apple"].move, off[1], atol=1e-5)

    # it has slipped in the hand: who carries it cannot know, and what is seen of it now, if right, does not count
    slip = np.array([0.0, 0.02, 0.0])
    slipped = vector(1, [lying(moved.apply(place[0] - at[0]) + at[1] + slip, moved * turns[0]), true[:, OWN + 7 :]])
    found = beliefs_of(recall, hidden, scales, slipped, kept, told(hidden, scales, slipped), at_first)
    near = np.linalg.norm(moved.apply(off[0]) - slip, axis=1) < NEAR
    assert near.any()
    np.testing.assert_allclose(found["knife"].move, np.where(near[:, None], moved.apply(off[0]) - slip, 0), atol=1e-5)


@pytest.mark.slow
def test_who_is_far_off_is_told_the_truth_and_who_sees_it_now_believes_that():
    hidden, recall, scales = setting()
    place, still, rolls = np.zeros((WORLDS, 3)), Rotation.identity(WORLDS), np.array([0.0, 0.3, 0.0])
    own = np.zeros((WORLDS, OWN), np.float32)
    first = np.concatenate([own, lying(place, still), lying(place, still)], axis=1)
    kept = recall.after(recall.blank(WORLDS), np.ones(WORLDS, bool), own, told(hidden, scales, first))
    rolled = np.concatenate([own, lying(place, still), lying(place + rolls, still)], axis=1)
    off = np.array([0.01, 0.0, -0.02])
    sees = np.concatenate([own, lying(place, still), lying(place + rolls + off, still)], axis=1)
    right = np.zeros((WORLDS, 2), np.float32)
    found = beliefs_of(recall, hidden, scales, rolled, kept, told(hidden, scales, sees), right)
    np.testing.assert_allclose(found["apple"].move, np.tile(off, (WORLDS, 1)), atol=1e-5)
    found = beliefs_of(recall, hidden, scales, rolled, kept, told(hidden, scales, first), right)
    assert rolls.max() > NEAR
    np.testing.assert_array_equal(found["apple"].move, 0)
    np.testing.assert_array_equal(found["apple"].turn, np.tile([1.0, 0, 0, 0], (WORLDS, 1)))
    little = np.array([0.0, 0.02, 0.0])
    nudged = np.concatenate([own, lying(place, still), lying(place + little, still)], axis=1)
    assert SAME < little.max() < NEAR
    found = beliefs_of(recall, hidden, scales, nudged, kept, told(hidden, scales, nudged), right)
    np.testing.assert_allclose(found["apple"].move, 0, atol=1e-5, err_msg="it is not where it lay, and that is seen")
    wrong = np.concatenate([own, lying(place, still), lying(place - little, still)], axis=1)
    found = beliefs_of(recall, hidden, scales, nudged, kept, told(hidden, scales, wrong), right)
    off_by = np.tile(-little, (WORLDS, 1))
    np.testing.assert_allclose(found["apple"].move, off_by, atol=1e-5, err_msg="what is seen is worse than the memory")
    half = np.arange(WORLDS) < 3
    true = true_at(half, {"apple": Belief(jnp.ones((WORLDS, 3)), jnp.zeros((WORLDS, 4)))})["apple"]
    np.testing.assert_array_equal(true.move[:, 0], 1.0 * ~half)
    np.testing.assert_array_equal(true.turn[:, 0], 1.0 * half)


@pytest.fixture(scope="module")
def fruit():
    """Two worlds of SlicingFruit, at the start."""
    env = ig2mj.make(
        "SlicingFruit", robot="fetch", worlds=2, engine="native", pool_size=2, observations=("proprioception",)
    )
    return env, env.reset(0)


@pytest.mark.slow
def test_an_expert_goes_where_an_object_is_believed_to_be(fruit):
    """As it does where everything that it sees of the object lies there."""
    env, state = fruit
    expert, world = expert_of(env), state.batch.world
    index, view = env.scene.object_index("carving_knife_0"), world.view
    off = np.array([[0.02, -0.03, 0.01], [-0.01, 0.02, 0.0]], np.float32)
    names = ("object_pos", "object_com", "aabb_low", "aabb_high")
    moved = {n: np.array(getattr(view, n)) for n in names}
    for array in moved.values():
        array[:, index] += off
    own = np.flatnonzero(env.core.rules.model.tables.link_object == index)
    moved["link_pos"] = np.array(view.link_pos)
    moved["link_pos"][:, own] += off[:, None]
    there = dataclasses.replace(world, view=dataclasses.replace(view, **moved))
    expected = expert(dataclasses.replace(state, batch=dataclasses.replace(state.batch, world=there)))
    base = Rotation.from_quat(np.asarray(view.agent.base_quat)[:, 0][:, [1, 2, 3, 0]])
    beliefs = {"carving_knife_0": Belief(base.inv().apply(off).astype(np.float32), np.tile([1.0, 0, 0, 0], (2, 1)))}
    np.testing.assert_allclose(expert(state, beliefs), expected, atol=1e-5)
    assert np.abs(np.asarray(expert(state)) - np.asarray(expected)).max() > 0.02
    right = no_error(PrivilegedTargets(0, len(NAMES), [n.replace("knife", "carving_knife_0") for n in NAMES]), 2)
    only = {"carving_knife_0": right["carving_knife_0"]}
    np.testing.assert_allclose(expert(state, only), expert(state), atol=1e-6)


@pytest.mark.slow
def test_an_adviser_labels_for_what_the_actor_believes_and_for_the_truth_in_the_first_step():
    targets, memory, scales = setting()
    asked = []

    def expert(state, beliefs):
        asked.append(beliefs)
        return state

    adviser = BeliefAdviser(expert, memory, targets)
    notes, own = adviser.begin(WORLDS), np.zeros((WORLDS, OWN), np.float32)
    still = Rotation.identity(WORLDS)
    true = np.concatenate([own, lying(np.zeros((WORLDS, 3)), still), lying(np.zeros((WORLDS, 3)), still)], axis=1)
    off = np.array([0.01, 0.0, 0.0])
    seen = np.concatenate([own, lying(np.tile(off, (WORLDS, 1)), still), true[:, OWN + 7 :]], axis=1)
    prediction, begins = told(targets, scales, seen), np.ones(WORLDS, bool)
    kept = memory.after(memory.blank(WORLDS), begins, own, prediction)
    notes = adviser.observe(notes, begins, scales, true, kept, prediction)
    adviser.label(jnp.zeros((WORLDS, 2)), notes, ~begins)
    adviser.label(jnp.zeros((WORLDS, 2)), notes, begins)
    np.testing.assert_allclose(asked[0]["knife"].move, np.tile(off, (WORLDS, 1)), atol=1e-5)
    np.testing.assert_array_equal(asked[1]["knife"].move, 0.0)
