"""Light in batched pictures: however much falls on a texture, it shows its own colour and none brighter."""

from __future__ import annotations

import jax
import mujoco
import numpy as np
import pytest

from ig2mj import load_scene
from ig2mj.engine.warp.engine import WarpEngine
from ig2mj.scene.manifest import AgentEntry
from ig2mj.sensors.batch_camera import BatchCamera
from ig2mj.states.initial import initial_states
from ig2mj.states.model import StateModel

COLOUR = (0.2, 0.4, 0.6)
"""Of the texture."""


def _before_a_lit_sign(spec: mujoco.MjSpec) -> AgentEntry:
    """An eye that looks along x at a textured triangle, on which two lamps shine."""
    texture = spec.add_texture(name="paint", type=mujoco.mjtTexture.mjTEXTURE_2D, width=4, height=4)
    texture.builtin, texture.rgb1 = mujoco.mjtBuiltin.mjBUILTIN_FLAT, COLOUR
    material = spec.add_material(name="painted", specular=0.0)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "paint"
    sign = spec.add_mesh(name="sign", inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
    sign.uservert, sign.userface = np.array([[0, 3, -2], [0, -3, -2], [0, 0, 3], [0.5, 0, 0]], float).ravel(), [0, 2, 1]
    sign.usertexcoord, sign.userfacetexcoord = [0, 0, 1, 0, 0, 1, 0, 0], [0, 2, 1]
    eye = spec.worldbody.add_body(name="eye", pos=[0, 0, 20])
    eye.add_camera(name="eye/eye", fovy=60.0, quat=[0.5, 0.5, -0.5, -0.5])
    place = {"type": mujoco.mjtGeom.mjGEOM_MESH, "group": 0, "contype": 0, "conaffinity": 0, "mass": 0.0}
    spec.worldbody.add_geom(name="sign", meshname="sign", material="painted", pos=[1.5, 0, 20], **place)
    for side in (-1.0, 1.0):
        lamp = spec.worldbody.add_light(pos=[0, side, 20], dir=[1, 0, 0], diffuse=[0.9] * 3, specular=[0.0] * 3)
        lamp.type = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    return AgentEntry(name="eye", body="eye", camera="eye/eye")


@pytest.fixture(scope="module")
def engine(tiny_home_folder) -> WarpEngine:
    return WarpEngine(load_scene(tiny_home_folder, [_before_a_lit_sign]), 1)


@pytest.mark.slow
@pytest.mark.parametrize("merge_meshes", [False, True])
def test_light_is_limited_before_a_texture_takes_its_share(engine, merge_meshes):
    model = StateModel.of_manifest(engine.scene.tables, engine.scene.manifest)
    camera = BatchCamera(engine, model, ["eye/eye"], width=16, height=16, merge_meshes=merge_meshes, segmentation=True)
    physics = engine.reset()
    images = jax.jit(camera.__call__)(physics, engine.view(physics), initial_states(model, 1))
    assert images.rgb is not None and images.geom is not None
    sign = np.asarray(images.geom)[0, 0] == engine.scene.model.geom("sign").id
    assert sign.sum() > 60
    np.testing.assert_allclose(np.asarray(images.rgb)[0, 0][sign] / 255.0, np.tile(COLOUR, (sign.sum(), 1)), atol=0.01)
