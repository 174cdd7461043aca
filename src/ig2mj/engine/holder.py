"""`EngineHolder`: what holds an engine is copied and pickled on purpose only.

A copy of an engine shares or doubles what the engine steps: two objects that look independent change each other's
worlds, or a pickle stops in the middle of a compiled program. States of worlds are copied instead (`fork`, `save`).
"""

from __future__ import annotations

from typing import Any, ClassVar

from ig2mj.errors import EngineError


class EngineHolder:
    """Mixin. `copy.copy` gives another object on the same engine; `copy.deepcopy` and `pickle` raise EngineError."""

    NO_COPY: ClassVar[str] = "it holds its engine, and is neither copied nor pickled"
    """Of the error: why, and what is done instead."""

    def __copy__(self) -> Any:
        """Another object on the same engine."""
        other = object.__new__(type(self))
        vars(other).update(vars(self))
        return other

    def __deepcopy__(self, memo: dict[int, Any]) -> Any:
        """Raises EngineError."""
        raise EngineError(f"{self!r}: {self.NO_COPY}")

    def __reduce__(self) -> Any:
        """Raises EngineError."""
        raise EngineError(f"{self!r}: {self.NO_COPY}")
