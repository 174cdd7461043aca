"""What an algorithm may be extended by: an encoder of images, a memory, and an adviser that gives labels.

Algorithms know these protocols only. `ig2mj.learn.algorithms.make_algorithm` puts the parts together.

Axes: W worlds, B samples, n numbers of an action, v of a vector, x of those an actor sees, q bytes of an image, f
features, g numbers of a prediction, m numbers that are remembered, k of them as a network sees them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, runtime_checkable

from jaxtyping import Bool, Float, UInt8

from ig2mj.engine.view import Array

Expert = Callable[..., Array]
"""From an environment's state to actions [W, n] (`ig2mj.envs.experts.expert_of`)."""

Scales = tuple[Float[Array, "v"], Float[Array, "v"]]
"""Mean and standard deviation of every number of a vector."""


@runtime_checkable
class Encoder(Protocol):
    """Turns images into features for an actor, and predicts privileged numbers from them.

    A constant that can be hashed. Its methods are called inside `networks.ActorNetwork`: the layers that they make
    are that module's.

    Attributes:
      shape: height, width and channels of an image. predictions: g; 0 where nothing is predicted.
      acts_on_prediction: the actor's layers see the prediction, and the prediction's loss alone trains the encoder.
    """

    @property
    def shape(self) -> tuple[int, int, int]: ...

    @property
    def predictions(self) -> int: ...

    @property
    def acts_on_prediction(self) -> bool: ...

    def features(self, image: UInt8[Array, "B q"]) -> Float[Array, "B f"]:
        """Features of images."""
        ...

    def predict(
        self, features: Float[Array, "B f"], vector: Float[Array, "B x"]
    ) -> tuple[Float[Array, "B g"], Float[Array, "B h"]]:
        """The prediction, and the features that the actor's layers see besides.

        Args:
          vector: what the actor sees apart from the image.
        """
        ...

    def card(self) -> dict[str, Any]:
        """What a policy's card says of it, for JSON."""
        ...


@runtime_checkable
class Memory(Protocol):
    """What an actor remembers of its episode. Constants only; all methods are pure.

    Attributes:
      size: m. shown: k.
    """

    size: int
    shown: int

    def blank(self, worlds: int) -> Float[Array, "W m"]:
        """Before the first step."""
        ...

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
        ...

    def normal(
        self,
        kept: Float[Array, "*b m"],
        vector: Float[Array, "*b _"],
        mean: Float[Array, "_"],
        deviation: Float[Array, "_"],
    ) -> Float[Array, "*b k"]:
        """What a network sees of the memory, each number with a deviation of about 1.

        Args:
          vector: as it is observed now, x or v numbers. mean, deviation: of them.
        """
        ...

    def card(self) -> dict[str, Any]:
        """What a policy's card says of it, for JSON."""
        ...


@runtime_checkable
class Adviser(Protocol):
    """Who gives the labels that a policy learns from. All methods are pure.

    An adviser may keep notes of every world from step to step: a pytree of arrays that begin with the world axis.
    """

    def begin(self, num_worlds: int) -> Any:
        """Notes before the first step; None where it keeps none."""
        ...

    def label(self, state: Any, notes: Any, begins: Bool[Array, "W"]) -> Float[Array, "W n"]:
        """The actions that the policy should take.

        Args:
          state: of the environment. notes: of the step before. begins: the step is the first of an episode.
        """
        ...

    def observe(
        self,
        notes: Any,
        begins: Bool[Array, "W"],
        scales: Scales,
        vector: Float[Array, "W v"],
        kept: Float[Array, "W m"],
        prediction: Float[Array, "W g"],
    ) -> Any:
        """Notes after the policy has looked at a step.

        Args:
          vector: as it was observed, privileged numbers included. kept: what the policy remembers now.
        """
        ...


class ExpertAdviser:
    """Labels of an expert that sees the state as it is."""

    def __init__(self, expert: Expert):
        """`expert`: pure."""
        self.expert = expert

    def begin(self, num_worlds: int) -> None:
        """It keeps no notes."""

    def label(self, state: Any, notes: None, begins: Bool[Array, "W"]) -> Float[Array, "W n"]:
        """The expert's actions."""
        return self.expert(state)

    def observe(self, notes: None, begins: Any, scales: Scales, vector: Array, kept: Array, prediction: Array) -> None:
        """Nothing is noted."""


def as_adviser(adviser: Adviser | Expert | None) -> Adviser | None:
    """An adviser, also of an expert alone."""
    return adviser if adviser is None or isinstance(adviser, Adviser) else ExpertAdviser(adviser)
