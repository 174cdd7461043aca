"""Warp's cache of kernels stays usable when its folder cannot be written to, a disk is full or a file is broken.

Warp ends with an OSError where it cannot make its folder, its compiler for processors ends the process where a disk is
full, and a file that was cut off fails in every later start. Here a folder that cannot be written to is replaced by one
of this process alone, a module is compiled only where there is room for it, and one that cannot be loaded is removed
and compiled again. Functions of Warp that it does not export are replaced; where a version has none of these names,
nothing is changed.
"""

from __future__ import annotations

import atexit
import functools
import os
import pathlib
import shutil
import sys
import tempfile
import threading
from typing import Any

import platformdirs

from ig2mj.errors import EngineError
from ig2mj.process.compilation import CACHE_VARIABLE, cache_folder
from ig2mj.process.program_cache import REMEDY, say_not_kept

NEEDED = 32 * 2**20
"""Bytes that must be free to compile a module; the largest, with its source, takes a fifth."""


def folder_of_warp() -> pathlib.Path:
    """Where Warp keeps kernels by its own settings: the folder that they name, or its default."""
    import warp as wp

    named = wp.config.kernel_cache_dir or os.environ.get("WARP_CACHE_PATH")
    return pathlib.Path(named or platformdirs.user_cache_dir("warp", "NVIDIA"))


def kernel_folder() -> pathlib.Path:
    """Where kernels are kept: the folder that Warp's settings name, else one in IG2MJ_CACHE_DIR, else Warp's default.
    Warp adds its version."""
    import warp as wp

    named = wp.config.kernel_cache_dir or os.environ.get("WARP_CACHE_PATH")
    return cache_folder() / "warp" if os.environ.get(CACHE_VARIABLE) and not named else folder_of_warp()


def usable_kernel_folder() -> pathlib.Path:
    """`kernel_folder`, or where it cannot be written to, one that is removed with the process, after a line on stderr.
    Before Warp begins."""
    folder = kernel_folder()
    why = _fault(folder)
    if why is None:
        return folder
    say_not_kept(folder, why, "compiled kernels")
    own = tempfile.mkdtemp(prefix="ig2mj-kernels-")
    atexit.register(shutil.rmtree, own, ignore_errors=True)
    return pathlib.Path(own)


def _fault(folder: pathlib.Path) -> str | None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as failure:
        return failure.strerror or type(failure).__name__
    return None if os.access(folder, os.W_OK) else "it cannot be written to"


def check_room(folder: pathlib.Path) -> None:
    """Raises EngineError where a module cannot be compiled to a file in this folder, for lack of space."""
    there = next(place for place in (folder, *folder.parents) if place.is_dir())
    if shutil.disk_usage(there).free < NEEDED:
        raise EngineError(f"kernels cannot be compiled: less than {NEEDED // 2**20} MiB are free in {there}: {REMEDY}")


@functools.cache
def keep_kernels_sound() -> None:
    """Replaces what compiles and loads Warp's modules in this process; once."""
    import warp as wp

    module = getattr(getattr(getattr(wp, "_src", None), "context", None), "Module", None)
    compiles, loads = getattr(module, "_compile", None), getattr(module, "load", None)
    if module is None or compiles is None or loads is None:
        return
    found = threading.local()

    def compile_where_there_is_room(
        self: Any, device: Any = None, output_dir: Any = None, output_name: Any = None, *args: Any, **kw: Any
    ) -> bool:
        if output_dir is not None and output_name is not None:
            folder = pathlib.Path(output_dir)
            if (folder / output_name).exists():
                found.folder = folder
            else:
                check_room(folder.parent)
        return compiles(self, device, output_dir, output_name, *args, **kw)

    def load_or_make_again(self: Any, *args: Any, **kw: Any) -> Any:
        found.folder = None
        try:
            return loads(self, *args, **kw)
        except Exception as failure:
            if found.folder is None:
                raise
            why = next(iter(str(failure).splitlines()), type(failure).__name__)
            print(
                f"ig2mj: broken kernels in {found.folder} are removed and compiled again ({why[:120]})", file=sys.stderr
            )
            shutil.rmtree(found.folder, ignore_errors=True)
            return loads(self, *args, **kw)

    module._compile, module.load = compile_where_there_is_room, load_or_make_again
