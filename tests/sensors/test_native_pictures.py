"""Native pictures: what each pixel shows is what MuJoCo's own rays hit, and states are seen."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
import pytest
from perceiving import Perceiving

from ig2mj.agents.humanoid import Humanoid
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.process.opengl import GL_BACKENDS, probe_gl
from ig2mj.scene.geom_groups import VISIBLE_GROUPS
from ig2mj.sensors.gl_canvas import Canvas
from ig2mj.sensors.labels import SLOTS, class_names, class_of_category
from ig2mj.sensors.native_camera import NativeCamera
from ig2mj.states import particles

pytestmark = pytest.mark.skipif(all(probe_gl(b) for b in GL_BACKENDS), reason="no OpenGL draws on this machine")

SIZE = {"width": 32, "height": 24}
GROUPS = np.array([g in VISIBLE_GROUPS for g in range(6)], np.uint8)


@pytest.fixture
def world(tiny_home_folder):
    return Perceiving(tiny_home_folder, Humanoid(pos=(0, -1.2, 0.55), quat=(0.7071, 0, 0, 0.7071)), worlds=2)


def hits(world, slopes):
    """(depth, geom) of MuJoCo's rays through the pixels' centres, from the eye of world 0."""
    model, data = world.engine.to_mujoco(world.physics, 0)
    pos, axes = world.eye()
    depth, geom = np.zeros(slopes.shape[:2]), np.full(slopes.shape[:2], -1)
    for row, column in np.ndindex(depth.shape):
        direction = np.array([*slopes[row, column], -1.0])
        length, found = np.linalg.norm(direction), np.zeros(1, np.int32)
        far = mujoco.mj_ray(model, data, pos, axes @ direction / length, GROUPS, 1, -1, found)
        if far >= 0:
            depth[row, column], geom[row, column] = far / length, found[0]
    return depth, geom


def test_depth_and_instances_are_those_of_mujocos_rays(world):
    from ig2mj.sensors.pinhole import pixel_slopes

    suite = world.suite("depth", "ins_seg", "seg", **SIZE)
    seen, _ = world.read(suite)
    depth, geom = hits(world, pixel_slopes(suite._setup).astype(float))
    owner = np.append(world.scene.tables.geom_object, -1)
    agent = np.append(world.scene.tables.body_agent[world.scene.model.geom_bodyid], -1)
    expected = np.where(agent[geom] >= 0, world.scene.tables.num_objects + 1, owner[geom] + 1)
    assert (np.abs(seen["depth"][0, ..., 0] - depth) < 2e-3).mean() > 0.97, "all but edges"
    assert (seen["ins_seg"][0, ..., 0] == expected).mean() > 0.97
    names = class_names()
    for number in np.unique(seen["ins_seg"][0]):
        category = {0: "nothing", world.scene.tables.num_objects + 1: "robot"}.get(int(number))
        category = category or world.scene.tables.object_categories[number - 1]
        classes = np.unique(seen["seg"][0][seen["ins_seg"][0] == number])
        assert [names[int(c)] for c in classes] == [category if category in names.values() else "other"]


def test_only_worlds_that_matter_are_drawn(world):
    """After a reset of some worlds, those that go on keep their pictures."""
    suite = world.suite("rgb", "depth", **SIZE)
    given = world.physics, world.engine.view(world.physics), world.states, world.state
    whole, _ = suite.look_fn(*given)
    half, _ = suite.look_fn(*given, rendered=np.array([False, True]))
    for name in ("rgb", "depth"):
        assert np.asarray(whole[name][0]).any() and not np.asarray(half[name][0]).any()
        np.testing.assert_array_equal(half[name][1], whole[name][1])


def test_rows_that_nobody_looks_at_show_nothing(world):
    names = ("rgb", "depth", "ins_seg")
    whole, part = world.see(*names, **SIZE), world.see(*names, **SIZE, rows=(6, 20))
    for name in names:
        assert whole[name][:, 20:].any()
        np.testing.assert_array_equal(part[name][:, 6:20], whole[name][:, 6:20])
        assert not part[name][:, :6].any() and not part[name][:, 20:].any()
    with pytest.raises(EngineError, match="are empty for images of 24 rows"):
        world.see("rgb", **SIZE, rows=(10, 25))


def test_hands_before_the_eye_are_not_cut_off(world):
    """MuJoCo's near plane grows with the scene; the sensors' is at 1 cm."""
    seen = world.see("ins_seg", "depth", **SIZE)
    hands = seen["ins_seg"][0] == world.scene.tables.num_objects + 1
    assert hands.any() and 0.1 < seen["depth"][0][hands].min() < 0.6


def test_the_eye_is_where_the_controller_says(world):
    """The humanoid's eye is no body: it moves in the controller's state alone, in world 1 only."""
    before = world.see("depth", **SIZE)["depth"]
    pos = np.array(world.state.eye_pos)
    pos[1, 0] += 0.2
    world.state = dataclasses.replace(world.state, eye_pos=pos)
    after = world.see("depth", **SIZE)["depth"]
    np.testing.assert_array_equal(before[0], after[0])
    middle = (SIZE["height"] // 2, SIZE["width"] // 2)
    assert before[1][middle] - after[1][middle] == pytest.approx(0.2, abs=2e-3)


def test_depths_out_of_range_read_nothing(world):
    seen = world.see("depth", "pc", **SIZE, depth_low=1.0, depth_high=2.0)
    everything = -seen["pc"][0, ..., 2]
    depth = seen["depth"][0, ..., 0]
    assert ((everything > 0) & (everything < 1)).any() and (everything > 2).any()
    np.testing.assert_array_equal(depth, np.where((everything >= 1) & (everything <= 2), everything, 0))


def test_a_stove_that_is_on_is_brighter_in_its_world_only(world):
    """iGibson's looks of states. Afterwards pictures are as before."""
    stove, plain = world.scene.object_index("stove"), world.states
    suite = world.suite("rgb", "ins_seg", **SIZE)
    before, _ = world.read(suite)
    world.states = dataclasses.replace(plain, toggled_on=plain.toggled_on.at[1, stove].set(True))
    after, _ = world.read(suite)
    np.testing.assert_array_equal(before["rgb"][0], after["rgb"][0])
    changed = (before["rgb"][1] != after["rgb"][1]).any(-1)
    assert changed.any() and (before["ins_seg"][1, ..., 0][changed] == stove + 1).all()
    assert (after["rgb"][1][changed] >= before["rgb"][1][changed]).all()
    world.states = plain
    np.testing.assert_array_equal(world.read(suite)[0]["rgb"], before["rgb"])


def test_dust_is_of_its_class_and_of_the_instance_it_lies_on(world):
    rows = world.model.parameters.dust_rows.tolist()
    table = world.scene.object_index("table")
    x = np.linspace(-0.35, 0.35, 20)
    pos = np.stack([x, np.full(20, -0.28), np.full(20, 0.5)], -1)[None].astype(np.float32)
    body = np.full((1, 20), world.scene.model.body("table").id, np.int32)
    normal = np.tile(np.array([0, 0, 1], np.float32), (1, 20, 1))
    dust, _ = particles.place(
        world.states.dust, rows.index(table), body, pos, normal, np.ones((1, 20), bool), 20, np.array([True, False])
    )
    world.states = dataclasses.replace(world.states, dust=dust)
    seen = world.see("seg", "ins_seg", width=256, height=256)
    dirty = seen["seg"] == SLOTS[0]
    assert dirty[0].any() and not dirty[1].any()
    assert (seen["ins_seg"][dirty] == table + 1).all()


@pytest.mark.parametrize("yaw", [0.0, 1.0, 2.0, 3.0, 4.0, 5.0])
def test_leaving_out_what_is_out_of_view_changes_no_pixel(tiny_home_folder, yaw, monkeypatch):
    robot = Humanoid(pos=(0.6, -0.6, 0.55), quat=(np.cos(yaw / 2), 0, 0, np.sin(yaw / 2)))
    world = Perceiving(tiny_home_folder, robot)
    suite = world.suite("rgb", "depth", "ins_seg", width=48, height=24)
    visible = []
    original = NativeCamera._in_view
    with monkeypatch.context() as patch:
        patch.setattr(NativeCamera, "_in_view", lambda *a: visible.append(original(*a)) or visible[-1])
        culled, _ = world.read(suite)
    assert visible[0].any() and not visible[0].all()
    monkeypatch.setattr(NativeCamera, "_in_view", lambda self, *_: np.ones(self._drawn.ngeom, bool))
    whole, _ = world.read(suite)
    for name, image in whole.items():
        np.testing.assert_array_equal(culled[name], image)


def test_classes_are_the_same_in_every_home():
    known = class_of_category()
    assert sorted(known, key=known.__getitem__) == sorted(known)
    assert min(known.values()) == 4 and max(known.values()) < SLOTS[0]


def test_mistakes_are_typed(world):
    with pytest.raises(UnknownNameError, match="no camera is named 'humanoid/ey'"):
        NativeCamera(world.engine, world.model, ["humanoid/ey"])
    with pytest.raises(EngineError, match="a camera must have pixels"):
        NativeCamera(world.engine, world.model, [])


def test_images_that_opengl_cannot_hold_are_refused_with_their_size(world):
    with pytest.raises(EngineError, match="cannot render images of 60000x60000 pixels"):
        Canvas(world.engine.scene.model.__copy__(), 60000, 60000, GROUPS, (), np.zeros(0, int))
