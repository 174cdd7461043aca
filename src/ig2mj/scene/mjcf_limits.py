"""Limits on an MJCF file, checked before MuJoCo reads it: a single element can request all available memory.

Counted are elements (those inside a `<replicate>` as often as it repeats them, instances of composites and flexes too)
and cells: of height fields, built-in textures, user data and user sensors, all together, and pixels of each image file.
Included files count with the file that includes them. The limits (`ig2mj.files.limits`) are `MJCF_ELEMENTS` and
`MJCF_CELLS`.
"""

from __future__ import annotations

import math
import pathlib
import xml.parsers.expat
from collections.abc import Mapping

from ig2mj.errors import InputError
from ig2mj.files.limits import limit, refuse_more

MAX_DEPTH = 490
"""Levels of elements; MuJoCo's XML reader gives up at 500."""
MAX_FILES = 50
"""Files that include one another."""
PNG_HEAD = 24
"""Bytes of a PNG up to its height."""

_CELLS = {
    "hfield": ("nrow", "ncol"),
    "texture": ("width", "height"),
    "numeric": ("size",),
    "user": ("dim",),
}
"""Element -> attributes whose product is allocated."""
_COUNTS = {"replicate": "count", "composite": "count", "flexcomp": "count"}
"""Element -> attribute that says how often something is made."""
_SIDES = {"cube": 6, "skybox": 6}
_SPECIAL = frozenset((*_CELLS, *_COUNTS, "size", "compiler", "mesh", "include", "model"))
"""Elements that are more than one element without cells."""


def check_mjcf(file: pathlib.Path, text: str | bytes | None = None) -> None:
    """Counts an MJCF file and what it includes.

    Args:
      text: its content, where it is not that of the file.

    Raises:
      InputError: it is no XML, cannot be read, or asks for more than a limit.
    """
    _Counter(file).read(file, text)


class _Counter:
    def __init__(self, file: pathlib.Path):
        self._file = file
        self._elements = self._cells = self._files = 0
        self._most_elements, self._most_cells = limit("MJCF_ELEMENTS"), limit("MJCF_CELLS")

    def read(self, path: pathlib.Path, text: str | bytes | None, repeats: int = 1) -> None:
        self._files += 1
        if self._files > MAX_FILES:
            raise InputError(self._file, f"includes more than {MAX_FILES} files", fix="put them into one file")
        if text is None:
            text = _content(path)
        raw = text.encode() if isinstance(text, str) else text
        refuse_more("TEXT_BYTES", len(raw), "has", path)
        stack = [repeats]
        folders: dict[str, str] = {}
        named: list[tuple[str, str]] = []
        included: list[tuple[str, int]] = []

        def start(tag: str, attributes: dict[str, str]) -> None:
            if len(stack) > MAX_DEPTH:
                raise InputError(path, f"is nested deeper than {MAX_DEPTH} levels", element=f"<{tag}>")
            here = stack[-1]
            if tag not in _SPECIAL:
                self._add(here, 0, path, tag)
                stack.append(here)
                return
            self._add(here, _cells(tag, attributes) * here, path, tag)
            stack.append(here * _count(tag, attributes))
            if tag in ("composite", "flexcomp"):
                self._add(stack[-1], 0, path, tag)
            if tag == "compiler":
                folders.update(attributes)
            elif tag in ("mesh", "texture", "hfield") and "file" in attributes:
                named.append((tag, attributes["file"]))
            elif tag in ("include", "model") and "file" in attributes:
                included.append((attributes["file"], here))

        def end(_: str) -> None:
            stack.pop()

        parser = xml.parsers.expat.ParserCreate()
        parser.StartElementHandler, parser.EndElementHandler = start, end
        try:
            parser.Parse(raw, True)
        except xml.parsers.expat.ExpatError as e:
            problem = f"MuJoCo cannot load it: it is no valid XML: {e}"
            raise InputError(path, problem, fix="convert the scene again") from e
        for kind, name in named:
            self._check_image(_place(path.parent, folders, kind, name), path)
        for name, here in included:
            for inner in {path.parent / name, self._file.parent / name}:  # MuJoCo looks in both
                if inner.is_file():
                    self.read(inner, None, here)

    def _add(self, elements: int, cells: int, path: pathlib.Path, tag: str) -> None:
        self._elements += elements
        self._cells += cells
        if self._elements > self._most_elements:
            refuse_more("MJCF_ELEMENTS", self._elements, "asks for", path, f"<{tag}>", " elements or more")
        if self._cells > self._most_cells:
            refuse_more("MJCF_CELLS", self._cells, "asks for", path, f"<{tag}>", " cells or more")

    def _check_image(self, image: pathlib.Path, path: pathlib.Path) -> None:
        """Each image by itself: homes have hundreds of textures, none of them large."""
        try:
            with image.open("rb") as opened:
                head = opened.read(PNG_HEAD)
        except (OSError, ValueError):
            return  # MuJoCo says which file is missing
        if head.startswith(b"\x89PNG\r\n\x1a\n") and len(head) == PNG_HEAD:
            width, height = (int.from_bytes(head[at : at + 4], "big") for at in (16, 20))
            refuse_more("MJCF_CELLS", width * height, "has", path, image.name, " pixels")


def _content(path: pathlib.Path) -> bytes:
    try:
        if path.exists() and not path.is_file():
            raise InputError(path, "is not a regular file")
        refuse_more("TEXT_BYTES", path.stat().st_size, "has", path)
        return path.read_bytes()
    except OSError as e:
        raise InputError(path, f"cannot be read: {e.strerror or e}") from e


def _place(folder: pathlib.Path, compiler: Mapping[str, str], kind: str, name: str) -> pathlib.Path:
    inner = compiler.get("texturedir" if kind == "texture" else "meshdir") or compiler.get("assetdir", "")
    return folder / inner / name


def _cells(tag: str, attributes: Mapping[str, str]) -> int:
    if tag == "size":
        return sum(_number(value) for name, value in attributes.items() if name.startswith("nuser"))
    if tag not in _CELLS or "file" in attributes:
        return 0
    sides = _SIDES.get(attributes.get("type", ""), 1)
    return sides * math.prod(_number(attributes.get(name, "0")) for name in _CELLS[tag])


def _count(tag: str, attributes: Mapping[str, str]) -> int:
    """How often what is inside an element is made."""
    if tag not in _COUNTS:
        return 1
    return max(1, math.prod(max(1, _number(word)) for word in attributes.get(_COUNTS[tag], "1").split()[:3]))


def _number(text: str) -> int:
    """A whole number, large ones cut; 0 for what MuJoCo refuses itself."""
    try:
        value = float(text)
    except ValueError:
        return 0
    return int(min(max(value, 0.0), 1e15)) if value == value else 0
