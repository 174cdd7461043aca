"""Batched cameras: tints and particles of each world, depth and segmentation against MuJoCo."""

from __future__ import annotations

import dataclasses
import gc
import pathlib

import engine_bench
import jax
import mujoco
import numpy as np
import pytest
import warp as wp
from bench_scene import TOP

from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.warp.engine import WarpEngine
from ig2mj.engine.warp.patches.graphs import Filled
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.sensors.batch_camera import BatchCamera
from ig2mj.sensors.images import RayPattern
from ig2mj.sensors.particle_slots import fill_slots
from ig2mj.sensors.render_model import make_render_model
from ig2mj.sensors.tints import TINTS, UNTINTED, tinted, tints, tints_of_geoms
from ig2mj.states import particles
from ig2mj.states.initial import initial_states
from ig2mj.states.model import StateModel

WIDTH, HEIGHT = 48, 40
"""Whole tiles of rays."""


@pytest.fixture(scope="session")
def bench_folder(tmp_path_factory) -> pathlib.Path:
    return tmp_path_factory.mktemp("bench")


@pytest.fixture(scope="module")
def scene(bench_folder):
    return engine_bench.bench_home(bench_folder, False)


@pytest.fixture(scope="module")
def model(scene) -> StateModel:
    return StateModel.of_manifest(scene.tables, scene.manifest)


@pytest.fixture(scope="module")
def view(scene):
    engine = NativeEngine(scene, 2, threads=1)
    return engine.view(engine.reset())


def dusty(model, states, scene, worlds):
    """Twenty particles of dust along the table's front edge."""
    x = np.linspace(-0.4, 0.4, 20)
    pos = np.stack([x, np.full(20, -0.25), np.full(20, 0.05)], -1)[None].astype(np.float32)
    body = np.full((1, 20), scene.model.body("table").id, np.int32)
    normal = np.tile(np.array([0, 0, 1], np.float32), (1, 20, 1))
    dust, _ = particles.place(states.dust, 0, body, pos, normal, np.ones((1, 20), bool), 20, np.asarray(worlds))
    return dataclasses.replace(states, dust=dust)


def with_value(states, field: str, world: int, thing: int, value: float):
    return dataclasses.replace(states, **{field: getattr(states, field).at[world, thing].set(value)})


# Tints.


def test_the_first_true_state_wins(model, scene):
    """iGibson's order: frozen, burnt, cooked, soaked, toggled on."""
    box = scene.object_index("box")
    assert [t.predicate.name for t in TINTS] == ["frozen", "burnt", "cooked", "soaked", "toggled_on"]
    states = initial_states(model, 1)
    assert (np.asarray(tints(model, states)) == UNTINTED).all()
    grey = np.full((1, 3), 0.5, np.float32)
    for field, value, name, colour in (
        ("wetness", 1e6, "soaked", (0.25, 0.25, 0.25 + 100 / 255)),
        ("max_temperature", 100.0, "cooked", (0.25 + 69.5 / 255, 0.25 + 34.5 / 255, 0.25 + 9.5 / 255)),
        ("max_temperature", 300.0, "burnt", (0.1, 0.1, 0.1)),
        ("temperature", -30.0, "frozen", (0.9, 0.9, 0.9)),
    ):
        states = with_value(states, field, 0, box, value)
        tint = np.asarray(tints(model, states))
        assert (tint[0] != UNTINTED).tolist() == [name == "box" for name in scene.object_names]
        assert TINTS[tint[0, box]].predicate.name == name
        assert np.asarray(tinted(grey, tint[:, [box]]))[0, 0] == pytest.approx(colour)


def test_a_switched_on_thing_is_brighter(tiny_home):
    model = StateModel.of_manifest(tiny_home.tables, tiny_home.manifest)
    stove = tiny_home.object_index("stove")
    states = initial_states(model, 1)
    states = dataclasses.replace(states, toggled_on=states.toggled_on.at[0, stove].set(True))
    of_geoms = tints_of_geoms(tints(model, states), np.array([stove, -1]))
    colour = np.asarray(tinted(np.array([[0.4, 0.8, 0.2]] * 2, np.float32), of_geoms))[0]
    assert colour[0] == pytest.approx([0.6, 1.0, 0.3])
    assert colour[1] == pytest.approx([0.4, 0.8, 0.2]), "what belongs to no object has no tint"


# Particles.


def test_slots_hold_the_first_particles_that_are_there(model, scene, view):
    states = dusty(model, initial_states(model, 2), scene, [False, True])
    alive = np.array(states.dust.alive)
    alive[1, 0, [0, 3]] = False
    states = dataclasses.replace(states, dust=dataclasses.replace(states.dust, alive=alive))
    slots = fill_slots(model, states, view, 16)
    assert (np.asarray(slots.owner)[0] == -1).all() and (np.asarray(slots.pos)[0, :, 2] < -10).all()
    assert (np.asarray(slots.owner)[1] == scene.object_index("table")).all()
    x = np.asarray(slots.pos)[1, :, 0]
    expected = np.delete(np.linspace(-0.4, 0.4, 20), [0, 3])[:16]
    assert x == pytest.approx(expected, abs=1e-6)
    assert np.asarray(slots.pos)[1, :, 2] == pytest.approx(0.4, abs=1e-6)
    np.testing.assert_allclose(np.asarray(slots.rotation)[1, 0], np.eye(3), atol=1e-6)


def test_slots_are_turned_to_the_surface(model, scene, view):
    states = dusty(model, initial_states(model, 2), scene, [True, True])
    normal = np.zeros((2, 1, 20, 3), np.float32)
    normal[..., 2], normal[0, 0, 0], normal[0, 0, 1] = 1, [1, 0, 0], [0, 0, -1]
    normal[0, 0, 2] = [0.6, 0.0, 0.8]
    states = dataclasses.replace(states, dust=dataclasses.replace(states.dust, normal=normal))
    axis = np.asarray(fill_slots(model, states, view, 20).rotation)[..., 2]
    np.testing.assert_allclose(axis, normal[:, 0], atol=1e-5)


def test_the_render_model_keeps_ids_and_moves_nothing(scene):
    render = make_render_model(scene, [mujoco.mjtGeom.mjGEOM_ELLIPSOID] * 5)
    assert (render.nv, render.nu, render.neq) == (0, 0, 0)
    assert [render.geom(g).name for g in range(scene.model.ngeom)] == [
        scene.model.geom(g).name for g in range(scene.model.ngeom)
    ]
    assert [render.camera(c).name for c in range(2)] == [scene.model.camera(c).name for c in range(2)]


def test_a_home_with_keyframes_and_meshes_has_a_render_model(tiny_home):
    assert make_render_model(tiny_home, ()).ngeom == tiny_home.model.ngeom


# Pictures.


@pytest.fixture(scope="module")
def engine(scene) -> WarpEngine:
    return WarpEngine(scene, 2)


@pytest.fixture(scope="module")
def physics(engine, scene):
    return engine.reset()


@pytest.fixture(scope="module")
def shoot(engine, model, physics):
    camera = BatchCamera(
        engine, model, ["front", "hand/eye"], width=WIDTH, height=HEIGHT, depth=True, segmentation=True, particles=32
    )
    call = jax.jit(camera.__call__)
    view = engine.view(physics)
    return lambda states, now=physics: jax.tree.map(np.asarray, call(now, view, states))


@pytest.mark.slow
def test_constants_of_programs_hold_no_unwritten_memory(engine, model, monkeypatch):
    """Another number in each process would give another program, which no cache has."""
    empty = wp.empty

    def marked(*arguments, **named):
        made = empty(*arguments, **named)
        if made.size and made.dtype in (wp.int32, wp.float32):
            made.fill_(12345)
        return made

    monkeypatch.setattr(wp, "empty", marked)
    camera = BatchCamera(engine, model, ["front"], width=8, height=8, particles=0)
    for path, leaf in jax.tree_util.tree_leaves_with_path((camera._template, camera._model)):
        assert not (np.asarray(leaf) == 12345).any(), jax.tree_util.keystr(path)


@pytest.mark.slow
def test_pictures_find_their_cuda_graphs_by_arrays_with_elements(engine, model, physics, monkeypatch):
    called, trace = [], Filled.__call__

    def noted(filled, *arrays, **named):
        called.append((filled, arrays))
        return trace(filled, *arrays, **named)

    monkeypatch.setattr(Filled, "__call__", noted)
    camera = BatchCamera(engine, model, ["front"], width=8, height=8, particles=0)
    view, states = engine.view(physics), initial_states(model, 2)
    jax.jit(lambda: camera(physics, view, states).rgb).trace()
    assert called
    for filled, arrays in called:
        counted = set(filled._call.array_input_indices)
        without = [filled._call.input_args[k].name for k in filled._indices if not arrays[k].size]
        assert "flexvert_xpos" in without  # there is nothing soft in it
        assert counted == {k for k in filled._indices if arrays[k].size}


@pytest.mark.slow
def test_a_compiled_program_goes_on_when_its_camera_is_gone(engine, model, physics):
    """What the ray caster keeps belongs to the camera in MJX; freed, a GPU would read memory of something else."""
    camera = BatchCamera(engine, model, ["front"], width=8, height=8, particles=0)
    view, states = engine.view(physics), initial_states(model, 2)
    call = jax.jit(lambda: camera(physics, view, states).rgb).lower().compile()
    before = np.asarray(call())
    del camera
    jax.clear_caches()
    gc.collect()
    np.testing.assert_array_equal(np.asarray(call()), before)


@pytest.mark.gpu
def test_programs_on_a_second_device_see_the_same(scene, model):
    devices = [d for d in jax.local_devices() if d.platform == "gpu"][:2]
    if len(devices) < 2:
        pytest.skip("needs two GPUs")
    with jax.default_device(devices[0]):
        engine = WarpEngine(scene, 2)
        camera = BatchCamera(engine, model, ["front"], width=WIDTH, height=HEIGHT, particles=0)
        camera.prepare_devices(devices)
        physics, states = engine.reset(), initial_states(model, 2)
    seen = []
    for device in devices:
        with jax.default_device(device):
            now = jax.device_put(physics, device)
            seen.append(np.asarray(jax.jit(lambda now: camera(now, engine.view(now), states).rgb)(now)))
    np.testing.assert_array_equal(seen[0], seen[1])


@pytest.mark.slow
def test_a_world_that_is_not_drawn_sees_nothing_and_the_other_what_it_saw(engine, model, physics, scene):
    rays = RayPattern("around", np.eye(3)[:2], 0.05, 10.0)
    options = {"width": WIDTH, "height": HEIGHT, "depth": True, "segmentation": True, "rays": [rays]}
    camera = BatchCamera(engine, model, ["front", "hand/eye"], **options)
    call, view, states = jax.jit(camera.__call__), engine.view(physics), initial_states(model, 2)
    above = np.tile(np.array([0, 0, TOP + 0.5], np.float32), (2, 1)), np.tile(np.eye(4, dtype=np.float32)[0], (2, 1))
    eyes = {"around": above}
    whole = call(physics, view, states, eyes, np.ones(2, bool))
    half = call(physics, view, states, eyes, np.array([False, True]))
    as_before = call(physics, view, states, eyes)
    for name in ("rgb", "depth", "geom"):
        pictures, seen = getattr(half, name), getattr(as_before, name)
        np.testing.assert_array_equal(getattr(whole, name), seen)
        np.testing.assert_array_equal(pictures[1], seen[1])
    assert (np.asarray(as_before.geom[0]) >= 0).any(), "there is something to be seen"
    assert (np.asarray(half.geom[0]) < 0).all() and not np.asarray(half.depth[0]).any()
    assert np.isinf(half.rays["around"][0]).all()


@pytest.mark.slow
@pytest.mark.parametrize("rows", [(8, 32), (5, 28)], ids=["of whole tiles", "of any"])
def test_rows_are_those_of_the_whole_picture(engine, model, physics, rows):
    options = {"width": WIDTH, "height": HEIGHT, "depth": True, "segmentation": True, "particles": 0}
    view, states = engine.view(physics), initial_states(model, 2)
    cameras = ["front", "hand/eye"]
    whole = jax.jit(BatchCamera(engine, model, cameras, **options).__call__)(physics, view, states)
    part = jax.jit(BatchCamera(engine, model, cameras, rows=rows, **options).__call__)(physics, view, states)
    for name, nothing in (("rgb", 0), ("depth", 0), ("segmentation", -1), ("geom", -1)):
        expected, seen = np.array(getattr(whole, name)), np.asarray(getattr(part, name))
        assert (expected[:, :, slice(*rows)] != nothing).any(), "there is something to be seen"
        expected[:, :, : rows[0]] = expected[:, :, rows[1] :] = nothing
        np.testing.assert_array_equal(seen, expected, err_msg=name)


@pytest.mark.slow
def test_a_cooked_object_changes_colour_in_its_world_only(shoot, model, scene):
    plain = initial_states(model, 2)
    before, after = shoot(plain), shoot(with_value(plain, "max_temperature", 1, scene.object_index("box"), 100.0))
    assert before.rgb.dtype == np.uint8 and before.rgb.shape == (2, 2, HEIGHT, WIDTH, 3)
    np.testing.assert_array_equal(before.rgb[0], after.rgb[0])
    changed = (before.rgb[1] != after.rgb[1]).any(-1)
    assert changed.any()
    box = before.segmentation[1] == scene.object_index("box")
    assert (changed <= box).all(), "nothing but the box"
    colour = after.rgb[1][box & changed].astype(float)
    assert (colour[:, 0] > colour[:, 2]).mean() > 0.9, "brown: more red than blue"


@pytest.mark.slow
def test_dust_is_seen_until_it_is_gone(shoot, model, scene):
    plain = initial_states(model, 2)
    clean, dirty = shoot(plain), shoot(dusty(model, plain, scene, [True, False]))
    assert (clean.rgb[0, 1] != dirty.rgb[0, 1]).any(-1).sum() > 10
    np.testing.assert_array_equal(clean.rgb[1], dirty.rgb[1])
    dust = dusty(model, plain, scene, [True, False])
    gone = dataclasses.replace(dust, dust=particles.remove(dust.dust, 0))
    np.testing.assert_array_equal(shoot(gone).rgb, clean.rgb)
    table = scene.object_index("table")
    assert (dirty.segmentation[0, 1] == clean.segmentation[0, 1]).mean() > 0.95
    assert (dirty.segmentation[0, 1][clean.rgb[0, 1].sum(-1) != dirty.rgb[0, 1].sum(-1)] == table).any()


@pytest.mark.slow
def test_depth_and_objects_are_mujocos(shoot, model, scene, engine, physics):
    """Against MuJoCo's own rays through the pixels' centres: planar depth in metres."""
    images = shoot(initial_states(model, 2))
    host, data = engine.to_mujoco(physics, 0)
    number = host.camera("front").id
    eye, frame = data.cam_xpos[number], data.cam_xmat[number].reshape(3, 3)
    half = np.tan(np.radians(host.cam_fovy[number]) / 2)
    groups = np.array([1, 1, 1, 0, 0, 0], np.uint8)
    owner = scene.tables.geom_object
    wrong_depth = wrong_object = 0
    for row in range(HEIGHT):
        for column in range(WIDTH):
            x = half * WIDTH / HEIGHT * (2 * (column + 0.5) / WIDTH - 1)
            y = half * (1 - 2 * (row + 0.5) / HEIGHT)
            ahead = frame @ (np.array([x, y, -1.0]) / np.linalg.norm([x, y, -1.0]))
            geom = np.zeros(1, np.int32)
            far = mujoco.mj_ray(host, data, eye, ahead, groups, 1, -1, geom)
            depth = 0.0 if far < 0 else far * float(ahead @ -frame[:, 2])
            seen = -1 if far < 0 else owner[geom[0]]
            wrong_depth += abs(images.depth[0, 0, row, column] - depth) > 1e-3
            wrong_object += images.segmentation[0, 0, row, column] != seen
    assert wrong_depth <= 0.01 * WIDTH * HEIGHT and wrong_object <= 0.01 * WIDTH * HEIGHT, "edges only"
    assert set(np.unique(images.segmentation)) >= {-1, scene.object_index("table"), scene.object_index("box")}


@pytest.mark.slow
def test_cameras_ride_on_their_bodies(shoot, model, engine):
    """The hand's eye goes where the hand goes, in world 1 only."""
    import jax.numpy as jnp

    states = initial_states(model, 2)
    snapshot = jax.tree.map(np.array, engine.snapshot(engine.reset()))
    address = engine.scene.model.joint("hand_z").qposadr[0]
    qpos = np.array(snapshot.qpos)
    qpos[1, address] = 0.15
    snapshot = snapshot.with_whole(qpos=qpos)
    moved = jax.jit(engine.load)(engine.reset(), jax.tree.map(jnp.asarray, snapshot))
    before, after = shoot(states), shoot(states, moved)
    np.testing.assert_array_equal(before.depth[0], after.depth[0])
    np.testing.assert_array_equal(before.depth[1, 0], after.depth[1, 0])
    middle = (HEIGHT // 2, WIDTH // 3)
    assert after.depth[1, 1][middle] - before.depth[1, 1][middle] == pytest.approx(0.15, abs=2e-3)


@pytest.mark.slow
def test_an_eye_that_its_controller_moves_is_where_it_says(engine, model, physics):
    """The hand's eye looks down on the table from 0.3 m above it in world 0 and from 0.5 m in world 1."""
    camera = BatchCamera(engine, model, ["hand/eye"], width=9, height=9, rgb=False, depth=True, particles=0)
    pos = np.array([[0.45, 0.25, TOP + 0.3], [0.45, 0.25, TOP + 0.5]], np.float32)
    quat = np.tile(np.array([1, 0, 0, 0], np.float32), (2, 1))
    eyes = {"hand/eye": (pos, quat)}
    images = jax.jit(camera)(physics, engine.view(physics), initial_states(model, 2), eyes)
    assert np.asarray(images.depth)[:, 0, 4, 4] == pytest.approx([0.3, 0.5], abs=2e-3)


@pytest.mark.parametrize(
    ("cameras", "options", "error", "says"),
    [
        (["frnt"], {}, UnknownNameError, "no camera is named 'frnt'; near matches: front"),
        ([], {}, EngineError, "a camera must have pixels"),
        (["front"], {"rgb": False}, EngineError, "a camera must have pixels"),
        (["front"], {"width": 0}, EngineError, "a camera must have pixels"),
    ],
)
def test_mistakes_are_typed(engine, model, cameras, options, error, says):
    with pytest.raises(error, match=says):
        BatchCamera(engine, model, cameras, **options)


def test_other_engines_have_no_batched_cameras(scene, model):
    with pytest.raises(EngineError, match="the native engine has no batched cameras"):
        BatchCamera(NativeEngine(scene), model, ["front"])  # type: ignore[arg-type]
