"""Cases of the throughput benchmark: the hand where it reaches objects, buffer sizes from where they are told to be."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import ig2mj
from benchmarks.harness.batch_case import Case
from benchmarks.harness.disturbance import Activity, geoms_of, join, lost_worlds, summary
from benchmarks.harness.made_home import write_home
from ig2mj.engine.warp.profile import EngineProfile, save_profile
from ig2mj.sampling.perturbation import loose_objects

PROFILE = EngineProfile(awake_dofs=40, constraints=200, contacts=30, convex_contacts=20)


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A made home of 20, and beside it a folder with its buffer sizes."""
    folder = tmp_path_factory.mktemp("cases")
    (folder / "profiles" / "made_20").mkdir(parents=True)
    save_profile(PROFILE, folder / "profiles" / "made_20")
    return write_home(folder / "made_20", 20)


def test_a_disturbed_case_has_a_hand_where_it_reaches_things(home):
    case = Case(str(home), True, 1, home.parent / "profiles")
    assert case.scene.model.nu == 16 and case.eye == "hand/eye"
    hand = case.scene.tables.agent_body[0]
    assert np.allclose(case.scene.model.body_pos[hand], case.reach.start)
    assert len(case.reach.objects) == 16
    assert case.profile == PROFILE
    assert case.pool.size == 1 and set(case.seconds) == {"reach", "pool", "profile"}


def test_an_idle_case_has_a_camera_there_and_nothing_that_moves(home):
    case = Case(str(home), False, 1, home.parent / "profiles")
    model = case.scene.model
    assert model.nu == 0 and case.eye == "eye/eye"
    assert np.allclose(model.body_pos[model.body("eye").id], case.reach.start)
    assert model.body_treeid[model.body("eye").id] == -1


def test_touch_is_between_the_hands_solid_geoms_and_loose_objects(home):
    case = Case(str(home), True, 1, home.parent / "profiles")
    hand, thing = geoms_of(case.scene)
    model = case.scene.model
    assert {model.geom(g).name.split("/")[1] for g in np.flatnonzero(hand)} == {"collision_0"}
    assert hand.sum() == 11 and not (hand & thing).any()
    names = {model.geom(g).name.split("/")[0] for g in np.flatnonzero(thing)}
    assert names == {f"thing_{k}" for k in range(16)}


def test_what_a_row_says_of_a_hand_is_a_mean_over_steps_and_worlds():
    touched = np.array([[True, False, False, False], [True, True, False, False]])
    one = Activity(touched=touched, awake_mean=np.array([20.0, 22.0]), awake_most=np.array([30.0, 28.0]))
    row = summary(join([one, one]), 16)
    assert row == {
        "hand_contact_share": 0.375,
        "worlds_touched_share": 0.5,
        "awake_dofs_beside_the_hand": 5.0,
        "awake_dofs_peak": 30,
    }


def test_a_robot_takes_the_hands_place_and_brings_its_own_buffer_sizes(home):
    sizes = EngineProfile(awake_dofs=50, constraints=300, contacts=40, convex_contacts=30)
    save_profile(sizes, home.parent / "profiles" / "made_20", "engine_profile.humanoid.json")
    case = Case(str(home), True, 1, home.parent / "profiles", robot="humanoid")
    tables, model = case.scene.tables, case.scene.model
    assert case.profile == sizes and case.eye == "humanoid/eye"
    assert np.linalg.norm(model.body_pos[tables.agent_body[0]][:2] - np.array(case.reach.start[:2])) < 3.0
    data = case.scene.start_data()
    mujoco.mj_fwdPosition(model, data)
    own = tables.body_agent[model.geom_bodyid[data.contact.geom[data.contact.dist < 0]]] >= 0
    assert not (own.any(1) & ~own.all(1)).any(), "it stands in nothing"
    assert (tables.actuator_agent == 0).all() and model.nu == 38
    robot, _ = geoms_of(case.scene)
    assert set(tables.hand_body) <= set(model.geom_bodyid[robot]), "its hands' touches are counted"


def test_a_dip_into_the_floor_is_no_loss_but_what_falls_past_it_or_flies_off_is():
    place = np.zeros((4, 2, 3))
    place[:, :, 2] = 0.05
    place[1, 0, 2], place[2, 1, 2], place[3, 0, 0] = -0.06, -0.12, 51.0
    assert lost_worlds(place) == 2


def test_what_slides_from_the_furniture_of_a_made_home_stays_on_its_floor(home):
    scene = ig2mj.load_scene(home)
    model, data = scene.model, scene.start_data()
    loose = loose_objects(scene.tables)
    model.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    address = model.jnt_dofadr[model.body_jntadr[scene.tables.object_root[loose]]]
    data.qvel[address], data.qvel[address + 2] = 6.0, 2.0
    for _ in range(480):
        mujoco.mj_step(model, data)
    place = data.xipos[scene.tables.object_root[loose]]
    assert (place[:, 0] > 6.5).any(), "beyond where its floor once ended"
    assert lost_worlds(place[None]) == 0
