"""`ig2mj play` without a window: keys, what they make of an action, the mouse's forces, and whole sessions."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from fake_window import FakeHandle

import ig2mj
from ig2mj.agents.fetch.controller import FetchController
from ig2mj.agents.humanoid.controller import HumanoidController
from ig2mj.cli import call
from ig2mj.viewer import interactive
from ig2mj.viewer.mouse import LET_GO, MAX_FORCE, Mouse, moment, push, spring
from ig2mj.viewer.play.actions import REACH, WALK, Wish, action_of
from ig2mj.viewer.play.keys import BINDINGS, BY_KEY, HOLD, Held
from ig2mj.viewer.play.session import PlaySession, launch

UP, PAD_9, PAD_5, PAD_0, EYE = 265, 329, 325, 320, ord("I")
HUMANOID = HumanoidController.action_names
MOVE = np.array([0.3] * 3 + [1.0] * 3)
LIMITS = np.array([*MOVE, *MOVE, *MOVE, 1.0, 1.0, *MOVE, 1.0, 1.0])
PERIOD = 1 / 30


def test_no_key_means_two_things_and_none_is_the_viewers_own():
    keys = [key for binding in BINDINGS for key in binding.keys]
    assert len(keys) == len(set(keys)) == len(BY_KEY)
    assert not {32, 47, 256, 257, 259, ord("P"), *map(ord, interactive.OVERLAY_KEYS)} & set(keys)


def test_a_movement_goes_on_while_its_key_is_repeated_and_then_stops():
    held = Held()
    assert held.press(UP, 1.0) is None
    assert held.moves(1.0 + 0.9 * HOLD) == {"forward"}
    held.press(UP, 1.0 + 0.9 * HOLD)
    assert held.moves(1.0 + 1.5 * HOLD) == {"forward"}
    assert held.moves(1.0 + 2 * HOLD) == frozenset()
    assert held.press(PAD_5, 2.0) == "close or open" and held.moves(2.0) == frozenset()
    assert held.press(999, 2.0) is None


def humanoid(wish: Wish) -> dict[str, float]:
    row = action_of(wish, HUMANOID, LIMITS, PERIOD)
    assert np.abs(row).max() <= 1.0
    return {name: number * high for name, number, high in zip(HUMANOID, row, LIMITS, strict=True) if number}


def test_what_a_person_wants_is_the_humanoids_action_at_walking_speed():
    done = humanoid(Wish({"forward", "hand up", "look down"}, hand=1, closed=(False, True), reset={0}))
    assert done["body_x"] == pytest.approx(WALK / 30) and done["right_hand_z"] == pytest.approx(REACH / 30)
    assert done["eye_pitch"] > 0 and done["right_hand_trigger"] > 0 > done["left_hand_trigger"]
    assert done["left_hand_reset"] == 1 and "right_hand_reset" not in done
    still = humanoid(Wish({"forward", "backward"}))
    assert set(still) == {"left_hand_trigger", "right_hand_trigger"}, "both ways is none; hands open"


def test_what_a_person_wants_is_fetchs_action():
    names, high = FetchController.action_names, FetchController.action_high
    done = dict(zip(names, action_of(Wish({"turn left", "hand forward", "look up"}), names, high, PERIOD), strict=True))
    assert done["turn_left"] > 0 == done["forward"]
    assert done["eef_x"] == 1.0 and done["head_tilt"] < 0 and done["gripper"] == 1.0
    closed = action_of(Wish(closed=(True,)), names, high, PERIOD)
    assert closed[names.index("gripper")] == -1.0
    driven = action_of(Wish({"forward"}), ("forward", "turn_left"), np.ones(2), PERIOD)
    np.testing.assert_allclose(driven, [0.5, 0.0])


def test_the_spring_of_the_mouse_holds_lifts_and_lets_go():
    """iGibson's 100 N are its limit; an object in rest under it is carried."""
    here, still = np.zeros(3), np.zeros(3)
    carried = spring(here, still, here, 0.5, weight=4.9)
    assert carried is not None and carried.tolist() == pytest.approx([0, 0, 4.9])
    pulled = spring(here, still, np.array([0.5, 0, 0]), 20.0)
    assert pulled is not None and np.linalg.norm(pulled) == pytest.approx(MAX_FORCE)
    slowed = spring(here, np.array([1.0, 0, 0]), here, 1.0)
    assert slowed is not None and slowed[0] < 0
    assert spring(here, still, np.array([0, 0, LET_GO * 1.01]), 1.0) is None
    np.testing.assert_allclose(push(np.array([0, -2.0, 0])), [0, -MAX_FORCE, 0])
    np.testing.assert_allclose(moment(np.array([0, 0, 1.0]), np.array([1.0, 0, 0]), here), [0, 0, 1, 0, -1, 0])


def test_a_dragged_object_follows_the_mouse_and_a_pushed_one_flies_off(tiny_home):
    world, mouse, perturb = ig2mj.Simulation(tiny_home, states=None), Mouse(), mujoco.MjvPerturb()
    body = tiny_home.model.body("ball").id
    perturb.select, perturb.active = body, int(mujoco.mjtPertBit.mjPERT_TRANSLATE)
    goal = world.object_pose("ball")[0] + np.array([0.0, 0.0, 0.4])
    perturb.refselpos[:] = goal
    ahead = np.array([1.0, 0.0, 0.0])
    for _ in range(45):
        mouse.apply(tiny_home.model, world.data, perturb, ahead)
        world.step()
    np.testing.assert_allclose(world.object_pose("ball")[0], goal, atol=0.02)
    perturb.active = 0
    mouse.push(1 / 30)
    for _ in range(4):
        mouse.apply(tiny_home.model, world.data, perturb, ahead)
        world.step()
    assert world.object_pose("ball")[0][0] > goal[0] + 0.1


def test_the_command_lists_its_keys(capsys):
    assert call(["play", "CookingMeat", "--keys"]) == 0
    said = capsys.readouterr().out
    assert all(binding.command in said for binding in BINDINGS)


def test_a_robot_that_there_is_not_is_refused(capsys):
    assert call(["play", "PointNavigation", "--robot", "turtlbot"]) == 2
    assert "turtlebot" in capsys.readouterr().err


@pytest.fixture(scope="module")
def session():
    """TurtleBot in its navigation task; the clock stands still."""
    env = ig2mj.make("PointNavigation", engine="native", pool_size=1, whole_actions=True, period=PERIOD)
    return PlaySession(env.with_horizon(10**9), clock=lambda: 0.0)


@pytest.mark.slow
def test_a_session_drives_shows_and_starts_anew(session, monkeypatch):
    handle = FakeHandle(session.scene.model, pictures=12)
    pressed = iter([UP, EYE])

    def window(model, data, key_callback, panels):
        assert not panels
        for key in pressed:
            key_callback(key)
        return handle

    monkeypatch.setattr(interactive, "launch_window", window)
    before = np.array(session.state.batch.world.view.agent.base_pos)[0, 0]
    launch(session)
    after = np.array(session.state.batch.world.view.agent.base_pos)[0, 0]
    assert 0.05 < np.linalg.norm(after - before) < 0.3
    assert handle.cam.distance == pytest.approx(0.05), "with the robot's eye"
    said = " ".join(text for page in handle.texts[-1] for text in page[2:])
    assert "goal" in said
    session.reset()
    np.testing.assert_allclose(np.array(session.state.batch.world.view.agent.base_pos)[0, 0], before, atol=1e-5)


@pytest.mark.slow
def test_a_person_grips_with_the_humanoids_right_hand_and_it_is_recorded(tmp_path):
    from ig2mj.demos import record
    from ig2mj.demos.reader import Recording

    env = ig2mj.make(
        "GraspingBook", engine="native", grasping="assisted", pool_size=1, whole_actions=True, period=PERIOD
    )
    session = PlaySession(record(env, tmp_path / "runs.h5", past_success=True), clock=lambda: 0.0)
    session.press(PAD_9)
    session.press(PAD_5)
    z = float(np.asarray(session.state.batch.world.view.agent.hand_pos)[0, 1, 2])
    for _ in range(6):
        session.step()
    assert float(np.asarray(session.state.batch.world.view.agent.hand_pos)[0, 1, 2]) > z + 0.03
    assert float(np.asarray(session.state.batch.controllers[0].trigger)[0, 1]) == pytest.approx(1.0)
    session.press(PAD_0)
    assert session.hand == 0 and "> left hand" in dict(session.lines(session.data))
    session.env.close()
    with Recording(tmp_path / "runs.h5") as file:
        assert len(file.runs) == 1
