"""`Recall`: what an actor remembers of its episode, so that what a hand soon hides is not lost.

A gripper covers what it takes, and an arm what lies behind it: on which side of a knife the edge is shows in the first
pictures, and in hardly any while the knife is held. An actor therefore keeps how things lay by its guess in the
episode's first step, and that guess and what it felt when a hand last took something or let go of it: where the hand
was says how it holds what had not moved until then. Nothing of this is learnt, so labels are learnt from single steps,
as without memory.

Axes: W worlds, x numbers of a vector that an actor sees, g of a guess, p of those that are kept, m = 2 p + x numbers
that are remembered.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, UInt8

from ig2mj.engine.view import Array
from ig2mj.learn.moments import LIMIT, normal

GRIPS = ("is_grasping", "has_grasped", "grasp_0")
"""How names end of what a robot feels of whether a hand holds something."""


def grips_of(names: Sequence[str], sizes: Sequence[int], felt: Sequence[str]) -> tuple[int, ...]:
    """Which numbers of a vector say whether a hand holds something.

    Args:
      names, sizes: of the observations that the vector is made of. felt: what each number of `proprioception` means.
    """
    if "proprioception" not in names:
        return ()
    first = sum(sizes[: list(names).index("proprioception")])
    return tuple(first + k for k, number in enumerate(felt) if number.endswith(GRIPS))


class Recall:
    """See the module's text. All methods are pure.

    Attributes:
      size: m. poses: [p] which numbers of a guess are kept. grips: which of the vector say whether a hand holds
        something.
    """

    def __init__(self, vector: int, poses: Sequence[int], grips: Sequence[int]):
        """`vector`: x."""
        self.size, self.poses, self.grips = 2 * len(poses) + vector, tuple(poses), tuple(grips)
        self._parts = [len(poses), 2 * len(poses)]

    @classmethod
    def of(cls, card: Mapping[str, Any], vector: int) -> Recall:
        """What `card` gave of another."""
        return cls(vector, card["poses"], card["grips"])

    def card(self) -> dict[str, Any]:
        """For JSON."""
        return {"poses": list(self.poses), "grips": list(self.grips)}

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
        self, kept: Float[Array, "*b m"], mean: Float[Array, "x"], deviation: Float[Array, "x"]
    ) -> Float[Array, "*b m"]:
        """For a network: what was felt with mean 0 and deviation 1, as guesses have anyway."""
        guesses, felt = jnp.split(kept, self._parts[1:], axis=-1)
        return jnp.concatenate([jnp.clip(guesses, -LIMIT, LIMIT), normal(felt, mean, deviation)], axis=-1)


def looked(
    look: Callable[..., Any],
    recall: Recall | None,
    scales: tuple[Float[Array, "x"], Float[Array, "x"]],
    vector: Float[Array, "W x"],
    picture: UInt8[Array, "W q"],
    kept: Float[Array, "W m"],
    begins: Bool[Array, "W"],
) -> tuple[Any, Float[Array, "W m"]]:
    """What an actor says that may remember something, and what it remembers from then on.

    Args:
      look: the actor (`networks.Actor`) with its weights. scales: mean and deviation of the vector, which is as it was
        observed. kept, begins: see `Recall.after`; kept as it is without a `recall`.
    """
    own = normal(vector, *scales)
    if recall is None:
        return look(own, picture), kept
    _, _, guess = look(own, picture, None, recall.normal(kept, *scales))
    kept = recall.after(kept, begins, vector, guess)
    # the guess is what it knows of the picture, which need not be looked at again
    return look(own, picture[:, :0], guess, recall.normal(kept, *scales)), kept
