"""What pages and `ig2mj vr` say to each other over the web socket.

From the page: text, one JSON object, checked to the last number (`decode`).

- `{"type": "devices", ...}`: head and hands in XR's axes, in the page's reference space; up to 90 times a second;
- `{"type": "desktop", ...}`: keys and mouse, of a page without a headset;
- `{"type": "rate", ...}`: frames a second that the page renders.

To the page: text for what happens now and then (`welcome`, `looks`, `pulse`), and binary for poses (`pose_message`).
"""

from __future__ import annotations

from typing import Annotated

import msgspec
import numpy as np
from jaxtyping import Float, Int

from ig2mj.vr.frames import Gaze, Hand, PlayArea, Pose, PoseFrame
from ig2mj.vr.xr_axes import hand_from_grip, head_from_xr, vector_from_xr

LARGEST = 4096
"""Bytes of a page's message."""

Coordinate = Annotated[float, msgspec.Meta(ge=-1000.0, le=1000.0)]
Unit = Annotated[float, msgspec.Meta(ge=-1.001, le=1.001)]
Share = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]
PoseRow = tuple[Coordinate, Coordinate, Coordinate, Unit, Unit, Unit, Unit]
Key = Annotated[str, msgspec.Meta(max_length=16)]


class HandMessage(msgspec.Struct, forbid_unknown_fields=True):
    """One hand's device; `pose` is of its grip space, None while it is not tracked."""

    pose: PoseRow | None = None
    trigger: Share = 0.0
    squeeze: Share = 0.0
    stick: tuple[Unit, Unit] = (0.0, 0.0)
    buttons: Annotated[int, msgspec.Meta(ge=0, lt=65536)] = 0


class Devices(msgspec.Struct, forbid_unknown_fields=True, tag="devices"):
    """Of a headset. `time`: s of the page's clock. `gaze`: origin and direction."""

    time: Annotated[float, msgspec.Meta(ge=0.0, le=1e9)]
    head: PoseRow | None
    hands: tuple[HandMessage, HandMessage]
    gaze: tuple[Coordinate, Coordinate, Coordinate, Unit, Unit, Unit] | None = None

    def frame(self) -> PoseFrame:
        """In the play area, our axes. Raises ValueError: a quaternion is none."""
        hands = []
        for k, hand in enumerate(self.hands):
            pose = None if hand.pose is None else hand_from_grip(k, hand.pose[:3], _turn(hand.pose[3:]))
            hands.append(Hand(pose, hand.trigger, hand.squeeze, hand.stick, hand.buttons))
        head = None if self.head is None else head_from_xr(self.head[:3], _turn(self.head[3:]))
        gaze = None
        if self.gaze is not None:
            gaze = Gaze(vector_from_xr(self.gaze[:3]), vector_from_xr(self.gaze[3:]))
        return PoseFrame(self.time, head, (hands[0], hands[1]), gaze=gaze)


class Desktop(msgspec.Struct, forbid_unknown_fields=True, tag="desktop"):
    """Keys that are held; pixels and wheel since the last message; buttons of the mouse as bits."""

    down: Annotated[list[Key], msgspec.Meta(max_length=16)]
    move: tuple[Annotated[float, msgspec.Meta(ge=-1e5, le=1e5)], Annotated[float, msgspec.Meta(ge=-1e5, le=1e5)]]
    wheel: Annotated[float, msgspec.Meta(ge=-1e5, le=1e5)] = 0.0
    buttons: Annotated[int, msgspec.Meta(ge=0, lt=64)] = 0


class Rate(msgspec.Struct, forbid_unknown_fields=True, tag="rate"):
    """Frames a second, and how long the slowest one took, ms."""

    pictures: Annotated[float, msgspec.Meta(ge=0.0, le=1e5)]
    slowest: Annotated[float, msgspec.Meta(ge=0.0, le=1e7)]


Message = Devices | Desktop | Rate

_DECODER: msgspec.json.Decoder[Message] = msgspec.json.Decoder(Message)


def decode(message: str | bytes) -> Message:
    """A page's message. Raises ValueError: it is none."""
    if not isinstance(message, str) or len(message) > LARGEST:
        raise ValueError("no text of a page")
    try:
        found = _DECODER.decode(message)
    except (msgspec.MsgspecError, RecursionError, UnicodeError) as e:
        raise ValueError(str(e)) from e
    if isinstance(found, Devices):
        found.frame()
    return found


def pose_message(
    area: PlayArea, head: Pose | None, index: Int[np.ndarray, "n"], poses: Float[np.ndarray, "n 7"]
) -> bytes:
    """Poses for a page, float32, little-endian: how many; play area (x, y, z, yaw); whether there is a head, and its
    pose in the play area (position, quaternion); then of each body number, position and quaternion (w-x-y-z)."""
    row = np.zeros(13, "<f4")
    row[:5] = len(index), area.x, area.y, area.z, area.yaw
    if head is not None:
        row[5], row[6:9], row[9:] = 1.0, head.pos, head.quat
    return row.tobytes() + np.concatenate([index[:, None], poses], axis=1).astype("<f4").tobytes()


def _turn(xyzw: tuple[float, ...]) -> np.ndarray:
    turn = np.asarray(xyzw, np.float64)
    size = float(np.linalg.norm(turn))
    if abs(size - 1.0) > 0.01:
        raise ValueError(f"a quaternion of length {size:.3g}")
    return turn / size
