"""The pushing hand: it touches and moves objects, in every batch alike, and lets go of what it cannot push."""

from __future__ import annotations

import dataclasses
import functools

import jax
import numpy as np
import pytest

import ig2mj
from ig2mj.agents.floating_hand import FloatingHand
from ig2mj.calibration.pushing import LEASH, push, start_pushing
from ig2mj.calibration.reach import find_reach
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.native.settle import settle
from ig2mj.sampling.perturbation import loose_objects
from ig2mj.worlds.random_streams import episode_keys

SECONDS = 1 / 30


def pushed(home, worlds: int, steps: int):
    """Objects moved by over 2 cm per world, and views and pushers of all steps."""
    bare = ig2mj.load_scene(home)
    reach = find_reach(bare)
    scene = ig2mj.load_scene(home, [FloatingHand(pos=reach.start)])
    engine = NativeEngine(scene, worlds)
    physics = engine.load(engine.reset(), settle(scene))
    view = engine.view(physics)
    start = np.array(view.object_com)
    key = episode_keys(0, np.arange(worlds), np.zeros(worlds, np.int32))
    act = jax.jit(functools.partial(push, reach), static_argnames="seconds")
    pusher, course = start_pushing(reach, worlds, scene.model.nu), []
    for step in range(steps):
        number = np.full(worlds, step, np.int32)
        pusher = act(pusher, view.object_com, view.agent.base_pos[:, 0], key, number, seconds=SECONDS)
        before = view
        physics, view = engine.step(physics, np.asarray(pusher.ctrl))
        course.append((before, pusher))
    way = np.linalg.norm(np.array(view.object_com) - start, axis=-1)[:, loose_objects(scene.tables)]
    return (way > 0.02).sum(1), course, reach


@pytest.fixture(scope="module")
def three_worlds(tiny_home_folder):
    return pushed(tiny_home_folder, 3, 150)


def test_things_are_moved_within_five_seconds(three_worlds):
    moved, _, _ = three_worlds
    assert (moved >= 1).all()


def test_controls_are_never_far_ahead_of_the_hand(three_worlds):
    _, course, reach = three_worlds
    for view, pusher in course:
        ahead = np.asarray(pusher.ctrl)[:, :3] + reach.start - np.asarray(view.agent.base_pos)[:, 0]
        assert np.abs(ahead).max() <= LEASH + 1e-5


def test_world_0_does_the_same_in_a_batch_of_any_size(three_worlds, tiny_home_folder):
    _, alone, _ = pushed(tiny_home_folder, 1, 40)
    _, course, _ = three_worlds
    for (_, one), (_, many) in zip(alone, course, strict=False):
        assert np.array_equal(np.asarray(one.ctrl)[0], np.asarray(many.ctrl)[0])


def test_worlds_go_different_ways(three_worlds):
    _, course, _ = three_worlds
    ends = np.asarray(course[-1][1].ctrl)[:, :3]
    assert np.linalg.norm(ends - ends[0], axis=-1).max() > 0.01


def test_what_lies_too_far_away_is_not_followed(three_worlds):
    """All objects two metres off: the hand goes on among the known places, and pushes nothing."""
    _, course, reach = three_worlds
    view, pusher = course[60]
    away = np.asarray(view.object_com) + np.array([2.0, 0.0, 0.0], np.float32)
    palm = np.asarray(view.agent.base_pos)[:, 0]
    key = episode_keys(0, np.arange(3), np.zeros(3, np.int32))
    low, high = reach.nodes.min(0) - 0.5, reach.nodes.max(0) + 0.5
    act = jax.jit(functools.partial(push, reach), static_argnames="seconds")
    for step in range(90):
        pusher = act(pusher, away, palm, key, np.full(3, step, np.int32), seconds=SECONDS)
        palm = np.asarray(pusher.ctrl)[:, :3] + reach.start
        assert not np.asarray(pusher.pushes).any()
        assert (palm > low).all() and (palm < high).all()


@pytest.mark.slow
def test_a_world_without_numbers_keeps_its_controls(three_worlds):
    _, course, reach = three_worlds
    view, pusher = course[30]
    lost = np.array(view.object_com)
    lost[1] = np.nan
    palm = np.array(view.agent.base_pos)[:, 0]
    palm[1] = np.nan
    key = episode_keys(0, np.arange(3), np.zeros(3, np.int32))
    after = push(reach, pusher, lost, palm, key, np.full(3, 30, np.int32), SECONDS)
    for field in dataclasses.fields(after):
        assert np.isfinite(np.asarray(getattr(after, field.name))).all(), field.name
    assert np.array_equal(np.asarray(after.ctrl)[1], np.asarray(pusher.ctrl)[1])


@pytest.mark.slow
@pytest.mark.parametrize("home", ["hazel", "birch"])
def test_in_shipped_homes_the_hand_disturbs_things(home):
    moved, _, reach = pushed(home, 2, 300)
    assert len(reach.objects) >= 2
    assert (moved >= 1).all()
