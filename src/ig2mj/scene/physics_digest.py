"""`physics_digest`: hash of what determines physics in the files of a scene or of an object of the library.

Left out are visual geoms, materials, textures, lights, cameras, colours, groups, comments and the form of the text.
Meshes count by their content, not by the names of their files. The hash is made from the files and not from the
compiled model, whose last digits depend on the processor.
"""

from __future__ import annotations

import hashlib
import pathlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping
from typing import Any

import msgspec

from ig2mj.scene.manifest import Manifest, ObjectEntry

APPEARANCE_ELEMENTS = frozenset(("visual", "material", "texture", "skin", "light", "camera", "default", "mesh"))
"""Elements that are left out. Defaults are merged into the elements that they are of, meshes into their geoms."""

APPEARANCE_ATTRIBUTES = frozenset(("rgba", "material", "texcoord", "content_type", "class", "childclass", "assetdir"))
APPEARANCE_ATTRIBUTES |= {"meshdir", "texturedir"}

GROUPS = "0 5"
"""MuJoCo's default of `inertiagrouprange`: geoms of these groups give mass to bodies without `inertial`."""

Defaults = dict[str, dict[str, dict[str, str]]]
"""Attributes by class and by tag, inherited ones included."""

MAIN = "main"
"""MuJoCo's name of the class of elements that name none."""


def physics_digest(file: pathlib.Path, manifest: Manifest) -> str:
    """Hash of a scene.xml or an object.xml and of the manifest's entries that belong to it.

    Where the file is not XML, which MuJoCo reports in its own words, the hash is of its bytes.
    """
    hashed = hashlib.blake2b(digest_size=16)
    try:
        root = ElementTree.parse(file).getroot()
    except ElementTree.ParseError:
        hashed.update(file.read_bytes())
    else:
        named = {link.geom for entry in manifest.objects for link in entry.links.values() if link.geom}
        _Reader(root, file.parent, named).feed(hashed)
    hashed.update(msgspec.json.encode([without_insides(manifest), manifest.rooms.instances, manifest.task]))
    return hashed.hexdigest()


def without_insides(manifest: Manifest) -> list[ObjectEntry]:
    """The objects as format version 1 has them: the inside of a container determines no physics."""
    return [o if o.inside is None else msgspec.structs.replace(o, inside=None) for o in manifest.objects]


class _Reader:
    """Feeds a hash with the elements that matter."""

    def __init__(self, root: ElementTree.Element, folder: pathlib.Path, named: set[str]):
        """`named`: geoms that the manifest names."""
        self._root, self._folder = root, folder
        compiler = root.find("compiler")
        self._compiler = {} if compiler is None else compiler.attrib
        self._defaults: Defaults = {MAIN: {}}
        for top in root.findall("default"):
            self._add_defaults(top, MAIN, {})
        self._meshes = {name: element for element in root.iter("mesh") if (name := _mesh_name(element))}
        self._referenced = named | set(_referenced_geoms(root))

    def feed(self, hashed: Any) -> None:
        for section in self._root:
            if section.tag == "statistic":  # the rest of it is of the viewer
                hashed.update("".join(v for k, v in section.attrib.items() if k == "meaninertia").encode())
            elif section.tag != "asset":
                self._feed(hashed, section, MAIN, massless=True)
            else:
                for element in section:
                    if element.tag not in APPEARANCE_ELEMENTS:
                        self._feed(hashed, element, MAIN, massless=True)

    def _feed(self, hashed: Any, element: ElementTree.Element, inherited: str, massless: bool) -> None:
        """One element and those in it. `inherited`: its class unless it names one. `massless`: geoms have no mass."""
        if element.tag in APPEARANCE_ELEMENTS:
            return
        attributes = {**self._of_class(element, inherited), **element.attrib}
        if element.tag == "geom":
            if self._is_visual(attributes, massless):
                return
            attributes["group"] = "" if massless else str(self._weighs(attributes))
            if attributes.get("name") not in self._referenced:
                attributes.pop("name", None)
            if mesh := attributes.get("mesh"):
                attributes["mesh"] = self._mesh(mesh)
        else:
            attributes.pop("group", None)
        if file := attributes.get("file"):
            attributes["file"] = _content(self._folder / file)
        kept = sorted((k, v) for k, v in attributes.items() if k not in APPEARANCE_ATTRIBUTES)
        hashed.update(f"<{element.tag} {kept} {(element.text or '').strip()}".encode())
        if element.tag in ("body", "worldbody"):
            has_mass = element.tag == "worldbody" or element.find("inertial") is not None
            massless = has_mass and self._compiler.get("inertiafromgeom", "auto") != "true"
            inherited = element.get("childclass", inherited)
        for inner in element:
            self._feed(hashed, inner, inherited, massless)
        hashed.update(b">")

    def _is_visual(self, attributes: Mapping[str, str], massless: bool) -> bool:
        """A geom that touches nothing, weighs nothing, and that nothing refers to."""
        if attributes.get("contype", "1") != "0" or attributes.get("conaffinity", "1") != "0":
            return False
        return attributes.get("name") not in self._referenced and (massless or not self._weighs(attributes))

    def _weighs(self, attributes: Mapping[str, str]) -> bool:
        """Whether a geom adds to the mass of a body without `inertial`."""
        low, high = map(int, self._compiler.get("inertiagrouprange", GROUPS).split())
        mass = attributes.get("mass", attributes.get("density", "1000"))
        return low <= int(attributes.get("group", "0")) <= high and float(mass) != 0

    def _of_class(self, element: ElementTree.Element, inherited: str) -> dict[str, str]:
        return self._defaults.get(element.get("class", inherited), {}).get(element.tag, {})

    def _add_defaults(self, element: ElementTree.Element, name: str, above: dict[str, dict[str, str]]) -> None:
        own = {tag: dict(values) for tag, values in above.items()}
        for inner in element:
            if inner.tag != "default":
                own[inner.tag] = {**own.get(inner.tag, {}), **inner.attrib}
        self._defaults[name] = own
        for inner in element.findall("default"):
            self._add_defaults(inner, inner.get("class", MAIN), own)

    def _mesh(self, name: str) -> str:
        """What a mesh is, whatever it is called."""
        element = self._meshes.get(name)
        if element is None:
            return name
        attributes = {**self._of_class(element, MAIN), **element.attrib}
        kept = sorted((k, v) for k, v in attributes.items() if k not in {"name", "file", *APPEARANCE_ATTRIBUTES})
        file = attributes.get("file")
        folder = self._folder / self._compiler.get("assetdir", "") / self._compiler.get("meshdir", "")
        return f"{kept} {_content(folder / file) if file else ''}"


def _mesh_name(element: ElementTree.Element) -> str:
    return element.get("name") or pathlib.PurePath(element.get("file", "")).stem


def _referenced_geoms(root: ElementTree.Element) -> Iterator[str]:
    """Names of geoms that contacts, tendons and sensors refer to."""
    for section in root:
        if section.tag not in ("worldbody", "asset", "default"):
            for element in section.iter():
                yield from (element.attrib[k] for k in ("geom", "geom1", "geom2") if k in element.attrib)
                if element.get("objtype") == "geom":
                    yield element.get("objname", "")


def _content(file: pathlib.Path) -> str:
    """Hash of a file; its name where it cannot be read, which MuJoCo reports in its own words."""
    try:
        return hashlib.blake2b(file.read_bytes(), digest_size=16).hexdigest()
    except OSError:
        return file.name
