"""`Rung`: what carries out the steps of a plan, in some worlds at once.

Three rungs have this interface: *symbolic* sets states, *kinematic* plans and checks motion and sets states, *physics*
acts. What fails on a rung and not on the one below it is a fault of what the rung adds.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from ig2mj.planning.facts import Facts
from ig2mj.planning.steps import Outcome, Step


@runtime_checkable
class Rung(Protocol):
    """See the module's text.

    Attributes:
      name: "symbolic", "kinematic" or "physics". num_worlds: W.
    """

    name: str

    @property
    def num_worlds(self) -> int: ...

    def facts(self, world: int) -> Facts:
        """What holds in a world now. To be read before anything else is asked of the rung."""
        ...

    def begin(self, world: int, step: Step) -> None:
        """Starts a primitive in a world; each world has at most one at a time."""
        ...

    def advance(self) -> dict[int, Outcome]:
        """Goes on until the primitive of at least one world has ended; outcomes of the worlds whose primitives have."""
        ...

    def ended(self, world: int) -> str | None:
        """Why no further primitive can begin in a world, in words, "" where its goal holds; None: one can."""
        ...
