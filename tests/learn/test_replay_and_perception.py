"""What is replayed, and what networks see."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from small_envs import PointMass, SeenPointMass

from ig2mj.cli.train import rendered_rows
from ig2mj.envs.observations import Space
from ig2mj.errors import Ig2mjError
from ig2mj.learn.collect import Transition
from ig2mj.learn.dagger import DaggerConfig
from ig2mj.learn.evaluate import wilson
from ig2mj.learn.imitation import Imitation
from ig2mj.learn.networks import AUGMENTATION, ActorNetwork, ConvEncoder, Convolutions, brightest, projected, shifted
from ig2mj.learn.occlusion.glimpses import GLIMPSE, GlimpseEncoder, GlimpseFeatures, coarse, encoder_of, window
from ig2mj.learn.occlusion.projection import FRAME, CameraProjection, ObjectTargets, with_object_targets
from ig2mj.learn.perception import DEPTH_RANGE, Perception, Seen, shrunk
from ig2mj.learn.policies import Policy, PolicyMismatch, depends_on, perception_of
from ig2mj.learn.privileged_targets import PrivilegedTargets, prediction_loss
from ig2mj.learn.replay import Replay
from ig2mj.learn.running_stats import RewardScale, RunningStats
from ig2mj.learn.sac import SAC, SACConfig

GAMMA = 0.5

AHEAD = CameraProjection(
    (0.0, 0.0, 0.0), ((0.0, 0.0, -1.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), (1.0, 1.0), 16, (2, 14)
)
"""In the middle of the base, looking ahead along x; rows 2 to 14 of 16x16 pixels."""

GOAL = [*(f"goal_pos_{c}" for c in "xyz"), *(f"goal_quat_{c}" for c in "wxyz")]
"""Of a privileged state."""


def told(steps, terminated, truncated):
    """Two worlds; what is seen in step t of world w is 100 w + t, and after it half more; rewards are 1."""
    number = 100.0 * jnp.arange(2) + jnp.asarray(steps, jnp.float32)[:, None]
    picture = jnp.zeros((len(steps), 2, 0), jnp.uint8)
    over, cut = (jnp.asarray(e, bool)[:, None] & jnp.array([True, False]) for e in (terminated, truncated))
    vector = jnp.repeat(number[..., None], 4, axis=-1)
    ones = jnp.ones(number.shape)
    return Transition(Seen(vector, picture), vector[..., :2], {}, ones, over, cut, Seen(vector + 0.5, picture))


@pytest.fixture(scope="module")
def samples():
    """Of a ring of six steps that was written over once; world 0 ends with success in step 4, is cut off in step 6."""
    replay = Replay.empty(6, 2, Perception(PointMass(2).observation_spaces), 2)
    for first in (0, 2, 4, 6):
        steps = [first, first + 1]
        replay = replay.insert(told(steps, [s == 4 for s in steps], [s == 6 for s in steps]))
    drawn = jax.jit(lambda kept, key: kept.sample(key, 400, 3, GAMMA))(replay, jax.random.PRNGKey(0))
    return jax.tree.map(np.asarray, drawn)


def test_rewards_go_on_to_the_end_of_the_episode_and_no_farther(samples):
    start = samples.seen.vector[:, 0]
    assert set(start) == {2, 3, 4, 5, 102, 103, 104, 105}  # rows 6 and 7 are only ends, 0 and 1 were written over
    for first, steps in ((2, 3), (3, 2), (4, 1), (5, 2), (102, 3), (105, 3)):
        reward = sum(GAMMA**k for k in range(steps))
        assert samples.reward[start == first] == pytest.approx(reward), first


def test_success_has_no_value_after_it_and_a_cut_has_that_of_what_was_seen_last(samples):
    start = samples.seen.vector[:, 0]
    for first, discount, after in ((2, 0, 4.5), (4, 0, 4.5), (5, GAMMA**2, 6.5), (102, GAMMA**3, 104.5)):
        assert samples.discount[start == first] == pytest.approx(discount), first
        assert samples.after.vector[start == first, 0] == pytest.approx(after), first


@pytest.mark.parametrize(("worlds", "counts"), [(16, True), (1024, False)])
def test_one_thrown_object_of_many_does_not_make_all_rewards_small(worlds, counts):
    """A return 100 times the others, in one world: of many worlds it is left out, of few it may be the only success."""
    reward, no = jnp.full((2, worlds), 0.5), jnp.zeros((2, worlds), bool)
    before = RewardScale.initial(worlds).update(reward, no, 0.9)
    after = before.update(reward.at[0, 3].set(100.0), no, 0.9)
    least, usual = 5.0 / 110.0, float(before.factor(5.0))
    assert float(after.factor(5.0)) == pytest.approx(least, rel=0.2) if counts else float(after.factor(5.0)) > usual / 4
    assert RewardScale.initial(worlds).update(reward.at[:, : worlds // 8].set(3.0), no, 0.9).largest > 5


def test_a_picture_is_averaged_over_areas_and_no_depth_is_far_away():
    picture = np.zeros((1, 4, 4, 1), np.float32)
    picture[0, :2, :2, 0] = (1.0, 2.0)
    picture[0, 2:, 2:, 0] = 9.0
    small = np.asarray(shrunk(picture, "depth", 2, 0, 2))[0, :, :, 0]
    assert small[0, 0] == round(255 * 1.5 / DEPTH_RANGE)
    assert small[1, 1] == small[0, 1] == 255
    assert np.asarray(shrunk((255 * (picture > 0)).astype(np.uint8), "rgb", 2, 0, 2))[0, :, :, 0].tolist() == [
        [255, 0],
        [0, 255],
    ]


def test_an_actor_from_pixels_does_not_see_the_privileged_state():
    env = SeenPointMass(2)
    perception = Perception(env.observation_spaces, "rgbd")
    assert perception.actor_size == 2 and perception.vector_size == 4
    assert perception.image_shape == (32, 32, 4)
    state = env.reset(0)
    seen = perception(state.obs)
    assert np.array_equal(seen.vector[:, :2], state.obs["proprioception"])
    assert np.array_equal(seen.vector[:, 2:], state.obs["privileged_state"])


def test_a_projected_distribution_keeps_its_mean_within_the_support():
    support = jnp.linspace(-2.0, 2.0, 9)
    chance = jnp.full((1, 9), 1 / 9)
    shared = np.asarray(projected(chance, 0.3 + 0.5 * support[None], support))
    assert shared.sum() == pytest.approx(1.0, abs=1e-6)
    assert (shared @ np.asarray(support))[0] == pytest.approx(0.3, abs=1e-6)
    outside = np.asarray(projected(chance, jnp.full((1, 9), 7.0), support))
    assert outside[0, -1] == pytest.approx(1.0, abs=1e-6)


def test_the_interval_of_a_rate_is_that_of_the_textbook():
    """Wilson's interval of 8 in 10: 0.490 to 0.943 (by hand from its formula)."""
    assert wilson(8, 10) == pytest.approx((0.490, 0.943), abs=1e-3)
    assert wilson(10, 10)[1] == 1.0


def test_a_policy_sees_pictures_in_the_size_it_was_trained_on():
    env = SeenPointMass(2)
    perception = Perception(env.observation_spaces, "rgbd", 16)
    sac = SAC(perception, 2, SACConfig(actor_layers=(8,), critic_layers=(8,)))
    policy = Policy.of(sac, jax.jit(sac.init)(jax.random.PRNGKey(0)), depends_on(env, perception), {})
    again = perception_of(policy, env.observation_spaces)
    assert again.image_shape == (16, 16, 4)
    obs = {name: jnp.zeros((2, *space.shape), space.dtype) for name, space in env.observation_spaces.items()}
    assert jax.eval_shape(policy.actor(again), obs).shape == (2, 2)
    with pytest.raises(PolicyMismatch, match="picture"):
        policy.check(env, Perception(env.observation_spaces, "rgbd"))
    with pytest.raises(Ig2mjError, match="32 pixels cannot be averaged down to 12"):
        Perception(env.observation_spaces, "rgbd", 12)


def test_the_brightest_point_of_a_map_is_found_between_pixels():
    maps = np.full((2, 5, 9, 2), -30.0, np.float32)
    maps[0, 0, 8, 0] = maps[0, 4, 2, 1] = maps[0, 4, 3, 1] = 30.0  # one pixel; two beside each other
    found = np.asarray(brightest(jnp.asarray(maps)))
    assert np.allclose(found[0], [-1.0, 1.0, 1.0, -0.375], atol=1e-4)  # rows of both channels, then columns
    assert np.allclose(found[1], 0.0, atol=1e-4)


def test_pictures_that_are_not_to_be_moved_stay_as_they_are():
    picture = jnp.arange(2 * 8 * 8 * 3, dtype=jnp.uint8).reshape(2, -1)
    assert np.array_equal(shifted(picture, (8, 8, 3), jax.random.PRNGKey(0), 0), picture)
    moved = shifted(picture, (8, 8, 3), jax.random.PRNGKey(0), 2)
    assert moved.shape == picture.shape and not np.array_equal(moved, picture)


@pytest.mark.parametrize("side", [32, 64, 128])
def test_an_encoder_ends_with_four_by_four_pixels(side):
    shape = jax.eval_shape(
        Convolutions((side, side, 4)).init, jax.random.PRNGKey(0), jnp.zeros((1, side * side * 4), jnp.uint8)
    )
    assert shape["params"]["Dense_0"]["kernel"].shape == (4 * 4 * 64, 50)


def test_rows_that_are_kept_are_those_of_the_whole_picture():
    env = SeenPointMass(2)
    state = env.reset(0)
    whole = np.asarray(Perception(env.observation_spaces, "rgbd", 16)(state.obs).image).reshape(2, 16, 16, 4)
    perception = Perception(env.observation_spaces, "rgbd", 16, (4, 12))
    assert perception.image_shape == (8, 16, 4)
    assert np.array_equal(np.asarray(perception(state.obs).image).reshape(2, 8, 16, 4), whole[:, 4:12])
    with pytest.raises(Ig2mjError, match="rows 12 to 20 of images of 16 rows"):
        Perception(env.observation_spaces, "rgbd", 16, (12, 20))


@pytest.mark.slow
def test_a_policy_that_acts_on_its_prediction_takes_it_along(tmp_path):
    env = SeenPointMass(2)
    spaces = {**env.observation_spaces, "privileged_state": Space((7,), np.float32, -np.inf, np.inf)}
    perception = with_object_targets(Perception(spaces, "rgbd", 16, (4, 16), GOAL), GOAL, AHEAD)
    config = SACConfig(actor_layers=(8,), critic_layers=(8,), encoder="glimpses")
    sac = SAC(perception, 2, config, encoder=encoder_of(perception))
    learner = jax.jit(sac.init)(jax.random.PRNGKey(0))
    learner.actor["guess"]["kernel"] += 1.0
    learner.actor["mean"]["kernel"] += 0.1
    policy = Policy.of(sac, learner, depends_on(env, perception), {})
    policy.save(tmp_path / "policy.npz")
    again = Policy.load(tmp_path / "policy.npz")
    sees = perception_of(again, spaces)
    assert sees.image_shape == (12, 16, 4) and sees.rows == (4, 16)
    obs = {**env.reset(0).obs, "privileged_state": jnp.zeros((2, 7))}
    expected = jax.jit(sac._look)(learner.actor, learner.moments, perception(obs))[0]
    assert np.allclose(jax.jit(again.actor(sees))(obs), np.tanh(expected), atol=0.02), "half precision"
    with pytest.raises(PolicyMismatch, match="rows"):
        again.check(env, Perception(env.observation_spaces, "rgbd", 16, (0, 12)))


def test_a_guess_is_of_rotations_and_not_of_the_sign_of_a_quaternion():
    names = ["cup_pos_x", *(f"cup_quat_{c}" for c in "wxyz"), "cup_velocity_x", "hand_holds"]
    hidden = PrivilegedTargets(2, 7, names)
    assert hidden.size == 2 + 6
    quat = np.array([0.0, 0.6, 0.8, 0.0])
    vector = jnp.asarray([[9, 9, 0.1, *quat, 5.0, 1.0], [9, 9, 0.1, *-quat, -5.0, 1.0]], jnp.float32)
    found = np.asarray(hidden(vector, vector))
    assert np.allclose(found[0], found[1])
    assert np.allclose(found[0, :2], [0.1, 1.0])
    assert np.allclose(found[0, 2:] / 3**0.5, [-0.28, 0.96, 0, 0.96, 0.28, 0], atol=1e-6), "columns x and y"
    assert PrivilegedTargets(2, 7).size == 7, "numbers without names are guessed as they are"
    expected = jnp.asarray(hidden(vector, vector))
    for number, more in ((0, 1.0), (5, 3.0)):  # a place: the absolute error; a rotation: its square
        one, two = (float(hidden.loss(expected.at[:, number].add(far), vector, vector)) for far in (1.0, 2.0))
        assert two - one == pytest.approx(more / hidden.size, abs=1e-3)
    assert prediction_loss(jnp.ones((1, 2)), jnp.ones((1, 2))) == 0
    far, farther = (float(prediction_loss(jnp.full((1, 1), x), jnp.zeros((1, 1)))) for x in (1.0, 2.0))
    assert farther - far == pytest.approx(1.0, abs=1e-3)


def test_rows_and_columns_of_objects_are_guessed_where_the_camera_is_known():
    cup = [*(f"cup_pos_{c}" for c in "xyz"), *(f"cup_quat_{c}" for c in "wxyz")]
    names = ["hand_1_pos_x", "hand_1_pos_y", "hand_1_pos_z", *cup, "stains"]
    hidden, vector = ObjectTargets(1, 11, names, AHEAD), jnp.array([[0.0, 1, 2, 3, 4, 0.5, -0.25, 1, 0, 0, 0, 7]])
    assert (hidden.size, hidden.pose_size, hidden.objects) == (15, 13, 1)
    found = np.asarray(hidden(vector, vector))[0]
    assert np.allclose(found[:13], [1, 2, 3, 4, 0.5, -0.25, 7, 3**0.5, 0, 0, 0, 3**0.5, 0])
    row, column = found[13:] / FRAME
    # 4 m ahead, half a metre to the left, a quarter below: a quarter and an eighth of half the picture
    assert (column + 1) / 2 * 15 == pytest.approx(8 * (1 - 0.125) - 0.5)
    assert (row + 1) / 2 * 11 + 2 == pytest.approx(8 * (1 + 0.0625) - 0.5)
    actor = ActorNetwork(2, (8,), GlimpseEncoder((12, 16, 4), hidden.pose_size, hidden.objects))
    seen = jnp.ones((2, 1)), jnp.ones((2, 768), jnp.uint8)
    shapes = jax.eval_shape(lambda key: actor.init_with_output(key, *seen)[0], jax.random.PRNGKey(0))
    assert shapes[2].shape == (2, 15)


def test_a_window_is_what_lies_around_a_point():
    picture = jnp.arange(40 * 60, dtype=jnp.float32).reshape(1, 40, 60, 1)
    row, column = 20.5, 30.5  # between pixels, as the window has no middle one
    point = jnp.array([[row / 39 * 2 - 1, column / 59 * 2 - 1]])
    assert np.allclose(window(picture, point)[0], picture[0, 5:37, 15:47], atol=0.01)
    corner = np.asarray(window(picture, jnp.array([[-1.0, -1.0]])))[0, :, :, 0]
    assert (corner[:15] == 0).all() and (corner[:, :15] == 0).all(), "nothing beside the picture"
    assert corner[16, 16] == pytest.approx(0.25 * (0 + 1 + 60 + 61))


def test_the_depth_at_the_brightest_point_is_seen():
    maps = np.full((1, 3, 4, 1), -30.0, np.float32)
    maps[0, 2, 3, 0] = 30.0
    depth = np.zeros((1, 6, 7), np.float32)  # a picture of 6x7: the last column of cells is half as wide
    depth[0, 4:, 6] = 0.25
    assert coarse(jnp.asarray(depth), (3, 4)).shape == (1, 3, 4)
    found = np.asarray(brightest(jnp.asarray(maps), coarse(jnp.asarray(depth), (3, 4))))
    assert np.allclose(found, [[1, 1, 1, 1, 1]], atol=1e-4), "row, column, depth, and depth times them"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("encoder", "moved"), [(GlimpseEncoder((12, 16, 4), 15, 2), False), (ConvEncoder((12, 16, 4), "points", 15), True)]
)
def test_whether_actions_train_the_encoder(encoder, moved):
    actor = ActorNetwork(2, (8,), encoder)
    vector, picture = jnp.ones((4, 2)), jax.random.randint(jax.random.PRNGKey(0), (4, 768), 0, 256).astype(jnp.uint8)

    @jax.jit
    def slopes(key):
        """Of the actions and of the guess."""
        params = jax.jit(actor.init)(key, vector, picture)["params"]
        _, back = jax.vjp(lambda p: actor.apply({"params": p}, vector, picture), params)
        told: Any = actor.apply({"params": params}, vector, picture)
        found = []
        for part in (0, 2):
            by = [2 * (a - 1.0) if k == part else jax.tree.map(jnp.zeros_like, a) for k, a in enumerate(told)]
            (gradient,) = back(type(told)(by))
            found.append(jnp.stack([jnp.abs(a).max() for a in jax.tree.leaves(gradient["encoder"])]).max())
        return jnp.stack(found)

    of_actions, of_the_guess = slopes(jax.random.PRNGKey(1))
    assert bool(of_actions > 0) is moved
    assert of_the_guess > 0, "the guess always does"


@pytest.mark.slow
def test_how_an_object_is_turned_is_learnt_from_its_own_glimpse_which_nothing_else_trains():
    actor = ActorNetwork(2, (8,), GlimpseEncoder((12, 16, 4), 15, 2))
    vector, picture = jnp.ones((4, 2)), jax.random.randint(jax.random.PRNGKey(0), (4, 768), 0, 256).astype(jnp.uint8)

    @jax.jit
    def slopes(key):
        params = jax.jit(actor.init)(key, vector, picture)["params"]

        def of(part):
            def loss(params):
                output: Any = actor.apply({"params": params}, vector, picture)
                return jnp.square(output[2][:, part] - 1.0).sum()

            slope = jax.grad(loss)(params)["encoder"]
            return {k: sum(jnp.abs(a).sum() for a in jax.tree.leaves(v)) for k, v in slope.items()}

        return [of(slice(*part)) for part in ((0, 3), (3, 9), (9, 15), (15, 19))]

    places, one, other, points = slopes(jax.random.PRNGKey(1))
    assert all(v == 0 for k, v in one.items() if k != "glimpse_0") and one["glimpse_0"] > 0
    assert all(v == 0 for k, v in other.items() if k != "glimpse_1") and other["glimpse_1"] > 0
    for rest in (places, points):
        assert rest["glimpse_0"] == rest["glimpse_1"] == 0 and rest["points"] > 0


@pytest.mark.slow
def test_half_precision_on_a_gpu_sees_nearly_the_same(monkeypatch):
    encoder = GlimpseFeatures((12, 16, 4), 1)
    picture = jax.random.randint(jax.random.PRNGKey(0), (3, 12 * 16 * 4), 0, 256).astype(jnp.uint8)
    params = jax.jit(encoder.init)(jax.random.PRNGKey(1), picture)
    full = np.asarray(jax.jit(encoder.apply)(params, picture))
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")
    half = np.asarray(jax.jit(lambda p, x: encoder.apply(p, x))(params, picture))
    assert full.dtype == half.dtype == np.float32
    assert 0 < np.abs(full - half).max() < 0.1


@pytest.mark.slow
def test_glimpses_look_beside_their_points_while_they_learn():
    encoder = GlimpseFeatures((48, 64, 4), 2)
    picture = jax.random.randint(jax.random.PRNGKey(0), (2, 48 * 64 * 4), 0, 256).astype(jnp.uint8)
    params = jax.jit(encoder.init)(jax.random.PRNGKey(1), picture)
    looks = jax.jit(lambda *key: encoder.apply(params, picture, rngs=dict(zip([AUGMENTATION], key, strict=False))))
    still, one, two = np.asarray(looks()), *(np.asarray(looks(jax.random.PRNGKey(k))) for k in (2, 3))
    seen = slice(4, 4 + 2 * GLIMPSE)
    assert (one[:, seen] != still[:, seen]).any() and (one[:, seen] != two[:, seen]).any()
    assert np.array_equal(np.delete(one, seen, 1), np.delete(still, seen, 1)), "nothing else moves"
    env = SeenPointMass(2)
    spaces = {**env.observation_spaces, "privileged_state": Space((7,), np.float32, -np.inf, np.inf)}
    perception = with_object_targets(Perception(spaces, "rgbd", 16, None, GOAL), GOAL, AHEAD)
    config = DaggerConfig(actor_layers=(8,), encoder="glimpses", image_shift=0)
    algorithm = Imitation(perception, 2, config, encoder=encoder_of(perception))
    actor, _ = jax.jit(algorithm.init)(jax.random.PRNGKey(0))
    own, none = perception({**env.reset(0).obs, "privileged_state": jnp.ones((2, 7))}), jnp.zeros((2, 2))
    moments = RunningStats.initial(perception.vector_size)
    loss = jax.jit(lambda key: algorithm.loss(actor, moments, own, none, key)[0])
    assert loss(jax.random.PRNGKey(0)) != loss(jax.random.PRNGKey(1)), "it learns so"


@pytest.mark.parametrize(("vector", "sizes", "recalled"), [(22, 192, 0), (49, 192, 0), (22, 192, 58), (49, 160, 85)])
def test_policies_of_glimpses_are_small_enough_to_ship(vector, sizes, recalled):
    """Of the humanoid's and Fetch's SlicingFruit, without and with memory. A file has 1.85 bytes for each number."""
    actor, picture = (
        ActorNetwork(6, (sizes, sizes), GlimpseEncoder((48, 128, 4), 47, 2), 21),
        jnp.zeros((1, 48 * 128 * 4), jnp.uint8),
    )
    own, kept = jnp.zeros((1, vector)), jnp.zeros((1, recalled)) if recalled else None
    shapes = jax.eval_shape(lambda key: actor.init(key, own, picture, None, kept), jax.random.PRNGKey(0))
    assert 1.85 * sum(math.prod(a.shape) for a in jax.tree.leaves(shapes)) < 0.7e6


@pytest.mark.parametrize(("pixels", "rows"), [(128, (60, 108)), (32, (20, 28)), (64, (0, 64))])
def test_a_training_draws_the_rows_that_its_networks_see(pixels, rows):
    whole = np.random.default_rng(0).integers(1, 256, (2, 128, 128, 3), np.uint8)
    drawn = rendered_rows(rows, pixels)
    assert drawn is not None and rendered_rows(None, pixels) is None
    part = np.zeros_like(whole)
    part[:, slice(*drawn)] = whole[:, slice(*drawn)]
    seen = [np.asarray(shrunk(picture, "rgb", pixels, *rows)) for picture in (whole, part)]
    np.testing.assert_array_equal(*seen)
    assert seen[0].all() and drawn[1] - drawn[0] == (rows[1] - rows[0]) * 128 // pixels
