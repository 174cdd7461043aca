"""Functions of another library replaced for some of its callers only.

While at least one block of a `ScopedReplacement` is entered, a function that chooses stands in place of each replaced
one: in threads that are inside a block it calls ours, in all others the original. Outside all blocks the library is
unchanged. Entries and exits of several threads are counted under a lock.
"""

from __future__ import annotations

import contextlib
import functools
import threading
from collections.abc import Callable, Iterator, Mapping
from types import ModuleType
from typing import Any, no_type_check

Place = tuple[ModuleType | type, str]
"""A module or a class, and the name of a function in it."""


class ScopedReplacement:
    """Our functions in place of others; without effect until a block is entered."""

    def __init__(self) -> None:
        self._own: dict[Place, Callable[..., Any]] = {}
        self._lock = threading.Lock()
        self._entered = 0
        self._originals: dict[Place, Any] = {}
        self._chosen: dict[Place, Any] = {}
        self._here = threading.local()

    def add(self, own: Mapping[Place, Callable[..., Any]]) -> None:
        """Adds functions of ours, by the place they are put in; they take part in blocks entered from now on."""
        with self._lock:
            self._own |= own

    @property
    @no_type_check
    def active(self) -> bool:
        """Whether this thread's calls go to our functions."""
        return getattr(self._here, "active", False)

    @contextlib.contextmanager
    def entered(self, active: bool = True) -> Iterator[None]:
        """Inside the block this thread's calls go to our functions, or with `active` false to the originals."""
        before = self.active
        self._put()
        self._here.active = active
        try:
            yield
        finally:
            self._here.active = before
            self._take_back()

    @no_type_check
    def original(self, holder: ModuleType | type, name: str) -> Any:
        """The function that stands in the library under this name, in a module or a class."""
        place = (holder, name)
        return self._originals[place] if place in self._originals else getattr(holder, name)

    def _put(self) -> None:
        with self._lock:
            self._entered += 1
            for place, own in self._own.items():
                if place not in self._originals:
                    self._originals[place] = getattr(*place)
                    self._chosen[place] = self._chooser(own, self._originals[place])
                    setattr(*place, self._chosen[place])

    def _take_back(self) -> None:
        with self._lock:
            self._entered -= 1
            if self._entered:
                return
            for place in list(self._chosen):
                # Where another function was put over ours in the meantime, both stay: theirs may call ours.
                if getattr(*place) is self._chosen[place]:
                    setattr(*place, self._originals.pop(place))
                    del self._chosen[place]

    def _chooser(self, own: Callable[..., Any], original: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(original)
        @no_type_check
        def choose(*args: Any, **kwargs: Any) -> Any:
            return (own if self.active else original)(*args, **kwargs)

        return choose
