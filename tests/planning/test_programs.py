"""Programs of a batch of worlds as arrays."""

import numpy as np
import pytest

from ig2mj.planning import execution
from ig2mj.planning.phases import LIMIT, Phase, Programs, Until
from ig2mj.planning.senses import Senses


def test_new_programs_of_some_worlds_leave_the_others_as_they_are():
    long = [Phase(yaw=float(k), limit=10 + k) for k in range(5)]
    carry = execution.begin([[Phase(yaw=7.0)], [], [Phase(yaw=8.0), Phase(yaw=9.0)]])
    new = execution.begin_some(carry, {1: long})
    assert new.programs.length.tolist() == [1, 5, 2]
    assert new.programs.phases["yaw"][0, 0] == 7.0 and new.programs.phases["yaw"][2, :2].tolist() == [8.0, 9.0]
    assert new.programs.phases["limit"][1].tolist() == [10, 11, 12, 13, 14]
    assert new.running.tolist() == [True, True, True] and not carry.running[1]
    over = execution.begin_some(new, {0: [], 2: []})
    assert over.running.tolist() == [False, True, False] and over.status[0] == execution.DONE


def test_behind_the_end_of_a_new_program_nothing_of_the_old_one_is_left():
    long = Programs.pack([[Phase(yaw=1.0, rise=0.2, limit=9) for _ in range(4)] for _ in range(2)])
    new = long.with_rows(np.array([1]), Programs.pack([[Phase(yaw=2.0, rise=0.3)]]))
    assert new.length.tolist() == [4, 1] and long.length.tolist() == [4, 4] and (long.phases["yaw"] == 1.0).all()
    assert new.phases["yaw"].tolist() == [[1.0] * 4, [2.0, 0.0, 0.0, 0.0]]
    assert new.phases["limit"][1, 1:].tolist() == [LIMIT] * 3 and (new.phases["hand"][1, 1:] == -1).all()
    np.testing.assert_array_equal(new.phases["rise"][1], np.float32([0.3, np.nan, np.nan, np.nan]))


def test_a_batch_that_is_packed_at_once_is_the_same():
    programs = [[Phase(hand=0, pos=(1.0, 2.0, 3.0))], [Phase(rise=0.1), Phase(close=True)]]
    one = Programs.pack(programs)
    two = execution.begin_some(execution.begin([[], []]), dict(enumerate(programs))).programs
    for name in ("length", "base", "pos", "moves", "hand", "close", "limit", "after"):
        a, b = ((p.length if name == "length" else p.phases[name]) for p in (one, two))
        assert np.array_equal(a[..., : b.shape[-1]] if a.shape != b.shape else a, b), name


def test_programs_of_several_batches_are_those_of_their_worlds():
    long, short = [Phase(yaw=1.0, rise=0.1), Phase(yaw=2.0), Phase(yaw=3.0)], [Phase(yaw=4.0, limit=7)]
    both = Programs.together([Programs.pack([long]), Programs.pack([[]]), Programs.pack([short, long])])
    every = Programs.pack([long, [], short, long])
    assert both.length.tolist() == every.length.tolist() == [3, 0, 1, 3]
    for world, count in enumerate(every.length):
        for name in ("yaw", "rise", "limit", "pos", "hand"):
            np.testing.assert_array_equal(both.phases[name][world, :count], every.phases[name][world, :count])
    assert np.isnan(both.phases["rise"][2, 1:]).all()


@pytest.mark.parametrize(("until", "held", "fails"), [
    (Until.HELD, "drawer", True), (Until.HELD, "pen", False), (Until.HELD, "", False), (Until.WAITED, "drawer", False),
])  # fmt: skip
def test_a_hand_that_closes_on_an_object_and_holds_another_one_does_not_go_on(until, held, fails):
    """What it holds meets it no more, so that it would press the object through that."""
    names, held_by = ["pen", "drawer"], np.zeros((1, 2, 2), bool)
    if held:
        held_by[0, 1, names.index(held)] = True
    senses = object.__new__(Senses)
    object.__setattr__(senses, "held", held_by)
    programs = Programs.pack([[Phase(hand=1, until=until, object=names.index("pen"), close=True, limit=15)]])
    assert execution._holds_another(senses, programs.at(np.zeros(1, int))).tolist() == [fails]
