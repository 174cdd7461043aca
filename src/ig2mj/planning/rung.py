"""`Rung`: carries out the steps of plans, in several worlds at once.

Three rungs have this interface: *symbolic* sets states, *kinematic* plans and checks motion and sets states, *physics*
acts. A failure that occurs on one rung and not on the rung below it is caused by what the rung adds.
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
        """What holds in a world now; valid until the rung's next method is called."""
        ...

    def begin(self, world: int, step: Step) -> None:
        """Starts a primitive in a world; each world has at most one at a time."""
        ...

    def advance(self) -> dict[int, Outcome]:
        """Continues until the primitive of at least one world has ended. Returns the outcomes of ended primitives."""
        ...

    def ended(self, world: int) -> str | None:
        """Why no further primitive can begin in a world, in words, "" where its goal holds; None: one can."""
        ...
