"""What lies in scenes_mjcf/: complete, small, at rest, open-able, reachable."""

from __future__ import annotations

import functools
import json
import time

import mujoco
import numpy as np
import pytest
from ig2mj_converters.bodies.inertia import DEFAULT_DENSITY
from ig2mj_homes.dataset.ship import SHARED, total_bytes, used_assets
from ig2mj_homes.dataset.shipped_homes import home_names
from ig2mj_homes.objects.opening_strength import open_joint
from ig2mj_homes.plans.layout_maps import reachable
from ig2mj_homes.plans.shipped import DRAWINGS, plan

from ig2mj.cli.homes import shipped_homes
from ig2mj.scene.manifest import load_manifest
from ig2mj.scene.paths import SHIPPED_HOMES
from ig2mj.scene.rooms import load_rooms
from ig2mj.scene.scene import Scene, load_scene

BUILDING = ("walls", "floors", "ceilings")
FEW = ("small_home", "aspen", "birch")
each_home = pytest.mark.parametrize("name", home_names())
load = functools.lru_cache(maxsize=3)(load_scene)


def start(model: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    return data


def place(scene: Scene, data: mujoco.MjData, name: str) -> np.ndarray:
    return data.xpos[scene.model.body(name).id].copy()


def test_the_small_home_and_the_sixteen_are_there():
    found = {home["home"]: home for home in shipped_homes()}
    assert sorted(found) == sorted(home_names())
    assert sum(len(found[name]["rooms"]) for name in DRAWINGS) == 119
    for name, drawing in DRAWINGS.items():
        assert found[name]["objects"] == drawing.objects, name
        assert sorted(found[name]["rooms"]) == sorted(room.name for room in plan(name).rooms), name


def test_the_whole_folder_stays_small():
    assert total_bytes(SHIPPED_HOMES) < 26.5e6


def test_every_model_of_the_library_was_converted_with_the_density_of_its_category():
    """Not with that of a category which a dataset does not describe."""
    manifests = [json.loads(file.read_text()) for file in SHIPPED_HOMES.glob("objects/*/*/manifest.json")]
    densities = {o["name"]: o["mass"] / np.prod(o["bounding_box"]) for m in manifests for o in m["objects"][:1]}
    assert len(densities) > 600
    assert not [name for name, density in densities.items() if abs(density - DEFAULT_DENSITY) < 0.05]


def test_meshes_and_textures_are_stored_once_and_all_are_used():
    files = [*SHIPPED_HOMES.glob("*/scene.xml"), *SHIPPED_HOMES.glob("objects/*/*/object.xml")]
    used = set().union(*map(used_assets, files))
    stored = {file.resolve() for part in SHARED for file in (SHIPPED_HOMES / part).iterdir()}
    assert used == stored


@each_home
def test_no_check_failed_when_it_was_converted(name: str):
    checks = json.loads((SHIPPED_HOMES / name / "checks.json").read_text())
    assert len(checks) == 8
    assert [check for check in checks if not check["passed"]] == []


@each_home
def test_a_disc_of_30_cm_reaches_every_room_by_the_homes_own_map(name: str):
    """The map is eroded by up to 10 cm already; the rest of the radius is taken here."""
    rooms = load_rooms(SHIPPED_HOMES / name)
    assert rooms.traversable is not None and rooms.resolution == rooms.trav_resolution
    reach = reachable(rooms.traversable, 0.2, rooms.trav_resolution)
    for number, room in enumerate(rooms.names):
        assert (reach & (rooms.room_map == number + 1)).any(), room


@each_home
def test_walls_floors_and_ceilings_are_there(name: str):
    """floor.n.01, the one synset of BEHAVIOR-100's objects that no household object stands for."""
    found = [o.category for o in load_manifest(SHIPPED_HOMES / name).objects if o.category in BUILDING]
    assert sorted(found) == sorted(BUILDING)


@each_home
def test_doors_between_rooms_name_both(name: str):
    manifest = load_manifest(SHIPPED_HOMES / name)
    doors = [o for o in manifest.objects if o.category == "door"]
    assert all(1 <= len(door.rooms) <= 2 and door.openable for door in doors)
    assert sum(len(door.rooms) == 1 for door in doors) == 1, "one front door"


@pytest.mark.parametrize("name", FEW)
def test_a_bare_name_loads_it_quickly_and_nothing_overlaps_or_drifts(name: str):
    _loads_and_rests(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in home_names() if name not in FEW])
def test_every_other_home_loads_quickly_and_rests(name: str):
    _loads_and_rests(name)


def _loads_and_rests(name: str) -> None:
    load(name)  # reads the files once
    began = time.process_time()
    scene = load_scene(name)
    assert time.process_time() - began < 2.0
    model = scene.model
    model.opt.enableflags &= ~int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    data = start(model)
    owner = scene.tables.geom_object
    for k in range(data.ncon):
        a, b = owner[data.contact.geom[k]]
        assert a == b or data.contact.dist[k] > -1e-3, (scene.object_names[a], scene.object_names[b])
    loose = [o for o in scene.manifest.objects if not o.fixed and not o.parked]
    before = {o.name: place(scene, data, o.name) for o in loose}
    mujoco.mj_step(model, data, nstep=120)
    mujoco.mj_kinematics(model, data)
    moved = {o.name: float(np.linalg.norm(place(scene, data, o.name) - before[o.name])) for o in loose}
    assert max(moved.values()) < 0.02, max(moved, key=lambda n: moved[n])


@pytest.mark.parametrize("name", FEW[:1])
def test_everything_opens_under_20_newtons_or_5_newton_metres_and_stays_open_and_half_open(name: str):
    _opens_and_stays(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in home_names() if name not in FEW[:1]])
def test_everything_opens_and_stays_in_every_other_home(name: str):
    _opens_and_stays(name)


def _opens_and_stays(name: str) -> None:
    """Every joint that opens something, loose objects' too, with all else in the home as it stands."""
    scene = load(name)
    opened = [
        open_joint(scene.model, openable.joint, openable.closed, openable.open)
        for entry in scene.manifest.objects
        for openable in entry.openable
        if not entry.parked
    ]
    assert len(opened) >= 10
    assert not [result for result in opened if not result.works]


@pytest.mark.parametrize("name", FEW)
def test_a_closed_fridge_stays_closed_when_bumped_gently(name: str):
    """A bump of 0.3 N s at the free edge, outwards: something of 0.6 kg at 0.5 m/s."""
    scene = load(name)
    model = scene.model
    doors = [o for f in scene.manifest.objects if f.category == "fridge" for o in f.openable]
    assert doors
    for openable in doors:
        data = start(model)
        joint = model.joint(openable.joint)
        hinge = joint.type[0] == mujoco.mjtJoint.mjJNT_HINGE
        leaf = np.flatnonzero((model.geom_bodyid == model.jnt_bodyid[joint.id]) & (model.geom_group == 3))[0]
        v, arm = int(joint.dofadr[0]), 2 * model.geom_size[leaf, 1] if hinge else 1.0
        data.qfrc_applied[v] = np.sign(openable.open - openable.closed) * 0.3 * arm * 120
        mujoco.mj_step(model, data)
        data.qfrc_applied[v] = 0.0
        mujoco.mj_step(model, data, nstep=120)
        moved = (data.qpos[int(joint.qposadr[0])] - openable.closed) / (openable.open - openable.closed)
        assert 0 <= moved < 0.05, f"{openable.joint}: from 5 % of its range on it counts as open"


def test_the_bowl_holds_its_apple_when_the_table_is_shaken():
    scene = load("small_home")
    model, data = scene.model, start(scene.model)
    bowl, apple = (place(scene, data, n) for n in ("bowl_0", "apple_0"))
    dof = int(model.joint("bowl_0/free").dofadr[0])
    data.qvel[dof : dof + 2] = (0.15, 0.0)
    mujoco.mj_step(model, data, nstep=120)
    mujoco.mj_kinematics(model, data)
    gap = (place(scene, data, "apple_0") - place(scene, data, "bowl_0")) - (apple - bowl)
    assert np.linalg.norm(gap[:2]) < 0.05 and abs(gap[2]) < 0.02


def test_a_drawer_carries_the_towel_in_it():
    scene = load("small_home")
    model, data = scene.model, start(scene.model)
    cabinet = scene.object("bottom_cabinet_0")
    towel = place(scene, data, "dishtowel_0")
    floor = min(cabinet.openable, key=lambda o: abs(_body_height(model, data, o.joint) - towel[2]))
    joint = model.joint(floor.joint)
    q, v = int(joint.qposadr[0]), int(joint.dofadr[0])
    for _ in range(240):
        data.qfrc_applied[v] = 20.0 if data.qvel[v] < 0.3 else 0.0
        mujoco.mj_step(model, data)
    moved = place(scene, data, "dishtowel_0") - towel
    assert data.qpos[q] > 0.8 * floor.open
    assert np.linalg.norm(moved[:2]) > 0.7 * data.qpos[q]
    assert abs(moved[2]) < 0.01


def _body_height(model: mujoco.MjModel, data: mujoco.MjData, joint: str) -> float:
    return float(data.xipos[model.jnt_bodyid[model.joint(joint).id], 2])
