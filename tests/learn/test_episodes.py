"""Episode files and what is reported of their axes."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ig2mj.envs.rollout import play
from ig2mj.errors import EngineError, InputError, PolicyServerError, UnknownNameError
from ig2mj.learn.axes import AxisResult
from ig2mj.learn.episodes import AXES, Episodes, find_episodes, make_episodes, parse_axes, possible_axes
from ig2mj.worlds.archive import save_tree


def test_names_of_axes_are_checked():
    assert parse_axes("all") == possible_axes() and parse_axes("physics") == ("nominal", "physics")
    with pytest.raises(UnknownNameError, match=r"'light'.*lights"):
        parse_axes("light")
    with pytest.raises(EngineError, match="'homes' cannot be played yet"):
        parse_axes("homes")


def test_rates_have_intervals_and_no_episode_has_none():
    found = AxisResult("lights", [True, True, False, False], [1.0, 1.0, 0.5, 0.0]).as_dict()
    assert found["success_rate"] == 0.5 and found["q"] == 0.625 and found["episodes"] == 4
    assert 0.1 < found["success_low"] < 0.2 and 0.8 < found["success_high"] < 0.9
    assert AxisResult("lights", [], []).as_dict()["success_rate"] is None


def test_what_was_played_before_a_server_failed_is_kept(cooking_meat):
    calls = []

    def act(state):
        calls.append(1)
        if len(calls) > 2:
            raise PolicyServerError("gone")
        return np.zeros((2, *cooking_meat.action_space.shape), np.float32)

    played = play(cooking_meat.with_horizon(2), act, 4, in_order=True, seeds=[7, 8, 9, 10])
    assert played.success == [False, False] and str(played.failed) == "gone"
    assert len(played.q) == 2 and all(0 <= q < 1 for q in played.q)


@pytest.mark.slow
def test_a_file_has_all_of_its_episodes_and_a_change_shows(tmp_path):
    made = make_episodes("GraspingBook", 3)
    made.save(tmp_path / "book.npz")
    back = Episodes.load(find_episodes(tmp_path / "book.npz"))
    assert back.count == 3 and back.header == made.header and set(back.axes) <= {"nominal", "all", *AXES}
    assert {"humanoid", "fetch"} <= set(back.header["robots"])
    changed = dataclasses.replace(back, seeds=(1, 2, 3))
    save_tree(tmp_path / "other.npz", {"pool": changed.pool, "seeds": np.array(changed.seeds, np.int32)}, back.header)
    with pytest.raises(InputError, match="hash does not fit"):
        Episodes.load(tmp_path / "other.npz")
