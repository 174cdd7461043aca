"""What an arm has taken is brought out past what is above it: around that, or after the base has gone back with it."""

import numpy as np
import pytest

from ig2mj.planning import drawing_out
from ig2mj.planning.phases import Base, Phase
from ig2mj.planning.world import PlannedWorld, Stance

GRIP, RAISED, EDGE = np.array([0.5, 0.0, 0.3]), np.array([0.5, 0.0, 1.0]), 0.1
"""m, where the hand is at first, and where it carries things; x up to which it has to be drawn back before it may be
raised."""


FORWARDS = np.array([1.0, 0.0, 0.0])


class _World(PlannedWorld):
    """A robot at the origin, which looks along x, with a hand below a board that ends `EDGE` ahead of it."""

    stance = Stance((0.0, 0.0), 0.0)
    around: list[np.ndarray] | None = None

    def _off(self, point):
        x, y = self.stance.xy
        return point + np.array([x, y, 0.0])

    def grip(self, hand):
        return self._off(GRIP)

    def carried(self, hand, stance):
        return self._off(RAISED)

    def hand_quat(self, hand):
        return np.array([1.0, 0.0, 0.0, 0.0])

    def from_body(self, point):
        return point

    def obstacles(self, *args):
        return None

    follows = obstacles


@pytest.fixture
def world(monkeypatch):
    found = object.__new__(_World)
    stances = [Stance((float(-apart), 0.0), 0.0) for apart in np.arange(1, 7) * 0.15]
    monkeypatch.setattr(drawing_out, "_back", lambda *a: stances)
    monkeypatch.setattr(drawing_out, "_as_close_as_now", lambda *a: None)
    monkeypatch.setattr(drawing_out, "straight", lambda obstacles, held, a, b: b[2] == a[2] or a[0] <= EDGE)
    monkeypatch.setattr(
        drawing_out, "hand_path", lambda obs, held, start, goal, **a: [goal] if start[0] <= EDGE else found.around
    )
    return found


def _programs(world, ends):
    """Programs of the way out, and what it returns; the base goes where it is asked to."""
    programs, run = [], drawing_out.led_out(world, "carton_0", 0, ends, Phase(keeps=3))
    try:
        program = next(run)
        while True:
            programs.append(program)
            for phase in program:
                if phase.base is Base.SHIFT:
                    world.stance = Stance(phase.xy, phase.yaw)
            program = run.send("")
    except StopIteration as end:
        return programs, end.value


def test_a_way_with_room_is_left_to_the_hand(world):
    assert _programs(world, [GRIP - 0.1 * FORWARDS]) == ([], None)


def test_a_hand_goes_around_what_is_in_its_way(world):
    world.around = [GRIP - 0.4 * FORWARDS, RAISED]
    (program,), reason = _programs(world, [RAISED])
    assert reason == "" and [p.pos is not None for p in program] == [True, True, False]
    assert all(p.base is Base.STAY and p.keeps == 3 for p in program)


def test_the_base_goes_back_a_little_farther_than_the_nearest_place_with_room(world):
    (back, raised), reason = _programs(world, [RAISED])
    assert reason == "" and raised[-1] == Phase(keeps=3)
    assert back[0].base is Base.SHIFT and back[0].keeps == 3
    assert np.allclose(back[0].xy, (-0.6, 0.0))  # 0.45 m would do
    assert back[0].in_body and np.allclose(back[0].pos, GRIP)  # the hand is not raised meanwhile
