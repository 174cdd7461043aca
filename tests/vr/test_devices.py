"""Messages of pages, mouse and keyboard, and who is there."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from rotations import turned

from ig2mj.agents.humanoid.frames import EYE_POS
from ig2mj.vr.desktop import DesktopPoses
from ig2mj.vr.frames import PlayArea, Pose
from ig2mj.vr.mapping import heading
from ig2mj.vr.messages import Desktop, Devices, Rate, decode, pose_message
from ig2mj.vr.page_source import PagePoses
from ig2mj.vr.sources import PoseSource
from ig2mj.vr.timing import PARTS, Timing
from ig2mj.vr.track import PoseTrack

DEVICES = {
    "type": "devices",
    "time": 1.5,
    "head": [0, 1.6, 0, 0, 0, 0, 1],
    "hands": [{}, {"pose": [0.2, 1.2, -0.4, 0, 0, 0, 1], "trigger": 0.5, "stick": [0, 1], "buttons": 3}],
}
DESKTOP = {"type": "desktop", "down": ["w"], "move": [3, -2]}


def text(**changes) -> str:
    return json.dumps(DEVICES | changes)


def test_messages_of_pages_become_frames():
    message = decode(text())
    assert isinstance(message, Devices)
    frame = message.frame()
    assert frame.head.pos == pytest.approx((0, 0, 1.6)) and heading(frame.head) == pytest.approx(0)
    assert frame.hands[0].pose is None
    assert frame.hands[1].trigger == 0.5 and frame.hands[1].stick == (0.0, 1.0) and frame.hands[1].buttons == 3
    assert isinstance(decode(json.dumps(DESKTOP)), Desktop)
    assert isinstance(decode('{"type": "rate", "pictures": 72, "slowest": 20}'), Rate)


MALFORMED = [
    b"\x00\x01",
    "",
    "null",
    "[]",
    "{}",
    "{" * 3000,
    "x" * 5000,
    '{"type": "devices"}',
    '{"type": "quit"}',
    text(head=[0, 1.6, 0, 0, 0, 0, 0]),
    text(head=[0, 1.6, 0, 0, 0, 1]),
    text(head=[0, 1e9, 0, 0, 0, 0, 1]),
    text(head=[0, 0, 0, 0.9, 0.9, 0.9, 0.9]),
    text(hands=[{}]),
    text(hands=[{}, {"trigger": 2}]),
    text(hands=[{}, {"trigger": "1"}]),
    text(hands=[{}, {"stick": [5, 0]}]),
    text(hands=[{}, {"more": 1}]),
    text(time=-1),
    text(time=None),
    text().replace("1.5", "NaN"),
    text().replace("1.5", "1e999"),
    json.dumps(DESKTOP | {"down": ["w"] * 99}),
    json.dumps(DESKTOP | {"down": ["w" * 99]}),
    json.dumps(DESKTOP | {"move": [1e99, 0]}),
]


@pytest.mark.parametrize("message", MALFORMED, ids=range(len(MALFORMED)))
def test_what_is_no_message_of_a_page_is_refused(message):
    with pytest.raises(ValueError):
        decode(message)


def test_a_message_with_poses_has_the_form_that_the_page_reads():
    poses = np.arange(14, dtype=np.float32).reshape(2, 7)
    message = pose_message(PlayArea(1.0, 2.0, 0.5, 0.25), Pose.of((0, 0, 1.6), turned()), np.array([3, 9]), poses)
    row = np.frombuffer(message, "<f4")
    assert row[:6].tolist() == [2, 1, 2, 0.5, 0.25, 1]
    assert row[6:13] == pytest.approx([0, 0, 1.6, 1, 0, 0, 0])
    assert row[13:].reshape(2, 8).tolist() == [[3, *poses[0]], [9, *poses[1]]]


# Who is there.


def test_nobody_is_there_before_a_page_says_so_after_it_is_closed_or_when_a_headset_falls_silent():
    source = PagePoses(stale=1.0)
    assert isinstance(source, PoseSource)
    assert source.poll() is None
    felt = []
    source.arrive(lambda *pulse: felt.append(pulse))
    source.receive(decode(text()), now=100.0)
    source.advance(100.5)
    assert source._frame is not None  # `poll` goes by the clock
    source.pulse(1, 0.3, 0.033)
    assert felt == [(1, 0.3, 0.033)]
    source.advance(101.6)
    assert source._frame is None
    source.receive(decode(text()), now=102.0)
    source.leave()
    assert source.poll() is None
    source.pulse(0, 0.9, 0.033)
    assert len(felt) == 1


def test_the_stick_of_a_page_walks_at_the_rate_of_pictures_and_the_area_comes_to_the_robot():
    source = PagePoses(stale=math.inf)
    source.arrive(lambda *pulse: None)
    walking = text(hands=[{"stick": [0, 1]}, {}])
    for k in range(31):
        source.receive(decode(walking), now=100.0 + k / 30)
    assert source.area.x == pytest.approx(0.6 + 0.06, abs=1e-3)  # after the first, whose time was cut
    body = Pose.of((3, 1, 0.55), turned(z=90))
    frame = source.stand_at(body)
    head = frame.in_world(frame.head)
    assert head.pos[:2] == pytest.approx((3, 1 + EYE_POS[0]), abs=0.07)  # the stick is still held
    assert heading(head) == pytest.approx(math.pi / 2)


def test_keys_that_are_held_are_let_go_when_a_page_falls_silent():
    source = PagePoses(stale=1.0)
    source.arrive(lambda *pulse: None)
    source.receive(decode(json.dumps(DESKTOP)), now=10.0)
    source.advance(10.05)
    walked = source.area.x
    assert walked > 0
    source.advance(11.5)
    there = source.area.x
    source.advance(11.6)
    assert source.area.x == there and source._frame.head is not None


# Mouse and keyboard.


def test_mouse_and_keyboard_look_around_choose_hands_and_grasp():
    devices = DesktopPoses()
    start = devices.frame(0.03)
    devices.feed([], (100.0, 0.0), 0.0, 2)
    assert heading(devices.frame(0.03).head) == pytest.approx(-0.4)
    devices.feed([], (0.0, 10_000.0), 0.0, 2)
    assert heading(devices.frame(0.03).head) == pytest.approx(-0.4)  # looking straight down
    devices.feed(["1"], (0.0, 0.0), 0.0, 1)
    frame = devices.frame(0.03)
    assert (frame.hands[0].trigger, frame.hands[1].trigger) == (1.0, 0.0)
    devices = DesktopPoses()
    devices.feed(["shift", "2"], (0.0, -100.0), -500.0, 0)
    moved = devices.frame(0.03)
    assert moved.hands[1].pose.pos - start.hands[1].pose.pos == pytest.approx((0.2, 0, 0.15))
    assert moved.hands[0].pose.pos == pytest.approx(start.hands[0].pose.pos)
    devices.feed(["w", "d", "t", "nonsense"], (0.0, 0.0), 0.0, 0)
    frame = devices.frame(0.03)
    assert (frame.hands[0].stick, frame.hands[1].stick) == ((1.0, 1.0), (0.0, 1.0))
    devices.feed(["r"], (0.0, 0.0), 0.0, 0)
    assert devices.frame(0.03).hands[1].pose.pos == pytest.approx(start.hands[1].pose.pos)


# Poses for whoever draws, and where time goes.


def test_poses_are_drawn_between_the_last_two_steps_however_rarely_there_is_one():
    track = PoseTrack()
    assert track.at(0.0) is None
    quat = np.array([[1.0, 0, 0, 0]] * 2)
    track.add(np.zeros((2, 3)), quat, now=0.0)
    track.add(np.array([[0.1, 0, 0], [40.0, 0, 0]]), np.array([[0, 0, 0, 1.0], [-1, 0, 0, 0]]), now=0.04)
    middle = track.at(0.06)
    assert middle[0, 0] == pytest.approx(0.05)
    assert middle[0, 3:] == pytest.approx((math.sqrt(0.5), 0, 0, math.sqrt(0.5)))
    assert middle[1, 0] == 40  # what slicing moves does not fly through the home
    assert track.at(0.08)[0, 0] == pytest.approx(0.1)
    assert track.at(9.0)[0, 0] == pytest.approx(0.1)
    track.add(np.zeros((2, 3)), quat, now=2.0)
    assert track.at(2.05)[0, 0] == pytest.approx(0.05)  # over a tenth of a second, not two


def test_the_time_of_a_part_is_not_counted_twice():
    timing = Timing()
    with timing.part("states"), timing.part("physics"):
        sum(range(200_000))
    timing.end_frame()
    found = timing.summary()
    assert set(found) == {*PARTS, "frame p99"}
    assert found["states"] < 0.5 * found["physics"]
    assert found["frame p99"] == pytest.approx(sum(found[name] for name in PARTS))
    assert "physics" in timing.line()
