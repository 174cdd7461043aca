"""The interactive viewer's overlays and keys, without a window."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
import pytest
from fake_window import FakeHandle

import ig2mj
from ig2mj.errors import MissingDependencyError
from ig2mj.scene.rooms import Rooms
from ig2mj.viewer import interactive
from ig2mj.viewer.interactive import ViewerState, open_viewer
from ig2mj.viewer.label_space import Sight, uncovered
from ig2mj.viewer.mouse import MAX_FORCE, Mouse
from ig2mj.viewer.overlays import Clock, Label, ObjectNames, Overlay, RoomNames, default_overlays
from ig2mj.viewer.overview import home_overview

SPACE, SLASH, ENTER, BACKSPACE, RIGHT = 32, 47, 257, 259, 262


@pytest.fixture
def data(tiny_home) -> mujoco.MjData:
    fresh = mujoco.MjData(tiny_home.model)
    if tiny_home.model.nkey:
        mujoco.mj_resetDataKeyframe(tiny_home.model, fresh, 0)
    mujoco.mj_forward(tiny_home.model, fresh)
    return fresh


def test_every_object_in_use_is_named_once_and_building_parts_are_not(tiny_home, data):
    names = [label.text for label in ObjectNames(tiny_home).labels(data)]
    expected = [
        o.name for o in tiny_home.manifest.objects if not o.parked and o.category not in ("walls", "floors", "ceilings")
    ]
    assert names == expected
    assert "apple" in names
    assert "apple_half_0" not in names


def test_a_name_hangs_above_its_object_and_goes_along_with_it(tiny_home, data):
    overlay = ObjectNames(tiny_home)
    index = [label.text for label in overlay.labels(data)].index("apple")
    before = np.array(overlay.labels(data)[index].pos)
    joint = tiny_home.model.joint("apple/free")
    data.qpos[joint.qposadr[0] : joint.qposadr[0] + 3] += (0.1, 0.2, 0.3)
    mujoco.mj_kinematics(tiny_home.model, data)
    after = np.array(overlay.labels(data)[index].pos)
    np.testing.assert_allclose(after - before, (0.1, 0.2, 0.3), atol=1e-6)
    assert after[2] > data.body("apple").xpos[2]


def test_rooms_are_named_inside_themselves_row_is_y_and_column_is_x(tiny_home, data):
    room_map = np.zeros((40, 40), dtype=np.int16)
    room_map[30:38, 2:10] = 1  # y in [1.0, 1.8], x in [-1.8, -1.0]
    room_map[0:20, 20:40] = 2
    room_map[0:18, 20:38] = 0  # what is left is an L: its mean lies outside it
    rooms = Rooms(("kitchen_0", "bedroom_0", "gone_0"), ("kitchen", "bedroom", "gone"), room_map, 0.1)
    labels = RoomNames(dataclasses.replace(tiny_home, rooms=rooms)).labels(data)
    assert [label.text for label in labels] == ["kitchen_0", "bedroom_0"]
    assert labels[0].pos[:2] == pytest.approx((-1.4, 1.4), abs=0.06)
    column, row = (int(np.floor(v / 0.1 + 20)) for v in labels[1].pos[:2])
    assert room_map[row, column] == 2


def test_a_scene_without_room_maps_has_no_room_labels(tiny_home, data):
    assert RoomNames(dataclasses.replace(tiny_home, rooms=None)).labels(data) == []


def test_the_clock_tells_time_and_what_is_awake(tiny_home, data):
    lines = dict(Clock(tiny_home).lines(data))
    assert lines["time"] == "0.0 s"
    assert lines["awake"].endswith(f"of {tiny_home.model.ntree}")


def test_default_overlays_fulfil_the_protocol(tiny_home):
    overlays = default_overlays(tiny_home)
    assert len(overlays) <= len(interactive.OVERLAY_KEYS)
    assert all(isinstance(o, Overlay) for o in overlays)


def test_keys_pause_step_reset_help_and_switch_overlays(tiny_home):
    state = ViewerState(default_overlays(tiny_home))
    assert state.wants_step()
    state.press(RIGHT)  # not paused: nothing
    state.press(SPACE)
    assert not state.wants_step()
    state.press(RIGHT)
    assert state.wants_step()
    assert not state.wants_step()
    state.press(SPACE)
    assert state.wants_step()
    state.press(BACKSPACE)
    assert state.reset
    state.press(ord("7"))
    assert state.shown == [True, False, True]
    state.press(ord("9"))  # no fourth overlay
    state.press(ord("H"))  # MuJoCo's
    assert state.shown == [True, False, True]
    for key in (ENTER, SLASH):
        before = state.help
        state.press(key)
        assert state.help is not before


def test_the_help_lists_a_key_for_every_overlay(tiny_home, data):
    state = ViewerState(default_overlays(tiny_home))
    state.press(ENTER)
    (_, _, keys, what) = state.texts(data)[1]
    assert "object names on, off" in what
    assert {"6", "7", "8", "Space", "Enter or ?"} <= set(keys.splitlines())


def test_an_overlay_of_ones_own_is_drawn_and_can_be_switched_off(tiny_home, data):
    class States:
        title = "states"

        def labels(self, data):
            return [Label((0.0, 0.0, 1.0), "cooked" * 40)]

        def lines(self, data):
            return [("goal", "3 of 4")]

    scene = mujoco.MjvScene(tiny_home.model, maxgeom=50)
    state = ViewerState([ObjectNames(tiny_home), States()])
    state.draw_labels(data, scene)
    drawn = [scene.geoms[i].label for i in range(scene.ngeom)]
    assert "apple" in drawn
    assert drawn[-1].startswith("cooked")
    assert scene.geoms[0].type == mujoco.mjtGeom.mjGEOM_LABEL
    assert state.texts(data)[0][2:] == ("goal", "3 of 4")
    state.press(ord("7"))
    state.draw_labels(data, scene)
    assert scene.ngeom == len(drawn) - 1
    assert state.texts(data)[0][2:] == ("", "")


def test_labels_beyond_the_scenes_capacity_are_left_out(tiny_home, data):
    scene = mujoco.MjvScene(tiny_home.model, maxgeom=3)
    ViewerState([ObjectNames(tiny_home)]).draw_labels(data, scene)
    assert scene.ngeom == 3


def test_without_a_display_the_error_tells_how_to_get_a_picture(tiny_home, data, monkeypatch):
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(MissingDependencyError, match="--image"):
        open_viewer(tiny_home, data, lambda: None)


def test_the_overview_leaves_out_what_is_parked(tiny_home, data):
    view = home_overview(tiny_home, data)
    floor = np.array(tiny_home.object("floor").bounding_box)
    assert np.hypot(*view.lookat[:2]) < 0.2 * floor[0]
    assert view.distance < 3 * np.linalg.norm(floor)
    parked = [data.body(o.bodies[0]).xpos for o in tiny_home.manifest.objects if o.parked]
    assert all(np.linalg.norm(p - view.lookat) > view.distance for p in parked)


class CopyingWorld:
    """A world whose data is a new copy after every step, as that of a batched engine is."""

    def __init__(self, scene):
        self.scene, self.data, self.steps = scene, mujoco.MjData(scene.model), 0

    def step(self) -> None:
        self.steps += 1
        self.data = mujoco.MjData(self.scene.model)
        self.data.time = self.steps / 30

    def reset(self) -> None:
        self.steps = 0
        self.data = mujoco.MjData(self.scene.model)


def test_the_window_shows_every_step_also_of_a_world_that_hands_out_copies(tiny_home, monkeypatch):
    handle = FakeHandle(tiny_home.model, pictures=3)
    shown, pressed = [], []

    def launch_window(model, data, key_callback, panels):
        assert panels
        shown.append(data)
        key_callback(ord("6"))
        return handle

    monkeypatch.setattr(interactive, "launch_window", launch_window)
    world = CopyingWorld(tiny_home)
    interactive.launch(world, step_time=0.001, key_callback=pressed.append)
    assert (world.steps, handle.synced) == (3, 1 + 3)
    assert shown[0].time == pytest.approx(3 / 30)
    assert pressed == [ord("6")]
    names = {handle.user_scn.geoms[i].label for i in range(handle.user_scn.ngeom)}
    assert "apple" not in names  # key 6 switched the names off
    assert dict(zip(*(t.splitlines() for t in handle.texts[-1][0][2:]), strict=True))["time"] == "0.1 s"


@pytest.mark.slow
def test_a_window_shows_the_steps_of_a_program_until_it_is_closed(tiny_home, monkeypatch):
    handle, keys = FakeHandle(tiny_home.model, pictures=6), []
    monkeypatch.setattr(interactive, "launch_window", lambda model, data, press, panels: keys.append(press) or handle)
    world = ig2mj.Simulation(tiny_home, states=None)
    with world.viewer(step_time=0.001):
        world.step(count=2)
        assert handle.synced == 1 + 2, "each control step is drawn"
        keys[0](32)  # Space: paused, until Space again
        keys[0](32)
        world.step(count=20)
    assert world.time == pytest.approx(22 / 30), "a closed window does not hold the program up"
    synced = handle.synced
    world.step()
    assert handle.synced == synced


def test_the_mouse_pushes_the_held_body_and_lets_it_go(tiny_home, data):
    perturb = mujoco.MjvPerturb()
    body = tiny_home.model.body("apple").id
    perturb.select, perturb.active = body, mujoco.mjtPertBit.mjPERT_TRANSLATE
    option, camera = mujoco.MjvOption(), mujoco.MjvCamera()
    scene = mujoco.MjvScene(tiny_home.model, maxgeom=500)
    mujoco.mjv_updateScene(tiny_home.model, data, option, None, camera, mujoco.mjtCatBit.mjCAT_ALL.value, scene)
    mujoco.mjv_initPerturb(tiny_home.model, data, scene, perturb)
    mouse, sight = Mouse(), np.array([1.0, 0.0, 0.0])
    perturb.refselpos[2] += 0.5
    mouse.apply(tiny_home.model, data, perturb, sight)
    assert 0 < data.xfrc_applied[body, 2] <= MAX_FORCE
    perturb.active = 0
    mouse.apply(tiny_home.model, data, perturb, sight)
    assert not data.xfrc_applied.any()
    mouse.push(1 / 30)
    pushed = []
    for _ in range(5):
        mouse.apply(tiny_home.model, data, perturb, sight)
        pushed.append(float(data.xfrc_applied[body, 0]))
    assert pushed == [MAX_FORCE] * 3 + [0.0] * 2, "a tenth of a second"


def test_before_anything_slow_the_window_says_what_is_prepared(tiny_home, monkeypatch):
    handle = FakeHandle(tiny_home.model, pictures=1)
    monkeypatch.setattr(interactive, "launch_window", lambda *_: handle)
    world, shown = CopyingWorld(tiny_home), []
    prepare = lambda: shown.append((handle.synced, handle.texts[-1][0][2:]))  # noqa: E731
    interactive.launch(world, step_time=0.001, prepare=prepare)
    assert shown == [(1, interactive.PREPARING)]
    assert handle.texts[-1][0][2] != "preparing"  # then the clock stands there


def test_a_simulation_prepares_without_changing_anything(tiny_home):
    world = ig2mj.Simulation(tiny_home)
    before, view = world.states, world.view
    world.prepare()
    assert world.time == 0.0 and world.states is before and world.view is view


WINDOW = Sight(np.zeros(3), np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]), np.pi / 2, (800, 600))
"""At the origin, looking along +x."""


def test_labels_that_would_cover_a_nearer_one_give_way():
    near, hidden, beside = (
        Label((2.0, 0.0, 0.0), "near"),
        Label((4.0, 0.0, 0.01), "far"),
        Label((4.0, 2.0, 0.0), "left"),
    )
    behind = Label((-1.0, 0.0, 0.0), "behind")
    assert uncovered([hidden, behind, beside, near], WINDOW) == [beside, near]
    assert uncovered([hidden, beside], WINDOW) == [hidden, beside]
    assert uncovered([], WINDOW) == []


def test_the_free_camera_of_the_window_is_where_mujoco_has_it(tiny_home, data):
    handle = FakeHandle(tiny_home.model, 0)
    handle.cam.lookat[:], handle.cam.distance = (0.3, -0.2, 0.5), 3.0
    handle.cam.azimuth, handle.cam.elevation = 70.0, -25.0
    sight = Sight.of_window(handle, tiny_home.model.vis.global_.fovy)
    scene, option = mujoco.MjvScene(tiny_home.model, maxgeom=500), mujoco.MjvOption()
    mujoco.mjv_updateScene(tiny_home.model, data, option, None, handle.cam, mujoco.mjtCatBit.mjCAT_ALL.value, scene)
    theirs = scene.camera[0]
    middle = (np.array(theirs.pos) + np.array(scene.camera[1].pos)) / 2  # of the two eyes
    np.testing.assert_allclose(sight.eye, middle, atol=1e-5)
    np.testing.assert_allclose(sight.axes[1:], [theirs.up, theirs.forward], atol=1e-5)
    at, depth = sight.pixels(np.array([handle.cam.lookat]))
    np.testing.assert_allclose(at[0], (400, 300), atol=1e-6)
    assert depth[0] == pytest.approx(3.0)
    handle.cam.type = mujoco.mjtCamera.mjCAMERA_FIXED
    assert Sight.of_window(handle, 45.0) is None
