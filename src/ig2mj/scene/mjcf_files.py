"""`read_mjcf`: the elements of an untrusted MJCF file, checked before MuJoCo reads it.

Refused are document types (and with them entities), encodings other than UTF-8, files that are too large or nested too
deeply, and paths that leave the scene's folder: of `<include>`, `<model>`, meshes, textures, height fields, skins and
whatever else has an attribute that begins with "file". One thing lies outside: meshes and textures that several homes
share (`ig2mj homes convert`) are in folders `meshes` and `textures` up to three levels above.

MuJoCo looks for a file where the scene lies and where the file lies that names it, in the folders of `<compiler>`:
every such place counts.
"""

from __future__ import annotations

import pathlib
import re
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from typing import Any

from ig2mj.errors import InputError
from ig2mj.files.content import read_bytes
from ig2mj.files.inside import inside
from ig2mj.scene.mjcf_limits import MAX_DEPTH, check_mjcf

MOST_FILES = 100
"""MJCF files that one includes, directly or not."""

MOST_PATHS = 200_000
"""Files that are named, times the folders in which they are looked for."""

FOLDERS = ("meshdir", "texturedir", "assetdir")
"""Attributes of `<compiler>` that name folders."""

_SHARED = re.compile(r"(?:\.\./){1,3}(?:meshes|textures)/?")
_PLAIN = re.compile(r"[\w.-]+", re.ASCII)
_FIX = "convert the scene again"


def read_mjcf(file: pathlib.Path, roots: Sequence[pathlib.Path] = ()) -> ElementTree.Element:
    """The root element of a file whose paths, and those of the files that it includes, lie where they may.

    Args:
      roots: further folders in which meshes and textures may lie.

    Raises:
      InputError: it is missing or no MJCF, or one that is not read (see the module's text), or it asks for more than a
        limit (`mjcf_limits`). OutsideError: it names a path outside.
    """
    found = _read_all(file, [root.resolve() for root in roots])[file]
    check_mjcf(file)
    return found


def _read_all(file: pathlib.Path, more: Sequence[pathlib.Path]) -> dict[pathlib.Path, ElementTree.Element]:
    """All files that belong to a scene, by path, the scene's own first. more: see `read_mjcf`."""
    root = file.parent.resolve()
    found, waiting = {file: _parse(file)}, [file]
    while waiting:
        place = waiting.pop()
        for name in _included(found[place]):
            for base in {file.parent, place.parent}:
                inner = inside(name, base, place, "include", [root])
                if inner.is_file() and inner not in found and inner != file.resolve():
                    if len(found) >= MOST_FILES:
                        raise InputError(file, f"includes more than {MOST_FILES} files", element="include")
                    found[inner] = _parse(inner)
                    waiting.append(inner)
    folders, shared = {"."}, []
    for place, compiler in ((place, c) for place, tree in found.items() for c in tree.iter("compiler")):
        for value in (compiler.get(name, "") for name in FOLDERS):
            if _SHARED.fullmatch(value):
                shared.append((file.parent / value).resolve())
            elif value:
                inside(value, file.parent, place, "compiler", [root, *more])
            folders.add(value or ".")
    bases = {base / folder for base in {file.parent, *(p.parent for p in found)} for folder in folders}
    names = {name: place for place, tree in found.items() for name in _named_files(tree)}
    if len(names) * len(bases) > MOST_PATHS:
        raise InputError(file, f"names {len(names)} files in {len(bases)} folders", fix="name fewer")
    roots = [root, *shared, *more]
    for name, place in names.items():
        for base in bases:
            if not _is_plain(name) or (base / name).is_symlink():
                inside(name, base, place, "file", roots)
    for base in bases:  # in which plain names lie
        inside(".", base, file, f"compiler: {base}", roots)
    return found


def _is_plain(name: str) -> bool:
    """Whether it can only be a file in the very folder that it is looked for in."""
    return name not in (".", "..") and _PLAIN.fullmatch(name) is not None


def _named_files(tree: ElementTree.Element) -> set[str]:
    """Names of all other files."""
    return {v for e in tree.iter() if e.tag != "include" for n, v in e.items() if n.startswith("file")}


def _included(root: ElementTree.Element) -> list[str]:
    """Names of the MJCF files that a file wants."""
    return [e.get("file", "") for tag in ("include", "model") for e in root.iter(tag) if "file" in e.attrib]


def _parse(file: pathlib.Path) -> ElementTree.Element:
    raw = read_bytes(file, limit="XML_BYTES", fix=_FIX)
    parser = ElementTree.XMLParser(target=_Builder(file))
    try:
        parser.feed(raw.decode("utf-8-sig"))  # whatever encoding it claims: MuJoCo reads bytes
        return parser.close()
    except UnicodeDecodeError as e:
        raise InputError(file, f"is not text in UTF-8: byte {e.start}", fix=_FIX) from e
    except (ElementTree.ParseError, ValueError) as e:
        raise InputError(file, f"MuJoCo cannot load it: it is no valid XML: {e}", fix=_FIX) from e


class _Builder(ElementTree.TreeBuilder):
    """Refuses document types and deep nesting while it reads."""

    def __init__(self, file: pathlib.Path):
        super().__init__()
        self._file, self._depth = file, 0

    def start(self, tag: Any, attrs: Any, /) -> Any:
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise InputError(self._file, f"is nested deeper than {MAX_DEPTH} levels", element=f"<{str(tag)[:60]}>")
        return super().start(tag, attrs)

    def end(self, tag: Any, /) -> Any:
        self._depth -= 1
        return super().end(tag)

    def doctype(self, *_: Any) -> None:
        raise InputError(self._file, "has a document type, which could declare entities", fix="remove <!DOCTYPE ...>")
