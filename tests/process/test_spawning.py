"""Processes are started without being asked for in ig2mj's own commands only."""

import pytest

from ig2mj.process import spawning


def test_a_users_script_starts_no_process_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """A spawned process would run a script without the guard again."""
    monkeypatch.setattr(spawning, "_allowed", False)
    assert spawning.processes_for(1000) == 1


def test_a_command_shares_work_between_processors(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(spawning, "_allowed", False)
    monkeypatch.setattr(spawning.os, "cpu_count", lambda: 16)
    spawning.allow_spawning()
    assert [spawning.processes_for(parts) for parts in (0, 1, 5, 1000)] == [1, 1, 5, 16]
