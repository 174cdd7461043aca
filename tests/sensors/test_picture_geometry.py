"""Point clouds, normals and flow against the geometry that they follow from."""

from __future__ import annotations

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from perceiving import Perceiving

from ig2mj.agents.humanoid import Humanoid
from ig2mj.engine.base import Write
from ig2mj.process.opengl import GL_BACKENDS, probe_gl
from ig2mj.sensors.definitions.normals import camera_normals
from ig2mj.sensors.pinhole import normalized_coordinates, pixel_slopes

pytestmark = pytest.mark.skipif(all(probe_gl(b) for b in GL_BACKENDS), reason="no OpenGL draws on this machine")

SIZE = {"width": 40, "height": 30}


@pytest.fixture
def world(tiny_home_folder):
    return Perceiving(tiny_home_folder, Humanoid(pos=(0, -1.2, 0.55), quat=(0.7071, 0, 0, 0.7071)))


def test_points_appear_at_their_pixels_again(world):
    suite = world.suite("pc", "depth", **SIZE, depth_high=100.0)
    seen, _ = world.read(suite)
    points, depth = seen["pc"][0], seen["depth"][0, ..., 0]
    np.testing.assert_array_equal(-points[..., 2], depth)
    assert (points[depth == 0] == 0).all()
    there = depth > 0
    where = np.asarray(normalized_coordinates(suite._setup, jnp.asarray(points)))
    centres = pixel_slopes(suite._setup) / np.array(suite._setup.slopes)
    np.testing.assert_allclose(where[there], centres[there], atol=1e-5)
    assert centres[0, 0] == pytest.approx([-1 + 1 / 40, 1 - 1 / 30])


def test_points_lie_on_the_floor(world):
    seen = world.see("pc", "ins_seg", **SIZE)
    pos, axes = world.eye()
    floor = world.scene.tables.object_names.index("floor") + 1
    points = seen["pc"][0][seen["ins_seg"][0, ..., 0] == floor]
    assert len(points) > 20
    np.testing.assert_allclose((points @ axes.T + pos)[:, 2], 0.0, atol=2e-3)


def test_normals_are_unit_vectors_that_face_the_viewer(world):
    seen = world.see("normal", "pc", **SIZE)
    there = seen["pc"][0, ..., 2] < 0
    normal, points = 2 * seen["normal"][0] - 1, seen["pc"][0]
    np.testing.assert_allclose(np.linalg.norm(normal[there], axis=-1), 1.0, atol=1e-4)
    assert ((normal * points).sum(-1)[there] < 1e-3).mean() > 0.98
    assert (seen["normal"][0][~there] == 0).all()


def test_the_floor_s_normal_is_up(world):
    seen = world.see("normal", "ins_seg", **SIZE)
    _, axes = world.eye()
    floor = world.scene.tables.object_names.index("floor") + 1
    normal = (2 * seen["normal"][0] - 1)[seen["ins_seg"][0, ..., 0] == floor]
    right = (np.abs(normal @ axes.T - (0, 0, 1)) < 0.02).all(-1)
    assert right.mean() > 0.97, "all but pixels that stand alone between others"


@given(
    yaw=st.floats(-1.2, 1.2),
    pitch=st.floats(-1.2, 1.2),
    distance=st.floats(0.3, 8.0),
)
def test_the_normal_of_a_plane_is_exact_at_every_pixel(yaw, pitch, distance):
    """Also at the borders of the picture and where another geom covers a part."""
    slopes = slopes_of(16, 12)
    normal = np.array([np.sin(yaw) * np.cos(pitch), np.sin(pitch), np.cos(yaw) * np.cos(pitch)])
    rays = np.concatenate([slopes, -np.ones((12, 16, 1))], axis=-1)
    facing = -(rays @ normal)
    depth = np.where(facing > 0.05, distance / np.maximum(facing, 1e-9), 0.0)
    geom = np.where(depth > 0, 3, -1)
    depth[4:7, 5:9], geom[4:7, 5:9] = 0.1, 4
    found = np.asarray(camera_normals(slopes, depth[None].astype(np.float32), geom[None].astype(np.int32)))[0]
    count = sum(np.roll(geom == 3, s, a) & (geom == 3) for a, s in ((0, 1), (0, -1), (1, 1), (1, -1)))
    plane = (geom == 3) & (count >= 3)
    if plane.any():
        np.testing.assert_allclose(found[plane], np.tile(normal, (plane.sum(), 1)), atol=0.02)


def slopes_of(width, height):
    x, y = 0.8 * (2 * (np.arange(width) + 0.5) / width - 1), 0.6 * (1 - 2 * (np.arange(height) + 0.5) / height)
    return np.stack(np.broadcast_arrays(x[None], y[:, None]), axis=-1).astype(np.float32)


def test_flow_of_a_camera_that_moves_ahead_follows_from_depth(world):
    """10 cm ahead in a room at rest: points come 10 cm nearer, and away from the middle in proportion."""
    suite = world.suite("optical_flow", "scene_flow", "pc", "ins_seg", **SIZE)
    _, memory = world.read(suite)
    pos = np.array(world.state.eye_pos)
    pos[0, 0] += 0.1
    world.state = dataclasses.replace(world.state, eye_pos=pos)
    seen, memory = world.read(suite, memory)
    room = seen["ins_seg"][0, ..., 0] > 0  # its own hands stand still in the room, too
    np.testing.assert_allclose(seen["scene_flow"][0][room], np.tile([0, 0, 0.1], (room.sum(), 1)), atol=2e-5)
    points = seen["pc"][0]
    now = np.asarray(normalized_coordinates(suite._setup, jnp.asarray(points)))
    earlier = np.asarray(normalized_coordinates(suite._setup, jnp.asarray(points - np.array([0, 0, 0.1]))))
    np.testing.assert_allclose(seen["optical_flow"][0][room], (now - earlier)[room], atol=1e-4)
    still, _ = world.read(suite, memory)
    assert np.abs(still["optical_flow"]).max() < 1e-5, "nothing moved since"


def test_flow_of_an_object_that_moves_is_its_own(world):
    suite = world.suite("scene_flow", "ins_seg", width=96, height=72)
    _, memory = world.read(suite)
    sponge = world.scene.object_index("sponge")
    view = world.engine.view(world.physics)
    mask = np.zeros((1, world.scene.tables.num_objects), bool)
    mask[0, sponge] = True
    pos = np.array(view.object_pos)
    pos[0, sponge] = (-0.1, -0.2, 0.7)
    quat = np.array(view.object_quat)
    world.physics = world.engine.write(world.physics, Write(object_mask=mask, object_pos=pos, object_quat=quat))
    _, memory = world.read(suite, memory)
    pos = pos + np.array([0.03, 0.0, 0.0], np.float32)
    world.physics = world.engine.write(world.physics, Write(object_mask=mask, object_pos=pos, object_quat=quat))
    seen, _ = world.read(suite, memory)
    mine = seen["ins_seg"][0, ..., 0] == sponge + 1
    _, axes = world.eye()
    assert mine.any()
    moved = seen["scene_flow"][0][mine] @ axes.T
    np.testing.assert_allclose(moved, np.tile([0.03, 0, 0], (mine.sum(), 1)), atol=1e-4)
    assert np.abs(seen["scene_flow"][0][~mine]).max() < 1e-4
