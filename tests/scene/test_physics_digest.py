"""What pools are bound to: all that determines physics in a scene's files, and nothing of its looks."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest

from ig2mj.errors import InputError
from ig2mj.sampling.settled import make_pool
from ig2mj.scene.scene import KNOWN_DIGESTS, load_scene
from ig2mj.tasks.activities import ACTIVITIES
from ig2mj.tasks.pools import bare_scene
from ig2mj.worlds import Rules
from ig2mj.worlds.pool import load_pool, save_pool
from tests.tiny_home import write_tiny_home

LOOKS = {
    "a colour": lambda text: text.replace("<geom ", '<geom rgba="1 0 0 1" '),
    "a visual geom": lambda text: text.replace(
        '<body name="table"', '<geom type="sphere" size="1" contype="0" conaffinity="0"/><body name="table"'
    ),
    "no visual geoms": lambda text: re.sub(r'<geom [^>]*contype="0" conaffinity="0"[^>]*/>', "", text),
    "a light and a camera": lambda text: text.replace(
        "<worldbody>", '<worldbody><light pos="0 0 9"/><camera name="another" pos="0 0 3"/>'
    ),
    "materials": lambda text: text.replace(
        "<worldbody>", '<asset><material name="gold" rgba="1 1 0 1"/></asset><worldbody>'
    ),
    "the viewer's settings": lambda text: text.replace(
        "<worldbody>", '<visual><map znear="0.01"/></visual><statistic extent="3"/><worldbody>'
    ),
    "the text's form": lambda text: text.replace("><", ">\n  <!-- comment -->\n<"),
    "groups of visual geoms": lambda text: text.replace('group="0"', 'group="1"'),
    "the name of a collision geom": lambda text: text.replace('"table/collision_0"', '"table/collision_top"'),
    "the model's name": lambda text: re.sub(r'<mujoco model="[^"]*"', '<mujoco model="another"', text),
}

PHYSICS = {
    "friction": lambda text: text.replace('friction="0.25 0.005 0.0001"', 'friction="0.26 0.005 0.0001"', 1),
    "a collision geom": lambda text: text.replace(
        '<body name="table"', '<geom type="sphere" size="0.1" pos="0 0 9"/><body name="table"'
    ),
    "where a body is": lambda text: re.sub(r'(<body name="table" pos=")[^"]*', r"\g<1>0.1 0.2 0.3", text),
    "gravity": lambda text: text.replace("<worldbody>", '<option gravity="0 0 -5"/><worldbody>'),
    "a visual geom that weighs something": lambda text: text.replace(
        "</worldbody>", '<body><geom size="1" group="3" contype="0" conaffinity="0"/></body></worldbody>'
    ),
}


@pytest.fixture
def home(tmp_path):
    folder = tmp_path / "home"
    folder.mkdir()
    write_tiny_home(folder)
    return folder


def changed(home, change):
    file = home / "scene.xml"
    text = file.read_text()
    new = change(text)
    assert new != text
    file.write_text(new)


@pytest.mark.parametrize("what", LOOKS)
def test_what_is_only_seen_does_not_change_the_digest(home, what):
    before = load_scene(home)
    digest, files = before.digest, before.files_digest
    changed(home, LOOKS[what])
    after = load_scene(home)
    assert after.digest == digest and after.files_digest != files
    assert after.owns(digest) and not after.owns(files)


@pytest.mark.parametrize("what", PHYSICS)
def test_what_determines_physics_changes_the_digest(home, what):
    before = load_scene(home).digest
    changed(home, PHYSICS[what])
    assert load_scene(home).digest != before


def test_meshes_count_by_their_content(home):
    def with_mesh(name):
        asset = f'<asset><mesh name="m" file="{name}"/></asset><worldbody><geom type="mesh" mesh="m" pos="0 0 9"/>'
        return lambda text: text.replace("<worldbody>", asset)

    original = (home / "scene.xml").read_text()
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    found = []
    for name, content in (("a.obj", corners), ("b.obj", corners), ("c.obj", corners.replace("1 0 0", "2 0 0"))):
        (home / name).write_text(content)
        (home / "scene.xml").write_text(original)
        changed(home, with_mesh(name))
        found.append(load_scene(home).digest)
    assert found[0] == found[1] != found[2]


def test_a_pool_outlives_a_change_of_looks_and_of_the_homes_name_and_not_one_of_physics(home, tmp_path):
    scene, file = load_scene(home), tmp_path / "pool.npz"
    pool = make_pool(scene, Rules.of_scene(scene).model, 1, share=0.0, threads=1)
    save_pool(pool, file, scene)
    changed(home, LOOKS["a colour"])
    manifest = home / "manifest.json"
    manifest.write_text(manifest.read_text().replace('"tiny_home"', '"renamed_home"', 1))
    renamed = load_scene(home)
    assert renamed.name == "renamed_home"
    assert np.array_equal(load_pool(file, renamed).physics.qpos, pool.physics.qpos)
    changed(home, PHYSICS["friction"])
    with pytest.raises(InputError, match="is a pool of scene 'tiny_home'"):
        load_pool(file, load_scene(home))
    manifest.write_text(manifest.read_text().replace('"renamed_home"', '"tiny_home"', 1))
    with pytest.raises(InputError, match="another version of the physics of 'tiny_home'"):
        load_pool(file, load_scene(home))


def test_known_digests_are_of_the_homes_of_the_activities():
    for task in ACTIVITIES.values():
        scene = bare_scene(task)
        assert scene.digest in json.loads(KNOWN_DIGESTS.read_text()).values()
