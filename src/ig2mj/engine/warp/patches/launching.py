"""What a launch of MuJoCo Warp's becomes while our functions run: another kernel or itself.

Parts of this package that change launches rather than functions have a function that is given a kernel, its dimensions
and its inputs, and answers with what to launch in their place, or None.

A step has hundreds of launches: functions on their way are left alone by run-time checks of types (`no_type_check`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, no_type_check

import warp as wp

from ig2mj.engine.warp.patches.replacements import original

Launch = tuple[wp.Kernel, Any, list[Any]]
"""A kernel, its dimensions, and its inputs."""

Substitute = Callable[[wp.Kernel, Any, Sequence[Any]], Launch | None]

_substitutes: list[Substitute] = []


def replace_by(substitutes: Sequence[Substitute]) -> None:
    """From now on launches of ours ask these functions, in this order."""
    _substitutes[:] = substitutes


@no_type_check
def substituted(kernel: wp.Kernel, dim: Any, inputs: Sequence[Any]) -> Launch:
    """What is launched in place of this."""
    for substitute in _substitutes:
        found = substitute(kernel, dim, inputs)
        if found is not None:
            return found
    return kernel, dim, list(inputs)


@no_type_check
def resolved(kernel: wp.Kernel, dim: Any, inputs: Sequence[Any], tiled: bool = False) -> Launch:
    """What is launched in place of this, in this thread and now."""
    return (kernel, dim, list(inputs)) if tiled else substituted(kernel, dim, inputs)


@no_type_check
def launch(kernel: wp.Kernel, dim: Any, inputs: Sequence[Any] = (), *args: Any, **kwargs: Any) -> Any:
    """In place of `warp.launch`."""
    kernel, dim, inputs = resolved(kernel, dim, inputs)
    return original(wp, "launch")(kernel, dim, inputs, *args, **kwargs)


@no_type_check
def launch_tiled(kernel: wp.Kernel, *, dim: Any, inputs: Sequence[Any] = (), **kwargs: Any) -> Any:
    """In place of `warp.launch_tiled`."""
    kernel, dim, inputs = resolved(kernel, dim, inputs, tiled=True)
    return original(wp, "launch_tiled")(kernel, dim=dim, inputs=inputs, **kwargs)
