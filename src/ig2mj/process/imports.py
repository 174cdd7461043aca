"""`find_devices`: JAX's devices are found while modules are imported; `find_gpu`: if there is one.

`import_mjx`: MJX without the two libraries that only its JAX implementation calls, and only for meshes.

MJX imports trimesh and SciPy's spatial algorithms, which with all that they import take 0.7 s of processor time of the
2.5 that MJX takes. While MJX is imported, something stands in their place that imports them when it is called.
"""

from __future__ import annotations

import contextlib
import importlib
import pathlib
import sys
import types
from collections.abc import Iterator, Mapping
from typing import Any

from ig2mj.process.gc_pause import GC_PAUSED
from ig2mj.process.worker_threads import spawn

SPARED = ("trimesh", "scipy.spatial")

WARP_VERSION = "1.18."
"""Beginning of the version of Warp whose inner workings are known to us: they are others before and after."""


class _Later(types.ModuleType):
    """Stands for a module; what it has are functions that import the module when they are called."""

    def __getattr__(self, name: str) -> _CalledLater:
        if name.startswith("__"):
            raise AttributeError(name)
        return _CalledLater(self.__name__, name)


class _CalledLater:
    def __init__(self, module: str, name: str):
        self._module, self._name = module, name

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        return getattr(importlib.import_module(self._module), self._name)(*args, **kwargs)


def find_devices() -> None:
    """JAX begins to look for its devices, and puts a first array on one, in a thread: 2.5 s with a GPU, most of it
    without Python.

    A caller that asks for a device waits until they are found, and gets the error if there is one.
    """
    import jax

    def find() -> None:
        with contextlib.suppress(Exception):
            jax.device_put(0.0, jax.devices()[0]).block_until_ready()

    spawn(find, "ig2mj-devices")


def find_gpu(environ: Mapping[str, str], devices: pathlib.Path = pathlib.Path("/dev")) -> bool:
    """`find_devices` if JAX will find an NVIDIA GPU, by this process's variables and the device files; whether it will.

    Options of JAX for processors alone can still be set afterwards where there is none.
    """
    platforms = {name.strip() for name in environ.get("JAX_PLATFORMS", "").split(",")} - {""}
    hidden = environ.get("CUDA_VISIBLE_DEVICES", "0").strip() in ("", "-1")
    found = (not platforms or bool(platforms & {"cuda", "gpu"})) and not hidden
    found = found and any(devices.glob("nvidia[0-9]*"))
    if found:
        find_devices()
    return found


@contextlib.contextmanager
def _unsearched() -> Iterator[None]:
    """Warp does not search the kernels of MJX, which are made inside the block, for modules that they depend on.

    It needs them only where `importlib.reload` is called on one of those modules, and takes 0.13 s for 690 kernels and
    functions. Kernels of others are searched. Without effect where Warp is another version.
    """
    import warp as wp

    kind = getattr(getattr(getattr(wp, "_src", None), "context", None), "Module", None)
    search = getattr(kind, "_find_references", None)
    if kind is None or search is None or not wp.config.version.startswith(WARP_VERSION):
        yield
        return

    def search_others(module: Any, adjoint: Any) -> None:
        if not adjoint.func.__module__.startswith("mujoco.mjx."):
            search(module, adjoint)

    kind._find_references = search_others
    try:
        yield
    finally:
        kind._find_references = search


@GC_PAUSED
def import_mjx() -> None:
    """Imports `mujoco.mjx`, if it is not yet; other modules that import the two libraries meanwhile may get ours."""
    if "mujoco.mjx" in sys.modules:
        return
    later = {name: _Later(name) for name in SPARED if name not in sys.modules}
    sys.modules.update(later)
    try:
        with _unsearched():
            importlib.import_module("mujoco.mjx")
    finally:
        for name, module in later.items():
            if sys.modules.get(name) is module:
                del sys.modules[name]
