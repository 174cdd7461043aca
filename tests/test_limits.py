"""The helper that measures readers of damaged inputs measures, ends what exceeds its limits, and passes errors on."""

from __future__ import annotations

import pytest
from limits import run_limited

from ig2mj.errors import InputError


def allocate(mebibytes: int) -> int:
    return len(bytearray(mebibytes * 2**20))


def spin() -> None:
    while True:
        pass


def refuse(file: str) -> None:
    raise InputError(file, "is refused", element="line 1")


def test_a_call_returns_its_value_and_what_it_took():
    outcome = run_limited(allocate, 100).check()
    assert outcome.value == 100 * 2**20
    assert 90 * 2**20 < outcome.memory < 140 * 2**20


def test_memory_above_the_limit_fails_the_check():
    with pytest.raises(AssertionError, match=r"took .* MiB"):
        run_limited(allocate, 1500).check()
    run_limited(allocate, 4000).check(MemoryError)


def test_processor_time_is_limited():
    outcome = run_limited(spin, seconds=1)
    assert outcome.killed == "SIGXCPU"
    with pytest.raises(AssertionError, match="ended by SIGXCPU"):
        outcome.check(InputError)


def test_errors_are_passed_on_with_their_fields():
    outcome = run_limited(refuse, "a.urdf").check(InputError, "a.urdf: line 1: is refused")
    assert isinstance(outcome.error, InputError) and outcome.error.file == "a.urdf"
    with pytest.raises(AssertionError, match="no InputError"):
        run_limited(allocate, 1).check(InputError)
