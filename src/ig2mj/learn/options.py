"""Settings of algorithms by name, as `--set name=value` gives them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any, TypeVar

from ig2mj.errors import Ig2mjError, UnknownNameError

Config = TypeVar("Config")

COUNTS = ("length", "updates", "batch", "capacity", "horizon", "atoms", "every", "held", "epochs", "parts", "steps")
"""Settings of which there is at least one, in whichever algorithm they are."""

SHARES = ("gamma", "smooth", "tau", "guided", "copied", "alone", "disturbed", "trust")
"""Settings from 0 to 1."""


def configured(config: Config, changes: Sequence[str]) -> Config:
    """A dataclass with some of its fields changed.

    Args:
      changes: "name=value"; the layers of a network as "256,256".

    Raises:
      UnknownNameError: no such setting, with near matches. Ig2mjError: no value of its type, or one that cannot be:
        negative, not finite, none of what is counted, a share above 1.
    """
    fields = {f.name: getattr(config, f.name) for f in dataclasses.fields(config)}  # pyright: ignore[reportArgumentType]
    new: dict[str, Any] = {}
    for change in changes:
        name, sign, text = change.partition("=")
        if not sign:
            raise Ig2mjError(f"--set {change}: a setting is name=value")
        if name not in fields:
            raise UnknownNameError("setting", name, fields)
        new[name] = _value(name, text, fields[name])
        _check(name, new[name])
    return dataclasses.replace(config, **new)  # pyright: ignore[reportArgumentType]


def _value(name: str, text: str, old: Any) -> Any:
    try:
        if isinstance(old, tuple):
            return tuple(int(part) for part in text.split(",") if part)
        if isinstance(old, str):
            return text
        return type(old)(text)
    except ValueError:
        kind = "numbers with commas" if isinstance(old, tuple) else f"of type {type(old).__name__}"
        raise Ig2mjError(f"--set {name}={text}: the value is {kind}, as in {name}={written(old)}") from None


def _check(name: str, value: Any) -> None:
    if isinstance(value, str):
        return
    least, most = (1 if name in COUNTS or isinstance(value, tuple) else 0), (1 if name in SHARES else math.inf)
    for number in value if isinstance(value, tuple) else (value,):
        if not (least <= number <= most and math.isfinite(number)):
            upwards = f"at least {least}" if most == math.inf else f"from {least} to {most}"
            raise Ig2mjError(f"--set {name}={written(value)}: {name} is {upwards}, and finite")


def written(value: Any) -> str:
    """A value as `configured` reads it."""
    return ",".join(map(str, value)) if isinstance(value, tuple) else str(value)
