"""From devices to the humanoid's action as iGibson maps them, and those of its bugs that concern it."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from inverses import grip_of_hand, to_xr
from rotations import turned
from scipy.spatial.transform import Rotation

from ig2mj.agents.humanoid.frames import BODY_Z, EYE_POS, HAND_POS, HAND_QUAT, MAX_MOVE, MAX_TURN, PALM_CENTER, mirrored
from ig2mj.vr.frames import SHAPES, Gaze, Hand, PlayArea, Pose, PoseFrame, from_arrays, to_arrays
from ig2mj.vr.mapping import HumanoidPose, Memory, action_of, heading
from ig2mj.vr.play_area import HEIGHTS, brought_to, moved
from ig2mj.vr.xr_axes import hand_from_grip, head_from_xr

STILL = Rotation.identity()


def rest(hand: int) -> Pose:
    return Pose(HAND_POS[hand], HAND_QUAT[hand])


def robot(body: Pose | None = None, **changes) -> HumanoidPose:
    """At rest, its body at (1, 2, 0.55), turned left by 90 degrees."""
    body = body or Pose.of((1.0, 2.0, 0.55), turned(z=90))
    made = HumanoidPose(body, Pose.of(EYE_POS, STILL), (rest(0), rest(1)), (0.0, 0.0))
    return dataclasses.replace(made, **changes)


def frame_at_rest(of: HumanoidPose, **changes) -> PoseFrame:
    """What devices say whose person is where the robot is."""
    head, hands = of.body * of.eye, tuple(Hand(of.body * hand) for hand in of.hands)
    return dataclasses.replace(PoseFrame(0.0, head, hands), **changes)


def carried_out(of: HumanoidPose, action: np.ndarray) -> HumanoidPose:
    """What the controller makes of an action, with a body that gets where it is sent."""

    def step(pose: Pose, six: np.ndarray) -> Pose:
        return Pose.of(pose.pos + six[:3], Rotation.from_euler("xyz", six[3:]) * pose.turn)

    body = of.body * Pose.of(action[:3], Rotation.from_euler("xyz", action[3:6]))
    hands = (step(of.hands[0], action[12:18]), step(of.hands[1], action[20:26]))
    return HumanoidPose(
        body, step(of.eye, action[6:12]), hands, (of.triggers[0] + action[18], of.triggers[1] + action[26])
    )


def apart(a: Pose, b: Pose) -> tuple[float, float]:
    return float(np.linalg.norm(a.pos - b.pos)), float((a.turn.inv() * b.turn).magnitude())


def test_devices_where_the_robot_is_move_nothing():
    action, _ = action_of(frame_at_rest(robot()), robot(), Memory())
    assert action.shape == (28,)
    assert action == pytest.approx(np.zeros(28), abs=1e-9)


def test_head_and_hands_are_reached_in_one_action_while_the_body_moves_below_the_head():
    now = robot()
    head = Pose.of(np.add(now.body.pos, (0.1, 0.15, 0.5)), turned(z=105) * turned(y=25))
    hands = tuple(
        Hand(Pose.of(np.add((now.body * h).pos, (0.05, 0.1, 0.1)), turned(x=20) * (now.body * h).turn))
        for h in now.hands
    )
    frame = PoseFrame(0.0, head, (hands[0], hands[1]))
    after = carried_out(now, action_of(frame, now, Memory())[0])
    assert apart(after.body * after.eye, head) == pytest.approx((0, 0), abs=1e-9)
    for k in range(2):
        assert apart(after.body * after.hands[k], hands[k].pose) == pytest.approx((0, 0), abs=1e-9)
    assert after.body.turn.as_euler("xyz", degrees=True) == pytest.approx((0, 0, 105), abs=1e-6)


def test_far_targets_are_reached_on_a_straight_way_within_the_limits_of_a_frame():
    now, memory = robot(), Memory()
    hand = Pose.of(np.add(now.body.pos, (0.9, -0.9, 0.2)), turned(x=170, z=45))
    for _ in range(12):
        frame = dataclasses.replace(frame_at_rest(robot()), hands=(Hand(), Hand(hand)))
        action, memory = action_of(frame, now, memory)
        for k in (0, 6, 12, 20):
            assert np.abs(action[k : k + 3]).max() <= MAX_MOVE + 1e-9
            assert np.abs(action[k + 3 : k + 6]).max() <= MAX_TURN + 1e-9
        now = carried_out(now, action)
    assert apart(now.body * now.hands[1], hand) == pytest.approx((0, 0), abs=1e-6)


def test_looking_around_drags_no_hand_along():
    """Hands that are stretched out stay where they are while the body follows the head."""
    now, memory = robot(), Memory()
    hands = tuple(Hand(Pose.of((now.body * Pose.of((0.6, y, 0.1), turned())).pos, turned())) for y in (0.2, -0.2))
    start = dataclasses.replace(frame_at_rest(now), hands=(hands[0], hands[1]))
    for _ in range(3):
        action, memory = action_of(start, now, memory)
        now = carried_out(now, action)
    around = dataclasses.replace(start, head=Pose.of(start.head.pos, turned(z=200)))
    for _ in range(8):
        action, memory = action_of(around, now, memory)
        now = carried_out(now, action)
        for k in range(2):
            assert apart(now.body * now.hands[k], hands[k].pose) == pytest.approx((0, 0), abs=1e-6)
    assert heading(now.body) == pytest.approx(math.radians(-160))


@pytest.mark.parametrize("pitch", [0, 80, -80, 100])
@pytest.mark.parametrize("yaw", [0, 65, 179, -120])
def test_the_heading_is_that_of_the_heads_right_however_it_is_pitched(yaw, pitch):
    assert math.degrees(heading(Pose.of((0, 0, 1), turned(z=yaw) * turned(y=pitch)))) == pytest.approx(yaw)


def test_a_head_on_its_side_turns_nobody():
    assert heading(Pose.of((0, 0, 1), turned(z=30) * turned(x=90))) is None
    now = robot()
    side = Pose.of((now.body * now.eye).pos, turned(z=30) * turned(x=90))
    action, _ = action_of(frame_at_rest(now, head=side), now, Memory())
    assert action[3:6] == pytest.approx(0, abs=1e-9)


def test_a_tracker_at_the_chest_is_followed_and_the_head_is_free():
    now = robot()
    torso = Pose.of(np.add(now.body.pos, (0.1, 0.0, 0.05)), now.body.turn)
    head = Pose.of((now.body * now.eye).pos, now.body.turn * turned(z=50))
    after = carried_out(now, action_of(frame_at_rest(now, torso=torso, head=head), now, Memory())[0])
    assert apart(after.body, torso) == pytest.approx((0, 0), abs=1e-9)
    assert apart(after.body * after.eye, head) == pytest.approx((0, 0), abs=1e-9)


def test_the_body_stays_between_the_floor_and_two_metres():
    now = robot()
    high = Pose.of((*now.body.pos[:2], 4.0), now.body.turn)
    memory = Memory()
    for _ in range(12):
        action, memory = action_of(frame_at_rest(robot(), head=high), now, memory)
        now = carried_out(now, action)
    assert now.body.pos[2] == pytest.approx(BODY_Z[1])


def test_what_is_not_tracked_stays():
    now = robot()
    frame = PoseFrame(0.0, None, (Hand(trigger=0.4), Hand()))
    action, _ = action_of(frame, now, Memory())
    assert np.flatnonzero(np.abs(action) > 1e-9).tolist() == [18]


def test_both_squeezes_for_a_second_let_go_and_take_hold_again():
    now, memory = robot(), Memory()
    away = Pose.of(np.add((now.body * now.eye).pos, (0.2, 0, 0)), now.body.turn)

    def press(time: float, squeezed: bool) -> np.ndarray:
        nonlocal memory
        hands = (Hand(squeeze=float(squeezed)), Hand(squeeze=float(squeezed)))
        action, memory = action_of(PoseFrame(time, away, hands), now, memory)
        return action

    press(0.0, True)
    press(0.9, True)
    assert memory.attached
    press(1.1, True)
    assert not memory.attached
    press(3.0, True)
    assert not memory.attached  # once for each time they are held
    detached = press(3.1, False)
    assert detached[6:] == pytest.approx(0)
    press(4.0, True)
    press(5.1, True)
    assert memory.attached and memory.took_hold == 1


def test_without_a_person_hands_open_and_rest():
    now = robot(triggers=(1.0, 0.5))
    action, _ = action_of(None, now, Memory())
    assert (action[18], action[26]) == (-1.0, -0.5)
    assert (action[19], action[27]) == (1.0, 1.0)
    assert action[:18] == pytest.approx(0, abs=1e-9)


def test_frames_are_kept_as_arrays_and_come_back():
    frame = frame_at_rest(robot(), gaze=Gaze(np.array([1.0, 2, 3]), np.array([0.0, 0, -1])), time=3.5)
    frame = dataclasses.replace(frame, area=PlayArea(1.0, 2.0, 0.5, 0.3, True))
    frame = dataclasses.replace(frame, hands=(Hand(None, 0.2, 0.3, (0.1, -1.0), 5), frame.hands[1]))
    arrays = to_arrays(frame)
    assert {name: array.shape for name, array in arrays.items()} == SHAPES
    back = to_arrays(from_arrays(arrays))
    assert all(np.array_equal(arrays[name], back[name]) for name in SHAPES)
    assert from_arrays(to_arrays(None)) is None
    for name, wrong in (("head", np.full(8, np.nan)), ("head", np.ones(7)), ("hands", np.ones((2, 8)))):
        with pytest.raises(ValueError):
            from_arrays(arrays | {name: wrong})


# The play area.


def test_the_left_stick_walks_where_the_head_faces_however_it_is_pitched():
    frame = PoseFrame(0.0, Pose.of((0.3, 0, 1.6), turned(z=90) * turned(y=50)), (Hand(stick=(0.0, 1.0)), Hand()))
    area = moved(PlayArea(), frame, 0.05)
    assert (area.x, area.y, area.z) == pytest.approx((0, 0.03, 0))
    assert moved(PlayArea(), frame, 60.0).y == pytest.approx(0.06)  # after a pause nobody flies
    to_the_right = dataclasses.replace(frame, hands=(Hand(stick=(0.5, 0.0)), Hand()))
    assert moved(PlayArea(), to_the_right, 0.05).x == pytest.approx(0.015)


def test_the_right_stick_lifts_within_bounds_and_turns_once_about_the_head():
    head = Pose.of((0.5, 0.2, 1.6), STILL)
    up = PoseFrame(0.0, head, (Hand(), Hand(stick=(0.0, 0.8))))
    area = PlayArea()
    for _ in range(200):
        area = moved(area, up, 0.05)
    assert area.z == HEIGHTS[1]
    right = PoseFrame(0.0, head, (Hand(), Hand(stick=(1.0, 0.0))))
    once = moved(PlayArea(), right, 0.02)
    assert math.degrees(once.yaw) == pytest.approx(-30)
    assert (once.pose * head).pos == pytest.approx(head.pos)
    assert moved(once, right, 0.02) == once
    back = moved(once, PoseFrame(0.0, head), 0.02)
    assert math.degrees(moved(back, right, 0.02).yaw) == pytest.approx(-60)


def test_the_play_area_is_brought_to_the_robot_with_the_persons_own_height():
    head, body = Pose.of((0.4, -0.3, 1.7), turned(z=-40) * turned(y=20)), robot().body
    area = brought_to(PlayArea(), head, body)
    placed = area.pose * head
    assert math.degrees(heading(placed)) == pytest.approx(90)
    assert placed.pos == pytest.approx([1.0, 2.0 + EYE_POS[0], 1.7])
    action, _ = action_of(PoseFrame(0.0, head, area=area), robot(), Memory())
    assert action[:2] == pytest.approx(0, abs=1e-9)


# Axes of devices.


def test_xr_axes_go_there_and_back():
    rng = np.random.default_rng(1)
    for _ in range(5):
        pos, quat = rng.normal(size=3), Rotation.random(random_state=rng).as_quat()
        for there, back in (
            (head_from_xr, to_xr),
            (lambda p, q: hand_from_grip(1, p, q), lambda h: grip_of_hand(1, h)),
        ):
            same_pos, same_quat = back(there(pos, quat))
            assert same_pos == pytest.approx(pos)
            assert abs(same_quat @ quat) == pytest.approx(1)
    ahead = head_from_xr((1, 2, 3), (0, 0, 0, 1))
    assert ahead.pos == pytest.approx((-3, -1, 2)) and ahead.turn.magnitude() == pytest.approx(0)


# Bugs of iGibson that are not copied.


@pytest.mark.parametrize("hand", [0, 1])
def test_a_hand_held_like_a_hammer_points_forward_with_the_palm_inwards(hand):
    """Quarter turns are exact, not degrees taken for radians. XR's identity grip: the tube of the fingers points
    forward, its x to the right."""
    pose = hand_from_grip(hand, (0, 1, 0), (0, 0, 0, 1))
    fingers, palm = pose.turn.apply((0, (1, -1)[hand], 0)), pose.turn.apply((0, 0, 1))
    thumb = pose.turn.apply((-1, 0, 0))
    assert thumb == pytest.approx((1, 0, 0))  # from the little finger to the thumb: forward
    assert fingers == pytest.approx((0, 0, -1))
    assert palm == pytest.approx((0, (-1, 1)[hand], 0))  # the left palm looks to the right, the right one to the left


def test_the_left_hands_grip_point_is_the_mirror_image_of_the_rights():
    left, right = (hand_from_grip(hand, (0, 0, 0), (0, 0, 0, 1)) for hand in range(2))
    for hand, pose in enumerate((left, right)):
        assert pose.pos + pose.turn.apply(mirrored(hand, PALM_CENTER)) == pytest.approx(0, abs=1e-12)
    assert mirrored(0, PALM_CENTER)[2] == PALM_CENTER[2]
    assert left.pos == pytest.approx(right.pos * (1, -1, 1))


def test_a_hand_can_move_both_ways():
    now = robot()
    for sign in (1, -1):
        moved_hand = Hand(
            Pose.of(np.add((now.body * now.hands[1]).pos, (0, 0, 0.1 * sign)), (now.body * now.hands[1]).turn)
        )
        frame = dataclasses.replace(frame_at_rest(now), hands=(frame_at_rest(now).hands[0], moved_hand))
        assert action_of(frame, now, Memory())[0][22] == pytest.approx(0.1 * sign)


@pytest.mark.parametrize("hand", [0, 1])
def test_a_pulled_trigger_closes_and_a_released_one_opens(hand):
    def trigger(value: float, of: HumanoidPose) -> float:
        hands = [Hand(), Hand()]
        hands[hand] = Hand(trigger=value)
        return float(action_of(PoseFrame(0.0, None, (hands[0], hands[1])), of, Memory())[0][18 + 8 * hand])

    closed = robot(triggers=(0.8, 0.8))
    assert trigger(1.0, robot()) == 1.0
    assert trigger(1.0, closed) == pytest.approx(0.2)
    assert trigger(0.0, closed) == pytest.approx(-0.8)
    assert trigger(7.0, robot()) == 1.0


def test_without_a_tracker_the_head_is_where_its_neck_lets_it_be():
    """The eye's rest above the body's middle is within reach of the neck; with the swapped constants it is not."""
    now = robot()
    tall = Pose.of(np.add((now.body * now.eye).pos, (0, 0, 0.6)), now.body.turn)
    memory = Memory()
    for _ in range(4):
        action, memory = action_of(frame_at_rest(robot(), head=tall), now, memory)
        now = carried_out(now, action)
    assert now.eye.pos == pytest.approx(EYE_POS, abs=1e-6)
    assert now.body.pos[2] == pytest.approx(tall.pos[2] - EYE_POS[2])


@pytest.mark.parametrize("hand", [0, 1])
def test_a_reset_is_that_of_its_own_hand(hand):
    hands = [Hand(), Hand()]
    hands[hand] = Hand(squeeze=1.0)
    action, _ = action_of(PoseFrame(0.0, None, (hands[0], hands[1])), robot(), Memory())
    assert (action[19], action[27]) == ((1.0, 0.0), (0.0, 1.0))[hand]


def test_head_and_hands_are_relative_to_the_same_new_body():
    now = robot()
    step = np.array([0.2, -0.1, 0.0])
    moved_frame = frame_at_rest(now)
    moved_frame = PoseFrame(
        0.0,
        Pose.of(moved_frame.head.pos + step, moved_frame.head.turn),
        tuple(Hand(Pose.of(hand.pose.pos + step, hand.pose.turn)) for hand in moved_frame.hands),
    )
    action, _ = action_of(moved_frame, now, Memory())
    assert np.linalg.norm(action[:3]) == pytest.approx(np.linalg.norm(step))
    assert action[6:] == pytest.approx(np.zeros(22), abs=1e-9)  # all move with the body, none in it


def test_a_robot_that_nobody_drives_returns_to_where_it_was_sent():
    """A load has pushed it aside; iGibson would take the new place for its target."""
    memory = action_of(frame_at_rest(robot()), robot(), Memory())[1]
    pushed = robot(body=Pose.of((1.02, 2.0, 0.55), turned(z=95)))
    action, memory = action_of(None, pushed, memory)
    assert carried_out(pushed, action).body.pos == pytest.approx((1.0, 2.0, 0.55))
    assert carried_out(pushed, action).body.turn.as_euler("xyz", degrees=True)[2] == pytest.approx(90)
