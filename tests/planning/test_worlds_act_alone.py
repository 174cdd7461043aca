"""What the robot does in one world of a batch depends on nothing in the others."""

import dataclasses

import numpy as np
import pytest

import ig2mj
from ig2mj.agents import Humanoid
from ig2mj.planning import execution
from ig2mj.planning.body_kinds import body_of
from ig2mj.planning.phases import Base, Phase, Until
from ig2mj.planning.senses import sense
from ig2mj.sampling.query import SceneQuery

WORLDS = 48


@pytest.fixture(scope="module")
def robot(tiny_home_folder):
    """How a humanoid is moved, and what it senses in one world."""
    scene = ig2mj.load_scene(tiny_home_folder, agents=[Humanoid().at(-0.45, 0.0, 0.0)])
    body = body_of(scene, scene.agents[0].controller(scene.tables, 0, 0.1))
    return body, sense(SceneQuery(scene).view, 0, body.hands)


def phase_of(rng):
    if rng.random() < 0.3:
        return Phase(Base(int(rng.integers(4))), xy=tuple(rng.normal(size=2)), yaw=float(rng.normal()))
    quat = rng.normal(size=4)
    return Phase(
        hand=int(rng.integers(2)),
        pos=tuple(rng.normal(size=3)) if rng.random() < 0.8 else None,
        quat=tuple(quat / np.linalg.norm(quat)) if rng.random() < 0.5 else None,
        in_body=bool(rng.random() < 0.5),
        close=[None, True, False][int(rng.integers(3))],
        reset=bool(rng.random() < 0.2),
        until=Until(int(rng.integers(5))),
        object=int(rng.integers(4)),
        keeps=int(rng.integers(-1, 4)),
        both=bool(rng.random() < 0.3),
    )


def test_a_world_of_a_batch_acts_as_it_does_alone(robot):
    body, senses = robot
    rng = np.random.default_rng(3)
    many = senses.of(np.zeros(WORLDS, int))
    moved = many.hand_pos + rng.normal(scale=0.2, size=many.hand_pos.shape).astype(np.float32)
    many = dataclasses.replace(many, hand_pos=moved, held=rng.random(many.held.shape) < 0.2)
    programs = [[phase_of(rng) for _ in range(int(rng.integers(3)))] for _ in range(WORLDS)]
    together, after = execution.advance_sensed(body, execution.begin(programs), many)
    for world, program in enumerate(programs):
        alone, one = execution.advance_sensed(body, execution.begin([program]), many.of(np.array([world])))
        assert np.array_equal(together[world], alone[0])
        assert (after.status[world], after.phase[world]) == (one.status[0], one.phase[0])


def test_both_hands_are_empty_before_an_object_counts_as_put_down(robot):
    body, senses = robot
    held = np.zeros_like(senses.held)
    held[0, 1, 0] = True
    for both, ends in ((False, True), (True, False)):
        carry = execution.begin([[Phase(hand=0, until=Until.EMPTY, both=both)]])
        _, carry = execution.advance_sensed(body, carry, dataclasses.replace(senses, held=held))
        assert carry.running[0] != ends
