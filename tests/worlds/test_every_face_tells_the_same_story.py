"""One core behind every face and engine: one story, told through each, gives the same states after each step.

A stove and a tap are switched on, an apple is heated, a sponge soaked, the apple cut; then everything is reset, and
the moment before the cut restored.
"""

from __future__ import annotations

import pathlib

import numpy as np
import pytest
from story import make_face, tell
from tiny_home import home_manifest, scene_xml

import ig2mj
from ig2mj.scene import manifest as mf

BEFORE_THE_CUT = "before the cut"
STORY: list[tuple] = [
    ("step", 2),
    ("set", "toggled_on", "stove", True),
    ("set", "toggled_on", "sink", True),
    ("put", "apple", (0.0, 1.6, 0.861)),
    ("put", "box", (-1.6, 0.0, 0.751)),  # holds the sponge above where the sink takes drops
    ("put", "sponge", (-1.6, 0.0, 0.823)),
    ("step", 28),
    ("save", BEFORE_THE_CUT),
    ("put", "knife", (-0.06, 1.6, 0.904)),
    ("step", 4),
    ("reset",),
    ("step", 2),
    ("restore", BEFORE_THE_CUT),
    ("put", "knife", (-0.06, 1.6, 0.904)),
    ("step", 4),
]

FLOATING = [call for call in STORY if call[:2] != ("put", "box")]
"""The story where nothing needs to be held."""

FLOATERS = ("stove", "sink", "apple", "apple_half_0", "apple_half_1", "knife", "sponge")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> pathlib.Path:
    """The tiny home, with states to start with, and an apple that any touch of the blade cuts."""
    return _written(tmp_path_factory.mktemp("story") / "home", scene_xml(), home_manifest())


def _written(home: pathlib.Path, xml: str, manifest: mf.Manifest) -> pathlib.Path:
    home.mkdir()
    (home / "scene.xml").write_text(xml)
    objects = {entry.name: entry for entry in manifest.objects}
    objects["apple"].abilities["sliceable"] = {"slice_force": 0.01}
    objects["apple"].state.update(temperature=40.0, max_temperature=60.0)
    objects["sponge"].state.update(wetness=1.0)
    mf.save_manifest(manifest, home / "manifest.json")
    return home


@pytest.fixture(scope="module")
def scene(folder) -> ig2mj.Scene:
    return ig2mj.load_scene(folder)


def _floating_xml() -> str:
    """The objects that the story is about, without gravity; of all pairs only the blade collides, with the apple and
    its halves."""

    def body(name: str, pos: str, geom: str, more: str = "", free: bool = True) -> str:
        joint = f'<freejoint name="{name}/free"/>' if free else ""
        return f'<body name="{name}" pos="{pos}">{joint}<geom {geom} group="3" gap="0.003" density="500"/>{more}</body>'

    food, blade, other = ('contype="0" conaffinity="1"', 'contype="1" conaffinity="0"', 'contype="0" conaffinity="2"')

    def ball(name: str, pos: str, radius: float) -> str:
        return body(name, pos, f'name="{name}/collision_0" type="sphere" size="{radius}" {food}')

    stove = '<site name="stove/heat_source" pos="0 0 0.85"/><site name="stove/toggle_button" pos="-0.3 0 0.7"/>'
    sink = '<site name="sink/water_source" pos="0 0 1.0"/><site name="sink/water_sink" pos="0 0 0.72"/>'
    area = 'name="sponge/cleaning_tool_area" type="box" size="0.05 0.03 0.005" pos="0 0 -0.015" mass="0" group="3"'
    area = f"<geom {area} {other}/>"
    return f"""<mujoco model="floating">
  <compiler angle="radian" inertiagrouprange="3 3"/>
  <option timestep="{1 / 120!r}" gravity="0 0 0"><flag sleep="enable"/></option>
  <worldbody>
{body("stove", "0 1.6 0", f'name="stove/collision_0" type="box" size="0.3 0.3 0.4" {other}', stove, False)}
{body("sink", "-1.6 0 0", f'name="sink/collision_0" type="box" size="0.25 0.2 0.35" {other}', sink, False)}
{ball("apple", "-0.2 0.1 0.53", 0.03)}
{ball("apple_half_0", "30 0 0.03", 0.02)}
{ball("apple_half_1", "31 0 0.03", 0.02)}
{body("knife", "-0.2 -0.15 0.5", f'name="knife/slicer" type="box" size="0.06 0.002 0.015" pos="0.06 0 0" {blade}')}
{body("sponge", "0.2 -0.2 0.5", f'name="sponge/collision_0" type="box" size="0.05 0.03 0.015" {other}', area)}
  </worldbody>
</mujoco>
"""


@pytest.fixture(scope="module")
def floating(tmp_path_factory) -> ig2mj.Scene:
    """A scene that MJX in JAX compiles in seconds."""
    manifest = home_manifest()
    manifest.objects = [entry for entry in manifest.objects if entry.name in FLOATERS]
    manifest.objects.sort(key=lambda entry: FLOATERS.index(entry.name))
    return ig2mj.load_scene(_written(tmp_path_factory.mktemp("floating") / "home", _floating_xml(), manifest))


@pytest.fixture(scope="module")
def told(scene, tmp_path_factory) -> list[dict[str, np.ndarray]]:
    """By a native batch."""
    face = make_face("worlds", scene, "native", tmp_path_factory.mktemp("worlds"))
    seen = tell(face, STORY)
    assert face.status.holds.tolist() == [True, True] and face.status.literals.shape == (2, 2)
    return seen


def test_the_story_is_about_something(told, scene):
    _assert_about_something(told, scene)


def _assert_about_something(told: list[dict[str, np.ndarray]], scene: ig2mj.Scene) -> None:
    """What each event is meant to do, it does: else the faces would agree on nothing."""
    at = {name: scene.object_index(name) for name in scene.object_names}
    start, cooked, cut, fresh, again = told[0], told[30], told[31], told[35], told[-4]
    assert start["temperature"][at["apple"]] == 40.0 and start["wetness"][at["sponge"]] == 1.0, "from the manifest"
    assert cooked["temperature"][at["apple"]] > 45.0 and cooked["wetness"][at["sponge"]] > 1.0
    assert not cooked["sliced"].any() and cut["sliced"][at["apple"]]
    place = cooked["object_pos"][at["apple"]]
    for half in ("apple_half_0", "apple_half_1"):
        assert np.abs(cut["object_pos"][at[half]] - place).max() < 0.03, "the view shows the halves at once"
        assert cut["temperature"][at[half]] > 45.0
    for name, array in start.items():
        np.testing.assert_array_equal(fresh[name], array, f"{name} after a reset")
    for name, array in cut.items():
        np.testing.assert_array_equal(again[name], array, f"{name} after the cut, told again")


@pytest.mark.parametrize("kind", ["simulation", "debug"])
def test_native_faces_agree_to_the_last_bit(told, scene, tmp_path, kind):
    for moment, (ours, theirs) in enumerate(
        zip(tell(make_face(kind, scene, "native", tmp_path), STORY), told, strict=True)
    ):
        for name, array in theirs.items():
            np.testing.assert_array_equal(ours[name], array, f"{name} at moment {moment}")


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("kind", ["worlds", "simulation", "debug", "sharded"])
def test_engines_agree(told, scene, tmp_path, kind):
    """Physics differs by rounding; switches, cuts and droplets do not, and temperatures follow."""
    _assert_alike(tell(make_face(kind, scene, "warp", tmp_path), STORY), told)


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("kind", ["worlds", "simulation", "debug", "sharded"])
def test_mjx_in_jax_agrees(floating, tmp_path, kind):
    """Among things that float: MJX in JAX was still compiling the home after a quarter of an hour."""
    native = tell(make_face("worlds", floating, "native", tmp_path), FLOATING)
    _assert_about_something(native, floating)
    _assert_alike(tell(make_face(kind, floating, "jax", tmp_path), FLOATING), native)


def _assert_alike(told: list[dict[str, np.ndarray]], native: list[dict[str, np.ndarray]]) -> None:
    for moment, (ours, theirs) in enumerate(zip(told, native, strict=True)):
        for name in ("toggled_on", "sliced", "wetness", "press_count"):
            np.testing.assert_array_equal(ours[name], theirs[name], f"{name} at moment {moment}")
        for name in ("temperature", "max_temperature"):
            np.testing.assert_allclose(ours[name], theirs[name], atol=1e-2, err_msg=f"{name} at moment {moment}")
        np.testing.assert_allclose(ours["object_pos"], theirs["object_pos"], atol=2e-2, err_msg=f"moment {moment}")
