"""The native engine's view: touching, forces, poses, who is awake."""

from __future__ import annotations

import dataclasses
import functools
import re

import jax
import mujoco
import numpy as np
import pytest
import tiny_home as homes

import ig2mj
from ig2mj.agents.floating_hand import FloatingHand, add_floating_hand, hand_ctrl
from ig2mj.engine.base import Engine, Write
from ig2mj.engine.layout import make_layout
from ig2mj.engine.model_fields import ModelFields
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.view import SCHEMA, but_agents, read_field
from ig2mj.errors import EngineError
from ig2mj.scene import manifest as mf


@pytest.fixture(scope="module")
def settled(tiny_home) -> ig2mj.Simulation:
    """The tiny home after two seconds; tests reset what they change with `fresh`."""
    simulation = ig2mj.Simulation(tiny_home)
    simulation.step(count=60)
    return simulation


@pytest.fixture
def home(tiny_home, settled):
    """A simulation of its own at the settled state."""
    simulation = ig2mj.Simulation(tiny_home)
    simulation.physics = simulation.engine.load(simulation.physics, settled.engine.export(settled.physics, 0))
    return simulation


def touch(simulation: ig2mj.Simulation, one: str, other: str) -> bool:
    scene, view = simulation.scene, simulation.view
    a, b = scene.object_index(one), scene.object_index(other)
    assert view.touching[0, a, b] == view.touching[0, b, a]
    return bool(view.touching[0, a, b])


def awake(simulation: ig2mj.Simulation) -> set[str]:
    return {n for n, a in zip(simulation.scene.object_names, simulation.view.awake[0], strict=True) if a}


def test_the_native_engine_is_an_engine(tiny_home):
    assert isinstance(NativeEngine(tiny_home), Engine)


def test_what_rests_touches_and_is_remembered_asleep(home):
    assert awake(home) == set()
    assert home.data.ncon == 0, "sleeping pairs have no contacts, so this is memory"
    for one, other in [("box", "table"), ("ball", "floor"), ("rod", "floor"), ("pan", "stove"), ("book", "cabinet")]:
        assert touch(home, one, other)
    for one, other in [("box", "floor"), ("box", "apple"), ("table", "floor"), ("apple", "apple_half_0")]:
        assert not touch(home, one, other)
    assert not home.view.touching[0].diagonal().any()


def test_touching_ends_at_three_millimetres(home):
    """3 mm, as measured in PyBullet."""
    half = 0.05
    home.set_object_pose("box", [0.1, 0, homes.TABLE_TOP + half + 0.0028])
    assert touch(home, "box", "table")
    home.set_object_pose("box", [0.1, 0, homes.TABLE_TOP + half + 0.0032])
    assert not touch(home, "box", "table")


def test_a_gap_is_seen_and_not_felt(home):
    """`gap` lists a contact and applies no force."""
    home.set_object_pose("box", [0.1, 0, homes.TABLE_TOP + 0.05 + 0.0025])
    assert touch(home, "box", "table")
    dof = home.model.joint("box/free").dofadr[0]
    mujoco.mj_step2(home.model, home.data)
    assert home.data.qacc[dof + 2] == pytest.approx(-9.8)


def test_touching_is_forgotten_when_lifted_and_comes_back(home):
    home.set_object_pose("box", [0.1, 0, 0.9])
    assert not touch(home, "box", "table")
    assert awake(home) == {"box"}
    home.step(count=5)
    assert not touch(home, "box", "table")
    home.step(count=60)
    assert touch(home, "box", "table") and awake(home) == set()


def test_only_what_is_awake_forgets(home):
    """The door wakes; the book that sleeps in the drawer of the same cabinet still touches it."""
    assert touch(home, "book", "cabinet")
    home.set_joint("cabinet_door_hinge", 1.0)
    assert awake(home) == {"cabinet"}
    assert touch(home, "book", "cabinet")
    home.step()
    assert touch(home, "book", "cabinet")


def test_a_write_wakes_the_whole_sleeping_island(home):
    home.set_joint("cabinet_drawer_slide", 0.001)
    assert awake(home) == {"cabinet", "book"}


def test_a_write_of_the_same_pose_wakes_too(home):
    pos, quat = home.object_pose("ball")
    home.set_object_pose("ball", pos, quat)
    assert awake(home) == {"ball"}
    assert touch(home, "ball", "floor")


def test_fixed_objects_without_joints_are_never_awake(tiny_home):
    view = ig2mj.Simulation(tiny_home).view
    fixed = {"floor", "walls", "table", "stove", "sink"}
    assert {n for n, a in zip(tiny_home.object_names, view.awake[0], strict=True) if not a} == fixed


def fresh_kinematics(simulation: ig2mj.Simulation) -> mujoco.MjData:
    data = mujoco.MjData(simulation.scene.model)
    data.qpos[:] = simulation.data.qpos
    mujoco.mj_forward(simulation.scene.model, data)
    return data


@pytest.mark.parametrize("steps", [0, 3, 9, 40])
def test_poses_belong_to_the_present_state_awake_or_asleep(tiny_home, steps: int):
    simulation = ig2mj.Simulation(tiny_home)
    simulation.set_object_pose("can", [0.3, 0.2, 0.7], [0.9, 0.1, 0.3, 0])
    view = simulation.step(count=steps)
    data, model, tables = fresh_kinematics(simulation), tiny_home.model, tiny_home.tables
    close = functools.partial(np.testing.assert_allclose, rtol=0, atol=2e-6)
    close(view.body_pos[0], data.xpos)
    close(view.body_quat[0], data.xquat)
    close(view.object_pos[0], data.xpos[tables.object_root])
    close(view.object_com[0], data.xipos[tables.object_root])
    close(view.joint_pos[0], data.qpos[tables.openable_qposadr])
    for link, geom in enumerate(tables.link_geom):
        if geom >= 0:
            close(view.link_pos[0, link], data.geom_xpos[geom])
            matrix = np.zeros(9)
            mujoco.mju_quat2Mat(matrix, view.link_quat[0, link].astype(np.float64))
            close(matrix, data.geom_xmat[geom])
    close(view.link_pos[0, 1], data.site("stove/heat_source").xpos)
    assert view.object_pos.dtype == np.float32 and view.touching.dtype == bool
    assert model.nbody == view.body_pos.shape[1]


def test_views_once_given_do_not_change_and_are_shared_while_nothing_moves(home):
    before = home.view
    kept = {name: np.array(read_field(before, name)) for name in SCHEMA}
    assert home.step() is before, "nothing moved: nothing to look at again"
    home.set_object_pose("box", [0.1, 0, 0.9])
    after = home.step()
    assert after is not before and after.link_pos is before.link_pos
    for name, array in kept.items():
        np.testing.assert_array_equal(read_field(before, name), array)


def test_a_write_with_nothing_in_its_masks_changes_nothing(home):
    number = len(home.scene.object_names)
    before = home.view
    nothing = Write(
        object_mask=np.zeros((1, number), bool),
        object_pos=np.full((1, number, 3), np.nan),
        object_quat=np.zeros((1, number, 4)),
    )
    home.engine.write(home.physics, nothing)
    assert home.view is before


def test_a_fixed_objects_row_of_a_write_is_ignored(home):
    number, table = len(home.scene.object_names), home.scene.object_index("table")
    mask = np.zeros((1, number), bool)
    mask[0, table] = True
    pose = np.tile(np.array([1.0, 0, 0, 0]), (1, number, 1))
    home.engine.write(home.physics, Write(object_mask=mask, object_pos=np.ones((1, number, 3)), object_quat=pose))
    assert home.object_pose("table")[0] == pytest.approx([0, 0, 0])


def test_split_off_bodies_go_along_with_their_object(tmp_path):
    """Box and book as one object: the book hangs on it by no joint."""
    homes.write_tiny_home(tmp_path)
    manifest = homes.home_manifest()
    manifest.objects = [o for o in manifest.objects if o.name != "book"]
    next(o for o in manifest.objects if o.name == "box").bodies = ["box", "book"]
    mf.save_manifest(manifest, tmp_path / "manifest.json")
    simulation = ig2mj.Simulation(tmp_path)
    layout = make_layout(simulation.scene.model, simulation.scene.tables)
    assert len(layout.extra_object) == 1
    half = np.sqrt(0.5)
    box, book = simulation.scene.model.body("box").id, simulation.scene.model.body("book").id
    offset = simulation.view.body_pos[0, book] - simulation.view.body_pos[0, box]
    simulation.set_object_pose("box", [0, 0, 3], [half, 0, 0, half])  # a quarter turn about z
    view = simulation.view
    moved = view.body_pos[0, book] - view.body_pos[0, box]
    assert moved == pytest.approx([-offset[1], offset[0], offset[2]], abs=1e-6)
    assert view.body_quat[0, book] == pytest.approx([half, 0, 0, half], abs=1e-6)


def reference_forces(simulation: ig2mj.Simulation) -> np.ndarray:
    """Largest normal force per link and object in one control step, by MuJoCo's own decoding; takes the step."""
    model, tables, data = simulation.model, simulation.scene.tables, mujoco.MjData(simulation.model)
    mujoco.mj_copyData(data, model, simulation.data)
    out = np.zeros((len(tables.link_kind), tables.num_objects))
    force = np.zeros(6)
    for substep in range(4):
        (mujoco.mj_step2 if substep == 0 else mujoco.mj_step)(model, data)
        for number in range(data.ncon):
            geoms = data.contact[number].geom
            for one, other in (geoms, geoms[::-1]):
                for link in np.flatnonzero(tables.link_geom == one):
                    thing = tables.geom_object[other]
                    if thing >= 0:
                        mujoco.mj_contactForce(model, data, number, force)
                        out[link, thing] = max(out[link, thing], force[0])
    return out


@pytest.mark.parametrize("cone", [mujoco.mjtCone.mjCONE_PYRAMIDAL, mujoco.mjtCone.mjCONE_ELLIPTIC])
def test_link_force_is_the_largest_normal_force_of_any_physics_step(tiny_home, cone):
    """Unlike iGibson's slicer: the largest of all substeps, not the last one's."""
    scene = dataclasses.replace(tiny_home, model=tiny_home.spec().compile())
    scene.model.opt.cone = cone
    simulation = ig2mj.Simulation(scene)
    simulation.set_object_pose("knife", [-0.2, -0.2, 1.2], [0.7071, 0, 0.7071, 0])  # point down
    slicer, table = 0, scene.object_index("table")
    peak = 0.0
    for _ in range(30):
        expected = reference_forces(simulation)
        view = simulation.step()
        np.testing.assert_allclose(view.link_force[0], expected, rtol=1e-5, atol=1e-5)
        peak = max(peak, float(view.link_force[0, slicer, table]))
    assert peak > 5.0, "a knife of 70 g that falls on its point"
    simulation.step(count=60)
    assert not simulation.view.link_force.any(), "asleep: no forces"


def test_forces_are_forgotten_by_a_write(tiny_home):
    simulation = ig2mj.Simulation(tiny_home)
    simulation.step(count=2)
    assert simulation.view.link_force.any(), "knife and sponge press on the table"
    simulation.set_object_pose("ball", [-1, -1, 0.5])
    assert not simulation.view.link_force.any()


def weld(spec: mujoco.MjSpec):
    """A hand with a weld to the box, switched off."""
    entry = add_floating_hand(spec, pos=(0.1, 0, 0.8))
    spec.add_equality(
        name="hand/box",
        type=mujoco.mjtEq.mjEQ_WELD,
        objtype=mujoco.mjtObj.mjOBJ_BODY,
        name1="hand",
        name2="box",
        active=False,
    )
    return entry


def test_a_switched_weld_is_a_grasp_and_what_is_let_go_falls(tiny_home_folder):
    simulation = ig2mj.Simulation(ig2mj.load_scene(tiny_home_folder, agents=[weld]))
    simulation.step(count=60)
    box = simulation.scene.object_index("box")
    assert awake(simulation) == set() and not simulation.view.held.any()
    data = simulation.engine.export(simulation.physics, 0).eq_data
    data = data.copy()
    hand, held = simulation.scene.model.body("hand").id, simulation.scene.model.body("box").id
    offset = simulation.view.body_pos[0, held] - simulation.view.body_pos[0, hand]
    data[0, :10] = [0, 0, 0, *offset, 1, 0, 0, 0]
    simulation.engine.write(
        simulation.physics, Write(eq_active=np.ones((1, 1), bool), model_fields=ModelFields(eq_data=data[None]))
    )
    assert awake(simulation) == {"box"}
    assert simulation.view.held[0, 0].nonzero()[0].tolist() == [box]
    before = simulation.object_pose("box")[0]
    for _ in range(30):
        simulation.step(hand_ctrl((0, 0, 0.3)))
    assert simulation.object_pose("box")[0][2] - before[2] == pytest.approx(0.3, abs=0.02)
    simulation.engine.write(simulation.physics, Write(eq_active=np.zeros((1, 1), bool)))
    assert not simulation.view.held.any()
    simulation.step(count=60)
    assert touch(simulation, "box", "table")


def test_agent_eye_and_fingers_follow_the_hand(tiny_home_folder):
    hand = FloatingHand(pos=(-1, 0, 1))
    simulation = ig2mj.Simulation(ig2mj.load_scene(tiny_home_folder, agents=[hand]))
    start = simulation.view
    assert start.agent.base_pos[0, 0] == pytest.approx([-1, 0, 1])
    assert start.agent.eye_pos[0, 0] == pytest.approx([-1, 0.08, 1.12], abs=1e-6)
    assert start.agent.eye_quat[0, 0] == pytest.approx([1, 0, 0, 0], abs=1e-6)
    for _ in range(60):
        view = simulation.step(hand_ctrl((0.2, 0, 0.1)))
    assert view.agent.base_pos[0, 0] == pytest.approx([-0.8, 0, 1.1], abs=2e-3)
    assert view.agent.eye_pos[0, 0] - view.agent.base_pos[0, 0] == pytest.approx([0, 0.08, 0.12], abs=2e-3)
    assert view.agent.finger_pos[0] - start.agent.finger_pos[0] == pytest.approx(
        np.tile([0.2, 0, 0.1], (10, 1)), abs=3e-3
    )


def test_views_say_whether_anything_but_agents_changed(tiny_home_folder):
    """A hand that moves, pushes a box, and moves on when that lies still again; and a write that moves an object."""
    scene = ig2mj.load_scene(tiny_home_folder, agents=[FloatingHand(pos=(-1, 0, 1))])
    engine, own = NativeEngine(scene), scene.tables.body_agent >= 0
    physics = engine.reset()
    for _ in range(60):
        physics, before = engine.step(physics)
    physics = engine.write(physics, teleport(scene, "box", (-1, 0, 0.8)))  # below the hand: it falls
    said = {True: 0, False: 0}
    for k in range(150):
        physics, view = engine.step(physics, hand_ctrl((0.1 * np.sin(k / 20), 0, 0.05))[None].astype(np.float64))
        same = but_agents(view) is but_agents(before)
        said[same] += 1
        for name in SCHEMA if same else ():
            now, then = read_field(view, name), read_field(before, name)
            if name in ("body_pos", "body_quat"):
                now, then = now[:, ~own], then[:, ~own]
            assert name.startswith("agent.") or now.tobytes() == then.tobytes(), name
        assert view.agent.joint_pos.tobytes() != before.agent.joint_pos.tobytes()
        before = view
    assert min(said.values()) > 10
    assert but_agents(jax.tree.map(np.copy, before)) is None  # copies may be changed


def teleport(scene: ig2mj.Scene, name: str, pos: tuple[float, float, float]) -> Write:
    count, obj = scene.tables.num_objects, scene.object_index(name)
    mask, to, turn = np.zeros((1, count), bool), np.zeros((1, count, 3)), np.zeros((1, count, 4))
    mask[0, obj], to[0, obj], turn[0, obj] = True, pos, (1, 0, 0, 0)
    return Write(object_mask=mask, object_pos=to, object_quat=turn)


def test_a_world_gone_wrong_is_named_with_its_bodies(home, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its own log beside the caller
    home.set_object_pose("can", [0.3, 0.2, 0.7])
    home.data.qvel[home.model.joint("can/free").dofadr[0]] = np.nan
    with pytest.raises(
        EngineError, match=r"world 0: position or velocity is not finite at t = 2\.033 s of 'box'.* and \d+ more"
    ):
        home.step()
    home.reset()
    assert np.isfinite(home.step().object_pos).all()


def test_a_scene_without_agents_and_cameras_has_a_whole_view(tmp_path):
    """All fields can be read, as batches made of one world's view do; those of agents are empty."""
    file = homes.write_tiny_home(tmp_path / "tiny") / "scene.xml"
    file.write_text(re.sub(r"<camera [^>]*/>", "", file.read_text()))
    scene = ig2mj.load_scene(file)
    assert scene.model.ncam == 0
    view = jax.tree.map(np.asarray, ig2mj.Simulation(scene).view)
    assert view.agent.eye_pos.shape == (1, 0, 3) and view.agent.eye_quat.shape == (1, 0, 4)
