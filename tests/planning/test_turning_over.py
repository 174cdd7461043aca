"""A tool that lies with the side up that cleans is turned over by one hand."""

import types

import numpy as np
import pytest

from ig2mj.planning import cleaning, cleaning_area
from ig2mj.planning.steps import Step
from ig2mj.planning.turning_over import LEANS, leaning
from ig2mj.planning.world import PlannedWorld

UP = np.array([0.0, 0.0, 1.0])


@pytest.mark.parametrize("yaw", [0.0, 2.0])
@pytest.mark.parametrize("out", [[0.0, 0.0, 1.0], [0.3, -0.2, 0.9]])
def test_a_tool_is_let_go_upright_with_its_held_edge_above_and_leans_onto_the_side_that_cleans(yaw, out):
    out, front = np.array(out) / np.linalg.norm(out), np.array([np.cos(yaw), np.sin(yaw), 0.0])
    turn = leaning(out, np.array([-0.2, 0.05, 0.04]), front)
    edge = np.array([-0.2, 0.05, 0.04])
    edge = edge - (edge @ out) * out
    top, side = turn @ edge / np.linalg.norm(edge), turn @ out
    assert np.allclose(turn @ turn.T, np.eye(3)) and np.linalg.det(turn) == pytest.approx(1.0)
    assert top @ UP == pytest.approx(np.cos(LEANS)) and top @ front == pytest.approx(-np.sin(LEANS))
    assert side @ UP == pytest.approx(-np.sin(LEANS)) and side @ front < 0.0


class World(PlannedWorld):
    """A gripper holds a cloth by `palm`, whose cleaning side faces `out`."""

    palm = UP
    body = types.SimpleNamespace(opening=0.1)
    held = property(lambda self: ["cloth"])  # pyright: ignore

    def vertices(self, name):
        flat = np.array([0.3, 0.2, 0.2 if name == "broom" else 0.02])
        return np.array(np.meshgrid(*[[-0.5, 0.5]] * 3)).reshape(3, -1).T * flat

    def hand_axes(self, hand, rotation=None):
        return UP, self.palm


@pytest.mark.parametrize(
    ("pitch", "out", "covered", "behind"),
    [
        (1.2, -1, False, True),
        (0.5, -1, False, False),
        (0.0, -1, False, False),
        (0.4, 1, False, False),
        (1.2, 1, True, False),
    ],
)
def test_a_gripper_is_behind_a_cloth_that_it_is_to_clean_a_floor_with(monkeypatch, pitch, out, covered, behind):
    """It points down by `pitch` (rad); one that is on the side that cleans turns the cloth over first."""
    world = object.__new__(World)
    world.palm = np.array([np.cos(pitch), 0.0, -np.sin(pitch)])
    monkeypatch.setattr(cleaning_area, "cleaning_area", lambda *_: (np.zeros((8, 3)), out * UP))
    assert cleaning_area.is_covered(world, "cloth", 0) == covered
    assert cleaning_area.is_behind(world, "cloth", world.palm) == behind
    assert cleaning_area.is_behind(world, "broom", world.palm), "what is not flat is held anyhow"


@pytest.mark.parametrize(
    ("opening", "action"), [(0.1, "_turned_over"), (None, "hand_over_in_the_open")], ids=["gripper", "floating hand"]
)
def test_a_cloth_that_is_held_askew_is_taken_from_behind_before_it_is_given_up(monkeypatch, opening, action):
    """A gripper lets it fall and takes it again; a hand that floats gives it to the other hand."""
    world, turned, planned = object.__new__(World), [], []
    world.body = types.SimpleNamespace(opening=opening)
    left = [2]

    def turned_over(world, tool, hand):
        yield []
        turned.append(tool)
        left[0] -= 1
        return True

    def plan_strokes(*_, around=False):
        planned.append(around)

    never = lambda *_: False  # noqa: E731
    changes = {
        "is_covered": never, "is_behind": lambda *_: left[0] == 0, "hand_with": lambda *_: 0,
        action: turned_over, "plan_strokes": plan_strokes, "strayed": never,
        "go_home_past": lambda *_: iter(()), "bars": never,
    }  # fmt: skip
    for name, change in changes.items():
        monkeypatch.setattr(cleaning, name, change)
    monkeypatch.setattr(World, "facts", property(lambda self: types.SimpleNamespace(holds=lambda *_: True)))
    monkeypatch.setattr(World, "dirt", lambda *_: [])
    world.domain = types.SimpleNamespace(has=never, loose=[], graspable=never)  # pyright: ignore
    running = cleaning.clean("dusty")(world, Step("wipe", ("shelf", "cloth")))
    with pytest.raises(StopIteration) as ended:
        while True:
            next(running)
    assert turned == ["cloth", "cloth"] and ended.value.value.reason == "no_base"
    assert planned[:3] == [False] * 3 and planned[3:] == [True] * (opening is None), "from all around at last"
