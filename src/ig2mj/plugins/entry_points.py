"""Plug-ins of installed packages, read from their metadata; none of their code is imported here."""

from __future__ import annotations

import dataclasses
import functools
import os
import pkgutil
import re
from typing import Any

from ig2mj.errors import PluginError, UnknownNameError

GROUP = "ig2mj.plugins"
"""Of entry points."""

KINDS: dict[str, str] = {
    "state": "ig2mj.states.added:STATES",
    "predicate": "ig2mj.predicates.registry:PREDICATES",
    "sensor": "ig2mj.sensors.registry:SENSORS",
    "robot": "ig2mj.agents.registry:ROBOTS",
    "command": "ig2mj.cli:ADDED",
    "overlay": "ig2mj.viewer.overlays:OVERLAYS",
}
"""What plug-ins add, and where the registry of each kind is ("module:name")."""

VARIABLE = "IG2MJ_PLUGINS"
"""Words with commas between them: `-NAME` switches an installed package off, `none` all of them; a file `FILE.py`, or
the name of a module, is imported and may call `ig2mj.register`."""


@dataclasses.dataclass(frozen=True)
class Plugin:
    """One entry point.

    Attributes:
      kind, name: what it adds, e.g. "state" and "age". target: where it is, "module:name".
      package, version, summary: of the distribution that has it.
    """

    kind: str
    name: str
    target: str
    package: str
    version: str
    summary: str = ""

    @property
    def source(self) -> str:
        """The distribution, for messages and files: "ig2mj-ageing 0.1.0"."""
        return f"{self.package} {self.version}"

    @property
    def off(self) -> str:
        """How to do without it."""
        return f"{VARIABLE}=-{self.package} switches the package off"

    def load(self, expected: str) -> Any:
        """What it adds, imported now.

        Args:
          expected: what that should be.

        Raises:
          PluginError: its code cannot be imported, or lacks the name.
        """
        try:
            return pkgutil.resolve_name(self.target)
        except (Exception, SystemExit) as e:
            why = f"{type(e).__name__}: {e}"
            raise self.error(f"{self.target} cannot be imported: {why}; {expected} is expected") from e

    def error(self, problem: str) -> PluginError:
        """An error that names this plug-in, and says how to switch it off."""
        name = f"{self.kind}.{self.name}" if self.name else self.kind
        return PluginError(f"plug-in '{name}' of {self.source}: {problem} ({self.off})")


def switches() -> tuple[frozenset[str] | None, list[str]]:
    """Packages that `IG2MJ_PLUGINS` switches off (None: all), and files and modules that it adds."""
    words = [word.strip() for word in os.environ.get(VARIABLE, "").split(",") if word.strip()]
    off = frozenset(normalized(word[1:]) for word in words if word.startswith("-"))
    added = [word for word in words if word != "none" and not word.startswith("-")]
    return None if "none" in words else off, added


def normalized(package: str) -> str:
    """A distribution's name as indices compare it."""
    return re.sub(r"[-_.]+", "-", package).lower()


def installed() -> tuple[list[Plugin], list[Plugin]]:
    """Plug-ins of installed packages that are on, and those that are switched off, by package and name.

    Raises:
      PluginError: an entry point has another name than `KIND.NAME`. UnknownNameError: `IG2MJ_PLUGINS` switches off a
        package that has no plug-ins.
    """
    off, _ = switches()
    every = _every()
    packages = {normalized(plugin.package) for plugin in every}
    if off and (unknown := off - packages):
        raise UnknownNameError(f"package with plug-ins ({VARIABLE})", min(unknown), sorted(packages))
    on = [plugin for plugin in every if off is not None and normalized(plugin.package) not in off]
    for plugin in on:
        if plugin.kind not in KINDS or not plugin.name:
            there = ", ".join(f"{kind}.NAME" for kind in KINDS)
            raise plugin.error(f"entry points of the group {GROUP} are named {there}")
    return on, [plugin for plugin in every if plugin not in on]


@functools.cache
def _every() -> tuple[Plugin, ...]:
    """Read once in a process: it takes 10 to 30 ms."""
    from importlib.metadata import entry_points

    found = []
    for point in entry_points(group=GROUP):
        kind, _, name = point.name.partition(".")
        about = point.dist
        package, version = (about.name, about.version) if about is not None else ("an unknown package", "")
        summary = str(about.metadata.get("Summary") or "") if about is not None else ""  # pyright: ignore
        found.append(Plugin(kind, name, point.value, package, version, "" if summary == "UNKNOWN" else summary))
    return tuple(sorted(found, key=lambda plugin: (normalized(plugin.package), plugin.kind, plugin.name)))
