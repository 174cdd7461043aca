"""Versions that must be equal wherever jobs of one run are executed."""

from __future__ import annotations

import functools
import hashlib
import pathlib
import platform
from importlib.metadata import PackageNotFoundError, version

from ig2mj.process.own_version import own_version

PACKAGES = ("jax", "jaxlib", "mujoco", "warp-lang", "numpy")


@functools.cache
def versions() -> dict[str, str]:
    """Versions by name; of ig2mj also a hash of its source files, since two checkouts may have the same version."""
    found = {"Python": ".".join(platform.python_version_tuple()[:2]), "ig2mj": f"{own_version()} ({_sources()})"}
    return found | {name: _version(name) for name in PACKAGES}


def difference(own: dict[str, str], other: dict[str, str]) -> str | None:
    """The first version that differs, as "numpy 2.1, not 2.2 as here"; None where all are the same."""
    for name, value in own.items():
        if other.get(name) != value:
            return f"{name} {other.get(name)}, not {value} as here"
    return None


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "absent"


def _sources() -> str:
    """8 hexadecimal digits of all source files of the package."""
    root, hashed = pathlib.Path(__file__).resolve().parents[1], hashlib.blake2b(digest_size=4)
    for file in sorted(root.rglob("*.py")):
        hashed.update(file.relative_to(root).as_posix().encode() + b"\0" + file.read_bytes())
    return hashed.hexdigest()
