"""Sensors of the native and of the Warp engine, from the same place: the same numbers but for edges and rounding."""

from __future__ import annotations

import dataclasses

import jax
import numpy as np
import pytest
from perceiving import Perceiving

import ig2mj
from ig2mj.agents.humanoid import Humanoid
from ig2mj.agents.turtlebot import TurtleBot
from ig2mj.process.opengl import GL_BACKENDS, probe_gl
from ig2mj.sensors.registry import SENSORS

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(all(probe_gl(b) for b in GL_BACKENDS), reason="no OpenGL draws on this machine"),
]

OPTIONS = {"width": 64, "height": 48, "scan_rays": 61, "lidar_columns": 20, "scan_angle": 360.0}


@pytest.fixture(scope="module")
def seen():
    """All sensors in birch, whose objects have textures and glass, with the head moved by the controller."""
    found = {}
    for engine in ("native", "warp"):
        world = Perceiving("birch", Humanoid(pos=(1.2, -1.2, 0.55), quat=(0.92388, 0, 0, 0.382683)), engine)
        suite = world.suite(*SENSORS, **OPTIONS)
        _, memory = world.read(suite)
        pos = np.array(world.state.eye_pos)
        pos[0] += (0.1, 0.0, 0.05)
        world.state = dataclasses.replace(world.state, eye_pos=pos)
        found[engine] = world.read(suite, memory)[0]
        found["spaces"] = suite.spaces
    return found


def apart(seen, name):
    return np.abs(seen["native"][name].astype(float) - seen["warp"][name].astype(float))


@pytest.mark.parametrize("name", SENSORS)
def test_names_shapes_types_and_ranges_are_the_same(seen, name):
    space = seen["spaces"][name]
    for engine in ("native", "warp"):
        array = seen[engine][name]
        assert array.shape == (1, *space.shape) and array.dtype == space.dtype
        assert space.low <= array.min() and array.max() <= space.high


@pytest.mark.parametrize(
    ("name", "close", "share"),
    [
        ("depth", 3e-3, 0.985),
        ("pc", 3e-3, 0.985),
        ("normal", 0.02, 0.93),
        ("optical_flow", 3e-3, 0.985),
        ("scene_flow", 3e-3, 0.985),
        ("seg", 0.5, 0.985),
        ("ins_seg", 0.5, 0.985),
        ("scan", 1e-3, 0.98),
        ("lidar", 5e-3, 0.99),
        ("occupancy_grid", 0.1, 0.99),
        ("bump", 0, 1),
        ("proprioception", 1e-3, 1),
        ("object_poses", 2e-2, 1),
        ("base_pose", 1e-3, 1),
        ("eye_pose", 1e-4, 1),
    ],
)
def test_readings_are_the_same_but_for_edges(seen, name, close, share):
    assert (apart(seen, name) <= close).mean() >= share


def colours(seen):
    """Mean colour on each engine of everything that covers 30 pixels or more, by its number."""
    instance = seen["native"]["ins_seg"][..., 0]
    same = instance == seen["warp"]["ins_seg"][..., 0]
    found = {}
    for number in np.unique(instance):
        pixels = same & (instance == number)
        if pixels.sum() >= 30:
            found[int(number)] = [seen[e]["rgb"][pixels].astype(float).mean(0) for e in ("native", "warp")]
    return found


def test_colours_of_objects_are_the_same(seen):
    """Textures, lights and glass."""
    for number, (native, warp) in colours(seen).items():
        np.testing.assert_allclose(native, warp, atol=8, err_msg=f"instance {number}")


def test_light_is_limited_before_a_texture_takes_its_share():
    """Where an activity's two lamps shine, textures would be 40 of 255 brighter than OpenGL's otherwise."""
    found = {}
    for engine in ("native", "warp"):
        env = ig2mj.make(
            "SlicingFruit", robot="fetch", worlds=1, engine=engine, pool_size=2, observations=("rgb", "ins_seg")
        )
        found[engine] = {name: np.asarray(value) for name, value in env.reset(0).obs.items()}
    pairs = colours(found)
    assert max(native.max() for native, _ in pairs.values()) > 200, "something is lit brightly"
    for number, (native, warp) in pairs.items():
        np.testing.assert_allclose(native, warp, atol=8, err_msg=f"instance {number}")


def test_textures_are_as_coarse_as_the_pixels(seen):
    """Colours pixel by pixel: with textures as they come (`texture_filter`) 6 % of them are more than 10 of 255 off."""
    same = (apart(seen, "ins_seg") == 0)[..., 0]
    assert (apart(seen, "rgb").max(-1)[same] > 10).mean() < 0.03


def test_a_bump_is_felt_and_the_same_readings_drop_out(tiny_home_folder):
    """The TurtleBot stands in a leg of the table; of each world and step the same three readings in ten are missing."""
    keys = np.asarray(jax.random.key_data(jax.random.split(jax.random.key(3), 1)), np.uint32)
    sizes, rates = {"width": 24, "height": 16, "scan_rays": 200}, {"depth_noise_rate": 0.3, "scan_noise_rate": 0.3}
    there, lost = {}, {}
    for engine in ("native", "warp"):
        world = Perceiving(tiny_home_folder, TurtleBot(pos=(0.35, -0.35, 0)), engine)
        clean = world.see("bump", "depth", "scan", **sizes)
        noisy = world.see("depth", "scan", **sizes, **rates, keys=keys)
        assert clean["bump"].tolist() == [[1.0]], engine
        there[engine] = {"depth": clean["depth"] > 0, "scan": clean["scan"] < 1}
        lost[engine] = {"depth": noisy["depth"] == 0, "scan": noisy["scan"] == 1}
    for name in ("depth", "scan"):
        both = there["native"][name] & there["warp"][name]
        assert both.sum() > 60, name
        np.testing.assert_array_equal(lost["native"][name][both], lost["warp"][name][both], err_msg=name)
        assert lost["native"][name][both].mean() == pytest.approx(0.3, abs=0.13), name


def test_drawn_lights_cameras_and_materials_look_alike():
    """By day, in a home with a lamp, whose light comes behind all others in the model; and with cameras that are drawn
    a few centimetres back, inside of the robot's head."""
    found = {}
    for engine in ("native", "warp"):
        env = ig2mj.make(
            "GraspingBook", robot="fetch", worlds=6, engine=engine, pool_size=2, observations=("rgb", "depth"),
            looks="day", randomize=("lights", "camera", "materials"),
        )  # fmt: skip
        found[engine] = {name: np.asarray(value).astype(float) for name, value in env.reset(0).obs.items()}
    dark, bright = sorted(found["native"]["rgb"].mean((1, 2, 3)))[::5]
    assert bright > dark + 20, "lights differ between worlds"
    for world in range(6):
        rgb, depth = (np.abs(found["native"][name][world] - found["warp"][name][world]) for name in ("rgb", "depth"))
        assert rgb.mean() < 6 and np.median(depth) < 3e-3, world
