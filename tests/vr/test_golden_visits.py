"""Recorded visits: the same devices and the same robot make the same action as when they were recorded."""

from __future__ import annotations

import pathlib

import numpy as np
import pytest
from golden_visits import load

from ig2mj.vr.mapping import Memory, action_of

FILES = sorted((pathlib.Path(__file__).parent / "golden").glob("*.npz"))


NAMES = {"body": slice(0, 3), "turn": slice(3, 6), "head": slice(6, 12), "hand": slice(20, 26), "grip": slice(26, 27)}
"""What a visit moves, and where that is in an action."""


@pytest.mark.parametrize("file", FILES, ids=[f.stem for f in FILES])
def test_recorded_devices_make_the_recorded_actions(file):
    parts = load(file)
    assert len(parts) == 5
    kinds = set()
    for part in parts:
        memory = Memory()
        for k, (frame, robot, recorded) in enumerate(part):
            action, memory = action_of(frame, robot, memory)
            if frame is None:
                kinds.add("nobody")
                if k == 0:
                    continue  # where the body was sent before is not part of the file
            assert action == pytest.approx(recorded, abs=2e-6), k
            kinds |= {name for name, of in NAMES.items() if np.abs(action[of]).max() > 1e-3}
    assert kinds == {"nobody", *NAMES}
