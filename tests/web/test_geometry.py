"""Visual geoms as GLB: what a page draws is what MuJoCo has."""

from __future__ import annotations

import io

import mujoco
import numpy as np
import pytest
import trimesh

from ig2mj.scene.scene import load_scene
from ig2mj.web.geometry import PLAIN, Look, corners, glb_of_geoms, linear, looked, visual_geoms

KINDS = ("box", "sphere", "ellipsoid", "capsule", "cylinder", "plane")


@pytest.fixture(scope="module")
def shapes() -> mujoco.MjModel:
    geoms = "".join(
        f'<geom name="{k}" type="{k}" size="0.3 0.2 0.1" rgba="0.2 0.4 0.8 1" pos="{n} 0 0"/>'
        for n, k in enumerate(KINDS)
    )
    return mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{geoms}</worldbody></mujoco>")


@pytest.mark.parametrize("kind", KINDS)
def test_a_primitive_fills_mujocos_own_box_and_its_normals_point_out(shapes, kind):
    geom = shapes.geom(kind).id
    vertices, normals, uv, faces = corners(shapes, geom)
    assert uv is None and faces.max() < len(vertices)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-6)
    half = np.abs(vertices).max(0)
    if kind != "plane":
        np.testing.assert_allclose(half, shapes.geom_aabb[geom, 3:], rtol=0.02)
        assert (np.einsum("ij,ij->i", vertices, normals) > 0).all()
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), normals[faces[:, 0]]) >= 0).all()  # seen from outside


def test_a_home_keeps_its_meshes_textures_and_colours():
    scene = load_scene("small_home")
    model = scene.model
    geoms = visual_geoms(model).tolist()
    textured = [g for g in geoms if model.geom_matid[g] >= 0 and model.mesh_texcoordnum[model.geom_dataid[g]] > 0]
    assert len(textured) > 20
    read = trimesh.load(io.BytesIO(glb_of_geoms(model, textured[:1])), file_type="glb")
    (mesh,) = read.geometry.values()
    rows = model.mesh_facenum[model.geom_dataid[textured[0]]]
    texture = int(model.mat_texid[model.geom_matid[textured[0]], 1])
    assert len(mesh.faces) == rows
    assert mesh.visual.material.baseColorTexture.size == (model.tex_width[texture], model.tex_height[texture])


def test_a_look_mixes_into_colour_and_texture():
    scene = load_scene("small_home")
    model = scene.model
    geoms = visual_geoms(model).tolist()
    having = [g for g in geoms if model.geom_matid[g] >= 0 and model.mesh_texcoordnum[model.geom_dataid[g]] > 0]
    plain = next(g for g in geoms if model.geom_matid[g] < 0)
    burnt = Look(0.8, (0.0, 0.0, 0.0))
    for geom in (plain, having[0]):
        before, after = (_brightness(glb_of_geoms(model, [geom], look)) for look in (PLAIN, burnt))
        assert 0 < after < 0.5 * before


def _brightness(glb: bytes) -> float:
    """Mean of the colour or the texture, 0..255."""
    (mesh,) = trimesh.load(io.BytesIO(glb), file_type="glb").geometry.values()
    material = mesh.visual.material
    picture = material.baseColorTexture
    return float(np.mean(material.baseColorFactor[:3] if picture is None else np.asarray(picture)[..., :3]))


def test_colours_of_gltf_are_linear():
    np.testing.assert_allclose(linear(np.array([0.0, 0.5, 1.0, 0.3])), [0, 0.2140, 1, 0.3], atol=1e-3)
    mixed = looked(np.array([[1.0, 0.5, 0.0]]), Look(0.5, (0.0, 0.0, 1.0), 1.0))
    np.testing.assert_allclose(mixed, [[0.5, 0.25, 0.5]])
