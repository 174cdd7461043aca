"""`register`: what a program, a notebook or a file of one's own adds to ig2mj."""

from __future__ import annotations

import pkgutil
from collections.abc import Iterable, Mapping
from typing import Any

from ig2mj.errors import PluginError
from ig2mj.plugins.entry_points import KINDS
from ig2mj.plugins.registry import source_of_caller


def registry_of(kind: str) -> Any:
    """The `Registry` of a kind; its module is imported now."""
    return pkgutil.resolve_name(KINDS[kind])


def register(
    *,
    states: Iterable[Any] = (),
    predicates: Iterable[Any] = (),
    sensors: Iterable[Any] = (),
    robots: Mapping[str, Any] | None = None,
    commands: Mapping[str, Any] | None = None,
    overlays: Mapping[str, Any] | None = None,
    replace: bool = False,
) -> None:
    """Makes things of one's own known to ig2mj in this process. Nothing is registered where one of them is refused.

    Args:
      states: `ig2mj.states.StateSpec`. Scenes whose states are made from now on have them.
      predicates: `ig2mj.predicates.Predicate`. sensors: `ig2mj.sensors.Sensor`.
      robots: their classes, or functions that make them, by name.
      commands: by name a function, or a mapping of functions for a command that has commands itself (`ig2mj.cli`).
      overlays: by name a class or function that makes an `ig2mj.viewer.overlays.Overlay` of a scene and a world.
      replace: whether what was registered earlier under the same name gives way, e.g. in a notebook.

    Raises:
      PluginError: one is not what is expected, or a name is taken.
    """
    requested: list[tuple[str, str, Any]] = []
    for kind, things in (("state", states), ("predicate", predicates), ("sensor", sensors)):
        requested += [(kind, getattr(thing, "name", "?"), thing) for thing in things]
    for kind, named in (("robot", robots), ("command", commands), ("overlay", overlays)):
        requested += [(kind, name, thing) for name, thing in (named or {}).items()]
    source = source_of_caller()
    registries = {kind: registry_of(kind) for kind, _, _ in requested}
    before = {kind: found.registered() for kind, found in registries.items()}
    try:
        for kind, name, thing in requested:
            registries[kind].add(name, thing, source, replace)
    except PluginError:
        for kind, found in registries.items():
            found.restore(before[kind])
        raise
