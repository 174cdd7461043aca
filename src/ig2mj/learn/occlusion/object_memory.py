"""`ObjectMemory`: what an actor remembers of its episode, so that what a hand soon hides is not lost.

A gripper covers what it takes, and an arm what lies behind it: on which side of a knife the edge is shows in the first
images, and in hardly any while the knife is held. An actor therefore keeps the poses of objects that it predicted in
the episode's first step, and its prediction and proprioception of the step in which a hand last took something or let
go of it. From the hand's pose then and now follows how the object lies now, if the hand carries it. The memory is
computed in closed form (`ObjectMemory.carried`); it is not learned, so labels are learned from single steps, as without
a memory. The network sees the first poses and the carried ones. With `full` it also sees what was felt and predicted at
the last grasp; that adds no information and lets it overfit to single episodes.

Axes: W worlds, x numbers of a vector that an actor sees, v with the privileged ones, g of a prediction, p of those that
are kept, m = 2 p + x numbers that are remembered, n of them as a network sees them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from ig2mj.agents.base import HandReading
from ig2mj.engine.view import Array
from ig2mj.errors import Ig2mjError
from ig2mj.geometry.poses import (
    inverse_transform_points,
    quat_rotate,
    quat_rotate_inverse,
    rpy_to_quat,
    transform_points,
)
from ig2mj.learn.perception import Perception
from ig2mj.learn.running_stats import LIMIT, normal

POSE = 9
"""Numbers of an object's pose in a prediction: position (3) and rotation (6)."""

PROPRIOCEPTION = "proprioception"


def make_memory(perception: Perception, readings: Sequence[HandReading], full: bool = False) -> ObjectMemory:
    """The memory of an actor of images.

    Args:
      readings: of the robot's controller, of each hand that may hold something.

    Raises:
      Ig2mjError: the actor predicts no pose.
    """
    targets = perception.targets
    if targets is None or not targets.poses:
        raise Ig2mjError("object_memory: the actor predicts no pose of an object (encoder = glimpses, obs = rgbd)")
    parts = targets.poses.values()
    grips, hands = hand_numbers(perception, readings)
    return ObjectMemory(
        perception.actor_size,
        [k for place, turned in parts for k in (*place, *turned)],
        grips,
        hands,
        [[int(targets.plain[k]) for k in place] for place, _ in parts],
        full,
    )


def hand_numbers(perception: Perception, readings: Sequence[HandReading]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Which numbers of a vector say of each hand whether it holds something, and the first of six of each that say
    where it is; none of these where one hand lacks them."""
    names = perception.vector_names
    if PROPRIOCEPTION not in names:
        return (), ()
    first = sum(perception.sizes[: names.index(PROPRIOCEPTION)])
    grips = tuple(first + reading.holds for reading in readings)
    poses = [reading.pose for reading in readings]
    return grips, () if None in poses else tuple(first + k for k in poses if k is not None)


class ObjectMemory:
    """See the module's text. All methods are pure.

    Attributes:
      size: m. shown: n. poses: [p] which numbers of a prediction are kept, `POSE` of each object.
      grips, hands: see `hand_numbers`; without hands no pose is carried.
      places: [objects, 3] which of a vector with privileged numbers are the positions that are predicted.
      full: the network sees all that is remembered; without hands it always does.
    """

    def __init__(
        self,
        vector: int,
        poses: Sequence[int],
        grips: Sequence[int],
        hands: Sequence[int] = (),
        places: Sequence[Sequence[int]] = (),
        full: bool = False,
    ):
        """`vector`: x."""
        self.size, self.poses, self.grips = 2 * len(poses) + vector, tuple(poses), tuple(grips)
        self.hands, self.places = tuple(hands), tuple(tuple(place) for place in places)
        assert not self.hands or (len(self.hands) == len(self.grips) and POSE * len(self.places) == len(poses))
        self.full = full or not self.hands
        self.shown = (self.size if self.full else len(poses)) + POSE * len(self.hands) * len(self.places)
        self._vector, self._parts = vector, [len(poses), 2 * len(poses)]

    @classmethod
    def of(cls, card: Mapping[str, Any], vector: int) -> ObjectMemory:
        """The memory that `card` describes; a card without "whole" is of a full one."""
        full = card.get("whole", True)
        return cls(vector, card["poses"], card["grips"], card.get("hands", ()), card.get("places", ()), full)

    def card(self) -> dict[str, Any]:
        """For JSON."""
        found: dict[str, Any] = {"poses": list(self.poses), "grips": list(self.grips)}
        if self.hands:
            found |= {"hands": list(self.hands), "places": [list(place) for place in self.places]}
            found["whole"] = self.full
        return found

    def blank(self, worlds: int) -> Float[Array, "W m"]:
        """Before the first step."""
        return jnp.zeros((worlds, self.size))

    def after(
        self,
        kept: Float[Array, "W m"],
        begins: Bool[Array, "W"],
        vector: Float[Array, "W x"],
        prediction: Float[Array, "W g"],
    ) -> Float[Array, "W m"]:
        """What is remembered after a step.

        Args:
          kept: of the step before. begins: the step is the first of an episode. vector: as it was observed.
        """
        first, taking, felt = jnp.split(kept, self._parts, axis=-1)
        grips, poses = np.array(self.grips, int), prediction[:, np.array(self.poses, int)]
        changed = begins | (jnp.abs(vector[:, grips] - felt[:, grips]) > 0.5).any(-1)
        first = jnp.where(begins[:, None], poses, first)
        taking, felt = (jnp.where(changed[:, None], new, old) for new, old in ((poses, taking), (vector, felt)))
        return jnp.concatenate([first, taking, felt], axis=-1)

    def normal(
        self,
        kept: Float[Array, "*b m"],
        vector: Float[Array, "*b _"],
        mean: Float[Array, "_"],
        deviation: Float[Array, "_"],
    ) -> Float[Array, "*b n"]:
        """What a network sees: predictions, with `full` what was felt, and carried poses, with a deviation of about 1.

        Args:
          vector: as it is observed now, x numbers or v. mean, deviation: of v numbers (of x without hands).
        """
        first, taking, felt = jnp.split(kept, self._parts, axis=-1)
        parts = [jnp.clip(first, -LIMIT, LIMIT)]
        if self.full:
            parts += [jnp.clip(taking, -LIMIT, LIMIT), normal(felt, mean[: self._vector], deviation[: self._vector])]
        if self.hands:
            parts.append(jnp.clip(self.carried(kept, vector, mean, deviation), -LIMIT, LIMIT))
        return jnp.concatenate(parts, axis=-1)

    def carried(
        self,
        kept: Float[Array, "*b m"],
        vector: Float[Array, "*b _"],
        mean: Float[Array, "v"],
        deviation: Float[Array, "v"],
    ) -> Float[Array, "*b c"]:
        """For each hand the poses of all objects, in the units of predictions, if it took each object where that lay at
        first and has held it since; their first poses where it holds nothing. c = `POSE` for each hand and object.

        Arguments as of `normal`.
        """
        first, _, felt = jnp.split(kept, self._parts, axis=-1)
        places, found = np.array(self.places, int), list[Array]()
        poses = first.reshape(*first.shape[:-1], len(places), POSE)
        middle, spread = jnp.asarray(mean)[places], jnp.asarray(deviation)[places]
        place, columns = poses[..., :3] * spread + middle, poses[..., 3:].reshape(*poses.shape[:-1], 2, 3)
        for grip, hand in zip(self.grips, self.hands, strict=True):
            (at, was), (to, now) = (
                (v[..., hand : hand + 3], rpy_to_quat(v[..., hand + 3 : hand + 6])) for v in (felt, vector)
            )
            moved = transform_points(to, now, inverse_transform_points(at, was, place))
            was, now = was[..., None, None, :], now[..., None, None, :]
            turned = quat_rotate(now, quat_rotate_inverse(was, columns)).reshape(poses[..., 3:].shape)
            held = jnp.concatenate([(moved - middle) / spread, turned], axis=-1)
            holds = (vector[..., grip] > 0.5) & (felt[..., grip] > 0.5)
            found.append(jnp.where(holds[..., None, None], held, poses).reshape(*first.shape[:-1], -1))
        return jnp.concatenate(found, axis=-1)
