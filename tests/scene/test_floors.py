"""Floors are a metre deep, their surfaces where the scene has them, and nothing of them reaches into rooms below."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
import pytest

import ig2mj
import ig2mj.scene.scene as scenes
from ig2mj.scene.convex_pieces import mesh_corners
from ig2mj.scene.floors import DEPTH, TIME_CONSTANT, deepen_floors
from ig2mj.scene.manifest import FORMAT_VERSION, Manifest, ObjectEntry
from ig2mj.viewer.overview import home_overview

HEXAGON = " ".join(
    f"{x} {y} {z}" for z in (-0.1, 0.1) for x, y in ((2, 0), (1, 1), (-1, 1), (-2, 0), (-1, -1), (1, -1))
)
WEDGE = "0 0 0  2 0 0  0 2 0  2 2 0  0 0 -0.1  2 0 -0.1  0 2 -0.2  2 2 -0.2"
ROOF = "0 0 0  2 0 0  0 2 0.5  2 2 0.5  0 0 -0.2  2 0 -0.2  0 2 0.3  2 2 0.3"


def deepened(geoms: str, body: str = "", **meshes: str) -> mujoco.MjModel:
    """A building of these floors, and meshes of these corners."""
    assets = "".join(f'<mesh name="{name}" vertex="{corners}"/>' for name, corners in meshes.items())
    spec = mujoco.MjSpec.from_string(
        f'<mujoco><compiler angle="degree"/><asset>{assets}</asset>'
        f'<worldbody><body name="floors" {body}>{geoms}</body></worldbody></mujoco>'
    )
    entry = ObjectEntry("floors", "floors", "made", ["floors"], True, (1, 1, 1), 1.0)
    deepen_floors(spec, Manifest(FORMAT_VERSION, "made", [entry]))
    return spec.compile()


@pytest.fixture(autouse=True)
def with_floors_alone(monkeypatch: pytest.MonkeyPatch):
    """A home differs from what its scene.xml compiles to in its floors only."""
    for name in ("add_ground", "add_ceiling", "deepen_walls"):
        monkeypatch.setattr(scenes, name, lambda spec, manifest: None)


def test_a_homes_floors_are_deep_and_their_surfaces_where_they_were():
    scene = ig2mj.load_scene("small_home")
    plain = mujoco.MjModel.from_xml_path(str(scene.folder / "scene.xml"))
    floors = scene.tables.object_is_floor[scene.tables.geom_object] & (scene.tables.geom_object >= 0)
    floors &= scene.model.geom_contype != 0
    for model in (scene.model, scene.spec().compile()):
        size, pos = model.geom_size[floors], model.geom_pos[floors]
        assert np.allclose(size[:, 2], DEPTH / 2) and np.allclose(pos[:, 2] + size[:, 2], 0.0, atol=1e-12)
        assert (size[:, :2] == plain.geom_size[floors, :2]).all() and (pos[:, :2] == plain.geom_pos[floors, :2]).all()
        assert np.allclose(model.geom_solref[floors, 0], TIME_CONSTANT)
        for name in ("geom_size", "geom_pos", "geom_solref"):
            assert (getattr(model, name)[~floors] == getattr(plain, name)[~floors]).all()


def test_the_view_of_a_home_from_above_is_that_of_its_thin_floors():
    scene = ig2mj.load_scene("small_home")
    thin = dataclasses.replace(scene, model=mujoco.MjModel.from_xml_path(str(scene.folder / "scene.xml")))
    assert home_overview(scene, scene.start_data()) == home_overview(thin, thin.start_data())


def test_a_floor_above_another_keeps_its_depth():
    model = deepened(
        '<geom type="box" size="2 2 0.1" pos="0 0 -0.1"/>'  # the ground floor, half of it over a cellar
        '<geom type="box" size="2 2 0.1" pos="4 0 -0.1"/>'  # the other half
        '<geom type="box" size="2 2 0.1" pos="0 0 -2.6"/>'  # the cellar's
        '<geom type="box" size="1 1 0.1" pos="4 0 2.9"/>'  # upstairs
    )
    assert np.allclose(2 * model.geom_size[:, 2], [0.2, DEPTH, DEPTH, 0.2])
    assert np.allclose(model.geom_pos[:, 2] + model.geom_size[:, 2], [0.0, 0.0, -2.5, 3.0])


@pytest.mark.parametrize(
    ("geom", "body"),
    [
        ('size="2 3 0.1" pos="1 2 -0.1"', ""),
        ('size="2 3 0.1"', 'pos="1 2 -0.1" quat="0.9659258 0 0 0.2588190"'),
        ('size="0.1 3 2" pos="1 2 -0.1" quat="0.7071068 0 0.7071068 0"', ""),
        ('size="2 3 0.1" pos="1 -2 0.1"', 'quat="0 1 0 0"'),
    ],
)
def test_boxes_reach_down_however_they_are_turned(geom, body):
    model = deepened(f'<geom type="box" {geom}/>', body)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    half = np.abs(data.geom_xmat[0].reshape(3, 3)) @ model.geom_size[0]
    assert data.geom_xpos[0][2] + half[2] == pytest.approx(0.0, abs=1e-6)
    assert 2 * half[2] == pytest.approx(DEPTH, abs=1e-6)
    assert data.geom_xpos[0][:2] == pytest.approx([1, 2], abs=1e-6) and sorted(model.geom_size[0])[1:] == [2, 3]


def corners_of(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """Of a mesh, world frame."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    corners = mesh_corners(model, int(model.geom_dataid[geom]))
    return corners @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]


@pytest.mark.parametrize("body", ["", 'pos="3 -1 0.5" quat="0.9659258 0 0 0.2588190"'])
def test_floors_that_are_no_boxes_reach_down_too(body):
    seen = '<geom type="mesh" mesh="hexagon" contype="0" conaffinity="0" pos="0 0 -0.1"/>'
    model = deepened(seen + '<geom type="mesh" mesh="hexagon" pos="0 0 -0.1"/>', body, hexagon=HEXAGON)
    drawn, felt = corners_of(model, 0), corners_of(model, 1)
    surface = drawn[:, 2].max()
    assert drawn[:, 2].min() == pytest.approx(surface - 0.2, abs=1e-6)
    assert felt[:, 2].max() == pytest.approx(surface, abs=1e-6)
    assert felt[:, 2].min() == pytest.approx(surface - DEPTH, abs=1e-6)
    for end in (felt[:, 2].max(), felt[:, 2].min()):
        level = felt[np.abs(felt[:, 2] - end) < 1e-6]
        assert len(level) == 6 and all(np.abs(drawn[:, :2] - c).max(1).min() < 1e-6 for c in level[:, :2])


def test_a_mesh_reaches_down_where_its_surface_is_level_however_its_underside_is():
    model = deepened(
        '<geom type="mesh" mesh="wedge"/><geom type="mesh" mesh="roof" pos="9 0 0"/>', wedge=WEDGE, roof=ROOF
    )
    wedge, roof = corners_of(model, 0), corners_of(model, 1)
    assert [wedge[:, 2].min(), wedge[:, 2].max()] == pytest.approx([-DEPTH, 0.0], abs=1e-6)
    assert [roof[:, 2].min(), roof[:, 2].max()] == pytest.approx([-0.2, 0.5], abs=1e-6)
    assert np.allclose(model.geom_solref[:, 0], TIME_CONSTANT)


def test_what_slopes_or_is_deep_or_is_neither_box_nor_mesh_keeps_its_shape():
    model = deepened(
        '<geom type="box" size="2 2 0.1" quat="0.9848078 0.1736482 0 0"/>'
        '<geom type="box" size="1 1 0.1" pos="0 -9 0" euler="0 0 20"/>'
        '<geom type="box" size="1 1 3" pos="9 0 -3"/>'
        '<geom type="cylinder" size="1 0.1" pos="0 9 0"/>'
    )
    assert model.geom_size.tolist() == [[2, 2, 0.1], [1, 1, 0.1], [1, 1, 3], [1, 0.1, 0]]
    assert np.allclose(model.geom_solref[:, 0], TIME_CONSTANT)
