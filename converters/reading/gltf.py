"""glTF 2.0 and GLB: triangles, instances and looks, every offset and count checked before it is used.

Numbers of a file lead to memory: accessors may claim any count, views may overlap, strides may be zero. NumPy checks
each accessor against its buffer here, and their sum is limited.
"""

from __future__ import annotations

import base64
import binascii
import dataclasses
import pathlib
import struct
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ig2mj.errors import InputError

from ..base.read_limits import check_limit, limits
from ..base.text import without_mark
from ..base.xml_reader import read_bytes
from .geometry_parts import Y_UP, Geometry, MeshContent, MeshSource, PlacedGeometry
from .json_reader import decode_json
from .looks import SurfaceLook, Texture, TextureReader
from .mesh_limits import MeshError, check_faces

_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_PLAIN = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")
"""Extensions that replace the geometry: what is left without them is none."""
BYTES_PER_FACE = 400
"""Of all accessors together, per triangle of the limit: three corners with all that glTF has of them."""


@dataclasses.dataclass
class _File:
    file: pathlib.Path
    tree: dict[str, Any]
    binary: bytes | None
    load: Callable[[str], bytes]
    textures: TextureReader | None
    buffers: dict[int, bytes] = dataclasses.field(default_factory=dict)
    arrays: dict[int, np.ndarray] = dataclasses.field(default_factory=dict)
    meshes: dict[int, list[tuple[Geometry, SurfaceLook]]] = dataclasses.field(default_factory=dict)
    looks: dict[int, SurfaceLook] = dataclasses.field(default_factory=dict)
    spent: int = 0


class _Broken(Exception):
    """Something in the file is not what it must be; the text says what."""


def read_gltf(source: MeshSource) -> MeshContent:
    """Reads a glTF (JSON) or GLB: metres, Y up.

    Raises:
      MeshError: broken, over a limit, or compressed by an extension. InputError: a buffer that it names is missing.
    """
    raw, file, textures = source.raw, source.file, source.textures

    def load(uri: str) -> bytes:
        return read_bytes(source.guard.resolve(uri, file.name, base=file.parent), "scene_bytes")

    text, binary = _chunks(raw, file) if file.suffix.lower() == ".glb" else (raw, None)
    try:
        tree = decode_json(without_mark(text), file)
    except InputError as e:
        raise MeshError(file, f"is not a glTF file: {e.problem}", fix=e.fix) from e
    if not isinstance(tree, dict):
        raise MeshError(file, "is not a glTF file: its JSON is no object")
    try:
        version = str(_dict(tree.get("asset")).get("version", "2.0"))
        if not version.startswith("2"):
            raise _Broken(f"its version {version[:20]!r} is not 2")
        required = tree.get("extensionsRequired") or []
        if isinstance(required, list) and (packed := [name for name in required if name in _PLAIN]):
            raise MeshError(file, f"is compressed ({packed[0]})", fix="export it without compression")
        opened = _File(file, tree, binary, load, textures)
        for number, buffer in enumerate(_list(tree.get("buffers"))):
            if "uri" in _dict(buffer):
                _buffer(opened, number)  # a name that leads outside is refused whether the scene uses it or not
        turn = np.eye(4)
        turn[:3, :3] = Y_UP
        return MeshContent(list(_placed(opened)), turn)
    except _Broken as e:
        raise MeshError(file, f"cannot be read as {file.suffix[1:].upper()}: {e}") from e


def _chunks(raw: bytes, file: pathlib.Path) -> tuple[bytes, bytes | None]:
    """(JSON, binary chunk or None) of a GLB."""
    if len(raw) < 20 or raw[:4] != b"glTF":
        raise MeshError(file, "cannot be read as GLB: it does not begin as one")
    version, _ = struct.unpack("<II", raw[4:12])
    if version != 2:
        raise MeshError(file, f"cannot be read as GLB: its version {version} is not 2")
    found: dict[bytes, bytes] = {}
    at = 12
    while at + 8 <= len(raw):
        (length,) = struct.unpack("<I", raw[at : at + 4])
        kind, at = raw[at + 4 : at + 8], at + 8
        if at + length > len(raw):
            raise MeshError(file, "cannot be read as GLB: a chunk is cut short")
        found.setdefault(kind, raw[at : at + length])
        at += length
    if b"JSON" not in found:
        raise MeshError(file, "cannot be read as GLB: it has no JSON chunk")
    return found[b"JSON"], found.get(b"BIN\0")


def _placed(at: _File) -> Iterator[PlacedGeometry]:
    """Instances of the default scene's nodes, in the order of the file."""
    nodes = _list(at.tree.get("nodes"))
    scenes = _list(at.tree.get("scenes"))
    if scenes:
        scene = _item(scenes, at.tree.get("scene", 0), "scene")
        roots = [_index(n, nodes, "node") for n in _list(scene.get("nodes"))]
    else:
        children = {n for node in nodes for n in _list(_dict(node).get("children")) if isinstance(n, int)}
        roots = [n for n in range(len(nodes)) if n not in children]
    count, faces = 0, 0
    stack = [(n, np.eye(4), 0) for n in reversed(roots)]
    while stack:
        number, above, depth = stack.pop()
        count += 1
        check_limit("mesh_instances", count, at.file, "nodes and instances", error=MeshError)
        if depth > len(nodes):
            raise _Broken("a node holds itself")
        node = _dict(nodes[number])
        matrix = above @ _matrix(node)
        if "mesh" in node:
            for geometry, look in _mesh(at, _index(node["mesh"], _list(at.tree.get("meshes")), "mesh")):
                faces += len(geometry.faces)
                check_faces(faces, at.file)
                yield PlacedGeometry(geometry, matrix, look)
        below = [_index(n, nodes, "node") for n in _list(node.get("children"))]
        stack += [(n, matrix, depth + 1) for n in reversed(below)]
        check_limit("mesh_instances", len(stack), at.file, "nodes and instances", error=MeshError)


def _matrix(node: dict[str, Any]) -> np.ndarray:
    """4x4 of a node: its matrix (by columns), or translation, rotation (x, y, z, w) and scale."""
    if "matrix" in node:
        return _numbers(node["matrix"], 16, "matrix").reshape(4, 4).T
    matrix = np.eye(4)
    if "rotation" in node:
        quat = _numbers(node["rotation"], 4, "rotation")
        if np.linalg.norm(quat) > 1e-9:
            matrix[:3, :3] = Rotation.from_quat(quat).as_matrix()
    if "scale" in node:
        matrix[:3, :3] *= _numbers(node["scale"], 3, "scale")
    if "translation" in node:
        matrix[:3, 3] = _numbers(node["translation"], 3, "translation")
    return matrix


def _mesh(at: _File, number: int) -> list[tuple[Geometry, SurfaceLook]]:
    if number not in at.meshes:
        found = []
        for primitive in _list(_dict(at.tree["meshes"][number]).get("primitives")):
            geometry = _primitive(at, _dict(primitive))
            if geometry is not None:
                look = SurfaceLook() if at.textures is None else _look(at, _dict(primitive).get("material"))
                found.append((geometry, look))
        at.meshes[number] = found
    return at.meshes[number]


def _primitive(at: _File, primitive: dict[str, Any]) -> Geometry | None:
    mode = primitive.get("mode", _TRIANGLES)
    if mode not in (_TRIANGLES, _STRIP, _FAN):
        return None  # points and lines
    if packed := [name for name in _dict(primitive.get("extensions")) if name in _PLAIN]:
        raise MeshError(at.file, f"is compressed ({packed[0]})", fix="export it without compression")
    attributes = _dict(primitive.get("attributes"))
    if "POSITION" not in attributes:
        return None
    vertices = _accessor(at, attributes["POSITION"], (3,)).astype(np.float64)
    if "indices" in primitive:
        corners = _accessor(at, primitive["indices"], (1,)).reshape(-1).astype(np.int64)
    else:
        corners = np.arange(len(vertices))
    if mode == _TRIANGLES:
        faces = corners[: len(corners) // 3 * 3].reshape(-1, 3)
    elif len(corners) < 3:
        return None
    elif mode == _STRIP:
        faces = np.stack([corners[:-2], corners[1:-1], corners[2:]], axis=1)
        faces[1::2] = faces[1::2, ::-1]
    else:
        faces = np.stack([np.full(len(corners) - 2, corners[0]), corners[1:-1], corners[2:]], axis=1)
    uv = _optional(at, attributes.get("TEXCOORD_0"), (2,), len(vertices))
    if uv is not None:
        uv = np.column_stack([uv[:, 0], 1.0 - uv[:, 1]])  # the image's upper left -> its lower left
    return Geometry(vertices, faces, uv, _optional(at, attributes.get("COLOR_0"), (3, 4), len(vertices)))


def _optional(at: _File, number: Any, widths: tuple[int, ...], count: int) -> np.ndarray | None:
    """An accessor of looks; broken, it is a warning."""
    if number is None or at.textures is None:
        return None
    try:
        values = _accessor(at, number, widths)
        if len(values) != count:
            raise _Broken("not one value per vertex")
    except _Broken as e:
        at.textures.warn(f"{at.file.name}: texture coordinates or colours are broken, and left out: {e}")
        return None
    scale = 1.0 if values.dtype.kind == "f" else float(np.iinfo(values.dtype).max)
    return values.astype(np.float64) / scale


def _accessor(at: _File, number: Any, widths: tuple[int, ...]) -> np.ndarray:
    """An accessor's values [count, width]."""
    accessors = _list(at.tree.get("accessors"))
    number = _index(number, accessors, "accessor")
    if number not in at.arrays:
        at.arrays[number] = _read_accessor(at, _dict(accessors[number]))
    if at.arrays[number].shape[1] not in widths:
        raise _Broken(f"accessor {number} has {at.arrays[number].shape[1]} components, not {widths[0]}")
    return at.arrays[number]


def _read_accessor(at: _File, accessor: dict[str, Any]) -> np.ndarray:
    kind, width = _TYPES.get(accessor.get("componentType", 0)), _WIDTHS.get(str(accessor.get("type")))
    if kind is None or width is None:
        raise _Broken("an accessor is of no known type")
    dtype, count = np.dtype(kind), _whole(accessor.get("count"), "count")
    most = BYTES_PER_FACE * limits().mesh_faces
    at.spent += count * width * dtype.itemsize
    if at.spent > most:
        check_limit("mesh_faces", at.spent // BYTES_PER_FACE + 1, at.file, "faces' worth of data", error=MeshError)
    if "bufferView" in accessor:
        values = _view(at, accessor["bufferView"], _whole(accessor.get("byteOffset", 0), "offset"), count, width, dtype)
    else:
        values = np.zeros((count, width), dtype)
    if "sparse" not in accessor:
        return values
    sparse = _dict(accessor["sparse"])
    some, values = _whole(sparse.get("count"), "count"), values.copy()
    where, what = _dict(sparse.get("indices")), _dict(sparse.get("values"))
    index_type = _TYPES.get(where.get("componentType", 0))
    if index_type is None or some > count:
        raise _Broken("an accessor's sparse values are of no known type")
    offsets = [_whole(part.get("byteOffset", 0), "offset") for part in (where, what)]
    rows = _view(at, where.get("bufferView"), offsets[0], some, 1, np.dtype(index_type)).reshape(-1).astype(np.int64)
    if len(rows) and (rows.min() < 0 or rows.max() >= count):
        raise _Broken("an accessor's sparse values lie outside it")
    values[rows] = _view(at, what.get("bufferView"), offsets[1], some, width, dtype)
    return values


def _view(at: _File, number: Any, offset: int, count: int, width: int, dtype: np.dtype) -> np.ndarray:
    """[count, width] out of a buffer view; NumPy refuses what does not lie in it."""
    views = _list(at.tree.get("bufferViews"))
    view = _dict(views[_index(number, views, "buffer view")])
    start, length = _whole(view.get("byteOffset", 0), "offset"), _whole(view.get("byteLength"), "length")
    buffer = _buffer(at, view.get("buffer"))
    if start + length > len(buffer):
        raise _Broken(f"a buffer view ends at byte {start + length} of {len(buffer)}")
    stride = _whole(view.get("byteStride", 0), "stride") or width * dtype.itemsize
    if stride < width * dtype.itemsize:
        raise _Broken("a buffer view's stride is shorter than its values")
    try:
        content = memoryview(buffer)[start : start + length]
        return np.ndarray((count, width), dtype, content, offset, (stride, dtype.itemsize))
    except (ValueError, TypeError, OverflowError) as e:
        raise _Broken(f"an accessor lies outside its buffer view: {e}") from e


def _buffer(at: _File, number: Any) -> bytes:
    buffers = _list(at.tree.get("buffers"))
    number = _index(number, buffers, "buffer")
    if number not in at.buffers:
        uri = _dict(buffers[number]).get("uri")
        if uri is None and number == 0 and at.binary is not None:
            at.buffers[number] = at.binary
        elif isinstance(uri, str):
            at.buffers[number] = _bytes_of(at, uri)
            check_limit("scene_bytes", sum(map(len, at.buffers.values())), at.file, "bytes in buffers", error=MeshError)
        else:
            raise _Broken(f"buffer {number} has no content")
    return at.buffers[number]


def _bytes_of(at: _File, uri: str) -> bytes:
    if not uri.startswith("data:"):
        return at.load(uri)
    head, comma, content = uri.partition(",")
    if not comma or not head.endswith(";base64"):
        raise _Broken("a data URI is not in base64")
    try:
        return base64.b64decode(content)
    except (binascii.Error, ValueError) as e:
        raise _Broken(f"a data URI is broken: {e}") from e


def _look(at: _File, number: Any) -> SurfaceLook:
    """A material's base colour and texture; broken, it is a warning and no look."""
    assert at.textures is not None
    if number is None:
        return SurfaceLook()
    if not isinstance(number, int) or number not in at.looks:
        try:
            materials = _list(at.tree.get("materials"))
            number = _index(number, materials, "material")
            at.looks[number] = _material(at, _dict(materials[number]))
        except _Broken as e:
            at.textures.warn(f"{at.file.name}: {e}: rendered without it")
            return SurfaceLook()
    return at.looks[number]


def _material(at: _File, material: dict[str, Any]) -> SurfaceLook:
    base = _dict(material.get("pbrMetallicRoughness"))
    factor, texture = base.get("baseColorFactor"), base.get("baseColorTexture")
    glossy = _dict(_dict(material.get("extensions")).get("KHR_materials_pbrSpecularGlossiness"))
    if glossy:
        factor, texture = glossy.get("diffuseFactor", factor), glossy.get("diffuseTexture", texture)
    rgba = None
    if factor is not None:
        r, g, b, a = (float(v) for v in np.clip(_numbers(factor, 4, "base colour"), 0, 1))
        rgba = (r, g, b, a or 1.0)
    image = None if texture is None else _texture(at, _dict(texture))
    return SurfaceLook(rgba, image)


def _texture(at: _File, reference: dict[str, Any]) -> Texture | None:
    assert at.textures is not None
    entry = _item(_list(at.tree.get("textures")), reference.get("index"), "texture")
    source = entry.get("source")
    if source is None:
        source = _dict(_dict(entry.get("extensions")).get("EXT_texture_webp")).get("source")
    images = _list(at.tree.get("images"))
    number = _index(source, images, "image")
    image = _dict(images[number])
    uri = image.get("uri")
    if isinstance(uri, str) and not uri.startswith("data:"):
        return at.textures.file(uri)
    name = f"{at.file.stem}-{image['name'] if isinstance(image.get('name'), str) else number}"
    if isinstance(uri, str):
        return at.textures.packed(name, _bytes_of(at, uri))
    views = _list(at.tree.get("bufferViews"))
    view = _dict(views[_index(image.get("bufferView"), views, "buffer view")])
    length = _whole(view.get("byteLength"), "length")
    return at.textures.packed(name, _view(at, image.get("bufferView"), 0, length, 1, np.dtype("u1")).tobytes())


def _dict(value: Any) -> dict[str, Any]:
    if value is None:
        return {}
    if not isinstance(value, dict):
        raise _Broken(f"{str(value)[:40]!r} is not an object")
    return value


def _list(value: Any) -> list[Any]:
    if value is None:
        return []
    if not isinstance(value, list):
        raise _Broken(f"{str(value)[:40]!r} is not a list")
    return value


def _item(values: list[Any], index: Any, what: str) -> dict[str, Any]:
    return _dict(values[_index(index, values, what)])


def _index(value: Any, values: list[Any], what: str) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < len(values):
        raise _Broken(f"there is no {what} {str(value)[:20]}")
    return value


def _whole(value: Any, what: str) -> int:
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value < 2**48:
        raise _Broken(f"a {what} is {str(value)[:20]!r}")
    return value


def _numbers(value: Any, count: int, what: str) -> np.ndarray:
    values = _list(value)
    if len(values) != count or not all(isinstance(v, int | float) and abs(v) < 1e15 for v in values):
        raise _Broken(f"a {what} is not {count} numbers")
    return np.array(values, dtype=float)
