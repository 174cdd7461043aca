"""What is drawn for images: colours, materials, lights, cameras and noise, within their settings."""

from __future__ import annotations

import types

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from ig2mj.scene.scene import load_scene
from ig2mj.sensors.base import Space
from ig2mj.sensors.noise import noisy
from ig2mj.sensors.render_model import CAMERA_LIGHT, SPARE_NAME, drawn_lights
from ig2mj.sensors.shading import FOV_PER_WORLD, lights_per_world, limit_light
from ig2mj.worlds.draw import SPARE_LIGHTS
from ig2mj.worlds.random_streams import episode_keys
from ig2mj.worlds.randomization import Randomization, kind_of_material, quat_of
from ig2mj.worlds.randomize import Lights, Materials, Randomize, SensorNoise

WORLDS = 64


@pytest.fixture(scope="module")
def scene():
    return load_scene("small_home")


@pytest.fixture(scope="module")
def keys():
    return episode_keys(0, np.arange(WORLDS), np.zeros(WORLDS, int))


def test_materials_are_exchanged_within_their_kind_and_colours_stay_in_range(scene, keys):
    model = scene.model
    fields = Randomization(Randomize(materials=Materials((0.5, 1.5), 1.0)), model, scene.tables).fields(keys)
    material = np.asarray(fields.geom_matid)
    kinds = np.array([kind_of_material(model.material(m).name) for m in range(model.nmat)] + [None])
    assert (kinds[material] == kinds[model.geom_matid]).all()
    unknown = kinds[model.geom_matid] == None  # noqa: E711 (of each)
    assert (material[:, unknown] == model.geom_matid[unknown]).all()
    assert (material != model.geom_matid).any()
    ratio = np.asarray(fields.geom_rgba)[..., :3] / np.maximum(model.geom_rgba[:, :3], 1e-6)
    shown = (model.geom_rgba[:, :3] > 0).all(1)
    assert ratio[:, shown].min() >= 0.5 - 1e-5 and ratio[:, shown].max() <= 1.5 + 1e-5
    np.testing.assert_array_equal(np.asarray(fields.geom_rgba)[..., 3], np.tile(model.geom_rgba[:, 3], (WORLDS, 1)))


def test_a_light_of_the_home_stays_on_and_spare_ones_are_on_in_some_worlds(scene, keys):
    lights = Lights(off=1.0, spare=0.5)
    draw = Randomization(Randomize(lights=lights), scene.model, scene.tables).draw(keys)
    on = (np.asarray(draw.light_colour) > 0).all(2)
    own = scene.model.nlight
    assert on.shape == (WORLDS, 1 + own + SPARE_LIGHTS) and on[:, 0].all()
    assert on[:, 1:].any(1).all(), "a world without any light but that at the camera"
    assert 0.2 < on[:, 1 + own :].mean() < 0.8
    np.testing.assert_allclose(np.linalg.norm(draw.light_quat, axis=-1), 1.0, atol=1e-5)


@pytest.mark.slow
def test_a_world_draws_the_same_in_a_batch_of_any_size(scene, keys):
    drawn = Randomization(Randomize.every(), scene.model, scene.tables)
    whole, alone = drawn.draw(keys), drawn.draw(keys[5:6])
    for one, other in zip(jax.tree.leaves(whole), jax.tree.leaves(alone), strict=True):
        np.testing.assert_array_equal(np.asarray(one)[5:6], np.asarray(other))


def test_noise_grows_with_the_strength_of_the_episode_and_differs_between_steps(keys):
    image = np.full((WORLDS, 8, 8, 3), 128, np.uint8)
    spaces = {"rgb": Space((8, 8, 3), np.uint8, 0.0, 255.0), "scan": Space((4,), np.float32, 0.0, 1.0)}
    readings = {"rgb": jnp.asarray(image), "scan": jnp.ones((WORLDS, 4))}
    strength = jnp.linspace(0.0, 1.0, WORLDS)
    found = noisy(readings, spaces, SensorNoise(rgb=0.1), strength, keys)
    spread = np.asarray(found["rgb"], float).std((1, 2, 3))
    assert spread[0] == 0 and spread[-1] == pytest.approx(25.5, rel=0.25)
    np.testing.assert_array_equal(found["scan"], readings["scan"])
    later = noisy(readings, spaces, SensorNoise(rgb=0.1), strength, keys + 1)
    assert (np.asarray(later["rgb"])[-1] != np.asarray(found["rgb"])[-1]).any()


def test_small_turns_are_quaternions_of_their_vector():
    np.testing.assert_allclose(quat_of(jnp.zeros(3)), [1, 0, 0, 0])
    half = np.pi / 4
    np.testing.assert_allclose(quat_of(jnp.array([0, 0, np.pi / 2])), [np.cos(half), 0, 0, np.sin(half)], atol=1e-6)


def test_the_kernel_takes_what_differs_between_worlds(monkeypatch):
    """Every line that is changed for it is in MuJoCo Warp's kernel exactly once."""
    made = []
    monkeypatch.setattr("ig2mj.sensors.shading.defined", lambda name, text, globals: lambda *_: made.append(text))
    limit_light(types.SimpleNamespace(), 3, changes=(*lights_per_world(2), *FOV_PER_WORLD))
    assert made[0].count("light_diffuse.shape[0], 2]") == 3 and "wide * ray_dir_local_cam[0]" in made[0]


def test_each_light_of_an_image_follows_its_own_draw():
    """MuJoCo orders lights by body: those that are added to the world come before a lamp's, and behind the world's."""
    scene = mujoco.MjSpec()
    lamp = scene.worldbody.add_body(name="lamp")
    lamp.add_light(name="bulb")
    scene.worldbody.add_light(name="sun")
    model = scene.compile()
    assert [model.light(k).name for k in range(2)] == ["sun", "bulb"]
    for name in ("fill", *(SPARE_NAME.format(k) for k in range(SPARE_LIGHTS)), CAMERA_LIGHT):
        scene.worldbody.add_light(name=name)
    scene.body("lamp").add_light(name="glow")
    host = scene.compile()
    found = dict(zip((host.light(k).name for k in range(host.nlight)), drawn_lights(host, model), strict=True))
    spares = {SPARE_NAME.format(k): 3 + k for k in range(SPARE_LIGHTS)}
    assert found == {"sun": 1, "bulb": 2, "fill": 1, "glow": 1, CAMERA_LIGHT: 0, **spares}
    assert set(drawn_lights(host, mujoco.MjSpec().compile())) == {0, *(1 + k for k in range(SPARE_LIGHTS))}
