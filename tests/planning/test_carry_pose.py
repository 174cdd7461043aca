"""Where hands carry what they hold, from where a base puts it away, and how far an arm has to reach."""

from types import SimpleNamespace

import numpy as np
import pytest

from ig2mj.planning.clearance import Obstacles
from ig2mj.planning.grasping import _making_room
from ig2mj.planning.grasps import GraspPose
from ig2mj.planning.moves import goes_on, hand_path
from ig2mj.planning.phases import Until
from ig2mj.planning.taking import closing_on
from ig2mj.planning.world import AWAY, BETWEEN, BODY_SPARE, PlannedWorld

TRUNK = 0.3


class _World(PlannedWorld):
    """A robot at the origin that looks along y and holds a board of 0.4 m before it."""

    def __init__(self, opening, held="board"):
        body = SimpleNamespace(opening=opening, carry=np.array([[0.3, 0.1, 1.1]]), trunk=(TRUNK, 1.5), stands=0.0)
        self.body, self._held = body, held  # pyright: ignore[reportAttributeAccessIssue]

    @property
    def base(self):
        return np.zeros(2), np.pi / 2

    @property
    def held(self):
        return [self._held]

    def vertices(self, name):
        return np.array([[x, y, 1.0] for x in (-0.2, 0.2) for y in (0.5, 0.9)])

    def grip(self, hand):
        return np.array([0.0, 0.51, 1.05])


def test_an_arm_carries_a_board_farther_from_the_body_that_reaches_back_from_the_hand():
    """The hand turns with it on its way, so that it has half its width at least."""
    assert _World(0.1).carry(0)[0] == pytest.approx(TRUNK + BODY_SPARE + 0.4 / np.sqrt(2))
    assert _World(None).carry(0)[0] == pytest.approx(TRUNK + BODY_SPARE + 0.4 / np.sqrt(2))
    behind = np.array([0.0, 0.9, 1.05])
    assert _World(0.1, held="").carry(0, "board", behind)[0] == pytest.approx(TRUNK + BODY_SPARE + 0.4)


def test_a_base_stands_nearer_to_what_its_gripper_puts_away_from_it():
    board = np.array([[0.0, y, 0.0, 0.01] for y in (0.0, 0.2, 0.4)])
    down, away = np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.6, -0.8])
    assert _World(0.1).away(board, away) == pytest.approx(AWAY)
    assert _World(0.1).away(board, -away) > AWAY + 0.2
    assert _World(0.1).away(board, down) == _World(None).away(board, away) > AWAY + 0.2


class _Arm:
    """Reaches 0.8 m, whatever is in the way."""

    def reaches(self, point):
        return bool(np.linalg.norm(point) <= 0.8)

    def __call__(self, points, spheres, turned_at=None):
        return self.passes(points)

    def passes(self, points):
        return all(self.reaches(point) for point in points)

    def arrives(self, points):
        return self.passes(points)


class _ShutInArm(_Arm):
    """Has no room where its hand is at what it takes."""

    def arrives(self, points):
        return False


def test_an_arm_has_to_reach_a_grasp_itself_not_only_the_place_before_it():
    before, grasp = np.array([0.75, 0.0, 0.0]), np.array([0.85, 0.0, 0.0])
    assert goes_on([before], before, _Arm()) and not goes_on([before], grasp, _Arm())
    assert goes_on([before], grasp, None) and not goes_on(None, before, None)


def test_an_arm_has_to_have_room_at_a_grasp_where_there_are_others():
    before, grasp = np.array([0.55, 0.0, 0.0]), np.array([0.65, 0.0, 0.0])
    assert goes_on([before], grasp, _Arm()) and not goes_on([before], grasp, _ShutInArm())
    assert goes_on([before], grasp, _ShutInArm(), strays=True)


class _Plain(PlannedWorld):
    """A world with a box 10 cm wide."""

    def __init__(self, opening, height=0.1):
        self._height = height
        turned = lambda *_: (1.0, 0.0, 0.0, 0.0)  # noqa: E731
        self.body = SimpleNamespace(opening=opening, turned=turned)  # pyright: ignore[reportAttributeAccessIssue]

    def index(self, name):
        return 3

    def vertices(self, name):
        return np.array([[0.0, 0.0, 0.0], [0.1, 0.1, self._height]])


@pytest.mark.parametrize("opening", [0.1, None])
def test_a_gripper_is_straight_before_a_grasp_when_it_goes_on_to_it(opening):
    """The end of a way is reached within 2.5 cm, and fingers are 1 cm wider apart than what they close on."""
    world = _Plain(opening)
    pose = GraspPose(np.array([0.5, 0.0, 0.1]), np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, -1.0]), 0.12)
    way = [np.array([0.3, 0.0, 0.5]), pose.at(pose.before)]
    program = closing_on(world, "box", 0, pose, way)
    before = next(k for k, phase in enumerate(program) if phase.until == Until.TOUCHED) - 1
    assert program[before].pos == pytest.approx(tuple(pose.at(pose.before)))
    straight = program[before].tolerance <= 0.01 and program[before].turn_tolerance < 0.1
    assert straight == (opening is not None) and before == len(way) - 1 + (opening is not None)


@pytest.mark.parametrize(("opening", "height", "attempt", "gently"), [
    (None, 0.1, 0, True), (None, 0.1, 1, False), (None, 0.02, 0, False), (None, 0.02, 1, True), (0.1, 0.1, 0, False),
])  # fmt: skip
def test_a_floating_hand_closes_gently_and_at_once_on_what_is_thin(opening, height, attempt, gently):
    """What is held meets no fingers: those that close at once go through the sides of a carton."""
    pose = GraspPose(np.array([0.5, 0.0, 0.1]), np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, -1.0]), 0.12)
    program = closing_on(_Plain(opening, height), "box", 0, pose, [pose.at(pose.before)], attempt)
    (closes,) = [phase for phase in program if phase.close]
    assert closes.until == Until.HELD and (closes.closes < 0.5) == gently
    assert closes.closes * closes.limit > 1.5  # it closes whole


class _StraysArm(_Arm):
    """Brings the hand to where it has no room, whatever the way."""

    def __call__(self, points, spheres, turned_at=None):
        return self.passes(points) and not len(spheres)


class _Nothing(Obstacles):
    """Nothing is in the way."""

    def __init__(self):
        self._keep, self._body, self._carried = np.zeros(0, bool), None, np.zeros((0, 4))
        self._low = self._high = np.zeros((0, 3))
        self._bounds = np.zeros((6, 0))


def test_a_hand_goes_where_its_arm_brings_it_off_the_line_only_where_nothing_else_is_found():
    hand, start, goal = np.array([[0.0, 0.0, 0.0, 0.05]]), np.zeros(3), np.array([0.4, 0.0, 0.0])
    for arm, search, found in ((_Arm, False, True), (_StraysArm, False, False), (_StraysArm, True, True)):
        assert (hand_path(_Nothing(), hand, start, goal, search=search, follows=arm()) is not None) == found


class _TwoHands(PlannedWorld):
    """A robot at the origin that looks along y; its floating hands hold boxes of some widths, by points off their
    middles."""

    def __init__(self, *boxes, held=("left", "right")):
        carry = np.array([[0.3, 0.16, 1.1], [0.3, -0.16, 1.1]])
        self.body = SimpleNamespace(opening=None, carry=carry, trunk=(TRUNK, 1.5), stands=0.0)  # pyright: ignore[reportAttributeAccessIssue]
        self._boxes, self._held = dict[str, tuple[float, float]](zip(("left", "right"), boxes, strict=True)), list(held)
        self.domain = SimpleNamespace(fixed=lambda name: False)  # pyright: ignore[reportAttributeAccessIssue]

    @property
    def base(self):
        return np.zeros(2), np.pi / 2

    @property
    def held(self):
        return self._held

    def vertices(self, name):
        width, _ = self._boxes[name]
        return np.array([[x, y, 1.0] for x in (-width / 2, width / 2) for y in (0.5, 0.52)])

    def grip(self, hand):
        return np.array([self._boxes[("left", "right")[hand]][1], 0.51, 1.0])

    def gap(self, held=None):
        """m between both boxes where they are carried."""
        sides = []
        for hand, name in enumerate(("left", "right")):
            across = self.grip(hand)[0] - self.vertices(name)[:, 0]
            sides.append(float(self.carry(hand, name, self.grip(hand), held)[1]) + np.sort(across)[[0, -1]])
        return sides[0][0] - sides[1][1]


@pytest.mark.parametrize("boxes", [((0.4, 0.0), (0.4, 0.0)), ((0.6, 0.0), (0.1, 0.0)), ((0.4, -0.15), (0.4, 0.1))])
def test_what_two_hands_carry_does_not_meet(boxes):
    assert _TwoHands(*boxes).gap() == pytest.approx(BETWEEN)


def test_what_does_not_meet_is_carried_where_each_hand_alone_carries_it():
    both, alone = _TwoHands((0.1, 0.0), (0.2, 0.0)), _TwoHands((0.1, 0.0), (0.6, 0.0), held=("", "right"))
    assert both.carry(0)[1] == -both.carry(1)[1] == pytest.approx(0.16) and both.gap() > BETWEEN
    assert alone.carry(1)[1] == 0.0


def test_a_hand_makes_room_for_what_the_other_takes():
    taking = _TwoHands((0.4, 0.0), (0.6, 0.0), held=("", "right"))
    taking.index = ("left", "right").index  # pyright: ignore[reportAttributeAccessIssue]
    (aside,) = _making_room(taking, "left", 0)
    assert aside.hand == aside.keeps == 1 and aside.in_body and aside.pos is not None and aside.pos[1] < -0.1
    assert taking.gap(held=("left", "right")) == pytest.approx(BETWEEN, abs=1e-3)
    assert _making_room(_TwoHands((0.1, 0.0), (0.2, 0.0), held=("", "right")), "left", 0) == []
