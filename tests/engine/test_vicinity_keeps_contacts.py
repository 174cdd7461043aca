"""What is kept out of the broad phase could have had no contact: motion and contacts are MuJoCo's own, bit for bit."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import mujoco
import numpy as np
import pytest

import ig2mj
from ig2mj.agents.floating_hand import FloatingHand, hand_ctrl
from ig2mj.engine.native import vicinity
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.native.vicinity import Masks, Vicinity, VicinityTable
from ig2mj.engine.view import SCHEMA, read_field

Act = Callable[[int, mujoco.MjData, np.random.Generator], None]
GEOM = 'gap="0.003" friction="0.25 0.005 0.0001"'
ARM = f"""
<body name="arm" pos="0 0 0.3">
  <joint name="x" type="slide" axis="1 0 0"/><joint name="y" type="slide" axis="0 1 0"/>
  <geom size="0.05" {GEOM}/>
  <body pos="0.1 0 0"><joint name="elbow" axis="0 0 1"/>
    <geom type="capsule" fromto="0.05 0 0 0.4 0 0" size="0.03" {GEOM}/>
    <body pos="0.45 0 0"><joint name="wrist" pos="-0.02 0 0" axis="0 1 0"/>
      <geom type="box" size="0.04 0.04 0.04" {GEOM}/></body>
  </body>
</body>"""
CABINET = f"""
<body name="cabinet_{{0}}" pos="{{1}} {{2}} 0.4">
  <geom type="box" size="0.02 0.3 0.4" {GEOM}/><geom type="box" pos="0.3 0.28 0" size="0.3 0.02 0.4" {GEOM}/>
  <body pos="0.0 -0.3 0"><joint name="door_{{0}}" axis="0 0 1" damping="0.1"/>
    <geom type="box" pos="0.3 0 0" size="0.28 0.01 0.35" {GEOM}/></body>
</body>"""
MOTORS = "".join(f'<velocity joint="{j}" kv="{kv}"/>' for j, kv in (("x", 60), ("y", 60), ("elbow", 3), ("wrist", 1)))


def _home(rng: np.random.Generator) -> mujoco.MjModel:
    """Towers and single objects on a floor, cabinets with doors, an arm that drives among them, a welded pair."""
    bodies, number = [], 0
    for _ in range(28):
        x, y = rng.uniform(0.4, 3, 2) * rng.choice([-1, 1], 2)
        for level in range(int(rng.integers(1, 4))):
            shape = rng.choice(['type="box" size="0.08 0.08 0.08"', 'type="cylinder" size="0.08 0.08"'])
            z = 0.081 + 0.161 * level
            bodies.append(
                f'<body name="thing_{number}" pos="{x} {y} {z}"><freejoint/><geom {shape} density="300" {GEOM}/></body>'
            )
            number += 1
    bodies += [CABINET.format(k, *(3 * rng.uniform(-1, 1, 2) + (0, 5))) for k in range(3)]
    xml = f"""<mujoco>
      <option timestep="{1 / 120}" gravity="0 0 -9.8" integrator="implicitfast"><flag sleep="enable"/></option>
      <worldbody><body name="floor"><geom type="box" size="6 12 0.05" pos="0 0 -0.05" {GEOM}/></body>
      {ARM}{"".join(bodies)}</worldbody>
      <equality><weld body1="thing_0" body2="thing_{number - 1}"/></equality>
      <actuator>{MOTORS}</actuator></mujoco>"""
    return mujoco.MjModel.from_xml_string(xml)


def _equality_tree(model: mujoco.MjModel) -> np.ndarray:
    return model.body_treeid[np.stack([model.eq_obj1id, model.eq_obj2id], 1)]


def _run(model: mujoco.MjModel, steps: int, masked: bool, act: Act, seed: int = 1) -> tuple[list[tuple], int]:
    """What every physics step left, and in how many a mask stood; `act` does something before each control step."""
    rng, data = np.random.default_rng(seed), mujoco.MjData(model)
    table = VicinityTable.build(model, _equality_tree(model))
    assert table.usable
    masks, near, found, closed = Masks(table, model), Vicinity(table, model, data), [], 0
    mujoco.mj_step1(model, data)
    for step in range(steps):
        act(step, data, rng)
        if masked:
            near.begin()
            masks.put(near.contype, near.conaffinity)
        for substep in range(4):
            (mujoco.mj_step if substep else mujoco.mj_step2)(model, data)
            if masked:
                near.moved()
                masks.put(near.contype, near.conaffinity)
                closed += not near.open
            pairs = np.array(data.contact.geom).tobytes()
            found.append((data.qpos.tobytes(), data.qvel.tobytes(), pairs, data.tree_awake.tobytes()))
        mujoco.mj_step1(model, data)
        data.xfrc_applied[:] = 0.0
    masks.open()
    return found, closed


def _assert_same(model: mujoco.MjModel, steps: int, act: Act) -> int:
    """Both ways are bitwise the same; says in how many physics steps a mask stood."""
    plain, _ = _run(model, steps, False, act)
    ours, closed = _run(model, steps, True, act)
    for step, (a, b) in enumerate(zip(plain, ours, strict=True)):
        assert a == b, f"physics step {step}"
    return closed


def _drive(step: int, data: mujoco.MjData, rng: np.random.Generator) -> None:
    if step % 20 == 0:
        data.ctrl[:] = rng.uniform(-1, 1, 4) * (4.0, 4.0, 10.0, 20.0)


def _drive_and_kick(step: int, data: mujoco.MjData, rng: np.random.Generator) -> None:
    """Also from outside, into what sleeps."""
    _drive(step, data, rng)
    if step % 50 == 25:
        data.qvel[int(rng.integers(len(data.qvel) - 6))] += rng.choice([-0.0, 0.01, 8.0])
    if step % 70 == 35:
        data.xfrc_applied[int(rng.integers(2, len(data.xpos))), 2] = 40.0


@pytest.fixture(autouse=True)
def _looks_often(monkeypatch):
    """Small scenes, too, and whatever moves in them."""
    for name, value in (("PATIENCE", 8), ("WORTHWHILE", 1), ("LASTING", 0), ("PAYS", 0)):
        monkeypatch.setattr(vicinity, name, value)


@pytest.mark.parametrize("reach", [0.25, 0.1])
@pytest.mark.parametrize("seed", range(6))
def test_motion_and_contacts_are_bitwise_those_of_plain_mujoco(seed, reach, monkeypatch):
    monkeypatch.setattr(vicinity, "SPHERE_MARGIN", reach)
    model = _home(np.random.default_rng(seed))
    closed = _assert_same(model, 240, _drive_and_kick if seed % 2 else _drive)
    assert closed > 200  # of 960 physics steps


def _spinner(others: str, equality: str = "") -> mujoco.MjModel:
    """A ball that a motor turns about the origin, 0.9 m away, over a floor; and far off ten balls that sleep."""
    balls = "".join(f'<body pos="{20 + k} 0 0.05"><freejoint/><geom size="0.05" {GEOM}/></body>' for k in range(10))
    return mujoco.MjModel.from_xml_string(f"""<mujoco>
      <option timestep="{1 / 120}" gravity="0 0 -9.8" integrator="implicitfast"><flag sleep="enable"/></option>
      <worldbody><body name="floor"><geom type="box" size="40 12 0.05" pos="0 0 -0.05" {GEOM}/></body>
      <body pos="0 0 0.5"><joint name="spin" axis="0 0 1" armature="1"/>
        <body pos="0.9 0 0"><geom size="0.05" {GEOM}/></body></body>
      {balls}{others}</worldbody><equality>{equality}</equality>
      <actuator><velocity joint="spin" kv="50"/></actuator></mujoco>""")


PLINTH = f'<body pos="{{0}} {{1}} 0.2"><geom type="box" size="0.1 0.1 0.2" {GEOM}/></body>'
BOX = f'<body name="{{2}}" pos="{{0}} {{1}} 0.5"><freejoint/><geom type="box" size="0.1 0.1 0.1" {GEOM}/></body>'


def _spin_from(first: int):
    def act(step: int, data: mujoco.MjData, rng: np.random.Generator) -> None:
        data.ctrl[:] = 6.0 if step >= first else 0.0

    return act


def test_a_ball_on_a_beam_meets_what_stands_in_its_way():
    model = _spinner(PLINTH.format(0, 0.9) + BOX.format(0, 0.9, "box"))
    assert _assert_same(model, 60, _spin_from(10)) > 100
    plain, _ = _run(model, 60, False, _spin_from(10))
    assert plain[-1][0] != plain[20][0] and len({p[3] for p in plain[40:]}) > 1  # the box slept and was hit


def test_what_a_weld_wakes_far_away_keeps_its_support():
    pair = PLINTH.format(0, 0.9) + BOX.format(0, 0.9, "near") + PLINTH.format(0, 5) + BOX.format(0, 5, "far")
    model = _spinner(pair, '<weld body1="near" body2="far"/>')
    assert _assert_same(model, 60, _spin_from(20)) > 100


def test_a_minus_zero_from_outside_wakes_with_all_contacts():
    model = _spinner(PLINTH.format(0, 5) + BOX.format(0, 5, "box"))

    def act(step: int, data: mujoco.MjData, rng: np.random.Generator) -> None:
        if step in (30, 45):
            assert data.ntree_awake == 1
            data.qvel[model.jnt_dofadr[-1] + 2] = -0.0

    assert _assert_same(model, 60, act) > 100


def test_a_tower_far_away_is_kept_out_and_one_in_reach_is_let_in_whole():
    model = _home(np.random.default_rng(0))
    data = mujoco.MjData(model)
    table = VicinityTable.build(model, np.zeros((0, 2), int))
    for _ in range(600):
        mujoco.mj_step(model, data)
    assert data.ntree_awake == 1  # the arm
    mujoco.mj_step1(model, data)
    near = Vicinity(table, model, data)
    near.begin()
    assert not near.open
    names = {model.body(int(b)).name for b in np.flatnonzero(near.contype)}
    assert {"arm", "floor"} <= names
    assert not any(n.startswith("cabinet") for n in names)
    things = [n for n in names if n.startswith("thing")]
    assert len(things) < 6
    assert near.contype is not table.contype and (near.contype <= table.contype).all()


def test_where_masks_do_not_last_everything_stays_in(monkeypatch):
    monkeypatch.setattr(vicinity, "PAYS", 500)
    model = _home(np.random.default_rng(0))
    assert 0 < _assert_same(model, 240, _drive) < _masked_always(model, monkeypatch)
    monkeypatch.setattr(vicinity, "WORTHWHILE", 10_000)
    assert not VicinityTable.build(model, _equality_tree(model)).usable


def _masked_always(model: mujoco.MjModel, monkeypatch) -> int:
    with monkeypatch.context() as within:
        within.setattr(vicinity, "PAYS", 0)
        return _run(model, 240, True, _drive)[1]


def test_models_that_are_not_understood_are_left_alone():
    xml = """<mujoco><worldbody><body name="m" mocap="true"><geom size="0.1"/></body>
      <body pos="0 0 1"><freejoint/><geom size="0.1"/></body></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    near = Vicinity(VicinityTable.build(model, np.zeros((0, 2), int)), model, data)
    for _ in range(40):
        near.begin()
        near.moved()
    assert near.open


def test_planes_and_the_world_stay_in():
    xml = f"""<mujoco><option><flag sleep="enable"/></option><worldbody><body><geom type="plane" size="1 1 1"/></body>
      <geom size="0.1" pos="9 9 9"/>
      {"".join(f'<body pos="{5 * k} 0 1"><freejoint/><geom size="0.1" {GEOM}/></body>' for k in range(8))}
      </worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    while data.ntree_awake != 0:
        mujoco.mj_step(model, data)
    data.qvel[2] = 1.0  # the first one hops
    mujoco.mj_step(model, data)
    mujoco.mj_step1(model, data)
    near = Vicinity(VicinityTable.build(model, np.zeros((0, 2), int)), model, data)
    near.begin()
    assert np.flatnonzero(near.contype).tolist() == [0, 1, 2]


def test_the_engine_with_a_hand_is_bitwise_the_same_and_shows_no_mask(tiny_home_folder, monkeypatch):
    scene = ig2mj.load_scene(tiny_home_folder, agents=[FloatingHand(pos=(0.1, 0.2, 0.65))])
    ours = NativeEngine(scene)
    build = VicinityTable.build
    monkeypatch.setattr(VicinityTable, "build", lambda *args: dataclasses.replace(build(*args), usable=False))
    plain, closed = NativeEngine(scene), 0
    one, two = ours.reset(), plain.reset()
    for step in range(60):
        ctrl = hand_ctrl((0.01 * min(step, 20), -0.02 * step, 0.0), (0, 0, 0), closed=0.0)[None]
        (one, a), (two, b) = ours.step(one, ctrl), plain.step(two, ctrl)
        closed += not one.worlds[0]._near.open
        assert two.worlds[0]._near.open
        for name in SCHEMA:
            np.testing.assert_array_equal(read_field(a, name), read_field(b, name), err_msg=name)
        np.testing.assert_array_equal(ours.to_mujoco(one, 0)[0].body_contype, scene.model.body_contype)
    assert closed > 10
