"""Substances among what `load_scene(objects=...)` takes: "substances:water,salt".

A scene without substances has no arrays for them. Their number is small, since every container has a volume of each.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence

from ig2mj.errors import Ig2mjError
from ig2mj.knowledge.substances import substance

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


def substances_as_text(names: Sequence[str | os.PathLike]) -> list[str]:
    """The value of `objects` for some substances; none for none."""
    return [PREFIX + ",".join(map(str, names))] if names else []


def check_substances(names: Sequence[str]) -> None:
    """Raises UnknownNameError: there is no such substance. Ig2mjError: there are too many."""
    for name in names:
        substance(name)
    if len(names) > MOST:
        raise Ig2mjError(f"{len(names)} substances: a scene has at most {MOST}")
