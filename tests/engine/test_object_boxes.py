"""World boxes of objects by both rules."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
import tiny_home as homes

import ig2mj
from ig2mj.geometry.boxes import BULLET_MARGIN_COMPOUND, BULLET_MARGIN_SINGLE

TURN = np.array([0.8, 0.3, -0.4, 0.33])


def surface_box(simulation: ig2mj.Simulation, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Tight box by brute force: farthest points of every collision geom along the world axes."""
    model, data, tables = simulation.model, simulation.data, simulation.scene.tables
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for geom in tables.piece_geom[tables.piece_object == simulation.scene.object_index(name)]:
        size, rotation = model.geom_size[geom], data.geom_xmat[geom].reshape(3, 3)
        kind = mujoco.mjtGeom(int(model.geom_type[geom]))
        angle = np.linspace(0, 2 * np.pi, 721)
        ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
        if kind == mujoco.mjtGeom.mjGEOM_BOX:
            points = size * np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
        elif kind == mujoco.mjtGeom.mjGEOM_MESH:
            mesh = model.geom_dataid[geom]
            start = model.mesh_vertadr[mesh]
            points = model.mesh_vert[start : start + model.mesh_vertnum[mesh]]
        elif kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
            points = np.concatenate([ring * size[0] + [0, 0, s * size[1]] for s in (-1, 1)])
        else:  # a ball, or a capsule: balls at its ends
            length = size[1] if kind == mujoco.mjtGeom.mjGEOM_CAPSULE else 0.0
            ends = np.array([[0, 0, -length], [0, 0, length]]) @ rotation.T + data.geom_xpos[geom]
            low, high = np.minimum(low, ends.min(0) - size[0]), np.maximum(high, ends.max(0) + size[0])
            continue
        world = points @ rotation.T + data.geom_xpos[geom]
        low, high = np.minimum(low, world.min(0)), np.maximum(high, world.max(0))
    return low, high


@pytest.mark.parametrize("name", ["box", "apple", "apple_half_0", "ball", "can", "rod", "knife", "sponge"])
@pytest.mark.parametrize("turn", [None, TURN])
def test_tight_boxes_enclose_the_surface_and_no_more(tiny_home, name, turn):
    simulation = ig2mj.Simulation(tiny_home)
    simulation.set_object_pose(name, [0.3, -0.7, 1.5], turn)
    view, number = simulation.view, tiny_home.object_index(name)
    low, high = surface_box(simulation, name)
    assert view.aabb_low[0, number] == pytest.approx(low, abs=2e-6)
    assert view.aabb_high[0, number] == pytest.approx(high, abs=2e-6)


def test_the_box_of_an_articulated_object_grows_as_it_opens(tiny_home):
    simulation = ig2mj.Simulation(tiny_home)
    cabinet = tiny_home.object_index("cabinet")
    before = simulation.view.aabb_low[0, cabinet].copy()
    simulation.set_joint("cabinet_drawer_slide", 0.3)
    after = simulation.view.aabb_low[0, cabinet]
    low, high = surface_box(simulation, "cabinet")
    assert after == pytest.approx(low, abs=2e-6)
    assert simulation.view.aabb_high[0, cabinet] == pytest.approx(high, abs=2e-6)
    assert before[0] - after[0] > 0.2


def test_boxes_follow_through_a_fall_into_sleep(tiny_home):
    simulation = ig2mj.Simulation(tiny_home)
    simulation.set_object_pose("book", [0.3, 0, 0.75], TURN)
    simulation.step(count=90)
    assert not simulation.view.awake.any()
    for name in ("book", "box", "cabinet", "table"):
        low, high = surface_box(simulation, name)
        number = tiny_home.object_index(name)
        assert simulation.view.aabb_low[0, number] == pytest.approx(low, abs=2e-6)
        assert simulation.view.aabb_high[0, number] == pytest.approx(high, abs=2e-6)


def test_igibsons_box_is_the_local_box_with_bullets_margin_rotated(tiny_home):
    """A hull ball of radius r gives +-r unrotated and more when turned, and 3 mm for one hull."""
    simulation = ig2mj.Simulation(tiny_home, boxes="igibson")
    number = tiny_home.object_index("ball")
    simulation.set_object_pose("ball", [0, 0, 2], [1, 0, 0, 0])
    view = simulation.view
    assert view.aabb_high[0, number] - [0, 0, 2] == pytest.approx([0.1 + BULLET_MARGIN_SINGLE] * 3, abs=1e-6)
    simulation.set_object_pose("ball", [0, 0, 2], TURN)
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, TURN / np.linalg.norm(TURN))
    reach = np.abs(matrix.reshape(3, 3)).sum(1) * (0.1 + BULLET_MARGIN_SINGLE)
    view = simulation.view
    assert view.aabb_high[0, number] - [0, 0, 2] == pytest.approx(reach, abs=1e-6)
    assert view.aabb_low[0, number] - [0, 0, 2] == pytest.approx(-reach, abs=1e-6)
    assert reach.max() > 0.15


def test_igibsons_margin_of_a_compound_is_four_millimetres(tiny_home):
    """The box is that of the whole compound."""
    view = ig2mj.Simulation(tiny_home, boxes="igibson").view
    table = tiny_home.object_index("table")
    top = [0.4, 0.3, homes.TABLE_TOP]
    assert view.aabb_high[0, table] == pytest.approx(np.array(top) + BULLET_MARGIN_COMPOUND, abs=1e-6)
    assert view.aabb_low[0, table] == pytest.approx(
        [-0.4 - BULLET_MARGIN_COMPOUND, -0.3 - BULLET_MARGIN_COMPOUND, -BULLET_MARGIN_COMPOUND], abs=1e-6
    )


def test_igibsons_box_contains_the_tight_one(tiny_home):
    loose, tight = (ig2mj.Simulation(tiny_home, boxes=rule) for rule in ("igibson", "tight"))
    for simulation in (loose, tight):
        for name in ("can", "knife", "rod", "apple"):
            simulation.set_object_pose(name, [0, 0, 2], TURN)
    assert (loose.view.aabb_low <= tight.view.aabb_low - 0.0029).all()
    assert (loose.view.aabb_high >= tight.view.aabb_high + 0.0029).all()


def test_igibsons_box_leaves_split_off_bodies_out(tmp_path):
    """4.2: union over the links of the main body only."""
    from ig2mj.scene import manifest as mf

    homes.write_tiny_home(tmp_path)
    manifest = homes.home_manifest()
    manifest.objects = [o for o in manifest.objects if o.name != "book"]
    next(o for o in manifest.objects if o.name == "box").bodies = ["box", "book"]
    mf.save_manifest(manifest, tmp_path / "manifest.json")
    box = 3
    loose, tight = (ig2mj.Simulation(tmp_path, boxes=rule).view for rule in ("igibson", "tight"))
    assert loose.aabb_high[0, box, 0] == pytest.approx(0.15 + BULLET_MARGIN_SINGLE, abs=1e-6)
    assert tight.aabb_high[0, box, 0] > 1.5


def test_an_object_without_collision_geometry_has_a_point_for_a_box(tmp_path):
    homes.write_tiny_home(tmp_path)
    text = (tmp_path / "scene.xml").read_text()
    start = text.index('<geom name="sink/collision_0"')
    end = text.index("/>", start) + 2
    (tmp_path / "scene.xml").write_text(text[:start] + text[end:])
    for rule in ("tight", "igibson"):
        simulation = ig2mj.Simulation(tmp_path, boxes=rule)
        number = simulation.scene.object_index("sink")
        assert simulation.view.aabb_low[0, number] == pytest.approx([-1.6, 0, 0])
        assert simulation.view.aabb_high[0, number] == pytest.approx([-1.6, 0, 0])
