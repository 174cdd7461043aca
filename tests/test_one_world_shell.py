"""`ig2mj.Simulation`: moving objects by name, and what it says when that makes no sense."""

from __future__ import annotations

import numpy as np
import pytest

import ig2mj
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.errors import EngineError, PoseError, UnknownNameError


@pytest.fixture
def simulation(tiny_home) -> ig2mj.Simulation:
    return ig2mj.Simulation(tiny_home)


def test_a_scene_may_be_given_by_its_path(tiny_home_folder):
    assert ig2mj.Simulation(tiny_home_folder).scene.name == "tiny_home"


def test_time_passes_in_thirtieths_of_a_second(simulation):
    assert simulation.time == 0.0
    simulation.step()
    assert simulation.time == pytest.approx(1 / 30)
    simulation.step(count=29)
    assert simulation.time == pytest.approx(1.0)


def test_a_pose_that_is_set_is_the_pose_that_is_read(simulation):
    quat = np.array([0.5, -0.5, 0.5, 0.5])
    simulation.set_object_pose("apple", [0.1, 0.2, 1.3], 3 * quat)
    pos, turn = simulation.object_pose("apple")
    assert pos == pytest.approx([0.1, 0.2, 1.3]) and turn == pytest.approx(quat)
    simulation.set_object_pose("apple", [0.1, 0.2, 1.4])
    assert simulation.object_pose("apple")[1] == pytest.approx(quat), "no rotation given: it stays"


def test_what_is_put_somewhere_is_at_rest(simulation):
    simulation.set_object_pose("box", [0, 0, 1.5])
    simulation.step(count=5)
    simulation.set_object_pose("box", [0, 0, 1.5])
    dof = simulation.model.joint("box/free").dofadr[0]
    assert (simulation.data.qvel[dof : dof + 6] == 0).all()


def test_joints_are_set_and_read_by_name(simulation):
    simulation.set_joint("cabinet_door_hinge", 1)
    assert simulation.joint("cabinet_door_hinge") == 1.0
    assert simulation.view.joint_pos[0].tolist() == [0.0, 1.0]


def test_reset_brings_the_start_back(simulation):
    start, held = simulation.view.object_pos, simulation.data
    simulation.set_object_pose("box", [0, 0, 1.5])
    simulation.step(count=10)
    simulation.reset()
    assert simulation.time == 0.0 and simulation.data is held
    np.testing.assert_array_equal(simulation.view.object_pos, start)


def test_forward_takes_up_what_was_changed_by_hand(simulation):
    simulation.step(count=60)
    simulation.data.joint("ball/free").qpos[:3] = [0.5, 0.5, 1.0]
    assert simulation.object_pose("ball")[0] == pytest.approx([-1, -1, 0.1], abs=1e-3)
    view = simulation.forward()
    assert simulation.object_pose("ball")[0] == pytest.approx([0.5, 0.5, 1.0])
    assert view.awake[0, simulation.scene.object_index("ball")]
    assert simulation.time == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("call", "error", "says"),
    [
        (
            lambda s: s.set_object_pose("bok", [0, 0, 1]),
            UnknownNameError,
            "no object is named 'bok'; near matches: book",
        ),
        (lambda s: s.object_pose("bok"), UnknownNameError, "near matches: book"),
        (lambda s: s.set_object_pose("table", [0, 0, 1]), PoseError, "object 'table' is fixed"),
        (lambda s: s.set_object_pose("box", [0, 0, np.nan]), PoseError, "position of object 'box' is not finite"),
        (lambda s: s.set_object_pose("box", [0, 0, 1e30]), PoseError, "position of object 'box' is beyond the 1e"),
        (lambda s: s.set_object_pose("box", [0, 0, 1], [1, 0, 0, np.inf]), PoseError, "rotation of object 'box'"),
        (lambda s: s.set_object_pose("box", [0, 0, 1], [0, 0, 0, 0]), PoseError, "zero quaternion"),
        (lambda s: s.set_object_pose("box", [0, 1]), PoseError, "needs 3 numbers"),
        (lambda s: s.set_joint("cabinet_drawer", 0.1), UnknownNameError, "near matches: cabinet_drawer_slide"),
        (lambda s: s.set_joint("cabinet_drawer_slide", np.nan), PoseError, "is not finite"),
        (lambda s: s.set_joint("cabinet_drawer_slide", 5), PoseError, "goes from 0 to 0.3 m; 5 is beyond its range"),
        (lambda s: s.set_joint("cabinet_drawer_slide", -0.01), PoseError, "is beyond its range"),
        (lambda s: s.set_joint("box/free", 0.1), PoseError, "is neither a hinge nor a slide"),
        (lambda s: s.joint("box/free"), PoseError, "is neither a hinge nor a slide"),
        (lambda s: s.step([0.0]), EngineError, "has 0 actuators"),
    ],
)
def test_mistakes_are_typed_and_change_nothing(simulation, call, error, says):
    before = simulation.view
    with pytest.raises(error) as caught:
        call(simulation)
    assert says in str(caught.value) and "\n" not in str(caught.value)
    assert simulation.view is before


def test_a_simulation_is_one_world(tiny_home):
    with pytest.raises(EngineError, match="the engine has 2"):
        ig2mj.Simulation(tiny_home, NativeEngine(tiny_home, 2))
    assert ig2mj.Simulation(tiny_home, NativeEngine(tiny_home, substeps=1)).engine.substeps == 1


def test_a_simulation_goes_on_from_a_world_of_a_batch(tiny_home):
    """How one looks at world 1 of many: `engine.export(world)`."""
    engine = NativeEngine(tiny_home, 2)
    physics = engine.reset()
    for _ in range(3):
        physics, view = engine.step(physics)
    states = ig2mj.Simulation(tiny_home).states
    wet = states.replace(wetness=states.wetness + 4)
    simulation = ig2mj.Simulation.from_snapshot(tiny_home, engine.export(physics, 1), wet)
    assert simulation.time == pytest.approx(0.1)
    np.testing.assert_array_equal(simulation.view.object_pos[0], view.object_pos[1])
    assert (np.asarray(simulation.states.wetness) == 4).all()
    simulation.step(count=5)
    simulation.reset()
    np.testing.assert_array_equal(simulation.view.object_pos[0], view.object_pos[1])


def test_a_simulation_is_a_batch_of_one(simulation):
    simulation.set_object_pose("apple", [0.1, 0.2, 1.3])
    other = simulation.fork()
    simulation.step(count=2)
    for _ in range(2):
        other.batch, status = other.core.step(other.batch)
    assert status.holds.shape == (1,) and int(other.world.step[0]) == int(simulation.world.step[0]) == 2
    np.testing.assert_array_equal(other.data.qpos, simulation.data.qpos)
    np.testing.assert_array_equal(other.states.temperature, simulation.states.temperature)
