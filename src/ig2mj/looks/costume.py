"""How robots are drawn in place of, or next to, their own visual geoms: parts on bodies, and arms between two bodies.

A robot that has a method `costume` gives one. Parts follow the bodies of the scene; they are geoms behind the scene's
own, so that its ids, collisions and masses stay. Arms are two bones, whose poses follow from the shoulder and the
wrist by inverse kinematics; nothing of them is simulated.

Axes: W worlds, B bodies, F followers (geoms).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import mujoco
import numpy as np
from jaxtyping import Float, Int

from ig2mj.looks.mesh import Builder
from ig2mj.scene.scene import Scene

Vector = tuple[float | int, float | int, float | int]


@dataclasses.dataclass(frozen=True)
class Arm:
    """An upper arm and a forearm of equal length. Bones lie along +z of their own frames, from the shoulder's end.

    Attributes:
      shoulder, wrist: body, and the point on it in its frame, m.
      length: m of each bone. pole: direction in the shoulder body's frame to which the elbow points.
      upper, fore: what is drawn of each.
    """

    shoulder: tuple[str, Vector]
    wrist: tuple[str, Vector]
    length: float | int
    pole: Vector
    upper: Builder
    fore: Builder


@dataclasses.dataclass(frozen=True)
class Costume:
    """What a robot is drawn as.

    Attributes: parts: what is drawn on bodies, in their frames. hidden: bodies whose own visual geoms are not seen.
    """

    parts: Mapping[str, Builder] = dataclasses.field(default_factory=dict)
    arms: Sequence[Arm] = ()
    hidden: Sequence[str] = ()


@runtime_checkable
class Dressed(Protocol):
    """A robot that has a costume."""

    def costume(self) -> Costume: ...


def costumes_of(scene: Scene) -> list[Costume]:
    """Of the robots that were loaded with a scene."""
    return [agent.costume() for agent in scene.agents if isinstance(agent, Dressed)]


def names_of(kind: str, number: int, part: str) -> str:
    """Name of the materials and geoms of a part of a robot, before their own."""
    return f"robot_{number}_{kind}_{part}"


class Followers:
    """Where the geoms of costumes are, from the poses of bodies.

    Attributes: geoms: their ids in the model of the looks.
    """

    def __init__(self, scene: Scene, model: mujoco.MjModel):
        """Finds them by their names."""
        self._body: list[int] = []
        self._bone: list[int] = []  # 0: on the body; 1 + 2 arm: its upper arm; 2 + 2 arm: its forearm
        geoms: list[int] = []
        self._arms: list[tuple[int, np.ndarray, int, np.ndarray, float, np.ndarray]] = []
        prefixes = dict[str, tuple[int, int]]()
        for number, costume in enumerate(costumes_of(scene)):
            for body in costume.parts:
                prefixes[names_of("on", number, body)] = _body_id(model, body), 0
            for k, arm in enumerate(costume.arms):
                at = len(self._arms)
                shoulder, wrist = (_body_id(model, body) for body, _ in (arm.shoulder, arm.wrist))
                ends = np.array(arm.shoulder[1], float), np.array(arm.wrist[1], float)
                self._arms.append((shoulder, ends[0], wrist, ends[1], float(arm.length), np.array(arm.pole, float)))
                prefixes[names_of("upper", number, str(k))] = shoulder, 1 + 2 * at
                prefixes[names_of("fore", number, str(k))] = shoulder, 2 + 2 * at
        for geom in range(scene.model.ngeom, model.ngeom):
            known = prefixes.get(model.geom(geom).name.removeprefix("ig2mj/").rpartition("/")[0])
            if known is not None:
                geoms.append(geom)
                self._body.append(known[0])
                self._bone.append(known[1])
        self.geoms: Int[np.ndarray, "F"] = np.array(geoms, int)
        self._pos = np.array(model.geom_pos[self.geoms], float)
        turned = np.zeros((len(geoms), 9))
        for k, geom in enumerate(geoms):
            mujoco.mju_quat2Mat(turned[k], model.geom_quat[geom])
        self._turn = turned.reshape(-1, 3, 3)

    def __len__(self) -> int:
        return len(self.geoms)

    @property
    def riders(self) -> dict[int, int]:
        """Geoms that are fixed to a body, each with that body; the others are of arms."""
        found = zip(self.geoms.tolist(), self._body, self._bone, strict=True)
        return {geom: body for geom, body, bone in found if not bone}

    def poses(self, pos: Float[Any, "W B 3"], axes: Float[Any, "W B 3 3"], xp: Any = np) -> tuple[Any, Any]:
        """Positions [W, F, 3] and rotation matrices [W, F, 3, 3] of the geoms, world frame.

        Args:
          pos, axes: of bodies. xp: NumPy, or what has its functions.
        """
        frames_pos, frames_axes = [], []
        bones = [bone for arm in self._arms for bone in _bones(arm, pos, axes, xp)]
        for body, bone in zip(self._body, self._bone, strict=True):
            frames_pos.append(bones[bone - 1][0] if bone else pos[:, body])
            frames_axes.append(bones[bone - 1][1] if bone else axes[:, body])
        at, turn = xp.stack(frames_pos, 1), xp.stack(frames_axes, 1)
        return at + xp.einsum("wfij,fj->wfi", turn, self._pos), xp.einsum("wfij,fjk->wfik", turn, self._turn)


def _bones(arm: tuple, pos: Any, axes: Any, xp: Any) -> list[tuple[Any, Any]]:
    """Frames of an arm's two bones: positions [W, 3] and axes [W, 3, 3].

    A hand farther away than the arm is long keeps its forearm; the upper arm keeps to the shoulder.
    """
    shoulder_body, shoulder_at, wrist_body, wrist_at, length, pole = arm
    shoulder = pos[:, shoulder_body] + axes[:, shoulder_body] @ shoulder_at
    wrist = pos[:, wrist_body] + axes[:, wrist_body] @ wrist_at
    between = wrist - shoulder
    far = xp.maximum(xp.linalg.norm(between, axis=-1, keepdims=True), 1e-6)
    along = between / far
    side = axes[:, shoulder_body] @ pole
    side = side - (side * along).sum(-1, keepdims=True) * along
    side = side / xp.maximum(xp.linalg.norm(side, axis=-1, keepdims=True), 1e-6)
    reach = xp.minimum(far / 2, length)
    high = xp.sqrt(xp.maximum(length * length - reach * reach, 0.0))
    from_shoulder = shoulder + reach * along + high * side
    from_wrist = wrist - reach * along + high * side
    frames = []
    for start, end in ((shoulder, from_shoulder), (from_wrist, wrist)):
        z = (end - start) / length
        y = xp.cross(z, side)
        y = y / xp.maximum(xp.linalg.norm(y, axis=-1, keepdims=True), 1e-6)
        frames.append((start, xp.stack([xp.cross(y, z), y, z], axis=-1)))
    return frames


def _body_id(model: mujoco.MjModel, name: str) -> int:
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
    assert number >= 0, f"a costume is for the body '{name}', which its robot does not have"
    return number
