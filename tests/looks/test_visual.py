"""How homes look: physics stays as it is, and what is added is in nobody's way."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from ig2mj.envs.config import EnvConfig
from ig2mj.errors import UnknownNameError
from ig2mj.looks import visual_of
from ig2mj.looks.home_plan import read_plan, spans
from ig2mj.looks.light import DAY, NIGHT, linear_lights, shade
from ig2mj.scene.scene import load_scene
from ig2mj.sensors.base import CAMERA_LOOKS, SensorOptions


@pytest.fixture(scope="module")
def home():
    return load_scene("small_home")


@pytest.fixture(scope="module")
def added(home):
    """Vertices of each geom that looks add, world frame, by name."""
    visual = visual_of(home)
    model, data = visual.model, visual.data(home.model, home.start_data())
    found = {}
    for geom in range(home.model.ngeom, model.ngeom):
        mesh = int(model.geom_dataid[geom])
        first = int(model.mesh_vertadr[mesh])
        vertices = model.mesh_vert[first : first + int(model.mesh_vertnum[mesh])]
        found[model.geom(geom).name] = vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
    return found


def test_physics_and_its_hash_do_not_depend_on_looks(home):
    plain = load_scene("small_home", looks="plain")
    assert plain.digest == home.digest and visual_of(plain).model is plain.model
    for name in ("body_mass", "geom_contype", "geom_size", "geom_rgba", "jnt_range", "key_qpos"):
        np.testing.assert_array_equal(getattr(plain.model, name), getattr(home.model, name))


def test_ids_of_the_scene_keep_their_meaning(home):
    visual, known = visual_of(home), home.model
    seen = visual.model
    for name in ("geom_bodyid", "geom_type", "geom_contype", "geom_matid"):
        np.testing.assert_array_equal(getattr(seen, name)[: known.ngeom], getattr(known, name), name)
    assert [seen.camera(k).name for k in range(seen.ncam)] == [known.camera(k).name for k in range(known.ncam)]
    np.testing.assert_array_equal(visual.owner[: known.ngeom], home.tables.geom_object)


def test_what_is_added_collides_with_nothing_and_weighs_nothing(home):
    visual = visual_of(home)
    more = np.arange(home.model.ngeom, visual.model.ngeom)
    assert len(more) and not visual.model.geom_contype[more].any() and not visual.model.geom_conaffinity[more].any()
    assert visual.model.body_mass[visual.model.geom_bodyid[more]].sum() == 0
    categories = {home.manifest.objects[k].category for k in visual.owner[more] if k >= 0}
    assert categories <= {"walls", "floors", "ceilings"}


def test_poses_are_those_of_the_world(home):
    visual, data = visual_of(home), home.start_data()
    data.qpos[:3] += 0.1
    mujoco.mj_kinematics(home.model, data)
    seen = visual.data(home.model, data)
    np.testing.assert_array_equal(seen.geom_xpos[: home.model.ngeom], data.geom_xpos)
    np.testing.assert_array_equal(seen.cam_xmat, data.cam_xmat)


def test_nothing_stands_where_loose_objects_are(home, added):
    loose = [s for s in read_plan(home).solids if not s.fixed]
    assert loose
    for name, vertices in added.items():
        for thing in loose:
            inside = ((vertices > thing.low - 0.01) & (vertices < thing.high + 0.01)).all(axis=1)
            assert not inside.any(), (name, thing.name)


def test_a_home_looks_the_same_whenever_it_is_loaded(home):
    again = visual_of(load_scene("small_home")).model
    model = visual_of(home).model
    np.testing.assert_array_equal(model.tex_data, again.tex_data)
    np.testing.assert_array_equal(model.mesh_vert, again.mesh_vert)


def test_few_geoms_are_added(home):
    """A ray caster and OpenGL take time for each geom."""
    assert visual_of(home).model.ngeom - home.model.ngeom <= 14 + 5 * len(home.rooms.names)


def test_every_room_has_walls_of_its_own_and_free_stretches_keep_clear_of_furniture(home):
    plan = read_plan(home)
    assert {face.room for face in plan.faces} >= set(home.rooms.names)
    for room in plan.rooms:
        for face in spans(plan, room.name, 1.3, 1.9, 0.1):
            low, high = face.point(face.low, 0.0, 1.3), face.point(face.high, 0.1, 1.9)
            low, high = np.minimum(low, high), np.maximum(low, high)
            assert not [s.name for s in plan.solids if (s.high > low).all() and (s.low < high).all()]


@pytest.mark.parametrize("light", [DAY, NIGHT])
def test_no_side_is_near_black(light):
    directions = np.random.default_rng(0).normal(size=(500, 3))
    lit = shade(directions / np.linalg.norm(directions, axis=1, keepdims=True), light)
    assert lit.min() > 0.25


def test_lights_of_linear_renderers_come_near_to_ours():
    directions = np.random.default_rng(1).normal(size=(500, 3))
    normals = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    ambient, lamps = linear_lights(DAY)
    linear = np.tile(ambient, (500, 1))
    for (direction, _), colour in zip(DAY.lamps, lamps, strict=True):
        toward = -np.asarray(direction) / np.linalg.norm(direction)
        linear += np.maximum(normals @ toward, 0)[:, None] * colour
    assert np.abs(np.clip(linear, 0, 1) ** (1 / 2.2) - shade(normals, DAY)).mean() < 6 / 255


def test_unknown_looks_are_refused(home):
    with pytest.raises(UnknownNameError, match=r"looks.*'dayy'"):
        load_scene("small_home", looks="dayy")


def test_robots_cameras_see_the_plain_home_unless_asked():
    """Policies that ship were trained on it."""
    assert SensorOptions().looks == CAMERA_LOOKS == "plain" == EnvConfig().sensor_options().looks
    assert EnvConfig(looks="night").sensor_options().looks == "night"
    with pytest.raises(UnknownNameError, match="'dayy'"):
        EnvConfig(looks="dayy").sensor_options()
