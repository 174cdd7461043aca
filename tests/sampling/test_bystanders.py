"""What a placement or an opened door does not cause is no reason to refuse it; what it does cause is."""

from __future__ import annotations

import collections

import numpy as np
import pytest

import ig2mj
from ig2mj.agents import Fetch
from ig2mj.envs.registry import find_task
from ig2mj.errors import StateError
from ig2mj.sampling.budget import Budget
from ig2mj.sampling.bystanders import MOVED, Bystanders
from ig2mj.sampling.conditions import read_conditions
from ig2mj.sampling.joints import JointMover
from ig2mj.sampling.many import make_sampler, sample_row
from ig2mj.sampling.query import SceneQuery
from ig2mj.tasks.pools import bare_scene
from ig2mj.tasks.task import Task

BEFORE_THE_CABINET = (1.1, -0.15, 0.05)
"""Of the box's middle: the door sweeps over it, and the drawer passes above."""


@pytest.fixture(scope="module")
def resting(tiny_home):
    return make_sampler(tiny_home)


@pytest.fixture
def simulation(tiny_home):
    made = ig2mj.Simulation(tiny_home)
    made.step(count=60)
    return made


def test_motion_that_a_change_does_not_cause_is_told_apart_from_what_it_does(tiny_home):
    query = SceneQuery(tiny_home)
    query.settle()
    ball, box = (tiny_home.object_index(name) for name in ("ball", "box"))
    query.place(ball, np.array([-1.0, -1.0, 0.5]), np.array([1.0, 0, 0, 0]))
    others = Bystanders(query, query.save())
    query.place(box, np.array([0.1, 0.1, 0.55]), np.array([1.0, 0, 0, 0]))
    for _ in range(6):
        query.physics, view = query.engine.step(query.physics)
    assert float(view.object_com[0, ball, 2]) < 0.45  # it falls
    assert np.flatnonzero(others.shoved()).tolist() == [box]
    assert not others.restless()[ball]


def test_a_copy_of_a_resting_world_is_never_stepped(resting, monkeypatch):
    """Rows that begin at rest are those of a comparison with where everything was at the start."""
    monkeypatch.setattr(Bystanders, "_unchanged", lambda self: pytest.fail("the copy was asked"))
    reasons = collections.Counter()
    for text in ("(on_top can table)", "(open cabinet)", "(inside apple pan)"):
        resting.sample(read_conditions([text]), np.random.default_rng(0), Budget(60), reasons)


def test_an_object_that_still_falls_is_no_reason_to_refuse_a_placement(simulation):
    simulation.set_object_pose("ball", (-1.0, -1.0, 0.6))
    simulation.set_object_pose("rod", (-1.0, 1.0, 0.3), (0.9, 0.1, 0.4, 0.1))
    assert simulation.set_predicate("on_top", "can", "box"), simulation.last_sampling
    assert simulation.predicate("on_top", "can", "box")
    simulation.step(count=90)
    assert simulation.predicate("on_top", "can", "box")


def test_what_a_change_pushes_away_is_shoved(resting):
    query = resting.query
    query.load(resting._start)
    box, can = (query.scene.object_index(name) for name in ("box", "can"))
    others = Bystanders(query, query.save())
    query.place(box, np.array([0.25, 0.2, 0.55]), np.array([1.0, 0, 0, 0]))  # it stands in the can
    query.settle()
    assert others.shoved()[[box, can]].all()


@pytest.mark.parametrize("value", [True, False])
def test_opening_and_closing_shove_nothing(simulation, value):
    """Joints are drawn so that what stands before a door stays where it is, and the answer is no where none will do."""
    simulation.set_predicate("open", "cabinet", value=not value)
    simulation.set_object_pose("box", BEFORE_THE_CABINET)
    simulation.step(count=30)
    opened = simulation.engine.export(simulation.physics, 0)
    before = np.array(simulation.view.object_com[0])
    cabinet, book = (simulation.scene.object_index(name) for name in ("cabinet", "book"))
    done = []
    for seed in range(12):
        simulation.physics = simulation.engine.load(simulation.physics, opened)
        done.append(simulation.set_predicate("open", "cabinet", value=value, seed=seed))
        way = np.linalg.norm(np.array(simulation.view.object_com[0]) - before, axis=1)
        way[[cabinet, book]] = 0.0  # the book is in the drawer
        assert way.max() <= MOVED
        assert simulation.predicate("open", "cabinet") == (value if done[-1] else not value)
    assert any(done)


def test_what_lies_in_a_drawer_goes_along(simulation):
    drawer, book = "cabinet_drawer_slide", simulation.scene.object_index("book")
    seen = set()
    for seed in range(8):
        simulation.reset()
        simulation.step(count=30)
        before, start = simulation.joint(drawer), np.array(simulation.view.object_com[0, book])
        assert simulation.set_predicate("open", "cabinet", seed=seed), simulation.last_sampling
        way = start - np.array(simulation.view.object_com[0, book])
        pulled = simulation.joint(drawer) - before
        assert way == pytest.approx([pulled, 0.0, 0.0], abs=MOVED)
        assert simulation.predicate("inside", "book", "cabinet")
        seen.add(pulled > 0.05)
    assert seen == {True, False}


def test_setting_the_state_of_a_door_shoves_nothing_and_says_what_is_in_the_way(simulation):
    simulation.set_object_pose("box", BEFORE_THE_CABINET)
    simulation.step(count=30)
    before = np.array(simulation.view.object_com[0, simulation.scene.object_index("box")])
    for _ in range(4):
        simulation.set_state("open", "cabinet", True)
        simulation.step(count=30)
        assert simulation.predicate("open", "cabinet")
        now = np.array(simulation.view.object_com[0, simulation.scene.object_index("box")])
        assert np.linalg.norm(now - before) <= MOVED
        simulation.set_state("open", "cabinet", False)
        simulation.step(count=30)
    simulation.set_object_pose("box", (1.17, -0.15, 0.05))  # before the door
    simulation.set_object_pose("ball", (1.1, -0.15, 0.6))  # and before the drawer, for now
    with pytest.raises(StateError, match=r"'cabinet' cannot be opened without moving .*ball.*move that first"):
        for _ in range(8):
            simulation.set_state("open", "cabinet", True)


def test_a_door_that_shoves_another_object_s_drawer_or_stands_in_something_is_refused(resting):
    query = resting.query
    query.load(resting._start)
    cabinet = query.scene.object_index("cabinet")
    mover = JointMover(query, cabinet)
    tables = query.scene.tables
    positions = np.array(query.view.joint_pos, float)
    moves = np.zeros(positions.shape, bool)
    moves[0, 0] = True
    assert tables.openable_object[0] == cabinet
    positions[0, 0] = tables.openable_open[0]
    assert mover.problem(mover.plan(positions, moves)) == ""
    query.load(mover.before)
    nobody = JointMover(query, query.scene.object_index("box"))  # as if the cabinet were another's
    assert nobody.shoved_by(nobody.plan(positions, moves)) == ["cabinet"]


def test_an_object_that_goes_on_rolling_forbids_nothing_and_goes_on(resting):
    """Rest is asked of what is placed, and of what would rest without it."""
    query, model = resting.query, resting.query.scene.model
    ball = query.scene.object_index("ball")
    query.load(resting._start)
    query.place(ball, np.array([-1.0, -1.5, 0.1]), np.array([1.0, 0, 0, 0]))
    rolling = query.save()
    dof = int(model.body_dofadr[query.scene.tables.object_root[ball]])
    qvel = np.array(rolling.qvel)
    qvel[[dof, dof + 4]] = 0.25, 2.5
    start, states = resting._start, resting._initial
    try:
        resting.start_from(rolling.with_whole(qvel=qvel), states)
        reasons = collections.Counter()
        conditions = read_conditions(["(on_top can box)", "(open cabinet)"])
        row = resting.sample(conditions, np.random.default_rng(0), Budget(60), reasons)
        assert row is not None, reasons
        assert np.flatnonzero(query.view.awake[0]).tolist() == [ball]
        assert float(query.view.object_com[0, ball, 0]) > -0.5
        assert resting.holds(conditions, row.states)
    finally:
        resting.start_from(start, states)


def test_a_door_is_not_opened_into_a_robot(tiny_home_folder):
    scene = ig2mj.load_scene(tiny_home_folder, agents=[Fetch(pos=(0.9, -0.15, 0.0))])
    simulation = ig2mj.Simulation(scene)
    start = simulation.engine.export(simulation.physics, 0)
    before = np.array(simulation.view.agent.base_pos[0, 0])
    reasons = collections.Counter()
    for seed in (0, 2, 3):
        simulation.physics = simulation.engine.load(simulation.physics, start)
        assert simulation.set_predicate("open", "cabinet", seed=seed)
        reasons.update(simulation.last_sampling)
        assert np.linalg.norm(np.array(simulation.view.agent.base_pos[0, 0]) - before) <= MOVED
    assert reasons["cabinet: moves others"] > 0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["SlicingFruit", "CookingMeat", "GraspingBook"])
def test_start_states_of_activities_do_not_depend_on_the_copy(name, monkeypatch):
    """Pools are sampled in homes at rest: the states of shipped policies' evaluations are what they were without it."""
    monkeypatch.setattr(Bystanders, "_unchanged", lambda self: pytest.fail("the copy was asked"))
    task = find_task(name)
    assert isinstance(task, Task)
    sampler = make_sampler(bare_scene(task))
    made = [sample_row(sampler, read_conditions(task.start), 2_000_003, number)[0] for number in range(4)]
    assert any(row is not None for row in made)
