"""Buffers are sized for rare events: tails of distributions, pairs of the broad phase, batches of any size."""

from __future__ import annotations

import json

import mujoco
import numpy as np
import pytest

from ig2mj.engine.warp.buffer_sizes import RARE, SHARED, SPARE_ROWS, Measurement, Tail, profile_of
from ig2mj.engine.warp.candidate_pairs import CandidatePairs
from ig2mj.engine.warp.profile import default_profile
from ig2mj.scene.paths import SHIPPED_HOMES


def test_quantiles_and_the_peak_of_what_was_counted():
    tail = Tail.of(np.array([1] * 90 + [5] * 9 + [20]))
    assert (tail.total, tail.peak) == (100, 20)
    assert tail.exceeded(0.5) == 1 and tail.exceeded(0.05) == 5 and tail.exceeded(0.0) == 20


def test_a_tail_that_was_seen_is_read_off_and_a_rarer_event_is_reckoned_from_its_slope():
    """An exponential tail of 5 per e-fold, that is 11.5 per decade."""
    rng = np.random.default_rng(0)
    values = np.floor(rng.exponential(5.0, 1_000_000)).astype(int)
    tail = Tail.of(values)
    assert tail.beyond(1e-3) == tail.exceeded(1e-3) == pytest.approx(5 * np.log(1e3), abs=1)
    truth = 5 * np.log(1 / RARE)
    assert tail.beyond(RARE) == pytest.approx(truth, rel=0.15)
    assert Tail.of(values[:20_000]).beyond(RARE) == pytest.approx(truth, rel=0.3)


def test_what_never_varies_needs_no_margin_and_nothing_needs_nothing():
    assert Tail.of(np.full(5000, 7)).beyond(RARE) == 7
    assert Tail.of(np.zeros(0, int)).beyond(RARE) == 0


def test_tails_of_different_length_add_up():
    both = Tail.of(np.array([1, 1])) + Tail.of(np.array([4]))
    assert both.counts.tolist() == [0, 2, 0, 0, 1]


def test_shared_buffers_follow_the_mean_and_spare_ones_the_worst_world(tiny_home):
    one = np.repeat(np.arange(8), 1000)
    tails = {"awake_dofs": Tail.of(one), "constraints": Tail.of(one), "contacts": Tail.of(one), "pairs": Tail.of(one)}
    measured = Measurement(tails, {"contacts": 10.0, "pairs": 30.0})
    profile = profile_of(measured, tiny_home.model)
    assert profile.contacts == profile.convex_contacts == SHARED * 30 + 3  # rounded up to a multiple of four
    assert profile.spare_contacts >= 0
    rare = Measurement({**tails, "contacts": Tail.of(np.append(one, 500))}, {"contacts": 10.0, "pairs": 30.0})
    assert profile_of(rare, tiny_home.model).for_worlds(1).contacts >= 500
    assert profile_of(rare, tiny_home.model, safety=1e9).awake_dofs == default_profile(tiny_home.model).awake_dofs


def test_a_world_has_rows_to_spare_where_calibration_shows_no_tail(tiny_home):
    """A hand in a corner of aspen asked for more than the 200 rows of its calibration."""
    always = Tail.of(np.full(8000, 100))
    tails = {"awake_dofs": always, "constraints": always, "contacts": always, "pairs": always}
    assert profile_of(Measurement(tails, {"contacts": 10.0, "pairs": 10.0}), tiny_home.model).constraints == 164


def test_homes_that_ship_have_rows_to_spare():
    for file in SHIPPED_HOMES.glob("*/engine_profile*.json"):
        profile = json.loads(file.read_text())
        assert profile["constraints"] >= profile["measured"]["peak_constraints"] + SPARE_ROWS, file


def test_a_measurement_is_joined_with_another():
    a = Measurement({"contacts": Tail.of(np.array([3]))}, {"contacts": 3.0})
    b = Measurement({"contacts": Tail.of(np.array([5])), "pairs": Tail.of(np.array([9]))}, {"contacts": 2.0})
    joined = a.joined(b)
    assert joined.tails["contacts"].total == 2 and joined.tails["pairs"].peak == 9
    assert joined.means == {"contacts": 3.0}
    assert joined.summary()["peak_contacts"] == 5


BOXES = """<mujoco><option><flag sleep="enable"/></option><worldbody>
  <geom name="floor" type="plane" size="0 0 1"/>
  <body name="a" pos="0 0 1"><freejoint/><geom type="box" size="0.1 0.1 0.1"/></body>
  <body name="b" pos="0.15 0 1"><freejoint/><geom type="box" size="0.1 0.1 0.1"/>
    <body name="child" pos="0 0 0.1"><joint type="hinge"/><geom type="box" size="0.1 0.1 0.1"/></body></body>
  <body name="far" pos="5 0 1"><freejoint/><geom type="box" size="0.1 0.1 0.1" contype="0" conaffinity="0"/></body>
</worldbody><contact>{}</contact></mujoco>"""


def test_pairs_are_boxes_that_overlap_and_may_collide():
    model = mujoco.MjModel.from_xml_string(BOXES.format(""))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    # a with b and with its child; those two are kin; the floor is far below; far collides with nothing
    assert CandidatePairs(model).count(data) == 2
    excluded = mujoco.MjModel.from_xml_string(BOXES.format('<exclude body1="a" body2="b"/>'))
    assert CandidatePairs(excluded).count(data) == 1
    data.qpos[:3] = 3.0, 0.0, 0.1
    mujoco.mj_forward(model, data)
    assert CandidatePairs(model).count(data) == 1, "a with the floor"
    data.tree_asleep[:] = 0
    assert CandidatePairs(model).count(data) == 0


def test_all_contacts_come_from_pairs(tiny_home):
    data = mujoco.MjData(tiny_home.model)
    mujoco.mj_step(tiny_home.model, data, nstep=20)
    mujoco.mj_forward(tiny_home.model, data)
    pairs = len({tuple(sorted(pair)) for pair in data.contact.geom.tolist()})
    assert 0 < pairs <= CandidatePairs(tiny_home.model).count(data)
