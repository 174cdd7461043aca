"""Headsets by OpenXR, against a runtime of this test's own (tests/vr/openxr_runtime.py) below the real loader."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys

import mujoco
import numpy as np
import pytest

if importlib.util.find_spec("xr") is None:  # not imported here: `load_xr` does, and undoes what that does to PyOpenGL
    pytest.skip("needs pyopenxr (extra xr)", allow_module_level=True)

from openxr_runtime import EXTENSIONS, PERIOD, Runtime, build_stub
from rotations import turned

import ig2mj
from ig2mj.agents import Humanoid
from ig2mj.errors import EngineError
from ig2mj.process.opengl import use_opengl
from ig2mj.vr.frames import PlayArea, Pose
from ig2mj.vr.openxr.actions import PRIMARY_BIT, PROFILES
from ig2mj.vr.openxr.devices import GAZE, HEADLESS, Headset
from ig2mj.vr.openxr.egl import EglGraphics
from ig2mj.vr.openxr.session import HeadsetLoop, OpenXRPoses
from ig2mj.vr.session import Session
from ig2mj.vr.sources import PoseSource
from ig2mj.vr.track import PoseTrack
from ig2mj.vr.xr_axes import hand_from_grip

UPRIGHT = (0.0, 0.0, 0.0, 1.0)
RIGHT = "/user/hand/right/input"


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    return build_stub(tmp_path_factory.mktemp("runtime"))


@pytest.fixture
def runtime(library):
    made = Runtime(library)
    yield made
    assert made.errors == []


@pytest.fixture(scope="module")
def scene(tiny_home_folder):
    return ig2mj.load_scene(tiny_home_folder, agents=[Humanoid(pos=(-1.0, 0.0, 0.55))])


def first_frame(headset):
    for _ in range(10):
        frame = headset.wait()
        if frame is not None:
            return frame
    raise AssertionError("the session never began")


def test_poses_triggers_sticks_buttons_and_gaze_are_read_in_our_axes(runtime):
    runtime.head = ((1.0, 1.7, -2.0), UPRIGHT)
    runtime.hands = [None, ((0.2, 1.2, -0.4), UPRIGHT)]
    runtime.gaze = ((1.0, 1.7, -2.0), UPRIGHT)
    runtime.state = {
        f"{RIGHT}/trigger/value": 0.7,
        f"{RIGHT}/squeeze/value": 1.0,
        f"{RIGHT}/thumbstick": (0.5, -1.0),
        f"{RIGHT}/a/click": True,
    }
    with Headset() as headset:
        assert headset.system == "A headset of this test" and headset.gazes
        frame, eyes = headset.locate(first_frame(headset))
        assert eyes is None  # nothing is drawn by a session without pictures
    assert frame.time == pytest.approx(PERIOD * 1e-9)
    assert frame.head.pos == pytest.approx((2, -1, 1.7))
    left, right = frame.hands
    assert left.pose is None and left.trigger == 0
    assert right.pose.pos == pytest.approx(hand_from_grip(1, (0.2, 1.2, -0.4), UPRIGHT).pos, abs=1e-6)
    assert (right.trigger, right.squeeze, *right.stick) == pytest.approx((0.7, 1.0, 0.5, -1.0))
    assert right.buttons == PRIMARY_BIT
    assert frame.gaze.direction == pytest.approx((1, 0, 0))


def test_every_kind_of_controller_is_bound_and_a_simple_one_still_grasps(runtime):
    runtime.profile = "/interaction_profiles/khr/simple_controller"
    runtime.state = {f"{RIGHT}/select/click": True}
    with Headset() as headset:
        frame, _ = headset.locate(first_frame(headset))
    assert set(runtime.bound) == {*PROFILES, "/interaction_profiles/ext/eye_gaze_interaction"}
    assert frame.hands[1].trigger == 1.0 and frame.hands[1].squeeze == 0.0 and frame.gaze is None
    vive = runtime.bound["/interaction_profiles/htc/vive_controller"]
    assert vive["/user/hand/left/input/squeeze/click"] == "squeeze" and vive["/user/hand/left/output/haptic"] == "pulse"


def test_pulses_reach_the_hand(runtime):
    with Headset() as headset:
        frame = first_frame(headset)
        headset.pulse(0, 0.9, 0.05)
        headset.pulse(1, 0.3, 1 / 30)
        headset.end(frame)
    assert runtime.pulses == [
        ("/user/hand/left", pytest.approx(0.9), pytest.approx(0.05)),
        ("/user/hand/right", pytest.approx(0.3), pytest.approx(1 / 30)),
    ]


def test_a_session_ends_when_the_runtime_says_so(runtime):
    with Headset() as headset:
        headset.end(first_frame(headset))
        headset.ask_to_end()
        for _ in range(10):
            if not headset.running:
                break
            assert headset.wait() is None
        assert not headset.running


def test_a_runtime_without_gaze_does_without_and_one_that_lacks_what_is_needed_is_named(library):
    blind = Runtime(library, extensions=(HEADLESS,))
    with Headset() as headset:
        assert not headset.gazes
        frame, _ = headset.locate(first_frame(headset))
        assert frame.gaze is None and frame.head is not None
    assert blind.errors == []
    Runtime(library)
    with pytest.raises(EngineError, match=f"lacks XR_NOT_THERE; it offers .*{HEADLESS}"):
        Headset(Nothing())


class Nothing:
    """Graphics that no runtime takes."""

    extension = "XR_NOT_THERE"

    def check(self, instance, system): ...

    def binding(self): ...

    def begin(self, session, sizes): ...

    def layers(self, space, views): ...

    def close(self): ...


def test_both_eyes_are_drawn_from_where_they_are_while_physics_stands_still(runtime, scene):
    """The head goes on at the headset's rate; the home is as the last step left it."""
    if use_opengl() != "egl":
        pytest.skip("needs EGL")
    data = scene.start_data()
    mujoco.mj_forward(scene.model, data)
    track = PoseTrack()
    track.add(data.xpos.astype(np.float32), data.xquat.astype(np.float32))
    session = Session.__new__(Session)
    session.track = track
    graphics = EglGraphics(scene)

    def look_around(runtime, frame):
        turn = turned(y=10.0 * frame)  # XR's y is up
        runtime.head = ((0.0, 1.2, 0.0), tuple(turn.as_quat()))

    runtime.script = look_around
    with Headset(graphics) as headset:
        source = OpenXRPoses(headset)
        assert isinstance(source, PoseSource)
        source.area = PlayArea(-1.0, 0.0, 0.0)
        loop = HeadsetLoop(headset, source, session, graphics)
        while loop.pictures < 4:
            loop.frame()
        drawn = graphics._pictures.read()
        assert source.poll().head.pos == pytest.approx((0, 0, 1.2), abs=1e-6)
        source.stand_at(Pose.of((1.0, 0.5, 0.55), turned(z=90)))
        assert source.poll().in_world(source.poll().head).pos[:2] == pytest.approx((1.0, 0.55), abs=1e-6)
    shown = [pictures for pictures in runtime.shown if pictures is not None]
    assert len(shown) == 4 and track.count == 1
    assert all(np.array_equal(shown[-1][eye], drawn[eye]) for eye in range(2))
    assert shown[-1][0].shape == (runtime.size[1], runtime.size[0], 3)
    left, right = (picture.astype(int) for picture in shown[-1])
    assert np.abs(left - right).mean() > 1  # from different places
    assert np.abs(shown[-1][0].astype(int) - shown[0][0]).mean() > 1  # looked around
    assert min(picture.std() for picture in (left, right)) > 5  # and there is something to see


def test_without_a_runtime_it_is_said_that_there_is_none(tmp_path):
    """In a process of its own, since the loader keeps the runtime that it found first."""
    code = "from ig2mj.vr.openxr.devices import Headset; Headset()"
    variables = {**os.environ, "XR_RUNTIME_JSON": str(tmp_path / "nothing.json")}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=variables)
    assert "MissingDependencyError: no OpenXR runtime is active here" in done.stderr


def test_the_extensions_of_the_tests_runtime_are_those_that_are_used():
    assert {HEADLESS, GAZE, EglGraphics.extension} < set(EXTENSIONS)
