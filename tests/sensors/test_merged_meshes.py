"""Merged meshes: every triangle where its geom has it, and the pictures that upstream's ray caster makes."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from ig2mj import load_scene
from ig2mj.agents import Humanoid
from ig2mj.engine.warp.engine import WarpEngine
from ig2mj.looks.visual import COSTUMES
from ig2mj.scene.geom_groups import VISIBLE_GROUPS
from ig2mj.scene.manifest import AgentEntry
from ig2mj.sensors.batch_camera import BatchCamera
from ig2mj.sensors.merged_meshes import MESH, alpha, mergeable, rigid_parts, tables_of
from ig2mj.sensors.render_model import make_render_model
from ig2mj.sensors.triangle_trees import trees_of
from ig2mj.states.initial import initial_states
from ig2mj.states.model import StateModel

CLOSE = 2e-5
"""Metres between depths, m."""


def _with_eye(spec: mujoco.MjSpec) -> AgentEntry:
    eye = spec.worldbody.add_body(name="eye")
    eye.add_camera(name="eye/eye", fovy=75.0)
    return AgentEntry(name="eye", body="eye", camera="eye/eye")


@pytest.fixture(scope="module")
def scene():
    return load_scene("small_home", [_with_eye])


@pytest.fixture(scope="module")
def host(scene) -> mujoco.MjModel:
    return make_render_model(scene, [mujoco.mjtGeom.mjGEOM_ELLIPSOID] * 4)


@pytest.fixture(scope="module")
def parts(scene, host):
    return rigid_parts(host, scene.model, VISIBLE_GROUPS)


def test_height_fields_and_flexes_are_left_to_the_upstream_ray_caster(host):
    ground = '<asset><hfield name="h" nrow="2" ncol="2" size="1 1 1 1"/></asset>', '<geom type="hfield" hfield="h"/>'
    cloth = "", '<flexcomp name="cloth" type="grid" count="2 2 1" spacing="1 1 1" dim="2"/>'
    assert mergeable(host)
    for assets, body in (ground, cloth):
        xml = f"<mujoco>{assets}<worldbody>{body}</worldbody></mujoco>"
        assert not mergeable(mujoco.MjModel.from_xml_string(xml))


def test_every_visible_mesh_is_in_one_part_and_what_never_moves_is_the_first(scene, host, parts):
    merged = [geom for part in parts for geom in part.geoms]
    seen = np.isin(host.geom_group, VISIBLE_GROUPS) & (host.geom_type == MESH) & (alpha(host) > 0)
    assert sorted(merged) == np.flatnonzero(seen).tolist()
    assert parts[0].geom == -1 and all(part.geom in part.geoms for part in parts[1:])
    bodies = scene.model.geom_bodyid
    still = [geom for geom in merged if scene.model.body_weldid[bodies[geom]] == 0]
    assert sorted(parts[0].geoms) == sorted(still) and len(still) > 10
    assert len(parts) < len(set(merged) - set(still)), "a body's meshes are one"


def test_what_robots_wear_is_parts_that_move_by_themselves_before_the_garden():
    scene = load_scene("small_home", [Humanoid()])
    host = make_render_model(scene, [], looks="day")
    parts = rigid_parts(host, scene.model, VISIBLE_GROUPS)
    seen = np.isin(host.geom_group, VISIBLE_GROUPS) & (host.geom_type == MESH) & (alpha(host) > 0)
    worn = [int(g) for g in np.flatnonzero(seen) if host.body(host.geom_bodyid[g]).name == COSTUMES]
    assert len(worn) >= 5
    assert [part.geom for part in parts if len(part.geoms) == 1 and part.geom in worn] == worn
    assert sorted(geom for part in parts for geom in part.geoms) == np.flatnonzero(seen).tolist()
    assert tables_of(host, parts).garden
    trees = trees_of([part.vertices[part.faces] for part in parts])
    assert all(np.isfinite(tree[1:, :3]).all() for tree in trees)


def test_a_triangle_of_a_part_lies_where_its_geom_has_it(host, parts):
    data = mujoco.MjData(host)
    mujoco.mj_forward(host, data)
    tables = tables_of(host, parts)
    rng = np.random.default_rng(0)
    for number, part in enumerate(parts):
        for face in rng.choice(len(part.faces), 5):
            corners = part.vertices[part.faces[face]].astype(float)
            if part.geom >= 0:
                corners = corners @ data.geom_xmat[part.geom].reshape(3, 3).T + data.geom_xpos[part.geom]
            geom = tables.face_geom[tables.part_face[number] + face]
            mesh = tables.geom_mesh[geom]
            own = host.mesh_face[host.mesh_faceadr[mesh] + face - tables.geom_face[geom]]
            there = host.mesh_vert[host.mesh_vertadr[mesh] + own]
            in_world = there @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
            np.testing.assert_allclose(corners, in_world, atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("options", [{}, {"shadows": True}, {"cull_backfaces": True}])
def test_pictures_are_those_of_separate_meshes(scene, options):
    model, engine = StateModel.of_manifest(scene.tables, scene.manifest), WarpEngine(scene, 2)
    physics = engine.reset()
    moving = scene.model.body_weldid[scene.model.geom_bodyid] > 0
    lifted = np.array(physics.data.geom_xpos) + np.where(moving[:, None], [0.0, 0.02, 0.05], 0.0)  # merged parts follow
    physics = physics.replace(data=physics.data.replace(geom_xpos=jnp.asarray(lifted, jnp.float32)))
    view, states = engine.view(physics), initial_states(model, 2)
    middle = np.median(np.asarray(view.object_com)[0], axis=0)
    place = np.array([[middle[0], middle[1], 1.3], [middle[0] + 0.5, middle[1] - 0.4, 1.6]], np.float32)
    looks = np.array([[0.5, 0.5, -0.5, -0.5], [0.65, 0.27, 0.27, 0.65]], np.float32)  # along x; down and ahead
    looks /= np.linalg.norm(looks, axis=1, keepdims=True)
    pictures = []
    for merge in (False, True):
        expected = {"width": 64, "height": 64, "depth": True, "segmentation": True, "merge_meshes": merge}
        camera = BatchCamera(engine, model, ["eye/eye"], **expected, **options)
        shoot = jax.jit(lambda *of, camera=camera: camera(*of, {"eye/eye": (place, looks)}))
        pictures.append(jax.tree.map(np.asarray, shoot(physics, view, states)))
    upstream, merged = pictures
    same = upstream.geom == merged.geom
    assert len(np.unique(upstream.geom)) > 10 and same.mean() > 0.999
    assert np.abs(upstream.depth - merged.depth)[same].max() < CLOSE
    apart = np.abs(upstream.rgb.astype(int) - merged.rgb.astype(int)).max(-1)
    assert (apart[same] <= 2).mean() > 0.999
