"""What a launch of MuJoCo Warp's becomes while our functions run: another kernel or itself.

Parts of this package that change launches rather than functions have a function that is given a kernel, its dimensions
and its inputs, and answers with what to launch in their place, or None.
"""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import warp as wp

from ig2mj.engine.warp.patches.replacements import original

Launch = tuple[wp.Kernel, Any, list[Any]]
"""A kernel, its dimensions, and its inputs."""

Substitute = Callable[[wp.Kernel, Any, Sequence[Any]], Launch | None]

Narrow = Callable[[wp.Kernel, Any, Sequence[Any], bool], Launch]
"""What a launch, of tiles where the last is true, becomes while only some worlds take part."""

_here = threading.local()
_substitutes: list[Substitute] = []


def replace_by(substitutes: Sequence[Substitute]) -> None:
    """From now on launches of ours ask these functions, in this order."""
    _substitutes[:] = substitutes


def substituted(kernel: wp.Kernel, dim: Any, inputs: Sequence[Any]) -> Launch:
    """What is launched in place of this."""
    for substitute in _substitutes:
        found = substitute(kernel, dim, inputs)
        if found is not None:
            return found
    return kernel, dim, list(inputs)


@contextlib.contextmanager
def narrowing(narrow: Narrow) -> Iterator[None]:
    """Inside the block this thread's launches become those that the function names, after all else."""
    _here.narrow = narrow
    try:
        yield
    finally:
        _here.narrow = None


def resolved(kernel: wp.Kernel, dim: Any, inputs: Sequence[Any], tiled: bool = False) -> Launch:
    """What is launched in place of this, in this thread and now."""
    if not tiled:
        kernel, dim, inputs = substituted(kernel, dim, inputs)
    narrow: Narrow | None = getattr(_here, "narrow", None)
    return narrow(kernel, dim, inputs, tiled) if narrow else (kernel, dim, list(inputs))


def launch(kernel: wp.Kernel, dim: Any, inputs: Sequence[Any] = (), *args: Any, **kwargs: Any) -> Any:
    """In place of `warp.launch`."""
    kernel, dim, inputs = resolved(kernel, dim, inputs)
    return original(wp, "launch")(kernel, dim, inputs, *args, **kwargs)


def launch_tiled(kernel: wp.Kernel, *, dim: Any, inputs: Sequence[Any] = (), **kwargs: Any) -> Any:
    """In place of `warp.launch_tiled`."""
    kernel, dim, inputs = resolved(kernel, dim, inputs, tiled=True)
    return original(wp, "launch_tiled")(kernel, dim=dim, inputs=inputs, **kwargs)
