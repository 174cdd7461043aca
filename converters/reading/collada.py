"""COLLADA (DAE): geometry by pycollada, which is given nothing but geometry; looks and instances are read here.

pycollada refuses a geometry for an error in its material, its normals or in an element that it does not know, and
loses it. So it gets a file of its own with vertices, texture coordinates, colours and nodes.
"""

from __future__ import annotations

import io
import pathlib
import warnings as python_warnings
from typing import Any

import numpy as np
from collada import Collada
from collada.common import DaeError
from collada.polylist import Polylist
from collada.scene import GeometryNode, Node, NodeNode
from collada.triangleset import TriangleSet
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]  it has no stubs

from ..base.read_limits import check_limit
from ..base.xml_reader import Element, decode_xml, parse_number, parse_strictly, strip_namespace
from .collada_looks import ColladaLooks
from .geometry_parts import Y_UP, Geometry, MeshContent, MeshSource, PlacedGeometry
from .looks import SurfaceLook
from .mesh_limits import MeshError

NAMESPACE = "http://www.collada.org/2005/11/COLLADASchema"
X_UP = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
_PRIMITIVES = ("polylist", "triangles", "tristrips", "trifans", "polygons")
_INPUTS = ("VERTEX", "POSITION", "TEXCOORD", "COLOR")
_TRANSFORMS = ("matrix", "translate", "rotate", "scale", "lookat")
_FALLBACK = "ig2mj-scene"
_BINDING = "ig2mj-binding"


def read_collada(source: MeshSource) -> MeshContent:
    """Reads a DAE.

    Raises:
      InputError: no XML, a unit that is none. MeshError: nodes that hold themselves, or over a limit.
    """
    file, textures = source.file, source.textures
    root = parse_strictly(decode_xml(source.raw, file), file)
    strip_namespace(root)
    turn = _frame(root, file)
    looks = None if textures is None else ColladaLooks(root, textures, file)
    bindings = _prepare(root, looks)
    _check_instances(root, file)
    plain = _document(root)
    if textures is None:
        _drop_looks(plain)
    found, lost = _load(plain)
    if lost and textures is not None:
        _drop_looks(plain)
        bare, less = _load(plain)
        if _faces(bare) > _faces(found):
            textures.warn(f"{file.name}: texture coordinates or colours are broken, and left out: {lost[0]}")
            found, lost = bare, less
    placed = []
    for symbol, bound, geometry, matrix in found:
        look = SurfaceLook() if looks is None else looks.look(symbol, bindings.get(bound or "", {}))
        placed.append(PlacedGeometry(geometry, matrix, look))
    return MeshContent(placed, turn, lost)


def _frame(root: Element, file: pathlib.Path) -> np.ndarray:
    turn = np.eye(4)
    axis = root.findtext("asset/up_axis") or "Y_UP"
    turn[:3, :3] = {"X_UP": X_UP, "Z_UP": np.eye(3)}.get(axis.strip(), Y_UP)
    unit = root.find("asset/unit")
    if unit is not None and unit.get("meter") is not None:
        metres = parse_number(unit.get("meter").strip())
        if metres is None or metres <= 0:
            raise MeshError(file, f"unit meter='{unit.get('meter')[:40]}' is not a positive number")
        turn[:3, :3] *= metres
    return turn


def _prepare(root: Element, looks: ColladaLooks | None) -> dict[str, dict[str, str]]:
    """Leaves what carries geometry; returns the material bindings of the instances, by the number put on each."""
    bindings: dict[str, dict[str, str]] = {}
    skins = _skins(root)
    for number, instance in enumerate([*root.iter("instance_geometry"), *root.iter("instance_controller")]):
        bindings[str(number)] = {} if looks is None else looks.bindings(instance)
        if instance.tag == "instance_controller":
            _unskin(instance, skins)
        for child in list(instance):
            instance.remove(child)
        instance.set(_BINDING, str(number))
    for child in list(root):
        if child.tag not in ("library_geometries", "library_nodes", "library_visual_scenes", "scene"):
            root.remove(child)
    for mesh in root.iterfind("library_geometries/geometry/mesh"):
        _strip_mesh(mesh)
    keep = {*_TRANSFORMS, "node", "instance_node", "instance_geometry"}
    for holder in [*root.iter("node"), *root.iter("visual_scene")]:
        for child in list(holder):
            if child.tag not in keep:
                holder.remove(child)
    scenes = root.findall("library_visual_scenes/visual_scene")
    requested = root.find("scene/instance_visual_scene")
    named = "" if requested is None else (requested.get("url") or "").removeprefix("#")
    if scenes and named not in {scene.get("id") for scene in scenes}:
        scenes[0].set("id", _FALLBACK)
        for scene in root.findall("scene"):
            root.remove(scene)
        root.append(etree.fromstring(f'<scene><instance_visual_scene url="#{_FALLBACK}"/></scene>'))
    return bindings


def _skins(root: Element) -> dict[str, Element]:
    """id -> <skin> or <morph> of the controllers."""
    found = {}
    for controller in root.iterfind("library_controllers/controller"):
        for kind in ("skin", "morph"):
            if (body := controller.find(kind)) is not None:
                found[controller.get("id") or ""] = body
    return found


def _unskin(instance: Element, skins: dict[str, Element]) -> None:
    """Makes an <instance_controller> one of the geometry that it bends, in its bind shape."""
    name, matrices = (instance.get("url") or "").removeprefix("#"), []
    for _ in range(len(skins)):
        if name not in skins:
            break
        shape = skins[name].findtext("bind_shape_matrix")
        if shape is not None:
            matrices.append(shape)
        name = (skins[name].get("source") or "").removeprefix("#")
    instance.tag = "instance_geometry"
    instance.set("url", f"#{name}")
    parent = instance.getparent()
    for text in matrices:
        node = etree.SubElement(parent, "node")
        etree.SubElement(node, "matrix").text = text
        parent = node
    if matrices:
        parent.append(instance)


def _strip_mesh(mesh: Element) -> None:
    """Leaves positions, texture coordinates and colours; the stride of indices stays as it is."""
    used = set()
    for child in list(mesh):
        if child.tag in ("source", "vertices"):
            continue
        if child.tag not in _PRIMITIVES:
            mesh.remove(child)
            continue
        _strip_inputs(child)
        for extra in list(child):
            if extra.tag not in ("input", "p", "vcount", "ph"):
                child.remove(extra)
    for vertices in mesh.iterfind("vertices"):
        for given in list(vertices):
            if given.tag != "input" or given.get("semantic") != "POSITION":
                vertices.remove(given)
    for given in mesh.iter("input"):
        used.add((given.get("source") or "").removeprefix("#"))
    for source in mesh.findall("source"):
        if source.get("id") not in used:
            mesh.remove(source)


def _strip_inputs(primitive: Element) -> None:
    inputs = primitive.findall("input")
    offsets = {i: int(i.get("offset")) for i in inputs if (i.get("offset") or "").strip().isdecimal()}
    kept = [i for i in inputs if i in offsets and i.get("semantic") in _INPUTS]
    for dropped in set(inputs) - set(kept):
        primitive.remove(dropped)
    vertex = next((i for i in kept if i.get("semantic") == "VERTEX"), None)
    if vertex is not None and offsets and max(offsets.values()) > max(offsets[i] for i in kept):
        wide = etree.fromstring("<input/>")  # the last offset gives the stride, whose input was dropped
        wide.set("semantic", "VERTEX")
        wide.set("source", vertex.get("source") or "")
        wide.set("offset", str(max(offsets.values())))
        vertex.addnext(wide)


def _check_instances(root: Element, file: pathlib.Path) -> None:
    """Counts what the scene's tree unfolds to before anything walks it: each instance of a node repeats all below."""
    named = {node.get("id"): node for node in root.iter("node") if node.get("id")}
    counts: dict[Element, int] = {}
    roots = [*root.iterfind("library_visual_scenes/visual_scene")]
    stack: list[tuple[Element, bool]] = [(scene, False) for scene in roots]
    open_: set[Element] = set()
    while stack:
        node, done = stack.pop()
        below = [child for child in node if child.tag == "node"]
        for link in node.iterfind("instance_node"):
            target = named.get((link.get("url") or "").removeprefix("#"))
            below += [] if target is None else [target]
        if done:
            open_.discard(node)
            own = sum(1 for _ in node.iterfind("instance_geometry"))
            counts[node] = 1 + own + sum(counts[child] for child in below)
            check_limit("mesh_instances", counts[node], file, "nodes and instances", error=MeshError)
        elif node not in counts:
            if node in open_:
                raise MeshError(file, "a node holds an instance of itself", element=f"node '{node.get('id')}'")
            open_.add(node)
            stack.append((node, True))
            for child in below:
                if child in open_:
                    raise MeshError(file, "a node holds an instance of itself", element=f"node '{child.get('id')}'")
                stack.append((child, False))


_Found = list[tuple[str | None, str | None, Geometry, np.ndarray]]


def _document(root: Element) -> Element:
    """A COLLADA document of what is left of `root`, which is emptied."""
    plain = etree.Element(f"{{{NAMESPACE}}}COLLADA", nsmap={None: NAMESPACE}, version="1.4.1")
    etree.SubElement(plain, f"{{{NAMESPACE}}}asset")
    for child in list(root):
        plain.append(child)
    for element in plain.iter(etree.Element):
        if "}" not in element.tag:
            element.tag = f"{{{NAMESPACE}}}{element.tag}"
    return plain


def _drop_looks(plain: Element) -> None:
    """Takes texture coordinates and colours out of the primitives; the stride of their indices stays as it is."""
    for given in list(plain.iter(f"{{{NAMESPACE}}}input")):
        if given.get("semantic") in ("TEXCOORD", "COLOR"):
            given.set("semantic", "VERTEX")  # of several, the first counts
            given.set("source", _vertex_source(given))


def _load(plain: Element) -> tuple[_Found, list[str]]:
    """(material symbol, binding, geometry, matrix) of every primitive in the scene, and pycollada's complaints."""
    with python_warnings.catch_warnings(), np.errstate(all="ignore"):
        python_warnings.simplefilter("ignore")
        document = Collada(io.BytesIO(etree.tostring(plain)), ignore=[DaeError])
        found: _Found = []
        made: dict[int, list[tuple[str | None, Geometry]]] = {}
        stack = [(node, np.eye(4)) for node in reversed(document.scene.nodes if document.scene else [])]
        while stack:
            node, matrix = stack.pop()
            if isinstance(node, GeometryNode):
                key = id(node.geometry)
                if key not in made:
                    made[key] = [
                        (primitive.material, geometry)
                        for primitive in node.geometry.primitives
                        if (geometry := _geometry(primitive)) is not None
                    ]
                binding = None if node.xmlnode is None else node.xmlnode.get(_BINDING)
                found += [(symbol, binding, geometry, matrix) for symbol, geometry in made[key]]
            elif isinstance(node, NodeNode):
                stack.append((node.node, matrix))
            elif isinstance(node, Node):
                inner = matrix @ np.asarray(node.matrix, dtype=float)
                stack += [(child, inner) for child in reversed(node.children)]
    return found, [str(error) for error in document.errors]


def _vertex_source(given: Element) -> str:
    siblings = given.getparent().iterfind(f"{{{NAMESPACE}}}input")
    return next((i.get("source") for i in siblings if i.get("semantic") == "VERTEX"), given.get("source"))


def _geometry(primitive: Any) -> Geometry | None:
    """Corner by corner: the corners of a face have vertex, texture coordinate and colour of their own."""
    if isinstance(primitive, Polylist):
        primitive = primitive.triangleset()
    if not isinstance(primitive, TriangleSet) or primitive.vertex is None:
        return None
    index = np.asarray(primitive.vertex_index).reshape(-1)
    if index.size and index.min() < 0:
        return None
    vertices = primitive.vertex[index]
    uv = colours = None
    if len(primitive.texcoordset):
        uv = np.asarray(primitive.texcoordset[0][np.asarray(primitive.texcoord_indexset[0]).reshape(-1)], dtype=float)
    if primitive.sources.get("COLOR"):
        offset, data = primitive.sources["COLOR"][0][0], primitive.sources["COLOR"][0][4].data
        rows = primitive.index[:, :, offset].reshape(-1)
        if len(rows) and rows.min() >= 0 and rows.max() < len(data) and data.shape[1] in (3, 4):
            colours = np.asarray(data[rows], dtype=float)
    return Geometry(vertices, np.arange(len(vertices)).reshape(-1, 3), uv, colours)


def _faces(found: _Found) -> int:
    return sum(len(geometry.faces) for _, _, geometry, _ in found)
