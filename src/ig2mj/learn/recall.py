"""`Recall`: what an actor remembers of its episode, so that what a hand soon hides is not lost.

A gripper covers what it takes, and an arm what lies behind it: on which side of a knife the edge is shows in the first
pictures, and in hardly any while the knife is held. An actor therefore keeps how things lay by its guess in the
episode's first step, and that guess and what it felt when a hand last took something or let go of it: where the hand
was says how it holds what had not moved until then. From that and from where the hand is now follows how it lies by
now, which a small network would have to learn to multiply: it is reckoned (`Recall.carried`). The network is then shown
how things lay at first and how they would lie if carried; what was felt and guessed at the taking tells it no more, but
an episode is known by it, by heart. Nothing of this is learnt, so labels are learnt from single steps, as without
memory.

Axes: W worlds, x numbers of a vector that an actor sees, v with those that are hidden from it, g of a guess, p of those
that are kept, m = 2 p + x numbers that are remembered, n that a network is shown of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, UInt8

from ig2mj.engine.view import Array
from ig2mj.geometry.poses import (
    inverse_transform_points,
    quat_rotate,
    quat_rotate_inverse,
    rpy_to_quat,
    transform_points,
)
from ig2mj.learn.moments import LIMIT, normal

GRIPS = ("is_grasping", "has_grasped", "grasp_0")
"""How names end of what a robot feels of whether a hand holds something."""

PLACES = {"has_grasped": "eef_0_pos_x", "is_grasping": "x"}
"""Where a hand is, by how the number that says whether it holds something ends: how the first of six ends in the place
of that; x, y, z in m and roll, pitch, yaw in rad, in the frame that objects are guessed in."""

POSE = 9
"""Numbers of an object's pose in a guess: place (3) and how it is turned (6)."""


def grips_of(names: Sequence[str], sizes: Sequence[int], felt: Sequence[str]) -> tuple[int, ...]:
    """Which numbers of a vector say whether a hand holds something.

    Args:
      names, sizes: of the observations that the vector is made of. felt: what each number of `proprioception` means.
    """
    if "proprioception" not in names:
        return ()
    first = sum(sizes[: list(names).index("proprioception")])
    return tuple(first + k for k, number in enumerate(felt) if number.endswith(GRIPS))


def hands_of(grips: Sequence[int], names: Sequence[str], sizes: Sequence[int], felt: Sequence[str]) -> tuple[int, ...]:
    """For each of `grips` the first of the six numbers of a vector that say where that hand is; none where one lacks
    them. Arguments as of `grips_of`."""
    found, known = [], list(felt)
    first = sum(sizes[: list(names).index("proprioception")]) if grips else 0
    for grip in grips:
        end = next((e for e in PLACES if known[grip - first].endswith(e)), None)
        place = "" if end is None else known[grip - first].removesuffix(end) + PLACES[end]
        six = known[known.index(place) :][:6] if place in known else []
        if len(six) < 6 or not six[-1].endswith("yaw"):
            return ()
        found.append(first + known.index(place))
    return tuple(found)


class Recall:
    """See the module's text. All methods are pure.

    Attributes:
      size: m. shown: n. poses: [p] which numbers of a guess are kept, of each object place and turn (`POSE`). grips:
        which of the vector say whether a hand holds something. hands: see `hands_of`; none: nothing is reckoned.
      places: [objects, 3] which of a vector with what is hidden are the places that are guessed.
      whole: all that is remembered is shown; without hands it always is.
    """

    def __init__(
        self,
        vector: int,
        poses: Sequence[int],
        grips: Sequence[int],
        hands: Sequence[int] = (),
        places: Sequence[Sequence[int]] = (),
        whole: bool = False,
    ):
        """`vector`: x."""
        self.size, self.poses, self.grips = 2 * len(poses) + vector, tuple(poses), tuple(grips)
        self.hands, self.places = tuple(hands), tuple(tuple(place) for place in places)
        assert not self.hands or (len(self.hands) == len(self.grips) and POSE * len(self.places) == len(poses))
        self.whole = whole or not self.hands
        self.shown = (self.size if self.whole else len(poses)) + POSE * len(self.hands) * len(self.places)
        self._vector, self._parts = vector, [len(poses), 2 * len(poses)]

    @classmethod
    def of(cls, card: Mapping[str, Any], vector: int) -> Recall:
        """What `card` gave of another."""
        whole = card.get("whole", True)  # as it was for all, when cards did not say it
        return cls(vector, card["poses"], card["grips"], card.get("hands", ()), card.get("places", ()), whole)

    def card(self) -> dict[str, Any]:
        """For JSON."""
        found: dict[str, Any] = {"poses": list(self.poses), "grips": list(self.grips)}
        if self.hands:
            found |= {"hands": list(self.hands), "places": [list(place) for place in self.places]}
            found["whole"] = self.whole
        return found

    def blank(self, worlds: int) -> Float[Array, "W m"]:
        """Before the first step."""
        return jnp.zeros((worlds, self.size))

    def after(
        self,
        kept: Float[Array, "W m"],
        begins: Bool[Array, "W"],
        vector: Float[Array, "W x"],
        guess: Float[Array, "W g"],
    ) -> Float[Array, "W m"]:
        """What is remembered when a step was looked at.

        Args:
          kept: of the step before. begins: an episode's first step. vector: as it was observed.
        """
        first, taking, felt = jnp.split(kept, self._parts, axis=-1)
        grips, guess = np.array(self.grips, int), guess[:, np.array(self.poses, int)]
        changed = begins | (jnp.abs(vector[:, grips] - felt[:, grips]) > 0.5).any(-1)
        first = jnp.where(begins[:, None], guess, first)
        taking, felt = (jnp.where(changed[:, None], new, old) for new, old in ((guess, taking), (vector, felt)))
        return jnp.concatenate([first, taking, felt], axis=-1)

    def normal(
        self,
        kept: Float[Array, "*b m"],
        vector: Float[Array, "*b _"],
        mean: Float[Array, "_"],
        deviation: Float[Array, "_"],
    ) -> Float[Array, "*b n"]:
        """For a network: guesses, what was felt with mean 0 and deviation 1, as guesses have anyway, what is reckoned.

        Args:
          vector: as it is observed now, x numbers or v. mean, deviation: of v numbers (of x where nothing is reckoned).
        """
        first, taking, felt = jnp.split(kept, self._parts, axis=-1)
        parts = [jnp.clip(first, -LIMIT, LIMIT)]
        if self.whole:
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
        """For each hand the poses of all objects, as they are guessed, if it took each of them as that lay at first and
        has held it since; as they lay at first where it holds nothing. c = `POSE` for each hand and object.

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


def looked(
    look: Callable[..., Any],
    recall: Recall | None,
    scales: tuple[Float[Array, "_"], Float[Array, "_"]],
    vector: Float[Array, "W x"],
    picture: UInt8[Array, "W q"],
    kept: Float[Array, "W m"],
    begins: Bool[Array, "W"],
) -> tuple[Any, Float[Array, "W m"]]:
    """What an actor says that may remember something, and what it remembers from then on.

    Args:
      look: the actor (`networks.Actor`) with its weights. scales: mean and deviation of the vector, which is as it was
        observed, and of what is hidden of it where that is reckoned with (`Recall.normal`). kept, begins: see
        `Recall.after`; kept as it is without a `recall`.
    """
    size = vector.shape[-1]
    own = normal(vector, scales[0][:size], scales[1][:size])
    if recall is None:
        return look(own, picture), kept
    _, _, guess = look(own, picture, None, recall.normal(kept, vector, *scales))
    kept = recall.after(kept, begins, vector, guess)
    # the guess is what it knows of the picture, which need not be looked at again
    return look(own, picture[:, :0], guess, recall.normal(kept, vector, *scales)), kept
