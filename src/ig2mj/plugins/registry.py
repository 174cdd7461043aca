"""`Registry`: things of one kind by name, those of ig2mj and those of plug-ins."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Generic, TypeVar

from ig2mj.errors import PluginError
from ig2mj.plugins.entry_points import Plugin, installed
from ig2mj.plugins.named_files import import_named
from ig2mj.process.user_warning import OURS

T = TypeVar("T")


class Registry(Mapping[str, T], Generic[T]):
    """Things of one kind by name: ig2mj's own, then what was registered, then what installed packages have.

    It is a mapping. Names of installed packages' things are known without importing them; reading a value imports it.

    Attributes:
      kind: "state", "predicate", ... expected: what a thing of it is, for messages.
    """

    def __init__(
        self,
        kind: str,
        expected: str,
        fits: Callable[[Any], bool],
        own: Mapping[str, T] | None = None,
        words: Callable[[T], Iterable[str]] = lambda thing: (),
        pattern: str = "[a-z][a-z0-9_]*",
    ):
        """A registry with ig2mj's own things.

        Args:
          fits: whether something is what is expected. own: ig2mj's things by name; None: `ship` says.
          words: names besides its own that a thing takes, e.g. aliases. pattern: regular expression of names.
        """
        self.kind, self.expected = kind, expected
        self._fits, self._of, self._pattern = fits, words, pattern
        self._own: Mapping[str, T] = own if own is not None else {}
        self._registered: dict[str, tuple[T, str]] = {}
        self._loaded: dict[Plugin, T] = {}

    def ship(self, own: Mapping[str, T]) -> None:
        """Sets ig2mj's own things."""
        self._own = own

    def __getitem__(self, name: str) -> T:
        if name in self._own:
            return self._own[name]
        import_named()
        if name in self._registered:
            return self._registered[name][0]
        return self._load(self.plugins()[name])

    def __contains__(self, name: object) -> bool:
        return name in self._own or name in self.sources()

    def __iter__(self) -> Iterator[str]:
        return iter([*self._own, *self.sources()])

    def __len__(self) -> int:
        return len(self._own) + len(self.sources())

    def added(self) -> dict[str, T]:
        """All things that are not ig2mj's own, by name; those of installed packages are imported.

        Raises:
          PluginError: one cannot be imported, is not what is expected, or has a name that is taken.
        """
        return {name: self[name] for name in self.sources()}

    def sources(self) -> dict[str, str]:
        """Where things that are not ig2mj's own come from, by name: "ig2mj-ageing 0.1.0", "module my_states". Imports
        nothing of installed packages. Raises PluginError: an entry point has a name that is taken."""
        import_named()
        registered = {name: source for name, (_, source) in self._registered.items()}
        return registered | {name: plugin.source for name, plugin in self.plugins().items()}

    def plugins(self) -> dict[str, Plugin]:
        """Entry points of this kind by name. Raises PluginError: one has a name that is taken."""
        found: dict[str, Plugin] = {}
        for plugin in installed()[0]:
            if plugin.kind != self.kind:
                continue
            if not re.fullmatch(self._pattern, plugin.name):
                raise plugin.error(f"names of this kind are '{self._pattern}'")
            by = {**dict.fromkeys(self._own, "ig2mj"), **{n: s for n, (_, s) in self._registered.items()}}
            by |= {name: other.source for name, other in found.items()}
            if plugin.name in by:
                raise plugin.error(f"the name is taken by {by[plugin.name]}; rename it")
            found[plugin.name] = plugin
        return found

    def add(self, name: str, thing: T, source: str, replace: bool = False) -> None:
        """Registers a thing.

        Args:
          source: where it comes from. replace: whether what was registered under this name gives way.

        Raises:
          PluginError: it is not what is expected, or a name that it takes is taken.
        """
        self.check(name, thing, source, replace)
        self._registered[name] = thing, source

    def check(self, name: str, thing: Any, source: str, replace: bool = False) -> None:
        """Raises PluginError: see `add`."""
        if not self._fits(thing):
            raise PluginError(f"{self.kind} '{name}': register {self.expected}, not {thing!r:.80}")
        if not isinstance(name, str) or not re.fullmatch(self._pattern, name):
            raise PluginError(f"{self.kind} {name!r:.80}: names of this kind are '{self._pattern}'")
        installed_here = {other: plugin.source for other, plugin in self.plugins().items()}
        taken = self._taken(without=name if replace else None) | installed_here
        self._refuse_taken(name, thing, taken, lambda text: PluginError(f"{self.kind} '{name}' of {source}: {text}"))

    def registered(self) -> dict[str, tuple[T, str]]:
        """What `add` registered, with its source."""
        return dict(self._registered)

    def restore(self, registered: Mapping[str, tuple[T, str]]) -> None:
        """What `registered` gave is registered, and nothing else."""
        self._registered = dict(registered)

    def _load(self, plugin: Plugin) -> T:
        if plugin in self._loaded:
            return self._loaded[plugin]
        thing: Any = plugin.load(self.expected)
        if not self._fits(thing):
            raise plugin.error(f"{plugin.target} is {thing!r:.80}; {self.expected} is expected")
        named = _own_name(thing)
        if named is not None and named != plugin.name:
            raise plugin.error(f"{plugin.target} has the name '{named}'; name the entry point '{self.kind}.{named}'")
        self._refuse_taken(plugin.name, thing, self._taken(), plugin.error)
        self._loaded[plugin] = thing
        return thing

    def _taken(self, without: str | None = None) -> dict[str, str]:
        """Who has each name and alias, of all that is imported."""
        there = [(name, thing, "ig2mj") for name, thing in self._own.items()]
        there += [(name, thing, source) for name, (thing, source) in self._registered.items() if name != without]
        here = self.plugins().values()
        there += [(plugin.name, thing, plugin.source) for plugin, thing in self._loaded.items() if plugin in here]
        return {word: source for name, thing, source in there for word in self._words(name, thing)}

    def _words(self, name: str, thing: Any) -> tuple[str, ...]:
        return name, *(self._of(thing) if self._fits(thing) else ())

    def _refuse_taken(self, name: str, thing: T, taken: Mapping[str, str], error: Callable[[str], PluginError]) -> None:
        for word in self._words(name, thing):
            if word in taken:
                raise error(f"the name '{word}' is taken by {taken[word]}; rename it")


def _own_name(thing: Any) -> str | None:
    """The name that a thing itself has; classes and functions have none that counts."""
    name = None if callable(thing) else getattr(thing, "name", None)
    return name if isinstance(name, str) else None


def source_of_caller() -> str:
    """The module outside of ig2mj that calls, as the source of what it registers."""
    frame = sys._getframe(1)
    while frame.f_back is not None and str(frame.f_globals.get("__name__", "")).split(".")[0] in OURS:
        frame = frame.f_back
    return f"module {frame.f_globals.get('__name__', '?')}"
