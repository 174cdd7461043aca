"""How many processors a process may use."""

import os

import pytest

from ig2mj.process import processors
from ig2mj.process.spawning import processes_for


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="no sets of processors here")
def test_processors_are_those_of_the_process(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {3, 5, 7})
    monkeypatch.setattr("ig2mj.process.spawning._allowed", True)
    assert processors.available() == 3
    assert processes_for(100) == 3


def test_where_sets_are_unknown_they_are_the_machine_s(monkeypatch):
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 6)
    assert processors.available() == 6
