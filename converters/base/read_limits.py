"""How much the converter's readers take from one input: what is beyond is refused before it is allocated or walked.

    with limits_of(ReadLimits(mesh_faces=3_000_000)):
        read_urdf(...)

On the command line: `ig2mj convert ... --limit mesh-faces=3000000`. Every message names the limit that it met.
"""

from __future__ import annotations

import contextlib
import contextvars
import dataclasses
from collections.abc import Iterator, Sequence

from ig2mj.errors import InputError


@dataclasses.dataclass(frozen=True)
class ReadLimits:
    """Limits of the readers; each counts what one file holds, unless it says otherwise.

    Attributes:
      xml_bytes: bytes of a URDF or a scene file.
      xml_elements: elements and attributes of an XML file, DAE files included.
      json_values: values of a JSON file, or of the JSON in a glTF: commas, colons and opening brackets.
      links: links of a URDF. joints: of them, joints that move (pairs of their bodies do not collide).
      link_depth: moving joints between a link and the base (MuJoCo reads MJCF of 500 levels).
      link_shapes: collision shapes, and visuals, of one link.
      mesh_bytes: bytes of an OBJ, STL or PLY. scene_bytes: of a DAE, GLB or glTF with the buffers that it names.
      mesh_faces: triangles of a mesh file, instances counted. mesh_vertices: vertices and texture coordinates of it.
      mesh_lines: lines of an OBJ.
      mesh_groups: `o` and `g` groups with faces of a collision OBJ.
      mesh_materials: materials with faces of a visual mesh; beyond, it is drawn in one colour.
      mesh_instances: nodes and instances of meshes in a DAE, GLB or glTF.
      image_pixels: pixels of a texture or a room map.
    """

    xml_bytes: int = 64 * 2**20
    xml_elements: int = 1_000_000
    json_values: int = 2_000_000
    links: int = 5_000
    joints: int = 400
    link_depth: int = 300
    link_shapes: int = 1_000
    mesh_bytes: int = 256 * 2**20
    scene_bytes: int = 128 * 2**20
    mesh_faces: int = 1_000_000
    mesh_vertices: int = 3_000_000
    mesh_lines: int = 12_000_000
    mesh_groups: int = 2_000
    mesh_materials: int = 500
    mesh_instances: int = 2_000
    image_pixels: int = 89_000_000

    @classmethod
    def from_words(cls, words: Sequence[str]) -> ReadLimits:
        """From "mesh-faces=3000000"-like words. Raises InputError: no such limit, or no positive whole number."""
        known = [field.name for field in dataclasses.fields(cls)]
        values = {}
        for word in words:
            name, _, value = word.partition("=")
            key = name.strip().replace("-", "_")
            if key not in known:
                fix = f"use {', '.join(k.replace('_', '-') for k in known)}"
                raise InputError("command line", f"there is no limit '{name}'", element="--limit", fix=fix)
            if not (value.isascii() and value.isdigit() and len(value) < 16 and int(value) > 0):
                raise InputError(
                    "command line", f"'{word}' is not NAME=N with a positive whole number N", element="--limit"
                )
            values[key] = int(value)
        return cls(**values)


DEFAULTS = ReadLimits()
_active: contextvars.ContextVar[ReadLimits] = contextvars.ContextVar("ig2mj_read_limits", default=DEFAULTS)


def limits() -> ReadLimits:
    """The limits in force."""
    return _active.get()


@contextlib.contextmanager
def limits_of(chosen: ReadLimits) -> Iterator[None]:
    """Puts limits in force inside the block."""
    token = _active.set(chosen)
    try:
        yield
    finally:
        _active.reset(token)


def check_limit(
    name: str,
    count: int,
    file: object,
    what: str,
    *,
    element: str = "",
    fix: str = "",
    error: type[InputError] = InputError,
) -> None:
    """Raises `error` where a count is beyond the limit of that name, with a message that names it.

    Args:
      what: is counted, for the message: "faces". fix: what would make it smaller.
    """
    most = getattr(limits(), name)
    if count > most:
        option = f"--limit {name.replace('_', '-')}=N"
        fix = f"{fix}, or raise the limit: {option}" if fix else f"raise the limit: {option}"
        raise error(file, f"has {count} or more {what}, the limit is {most}", element=element, fix=fix)
