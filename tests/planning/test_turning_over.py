"""A tool that lies with the side up that cleans is turned over by one hand."""

import numpy as np
import pytest

from ig2mj.planning.turning_over import LEANS, leaning

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
