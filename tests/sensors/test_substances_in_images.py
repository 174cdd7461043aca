"""Robots' cameras show contents, streams and spots at the right place, the same on both renderers."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hand_world import HandWorld, Item
from substance_world import GLASS, JUG, SUBSTANCES, tilted, world

from benchmarks.harness.pouring import GLASS as POURED_GLASS
from benchmarks.harness.pouring import JUG as POURED_JUG
from benchmarks.harness.pouring import WALL, write_pouring
from ig2mj.engine import make_engine
from ig2mj.scene.scene import load_scene
from ig2mj.sensors.batch_camera import BatchCamera
from ig2mj.sensors.content_levels import levels
from ig2mj.sensors.native_camera import NativeCamera
from ig2mj.sensors.particle_slots import fill_slots, slot_kinds
from ig2mj.sensors.slots import SUBSTANCE
from ig2mj.sensors.substance_slots import PIECES, PUFFS
from ig2mj.states import initial_states
from ig2mj.states.substances import coat, volume
from ig2mj.worlds import Rules

HOME = world()
MODEL, VIEW = HOME.model(), HOME.view()
ABOVE = 0.4
"""m over the floor: the camera, over the glass."""

SIDE = 64
"""Pixels."""


def _holding(model, home, **litres: float):
    states = initial_states(model, 1)
    for name, value in litres.items():
        states = volume.set_volume(model, states, home.index[name], "water", value)
    return states


# Where shapes are.


@pytest.mark.parametrize("degrees", [0, 30, 60])
def test_the_share_below_a_level_is_the_share_that_is_full(degrees):
    view = HOME.view(quat={"jug": tilted(degrees)})
    points = MODEL.substances.containers.filling[0]
    turned = points @ np.array([-np.sin(np.deg2rad(degrees)), 0, np.cos(np.deg2rad(degrees))])
    before = -np.inf
    for share in (0.1, 0.3, 0.5, 0.8, 0.95):
        found = levels(MODEL, _holding(MODEL, HOME, jug=2 * share), view)
        height = float(found.pos[0, 0, 2]) - 0.5
        assert np.mean(turned < height) == pytest.approx(share, abs=0.06)
        assert height > before
        before = height


def test_a_level_is_horizontal_however_its_container_is_turned():
    rng = np.random.default_rng(0)
    for _ in range(20):
        quat = rng.normal(size=4)
        view = HOME.view(quat={"jug": tuple(quat / np.linalg.norm(quat))})
        axes = np.asarray(levels(MODEL, _holding(MODEL, HOME, jug=1.0), view).axes)[0, 0]
        assert axes[:, 2] == pytest.approx([0, 0, 1], abs=1e-5)
        assert axes.T @ axes == pytest.approx(np.eye(3), abs=1e-5) and np.linalg.det(axes) > 0


@pytest.mark.slow
def test_spots_are_the_points_that_are_covered():
    states = coat.set_covered(MODEL, initial_states(MODEL, 1), HOME.index["sponge"], "mud", True)
    row = MODEL.substances.row[HOME.index["sponge"]]
    bits = np.array(states.coat)
    bits[0, row, SUBSTANCES.index("mud")] = 0b10000000000000000101
    slots = fill_slots(MODEL, dataclasses.replace(states, coat=bits), VIEW, 8)
    shown = np.flatnonzero(np.asarray(slots.kind)[0] == SUBSTANCE)
    expected = np.asarray(coat.positions(MODEL, VIEW))[0, row, [0, 2, 19]]
    assert np.asarray(slots.pos)[0, shown] == pytest.approx(expected, abs=1e-6)
    assert set(np.asarray(slots.owner)[0, shown]) == {HOME.index["sponge"]}


@pytest.mark.slow
def test_more_spots_than_slots_fill_all_slots():
    states = coat.set_covered(MODEL, initial_states(MODEL, 1), HOME.index["sponge"], "mud", True)
    states = coat.set_covered(MODEL, states, HOME.index["floor"], "olive_oil", True)
    slots = fill_slots(MODEL, states, VIEW, 30)
    assert (np.asarray(slots.kind)[0] == SUBSTANCE).sum() == 30
    assert len(np.unique(np.asarray(slots.pos)[0, -30:], axis=0)) == 30


@pytest.mark.slow
def test_a_stream_ends_in_the_glass():
    view = HOME.view(quat={"jug": tilted(110)})
    slots = fill_slots(MODEL, _holding(MODEL, HOME, jug=1.0), view, 4)
    shown = np.flatnonzero(np.asarray(slots.kind)[0] == SUBSTANCE)[1:]  # the first is what is left in the jug
    assert len(shown) == PIECES
    pos, size = np.asarray(slots.pos)[0, shown], np.asarray(slots.size)[0, shown]
    glass = np.array(HOME.things[HOME.index["glass"]].pos)
    assert np.all(np.diff(pos[:, 2]) < 0) and np.abs(pos[-1, :2] - glass[:2]).max() < GLASS[0]
    assert pos[-1, 2] - size[-1, 2] < glass[2] + GLASS[2] < pos[0, 2] < 0.5 + JUG[2]


@pytest.mark.parametrize(("celsius", "litres", "puffs"), [(70.0, 0.3, PUFFS), (50.0, 0.3, 0), (70.0, 0.0, 0)])
def test_steam_rises_from_hot_water_only(celsius, litres, puffs):
    states = _holding(MODEL, HOME, glass=litres)
    glass = HOME.index["glass"]
    states = dataclasses.replace(states, temperature=np.asarray(states.temperature).copy())
    states.temperature[0, glass] = celsius
    slots = fill_slots(MODEL, states, VIEW, 4)
    shown = np.flatnonzero(np.asarray(slots.kind)[0] == SUBSTANCE)[int(litres > 0) :]  # the first is the level
    assert len(shown) == puffs
    pos, top = np.asarray(slots.pos)[0, shown], np.add(HOME.things[glass].pos, (0, 0, GLASS[2]))
    assert (pos[:, 2] > top[2]).all() and (np.diff(pos[:, 2]) > 0).all()
    assert np.abs(pos[:, :2] - top[:2]).max(initial=0.0) < GLASS[0]


def test_scenes_without_substances_have_particles_only():
    plain = HandWorld(Item("box"))
    assert len(slot_kinds(plain.model(), 16)) == 16 and slot_kinds(MODEL, 0) == ()
    assert fill_slots(plain.model(), initial_states(plain.model(), 1), plain.view(), 16).pos.shape == (1, 16, 3)


# Images.


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = write_pouring(tmp_path_factory.mktemp("pour") / "pouring", degrees=0.0)
    text = (made / "scene.xml").read_text()
    camera = f'<camera name="above" pos="0.15 0 {ABOVE}" fovy="40"/>'
    light = '<light type="directional" dir="0 0 -1" diffuse="0.5 0.5 0.5" specular="0 0 0"/>'
    head = '<visual><headlight diffuse="0 0 0" specular="0 0 0" ambient="0.3 0.3 0.3"/></visual>'
    text = text.replace("<worldbody>", f"{head}<worldbody>{camera}{light}", 1).replace('group="3"', "")
    (made / "scene.xml").write_text(text)
    return made


def _images(folder, name: str, litres: float, celsius: float = 23.0):
    scene = load_scene(folder)
    rules = Rules.of_scene(scene)
    engine = make_engine(name, scene, 1)
    physics = engine.reset()
    states = volume.set_volume(rules.model, rules.initial, scene.object_index("glass"), "water", litres)
    heat = np.full(np.shape(states.temperature), celsius, np.float32)
    states = dataclasses.replace(states, temperature=heat)
    kind = NativeCamera if name == "native" else BatchCamera
    camera = kind(engine, rules.model, ["above"], width=SIDE, height=SIDE, depth=True, segmentation=True, particles=4)
    call = camera if name == "native" else jax.jit(camera)
    states = jax.tree.map(jnp.asarray, states)
    return jax.tree.map(np.asarray, call(physics, engine.view(physics), states))


@pytest.mark.slow
def test_images_of_both_renderers_show_the_level_of_a_glass(folder):
    """The level is where the glass is full to, in the depths; colours differ by less than a fiftieth."""
    bottom, height = 2 * WALL, 2 * POURED_GLASS[2]
    middle = (SIDE // 2, SIDE // 2)
    found = {name: [_images(folder, name, litres) for litres in (0.06, 0.24)] for name in ("native", "warp")}
    for images in found.values():
        for one, share in zip(images, (0.2, 0.8), strict=True):
            level = ABOVE - one.depth[0, 0][middle]
            assert level == pytest.approx(bottom + share * height, abs=0.004)
            assert one.segmentation[0, 0][middle] == 2  # the glass
        red, green, blue = images[1].rgb[0, 0][middle].astype(int)
        assert blue > green > red
    for native, warp in zip(found["native"], found["warp"], strict=True):
        assert np.abs(native.rgb.astype(int) - warp.rgb.astype(int)).mean() < 5.0
        assert np.abs(native.depth - warp.depth).mean() < 2e-3
    assert np.abs(found["warp"][0].rgb.astype(int) - found["warp"][1].rgb.astype(int)).mean() > 0.1
    assert POURED_JUG[0] < 0.15 - POURED_GLASS[0]  # the jug does not hide the glass


@pytest.mark.slow
def test_images_of_both_renderers_show_steam_over_hot_water(folder):
    middle = (SIDE // 2, SIDE // 2)
    found = [[_images(folder, name, 0.24, celsius) for celsius in (23.0, 80.0)] for name in ("native", "warp")]
    for cold, hot in found:
        assert hot.depth[0, 0][middle] < cold.depth[0, 0][middle] - 0.1
        red, green, blue = hot.rgb[0, 0][middle].astype(int)
        assert abs(red - blue) < 8 and abs(red - green) < 8  # grey, not the water's blue
    assert np.abs(found[0][1].depth - found[1][1].depth).mean() < 2e-3
