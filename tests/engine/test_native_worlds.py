"""Many worlds on the native engine: bitwise the same for any threads and numbers; saving, loading, starting asleep."""

from __future__ import annotations

import jax
import mujoco
import numpy as np
import pytest
import tiny_home as homes

import ig2mj
from ig2mj.agents.floating_hand import FloatingHand, add_floating_hand, hand_ctrl
from ig2mj.engine.base import Write
from ig2mj.engine.model_fields import ModelFields
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.registry import make_engine
from ig2mj.engine.view import SCHEMA, PhysicsView, read_field
from ig2mj.errors import EngineError, UnknownNameError


@pytest.fixture(scope="module")
def hand_home(tiny_home_folder) -> ig2mj.Scene:
    """The tiny home with a hand beside the box on the table."""
    return ig2mj.load_scene(tiny_home_folder, agents=[FloatingHand(pos=(0.1, 0.2, 0.65))])


def push(world: int, step: int) -> np.ndarray:
    """Controls that differ from world to world."""
    return hand_ctrl((0.02 * world, -0.03 * step, 0.0), (0, 0, 0.2 * world), closed=min(1.0, 0.1 * step))


def rollout(engine: NativeEngine, worlds: list[int], steps: int, physics=None) -> list[PhysicsView]:
    """Steps the engine; its row w does what world `worlds[w]` does."""
    physics = engine.reset() if physics is None else physics
    number = engine.tables.num_objects
    can = engine.scene.object_index("can")
    mask = np.zeros((len(worlds), number), bool)
    pos, quat = np.zeros((len(worlds), number, 3)), np.tile([1.0, 0, 0, 0], (len(worlds), number, 1))
    for row, world in enumerate(worlds):
        mask[row, can] = world % 2 == 1
        pos[row, can] = 0.3, 0.2, 0.7 + 0.1 * world
    physics = engine.write(physics, Write(object_mask=mask, object_pos=pos, object_quat=quat))
    views = []
    for step in range(steps):
        physics, view = engine.step(physics, np.stack([push(w, step) for w in worlds]))
        views.append(view)
    return views


def assert_rows_equal(one: PhysicsView, row: int, other: PhysicsView, other_row: int) -> None:
    for name in SCHEMA:
        np.testing.assert_array_equal(read_field(one, name)[row], read_field(other, name)[other_row], err_msg=name)


def test_worlds_do_not_depend_on_threads_or_on_each_other_bitwise(hand_home):
    """The same for any thread count; and one world is row w of four."""
    four = rollout(NativeEngine(hand_home, 4, threads=1), [0, 1, 2, 3], 15)
    for threads in (2, 3, 4):
        again = rollout(NativeEngine(hand_home, 4, threads=threads), [0, 1, 2, 3], 15)
        for row in range(4):
            for one, other in zip(four, again, strict=True):
                assert_rows_equal(one, row, other, row)
    for world in (1, 3):
        alone = rollout(NativeEngine(hand_home), [world], 15)
        for one, other in zip(four, alone, strict=True):
            assert_rows_equal(one, world, other, 0)
    assert not np.array_equal(four[-1].object_pos[0], four[-1].object_pos[1]), "the worlds do differ"


@pytest.mark.parametrize(("steps", "threads"), [(4, 1), (25, 2)])
def test_a_world_saved_and_loaded_goes_on_bitwise(hand_home, steps: int, threads: int):
    """While the hand pushes, some objects sleep and some move; physics and view go on the same."""
    engine = NativeEngine(hand_home)
    physics = engine.reset()
    for step in range(steps):
        physics, _ = engine.step(physics, push(1, step)[None])
    saved = engine.export(physics, 0)
    other = NativeEngine(hand_home, 3, threads=threads)
    copies = other.load(other.reset(), saved)
    assert other.time(copies).tolist() == [engine.time(physics)[0]] * 3
    for step in range(steps, steps + 25):
        physics, view = engine.step(physics, push(1, step)[None])
        copies, others = other.step(copies, np.stack([push(1, step)] * 3))
        for row in range(3):
            assert_rows_equal(view, 0, others, row)
    end, last = engine.export(physics, 0), other.export(copies, 2)
    for a, b in zip(jax.tree.leaves(end), jax.tree.leaves(last), strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_sleeping_world_is_loaded_asleep_with_its_memory(tiny_home):
    engine = NativeEngine(tiny_home)
    physics = engine.reset()
    for _ in range(60):
        physics, view = engine.step(physics)
    saved = engine.export(physics, 0)
    assert (saved.tree_asleep >= 0).all()
    other = NativeEngine(tiny_home, 2)
    copies = other.load(other.reset(), saved, np.array([False, True]))
    loaded = other.view(copies)
    assert_rows_equal(view, 0, loaded, 1)
    assert loaded.awake[0].any() and not loaded.awake[1].any(), "only the masked world was replaced"
    copies, after = other.step(copies)
    assert_rows_equal(loaded, 1, after, 1)


def test_snapshots_share_no_memory_with_the_engine(tiny_home):
    engine = NativeEngine(tiny_home)
    physics = engine.reset()
    saved = engine.export(physics, 0)
    kept = saved.qpos.copy()
    physics, _ = engine.step(physics)
    np.testing.assert_array_equal(saved.qpos, kept)
    engine.step(engine.load(physics, saved))
    np.testing.assert_array_equal(saved.qpos, kept)


def test_each_world_gets_its_own_row_of_a_batch_of_snapshots(tiny_home):
    engine = NativeEngine(tiny_home, 2)
    physics = engine.reset()
    saved = engine.export(physics, 0)
    batch = jax.tree.map(lambda a: np.stack([a] * 2), saved)
    batch.time[:] = 1.0, 2.0
    batch.qpos[1, engine.layout.object_qposadr[tiny_home.object_index("ball")]] += 0.25
    physics = engine.load(physics, batch)
    assert engine.time(physics).tolist() == [1.0, 2.0]
    ball = engine.view(physics).object_pos[:, tiny_home.object_index("ball"), 0]
    assert ball[1] - ball[0] == pytest.approx(0.25)
    with pytest.raises(EngineError, match="2 snapshots do not fit 1 worlds"):
        one = NativeEngine(tiny_home)
        one.load(one.reset(), batch)


def test_a_snapshot_of_another_scene_is_refused(tiny_home, hand_home):
    engine, other = NativeEngine(tiny_home), NativeEngine(hand_home)
    with pytest.raises(EngineError, match="does not fit scene 'tiny_home'"):
        engine.load(engine.reset(), other.export(other.reset(), 0))


def test_equality_parameters_are_each_worlds_own(tiny_home_folder):
    """On the native engine: worlds that share a thread share a model, but not eq_data."""

    def add(spec):
        entry = add_floating_hand(spec, pos=(0.1, 0, 0.8))
        spec.add_equality(
            type=mujoco.mjtEq.mjEQ_WELD, objtype=mujoco.mjtObj.mjOBJ_BODY, name1="hand", name2="box", active=False
        )
        return entry

    scene = ig2mj.load_scene(tiny_home_folder, agents=[add])
    engine = NativeEngine(scene, 2, threads=1)
    physics = engine.reset()
    data = np.stack([engine.export(physics, 0).eq_data] * 2)
    data[:, 0, :10] = 0, 0, 0, 0, 0, -0.25, 1, 0, 0, 0
    data[1, 0, 3] = 0.1
    physics = engine.write(physics, Write(eq_active=np.array([[True], [True]]), model_fields=ModelFields(eq_data=data)))
    for _ in range(30):
        physics, view = engine.step(physics)
    box = view.object_pos[:, scene.object_index("box")]
    assert box[1, 0] - box[0, 0] == pytest.approx(0.1, abs=5e-3)
    assert view.held[:, 0, scene.object_index("box")].all()


def test_trees_that_start_asleep_know_what_they_touch(tmp_path):
    homes.write_tiny_home(tmp_path)
    scene = ig2mj.load_scene(tmp_path)
    simulation = ig2mj.Simulation(scene)
    simulation.step(count=60)
    ball, rest = simulation.scene.object_index("ball"), simulation.object_pose("ball")[0]
    text = (tmp_path / "scene.xml").read_text()
    old = '<body name="ball" pos="-1 -1 0.1" quat="1 0 0 0">'
    assert old in text
    new = f'<body name="ball" sleep="init" pos="-1 -1 {rest[2]}">'
    (tmp_path / "scene.xml").write_text(text.replace(old, new))
    view = ig2mj.Simulation(tmp_path).view
    assert not view.awake[0, ball]
    assert view.touching[0, ball, scene.object_index("floor")]
    assert view.awake[0, scene.object_index("box")]
    assert view.touching[0, scene.object_index("box"), scene.object_index("table")]


def test_worlds_start_at_the_first_keyframe(tmp_path):
    homes.write_tiny_home(tmp_path)
    scene = ig2mj.load_scene(tmp_path)
    qpos = scene.model.qpos0.copy()
    qpos[scene.model.joint("cabinet_drawer_slide").qposadr[0]] = 0.2
    key = f'<keyframe><key name="start" qpos="{" ".join(map(str, qpos))}"/></keyframe></mujoco>'
    text = (tmp_path / "scene.xml").read_text()
    (tmp_path / "scene.xml").write_text(text.replace("</mujoco>", key))
    assert ig2mj.Simulation(tmp_path).view.joint_pos[0, 0] == pytest.approx(0.2)
    with_hand = ig2mj.Simulation(ig2mj.load_scene(tmp_path, agents=[add_floating_hand]))
    assert with_hand.view.joint_pos[0, 0] == pytest.approx(0.2)
    assert with_hand.view.agent.base_pos[0, 0] == pytest.approx([0, 0, 1])


def test_one_bad_world_stops_no_other(tiny_home, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its own log beside the caller
    engine = NativeEngine(tiny_home, 3, threads=2)
    physics = engine.reset()
    engine.to_mujoco(physics, 1)[1].qvel[2] = np.inf
    with pytest.raises(EngineError, match=r"world 1: .* of .*'box'"):
        engine.step(physics)
    assert engine.time(physics) == pytest.approx([1 / 30] * 3)
    physics = engine.load(physics, engine.export(physics, 0), np.array([False, True, False]))
    physics, view = engine.step(physics)
    np.testing.assert_array_equal(view.object_pos[1], view.object_pos[2])


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"boxes": "loose"}, "there is no box rule 'loose' (rules: tight, igibson)"),
        ({"num_worlds": 0}, "num_worlds = 0"),
        ({"substeps": 0}, "substeps = 0"),
        ({"timestep": float("nan")}, "timestep = nan"),
        ({"threads": 0}, "threads = 0"),
    ],
)
def test_bad_arguments_are_refused_in_one_line(tiny_home, options, says):
    with pytest.raises(EngineError) as error:
        NativeEngine(tiny_home, **options)
    assert says in str(error.value) and "\n" not in str(error.value)


def test_an_unknown_engine_lists_near_matches(tiny_home):
    with pytest.raises(UnknownNameError, match="near matches: native"):
        make_engine("nativ", tiny_home)


def test_substeps_and_timestep_make_the_control_step(tiny_home):
    engine = NativeEngine(tiny_home, substeps=1, timestep=1 / 240)
    physics, _ = engine.step(engine.reset())
    assert engine.time(physics)[0] == pytest.approx(1 / 240)
    assert tiny_home.model.opt.timestep == pytest.approx(1 / 120), "the scene's own model is left alone"


def test_a_world_that_sleeps_as_a_whole_is_left_as_mujoco_would_leave_it(tiny_home):
    """The native engine passes over the physics of a sleeping world; MuJoCo itself must agree to the bit."""
    engine = NativeEngine(tiny_home)
    physics = engine.reset()
    for _ in range(150):
        physics, view = engine.step(physics)
    assert not np.asarray(view.awake).any()
    before = engine.export(physics, 0)
    model, data = engine.to_mujoco(physics, 0)
    other = mujoco.MjData(model)
    mujoco.mj_copyData(other, model, data)
    for _ in range(5):
        physics, _ = engine.step(physics)
    mujoco.mj_step2(model, other)
    mujoco.mj_step(model, other, nstep=5 * engine.substeps - 1)
    after = engine.export(physics, 0)
    for name in ("qpos", "qvel", "qacc_warmstart", "tree_asleep", "act"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name), err_msg=name)
        np.testing.assert_array_equal(getattr(after, name), getattr(other, name), err_msg=name)
    assert float(after.time) == other.time


def test_a_push_from_outside_wakes_a_sleeping_world(tiny_home):
    """A force applied by hand, as the viewer's mouse does, is not passed over."""
    engine = NativeEngine(tiny_home)
    physics = engine.reset()
    for _ in range(150):
        physics, view = engine.step(physics)
    ball = tiny_home.object_index("ball")
    start = np.array(view.object_pos)[0, ball]
    _, data = engine.to_mujoco(physics, 0)
    data.xfrc_applied[tiny_home.tables.object_root[ball], 2] = 50.0
    for _ in range(5):
        physics, view = engine.step(physics)
    assert np.asarray(view.awake)[0, ball]
    assert np.linalg.norm(np.asarray(view.object_pos)[0, ball] - start) > 0.01
