"""Parts of recorded visits, as small files: what devices said, where the humanoid was, and the action that came of it.

    python tests/vr/golden_visits.py VISIT.h5 tests/vr/golden/visit.npz

writes such a file from a recording (`tests/vr/test_page_in_chromium.py` leaves one in out/vr/).
"""

from __future__ import annotations

import pathlib
import sys

import numpy as np
from apple_on_table import APPLE_ON_TABLE
from scipy.spatial.transform import Rotation

from ig2mj.agents.humanoid.frames import MAX_MOVE, MAX_TURN
from ig2mj.demos import Recording
from ig2mj.vr.frames import SHAPES, Pose, from_arrays
from ig2mj.vr.mapping import HumanoidPose

LENGTH = 40
"""Frames of a part."""

_POSE = [MAX_MOVE] * 3 + [MAX_TURN] * 3
SCALE = np.array([*_POSE, *_POSE, *_POSE, 1.0, 1.0, *_POSE, 1.0, 1.0], np.float32)
"""Of an environment's action, whose numbers are -1 to 1."""


def load(file: pathlib.Path) -> list[list[tuple]]:
    """Parts; of each frame what devices said, the robot, and the action in metres and radians."""
    with np.load(file, allow_pickle=False) as arrays:
        found = dict(arrays)
    parts = []
    for start in range(0, len(found["action"]), LENGTH):
        part = []
        for k in range(start, start + LENGTH):
            frame = from_arrays({name: np.asarray(found[name][k]) for name in SHAPES})
            body, eye, hands = found["body"][k], found["eye"][k], found["robot_hands"][k]
            left, right = found["robot_triggers"][k].tolist()
            robot = HumanoidPose(_pose(body), _pose(eye), (_pose(hands[0]), _pose(hands[1])), (left, right))
            part.append((frame, robot, found["action"][k] * SCALE.astype(float)))
        parts.append(part)
    return parts


def _pose(row: np.ndarray) -> Pose:
    quat = row[3:].astype(float)
    return Pose(row[:3].astype(float), quat / np.linalg.norm(quat))


def write(recording: pathlib.Path, file: pathlib.Path) -> None:
    """Takes parts: the start, the way to the apple, the grasp, turning with it, and letting go."""
    with Recording(recording) as opened:
        rows = opened.runs[0].all_rows
        trigger = np.flatnonzero(np.diff(rows("steps/devices/triggers")[:, 1]))
        stick = np.flatnonzero(np.abs(rows("steps/devices/sticks")).sum((1, 2)))
        turning = np.flatnonzero(np.abs(rows("steps/action")[:, 5]) > 0.3)
        turning = turning[turning > trigger[0]]
        first = np.flatnonzero(rows("steps/devices/head")[:, 0])[0]
        starts = [first - 5, stick[0] - 10, trigger[0] - 15, turning[0] - 10, trigger[-1] - 15]
        chosen = np.concatenate([np.arange(s, s + LENGTH) for s in np.maximum(starts, 0)])
        qpos, state = rows("frames/physics/agents/qpos"), "frames/controllers/0"
        parts = {
            "action": rows("steps/action")[chosen],
            "body": np.concatenate([qpos[chosen, :3], turned(qpos[chosen, 3:7])], axis=1).astype(np.float32),
            "eye": np.concatenate([rows(f"{state}/eye_pos"), rows(f"{state}/eye_quat")], axis=1)[chosen],
            "robot_hands": np.concatenate([rows(f"{state}/hand_pos"), rows(f"{state}/hand_quat")], axis=2)[chosen],
            "robot_triggers": rows(f"{state}/trigger")[chosen],
            **{name: rows(f"steps/devices/{name}")[chosen] for name in SHAPES},
        }
    file.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(file, **parts)


def turned(ball: np.ndarray) -> np.ndarray:
    """Orientations of the body, w-x-y-z: its ball joint turns it from how it stood at the start."""
    start = Rotation.from_euler("z", APPLE_ON_TABLE.acts("humanoid").yaw, degrees=True)
    return np.roll((start * Rotation.from_quat(np.roll(ball, -1, axis=1))).as_quat(), 1, axis=1)


if __name__ == "__main__":
    write(pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2]))
