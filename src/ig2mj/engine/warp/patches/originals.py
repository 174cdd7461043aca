"""What is replaced in MuJoCo Warp, and what stood there."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Iterable, Iterator, Mapping
from types import ModuleType
from typing import Any

_originals: dict[tuple[ModuleType, str], Any] = {}


def original(module: ModuleType, name: str) -> Any:
    """MuJoCo Warp's own function of a replaced name."""
    return _originals[module, name]


def replace(needed: Mapping[ModuleType, Iterable[str]], own: Mapping[tuple[ModuleType, str], Any]) -> bool:
    """Puts functions in place of MuJoCo Warp's, once per process. Returns whether they are there.

    Args:
      needed: names that must exist; where one is missing nothing is replaced, with a warning.
      own: functions by module and name.
    """
    if _originals:
        return True
    missing = [name for module, names in needed.items() for name in names if not hasattr(module, name)]
    if missing:
        warnings.warn(f"this MuJoCo Warp has no {', '.join(missing)}: its own, slower kernels run", stacklevel=3)
        return False
    for (module, name), function in own.items():
        _originals[module, name] = getattr(module, name)
        setattr(module, name, function)
    return True


@contextlib.contextmanager
def upstream_kernels() -> Iterator[None]:
    """MuJoCo Warp as it comes, for comparison. Programs traced or captured before keep what they have."""
    replaced = dict(_originals)
    _originals.clear()
    own = {key: getattr(*key) for key in replaced}
    for (module, name), function in replaced.items():
        setattr(module, name, function)
    try:
        yield
    finally:
        for (module, name), function in own.items():
            setattr(module, name, function)
        _originals.update(replaced)
