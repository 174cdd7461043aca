"""`PoseFrame`: what a person's devices say at one instant, and `PlayArea`: where their room is in the home.

Every source turns its own axes into these, once:

- the play area's frame is z up; its floor is z = 0; metres; quaternions are w-x-y-z;
- a head looks along its x, its left is y, its up is z (as the humanoid's eye);
- a hand is the humanoid's: fingers along -y (right) or y (left), the palm's face along z (`agents.humanoid.frames`).

A frame is kept as arrays of fixed shape, which a recording has of every step (`devices/<name>`, docs/guide/vr.md).
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation


@dataclasses.dataclass(frozen=True, eq=False)
class Pose:
    """Position [3], m, and orientation [4], w-x-y-z."""

    pos: Float[np.ndarray, "3"]
    quat: Float[np.ndarray, "4"]

    @classmethod
    def of(cls, pos: object, turn: Rotation) -> Pose:
        """From a position and a rotation."""
        x, y, z, w = turn.as_quat()
        return cls(np.asarray(pos, np.float64), np.array([w, x, y, z]))

    @property
    def turn(self) -> Rotation:
        """The orientation."""
        return Rotation.from_quat(np.roll(self.quat, -1))

    def __mul__(self, other: Pose) -> Pose:
        """`other`, given in this pose's frame, in the frame that this pose is given in."""
        return Pose.of(self.pos + self.turn.apply(other.pos), self.turn * other.turn)

    def inverse(self) -> Pose:
        """The frame that this pose is given in, seen from this pose."""
        back = self.turn.inv()
        return Pose.of(-back.apply(self.pos), back)


@dataclasses.dataclass(frozen=True)
class PlayArea:
    """Pose of the play area in the world: place of its origin, m, and turn about the vertical, rad.

    `turning`: a turn by the stick was made and the stick has not come back since.
    """

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    yaw: float = 0.0
    turning: bool = False

    @property
    def pose(self) -> Pose:
        return Pose.of((self.x, self.y, self.z), Rotation.from_euler("z", self.yaw))


@dataclasses.dataclass(frozen=True, eq=False)
class Gaze:
    """A ray: origin and direction [3] in the play area's frame."""

    origin: Float[np.ndarray, "3"]
    direction: Float[np.ndarray, "3"]


@dataclasses.dataclass(frozen=True, eq=False)
class Hand:
    """One hand's device.

    Attributes:
      pose: None while it is not tracked.
      trigger, squeeze: 0..1. stick: right, forward, -1..1.
      buttons: pressed ones as bits, in the order of WebXR's "xr-standard" mapping (4 and 5 are A/X and B/Y).
    """

    pose: Pose | None = None
    trigger: float = 0.0
    squeeze: float = 0.0
    stick: tuple[float, float] = (0.0, 0.0)
    buttons: int = 0


@dataclasses.dataclass(frozen=True, eq=False)
class PoseFrame:
    """What a person's devices say at one instant: metres and w-x-y-z in the play area's frame, z up.

    Attributes:
      time: s, of the source's own clock.
      head: None while it is not tracked. hands: left, right.
      torso: of a tracker at the chest, its frame that of the humanoid's body; None where there is none.
      gaze: None where eyes are not tracked.
      area: where the play area was.
    """

    time: float
    head: Pose | None
    hands: tuple[Hand, Hand] = (Hand(), Hand())
    torso: Pose | None = None
    gaze: Gaze | None = None
    area: PlayArea = PlayArea()

    def in_world(self, pose: Pose) -> Pose:
        """A pose of this frame in the home."""
        return self.area.pose * pose


SHAPES: dict[str, tuple[int, ...]] = {
    "time": (),
    "head": (8,),
    "hands": (2, 8),
    "triggers": (2,),
    "squeezes": (2,),
    "sticks": (2, 2),
    "buttons": (2,),
    "torso": (8,),
    "gaze": (7,),
    "area": (5,),
}
"""Arrays of a frame, float64. Poses: valid (1 or 0), position, quaternion; gaze: valid, origin, direction; area:
x, y, z, yaw, turning."""


def to_arrays(frame: PoseFrame | None) -> dict[str, np.ndarray]:
    """A frame as arrays of `SHAPES`; zeros where the source has none."""
    found = {name: np.zeros(shape) for name, shape in SHAPES.items()}
    if frame is None:
        return found
    found["time"] = np.array(frame.time, np.float64)
    found["head"], found["torso"] = _row(frame.head), _row(frame.torso)
    found["hands"] = np.stack([_row(hand.pose) for hand in frame.hands])
    for name, field in (("triggers", "trigger"), ("squeezes", "squeeze"), ("sticks", "stick"), ("buttons", "buttons")):
        found[name] = np.array([getattr(hand, field) for hand in frame.hands], np.float64)
    if frame.gaze is not None:
        found["gaze"] = np.concatenate([[1.0], frame.gaze.origin, frame.gaze.direction])
    area = frame.area
    found["area"] = np.array([area.x, area.y, area.z, area.yaw, area.turning], np.float64)
    return found


def from_arrays(arrays: dict[str, np.ndarray]) -> PoseFrame | None:
    """The frame that `to_arrays` wrote; None where the source had none.

    Raises:
      ValueError: an array has another shape, is missing, or has numbers that no frame has.
    """
    for name, shape in SHAPES.items():
        if name not in arrays or np.shape(arrays[name]) != shape:
            raise ValueError(f"'{name}' is not an array of shape {shape}")
        if not np.isfinite(arrays[name]).all():
            raise ValueError(f"'{name}' has a number that is not finite")
    if not any(np.any(arrays[name]) for name in SHAPES):
        return None
    hands = tuple(
        Hand(
            _pose(arrays["hands"][k]),
            float(arrays["triggers"][k]),
            float(arrays["squeezes"][k]),
            (float(arrays["sticks"][k][0]), float(arrays["sticks"][k][1])),
            int(arrays["buttons"][k]),
        )
        for k in range(2)
    )
    gaze = arrays["gaze"]
    x, y, z, yaw, turning = (float(v) for v in arrays["area"])
    return PoseFrame(
        float(arrays["time"]),
        _pose(arrays["head"]),
        (hands[0], hands[1]),
        _pose(arrays["torso"]),
        Gaze(gaze[1:4], gaze[4:]) if gaze[0] else None,
        PlayArea(x, y, z, yaw, bool(turning)),
    )


def _row(pose: Pose | None) -> Float[np.ndarray, "8"]:
    return np.zeros(8) if pose is None else np.concatenate([[1.0], pose.pos, pose.quat])


def _pose(row: Float[np.ndarray, "8"]) -> Pose | None:
    if not row[0]:
        return None
    size = float(np.linalg.norm(row[4:]))
    if not math.isclose(size, 1.0, abs_tol=1e-3):
        raise ValueError(f"a quaternion has length {size:g}")
    return Pose(row[1:4], row[4:])  # as it is, so that the same action comes of it
