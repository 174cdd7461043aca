"""Finished outputs, kept between runs: the same conversion of the same input is copied instead of done again.

An entry is one zip file named after the request: the command's arguments, the options that decide what comes out, and
the versions of everything that takes part, down to the converter's own source. Inside it stand the output's files,
those that it shares with other outputs, and the record of all input the conversion looked at (see `inputs`); it is used
only while every file of that record still has the same content, and what was absent still is. Nothing heavy is imported
here.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import importlib.metadata
import importlib.util
import json
import os
import pathlib
import sys
import tempfile
import zipfile
import zlib
from collections.abc import Mapping
from typing import Any

from .cache_folder import cache_folder, prune
from .inputs import Record
from .options import ConvertOptions
from .outcome import ConversionOutcome
from .output import MARK, put_shared_file, replaced_folder

LIMIT = 2 * 2**30
"""Bytes of all entries together."""

UNPACKED = 16 * 2**30
"""Bytes that an entry may unpack to; a larger one is taken as damaged."""

PACKAGES = (
    "ig2mj", "mujoco", "coacd", "trimesh", "manifold3d", "fast-simplification", "numpy", "scipy", "shapely",
    "pillow", "lxml", "pycollada", "jinja2", "bddl",
)  # fmt: skip
"""Distributions whose version may change what comes out."""

SOURCES = ("ig2mj_converters", "ig2mj.knowledge", "ig2mj.scene", "ig2mj.sensors", "ig2mj.viewer")
"""Packages of this project whose files decide what comes out (sensors and viewer draw the report's images)."""

_DAMAGED = (
    OSError, ValueError, KeyError, TypeError, AttributeError, EOFError, RecursionError, NotImplementedError,
    RuntimeError, zipfile.BadZipFile, zlib.error,
)  # fmt: skip
"""What reading an entry raises that was changed: `zipfile` raises the last ones at methods and passwords."""

_FACTS = "ig2mj-cache.json"
_SHARED = "ig2mj-shared/"
"""Before the number of a file that lies outside the output's folder."""
_PACKED = (".png", ".npz", ".jpg")


def key_of(request: Mapping[str, Any], options: ConvertOptions) -> str:
    """Name of the entry for a request: a hash of everything but the input's content."""
    known = {
        "request": request,
        "options": options.record(),
        "skip_missing": options.skip_missing,
        "report": options.report,
        "strict": options.strict,
        "folders": [os.path.abspath(p) for p in (options.mesh_root or "", *options.package_path)],  # noqa: PTH100
        "assets": options.assets,
        "limits": dataclasses.asdict(options.limits),
        "pictures": options.renderer is not None and os.environ.get("MUJOCO_GL", ""),
        "versions": [sys.version, *(_version(name) for name in PACKAGES)],
        "sources": [_source_hash(name) for name in SOURCES],
    }
    return hashlib.sha256(json.dumps(known, sort_keys=True).encode()).hexdigest()


def fetch(key: str, out: str | os.PathLike) -> ConversionOutcome | None:
    """Puts an entry's output in place of `out`, and next to it the files that it shares with others.

    Returns:
      None: there is no entry, its input has changed, or it is damaged.

    Raises:
      InputError: `out` may not be replaced (see `replaced_folder`).
    """
    path = _path(key)
    try:
        with zipfile.ZipFile(path) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > UNPACKED:
                return None
            facts = json.loads(archive.read(_FACTS))
            if facts["key"] != key or not Record(facts["inputs"]).holds_still():
                return None
            outcome = ConversionOutcome.from_json(facts["outcome"])
            names = [name for name in archive.namelist() if name != _FACTS and not name.startswith(_SHARED)]
            shared = {name: archive.read(f"{_SHARED}{k}") for k, name in enumerate(outcome.shared)}
            with replaced_folder(out) as folder:
                archive.extractall(folder, names)  # checks each file's CRC
                if hashlib.sha256((folder / MARK).read_bytes()).hexdigest() != outcome.manifest_hash:
                    raise ValueError("not the manifest that was kept")
                for name, raw in shared.items():
                    put_shared_file(folder / name, raw)
        os.utime(path)
    except _DAMAGED:
        return None
    outcome.cached = True
    return outcome


def store(key: str, record: Record, outcome: ConversionOutcome, out: str | os.PathLike) -> None:
    """Keeps a finished output. A folder that cannot be written is no error: the work is done again next time."""
    path, folder = _path(key), pathlib.Path(out)
    facts = {"key": key, "inputs": record.answers, "outcome": outcome.to_json()}
    temporary = None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".part", delete=False) as file:
            temporary = pathlib.Path(file.name)
            with zipfile.ZipFile(file, "w", compresslevel=1) as archive:
                files = {s.relative_to(folder).as_posix(): s for s in sorted(folder.rglob("*")) if s.is_file()}
                files |= {f"{_SHARED}{k}": folder / name for k, name in enumerate(outcome.shared)}
                for name, source in files.items():
                    archive.write(
                        source, name, zipfile.ZIP_STORED if source.suffix in _PACKED else zipfile.ZIP_DEFLATED
                    )
                archive.writestr(_FACTS, json.dumps(facts), zipfile.ZIP_DEFLATED)
        if temporary.stat().st_size <= LIMIT:
            temporary.replace(path)
            temporary = None
        prune(cache_folder("outputs"), ".zip", LIMIT)
    except (OSError, ValueError):  # ValueError: a file older than zip knows of
        pass
    finally:
        if temporary is not None:
            with contextlib.suppress(OSError):
                temporary.unlink()


def _path(key: str) -> pathlib.Path:
    return cache_folder("outputs") / key[:2] / f"{key}.zip"


def _version(name: str) -> str:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return ""


def _source_hash(package: str) -> str:
    """Hash over the files of a package, found without importing it."""
    spec = importlib.util.find_spec(package)
    digest = hashlib.sha256()
    for place in (spec.submodule_search_locations or []) if spec is not None else []:
        for file in sorted(pathlib.Path(place).rglob("*")):
            if file.suffix in (".py", ".json", ".j2"):
                digest.update(str(file.relative_to(place)).encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()
