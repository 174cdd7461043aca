"""Commands on tasks of a file: sound ones are listed next to faulty ones; a home is not a task."""

from __future__ import annotations

import numpy as np
import pytest

from ig2mj.cli import call
from ig2mj.errors import InputError
from ig2mj.tasks.custom.code import call as call_function

TASKS = """
import ig2mj

class Good(ig2mj.CustomTask):
    \"\"\"A can on a table.\"\"\"
    home = "small_home"
    goal = "(on_top mug_0 breakfast_table_0)"

class Bad(ig2mj.CustomTask):
    home = "nowhere_at_all"
    goal = "(on_top mug_0 breakfast_table_0)"
"""


def test_sound_tasks_of_a_file_are_listed_next_to_faulty_ones(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("ig2mj.tasks.registry.REGISTERED", {})
    file = tmp_path / "mine.py"
    file.write_text(TASKS)
    assert call(["list-envs", str(file)]) == 1
    out, err = capsys.readouterr()
    assert "Good" in out and "A can on a table" in out
    assert "Bad.home" in err and "nowhere_at_all" in err


def test_a_home_is_not_a_task(capsys):
    assert call(["rollout", "small_home"]) == 2
    said = capsys.readouterr().err
    assert "'small_home' is a home, and an environment is a task in one: GraspingBook" in said
    assert "ig2mj view small_home" in said


def test_a_condition_on_arrays_says_what_to_write_instead():
    def reward(world):
        return 1 if np.zeros(3) > 0 else 0

    with pytest.raises(InputError, match=r"has a value for each world.*jnp.where instead of if"):
        call_function(reward, None)
