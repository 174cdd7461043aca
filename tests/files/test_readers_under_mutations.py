"""Whatever is done to a file or a message, a reader raises nothing but typed errors of one line."""

from __future__ import annotations

import pytest
from hostile_readers import READERS

QUICK, MANY = 20, 2000
"""Mutations of each reader: in every run of the tests, and in the slow ones."""

NEEDS = {"page_messages": "viser", "checkpoints": "orbax.checkpoint"}


def reader(name: str, folder):
    if name in NEEDS:
        pytest.importorskip(NEEDS[name])
    made = READERS[name](folder)
    made.read_valid()
    return made


@pytest.mark.parametrize("name", READERS)
def test_mutations_end_in_typed_errors(name, tmp_path):
    assert reader(name, tmp_path).failures(range(QUICK)) == {}


@pytest.mark.slow
@pytest.mark.parametrize("name", READERS)
def test_thousands_of_mutations_end_in_typed_errors(name, tmp_path):
    assert reader(name, tmp_path).failures(range(QUICK, QUICK + MANY)) == {}
