"""Substances among what `load_scene(objects=...)` takes.

    substances:water,salt         what is in use
    substances:milk@carton_0      the container is filled with it at the start

A scene without substances has no arrays for them. Their number is small, since every container has a volume of each.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence

import msgspec

from ig2mj.errors import Ig2mjError, UnknownNameError
from ig2mj.knowledge.substances import FILL, substance
from ig2mj.scene.manifest import Manifest

PREFIX = "substances:"

MOST = 24
"""Substances of one scene."""


def is_substances(requested: object) -> bool:
    """Whether a value of `objects` names substances."""
    return isinstance(requested, str) and requested.startswith(PREFIX)


def read_substances(requested: Iterable[str | os.PathLike]) -> tuple[list[str], list[str | os.PathLike]]:
    """Names of substances in values of `objects`, and the other values."""
    named, others = list[str](), list[str | os.PathLike]()
    for value in requested:
        if is_substances(value):
            named += [name.strip() for name in str(value).removeprefix(PREFIX).split(",")]
        else:
            others.append(value)
    return named, others


def split_contents(named: Iterable[str]) -> tuple[list[str], list[str]]:
    """Names of substances, and which of them containers are filled with at the start ("milk@carton_0"). Raises
    Ig2mjError."""
    names, contents = list[str](), list[str]()
    for text in named:
        name, at, container = text.partition("@")
        if at and not (name and container):
            raise Ig2mjError(f"'{PREFIX}{text}': a substance and the container that it fills, such as milk@carton_0")
        names.append(name)
        contents += [text] if at else []
    return list(dict.fromkeys(names)), list(dict.fromkeys(contents))


def with_contents(manifest: Manifest) -> Manifest:
    """A scene's manifest with what containers are filled with at the start; several substances share the room.

    Raises:
      UnknownNameError: the scene has no such object. Ig2mjError: it is no container, or the substance fills none.
    """
    if not manifest.contents:
        return manifest
    inside: dict[str, list[str]] = {}
    for text in manifest.contents:
        name, _, container = text.partition("@")
        if not substance(name).has_volume:
            raise Ig2mjError(f"'{PREFIX}{text}': {name} covers objects, and does not fill containers")
        inside.setdefault(container, []).append(name)
    entries = {o.name: o for o in manifest.objects}
    for container, names in inside.items():
        entry = entries.get(container)
        if entry is None:
            raise UnknownNameError("object", container, entries)
        if entry.inside is None:
            raise Ig2mjError(f"'{PREFIX}{names[0]}@{container}': '{container}' ({entry.category}) is no container")
        litres = FILL * entry.inside.litres / len(names)
        state = {**entry.state, "volume": dict.fromkeys(names, litres)}
        entries[container] = msgspec.structs.replace(entry, state=state)
    return msgspec.structs.replace(manifest, objects=list(entries.values()))


def requested_substances(manifest: Manifest) -> list[str]:
    """The values of `objects` for the substances of a scene and its contents at the start."""
    found = list[str]()
    for name in manifest.substances:
        found += [text for text in manifest.contents if text.startswith(f"{name}@")] or [name]
    return substances_as_text(found)


def substances_as_text(names: Sequence[str | os.PathLike]) -> list[str]:
    """The value of `objects` for some substances; none for none."""
    return [PREFIX + ",".join(map(str, names))] if names else []


def check_substances(names: Sequence[str]) -> None:
    """Raises UnknownNameError: there is no such substance. Ig2mjError: there are too many."""
    for name in names:
        substance(name)
    if len(names) > MOST:
        raise Ig2mjError(f"{len(names)} substances: a scene has at most {MOST}")
