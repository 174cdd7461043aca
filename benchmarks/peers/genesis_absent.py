"""Empty modules in place of packages that Genesis imports but a rigid scene without pictures never uses.

So it runs where only part of its requirements is installed, and where there is no OpenGL.
"""

from __future__ import annotations

import importlib.abc
import importlib.machinery
import importlib.util
import sys
import types
from typing import Any

OPTIONAL = frozenset(
    [
        "pygel3d",
        "vtk",
        "pymeshlab",
        "z3",
        "tetgen",
        "moviepy",
        "cv2",
        "OpenEXR",
        "Imath",
        "gs_madrona",
        "pysplashsurf",
        "skimage",
        "numba",
        "av",
        "zstandard",
        "pygltflib",
        "DracoPy",
        "collada",
        "xacro",
        "freetype",
        "rtree",
        "pyglet",
        "OpenGL",
        "coacd",
        "lxml",
        "imageio",
        "matplotlib",
        "networkx",
    ]
)
"""Packages that are replaced where they are not installed: readers of meshes, drawing, films, soft bodies."""

DRAWING = (
    "genesis.ext.pyrender",
    "genesis.vis.rasterizer",
    "genesis.vis.rasterizer_context",
    "genesis.vis.viewer",
)
"""Genesis' own modules that want OpenGL as soon as they are imported; always replaced."""


class Anything:
    """Can be called, read, iterated (it is empty) and used as a base class, and is of no use."""

    def __init__(self, *args: Any, **kwargs: Any) -> None: ...

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        decorates = len(args) == 1 and not kwargs and isinstance(args[0], type | types.FunctionType)
        return args[0] if decorates else Anything()

    def __getattr__(self, name: str) -> Any:
        return _attribute(name)

    def __getitem__(self, key: Any) -> Any:
        return Anything()

    def __iter__(self) -> Any:
        return iter(())

    def __mro_entries__(self, bases: Any) -> tuple[type, ...]:
        return (object,)


class _Module(types.ModuleType):
    def __init__(self, name: str):
        super().__init__(name)
        self.__path__, self.__all__, self.__version__ = [], [], "0.0"

    def __getattr__(self, name: str) -> Any:
        return _attribute(name)


def _attribute(name: str) -> Any:
    if name.startswith("__"):
        raise AttributeError(name)  # protocols that are asked for (`__array__` ...) are not there
    return Anything()


class _Finder(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    def find_spec(self, fullname: str, path: Any = None, target: Any = None) -> Any:
        drawing = any(fullname == name or fullname.startswith(name + ".") for name in DRAWING)
        if drawing or (fullname.split(".")[0] in OPTIONAL and not _installed(fullname.split(".")[0])):
            return importlib.machinery.ModuleSpec(fullname, self, is_package=True)
        return None

    def create_module(self, spec: Any) -> types.ModuleType:
        return _Module(spec.name)

    def exec_module(self, module: types.ModuleType) -> None: ...


def _installed(package: str) -> bool:
    return importlib.machinery.PathFinder.find_spec(package) is not None


def put_in_place() -> None:
    """From now on imports of this process find the empty modules."""
    sys.meta_path.insert(0, _Finder())
