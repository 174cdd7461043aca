"""`manifest.json`: everything about a scene that MJCF cannot say. Schema, reading, writing.

The manifest stands next to `scene.xml`. Names in it are names of MJCF elements. Quaternions are w, x, y, z; lengths
metres; masses kilograms; joint positions radians or metres.
"""

from __future__ import annotations

import collections
import math
import os
import pathlib
from typing import Any

import msgspec

from ig2mj.errors import ManifestError
from ig2mj.files.content import read_struct

FORMAT_VERSION = 2
"""Version 2 has the inside of containers (`InsideEntry`)."""

MAX_CORNERS = 64
"""Of an inside, and of its rim."""

READABLE = (1, FORMAT_VERSION)
UPGRADE = "ig2mj convert upgrade"
"""Command that adds what version 1 lacks."""

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]


class JointEntry(msgspec.Struct, omit_defaults=True):
    """One joint inside an object (never the free joint of its base)."""

    name: str
    type: str  # "hinge" or "slide"
    range: tuple[float, float] | None = None  # None: continuous


class OpenableEntry(msgspec.Struct):
    """A joint that says whether the object is Open: its closed end and its open end (iGibson's open.py)."""

    joint: str
    closed: float
    open: float


class LinkEntry(msgspec.Struct, omit_defaults=True):
    """An annotated (meta) link: a site for a point, a geom for a box. Exactly one of `site` and `geom` is set.

    Kinds (the keys of `ObjectEntry.links`): heat_source, toggle_button, water_source, water_sink, slicer,
    cleaning_tool_area.
    """

    site: str | None = None
    geom: str | None = None


class OrientationEntry(msgspec.Struct):
    """A stable orientation of the object's base, its probability, and the box size it has there."""

    quat: Quat
    prob: float
    size: Vec3


class PartEntry(msgspec.Struct):
    """One half of a sliceable object: the object's name, and its base pose in the whole's base frame (scaled)."""

    object: str
    pos: Vec3
    quat: Quat


class InsideEntry(msgspec.Struct):
    """What a container holds: the convex inside of its base body, in that body's frame, m.

    `litres` are what it holds when it stands. `vertices` are corners of the inside. `rim` goes round its opening,
    convex and flat; what stands higher than the lowest corner of the rim flows out.
    """

    litres: float
    vertices: list[Vec3]
    rim: list[Vec3]


BUILDING = frozenset({"walls", "floors", "ceilings"})
"""Categories of the house itself. They are objects of a scene, but a home is not said to have them."""


class ObjectEntry(msgspec.Struct, omit_defaults=True):
    """One object of the scene."""

    name: str
    category: str
    model: str
    bodies: list[str]  # the root of the main body first; roots of split-off floating links later
    fixed: bool
    bounding_box: Vec3  # at joint positions 0, in base-link axes, scaled
    mass: float
    synset: str | None = None
    rooms: list[str] = []  # room instances, e.g. "kitchen_0"
    scale: Vec3 = (1.0, 1.0, 1.0)
    base_link_offset: Vec3 = (0.0, 0.0, 0.0)  # centre of the bounding box in the base body's frame, scaled
    joints: list[JointEntry] = []
    openable: list[OpenableEntry] = []
    openable_both_sides: bool = False
    links: dict[str, LinkEntry] = {}
    abilities: dict[str, dict[str, float | bool]] = {}
    orientations: list[OrientationEntry] = []
    parts: list[PartEntry] = []  # of a whole: its halves
    part_of: str | None = None  # of a half: its whole
    parked: bool = False  # starts on the parking slab outside the house, not in use
    assisted_grasp: bool = True  # avg_category_specs' enable_ag
    object_scope: str | None = None  # BDDL instances this object is bound to, as in the source
    inside: InsideEntry | None = None  # of a container; None: it holds nothing
    state: dict[str, Any] = {}  # initial extended state, where the source had one; keys as ig2mj names states

    @property
    def in_household(self) -> bool:
        """Whether it counts as an object of the home: in use (no parked half), and no part of the building."""
        return not self.parked and self.category not in BUILDING


class RoomEntry(msgspec.Struct):
    """A room instance: its type, such as "kitchen", and its floor, 0 the lowest."""

    type: str
    floor: int = 0


class RoomsEntry(msgspec.Struct, omit_defaults=True):
    """Room instances, and the file with the maps (see `ig2mj.scene.rooms`)."""

    file: str | None = None
    instances: dict[str, RoomEntry] = {}


class AgentEntry(msgspec.Struct, omit_defaults=True):
    """An agent compiled into the scene: its base body, its camera, the finger bodies that press buttons, its hands.

    `laser` is where its scanner stands, m in the frame of the base (x forward, z up), None where it has none.
    `no_contact` names, for bodies of the agent, categories of objects that they pass through. For hands of `assisted`
    agents equality constraints to everything graspable are compiled (`ig2mj.scene.grasp_equalities`).
    `wrist_cameras` are the cameras on its hands by their names in observations, "right_wrist" and "left_wrist".
    """

    name: str
    body: str
    camera: str | None = None
    fingers: list[str] = []
    hands: list[str] = []
    no_contact: dict[str, list[str]] = {}
    assisted: bool = False
    laser: tuple[float, float, float] | None = None
    wrist_cameras: dict[str, str] = {}


class Manifest(msgspec.Struct, omit_defaults=True):
    """The whole of `manifest.json`. Objects keep the order of the source; it is the `O` axis of all arrays."""

    format_version: int
    name: str
    objects: list[ObjectEntry]
    source: dict[str, Any] = {}
    rooms: RoomsEntry = msgspec.field(default_factory=RoomsEntry)
    agents: list[AgentEntry] = []
    task: dict[str, Any] | None = None
    substances: list[str] = []  # in use, by the names of `ig2mj.knowledge.substances`
    extras: list[str] = []  # further states that it has (`ig2mj.scene.extras`)
    contents: list[str] = []  # what containers are filled with at the start, "milk@carton_0"


def load_manifest(path: str | os.PathLike) -> Manifest:
    """Reads and validates a manifest.

    Args:
      path: the file `manifest.json`, or the folder that holds it.

    Raises:
      ManifestError: the file is missing, is not JSON, does not fit the schema, has another format version, or is not
        consistent in itself.
    """
    file = pathlib.Path(path)
    if file.is_dir():
        file = file / "manifest.json"
    if not file.exists():
        raise ManifestError(file, "there is no such file", fix="give the folder that `ig2mj convert` wrote")
    manifest = read_struct(file, Manifest, error=ManifestError, fix="convert the scene again")
    check_manifest(manifest, file)
    return manifest


def save_manifest(manifest: Manifest, path: str | os.PathLike) -> None:
    """Writes the manifest as indented JSON, keys in the schema's order, so that equal manifests are equal bytes."""
    text = msgspec.json.format(msgspec.json.encode(manifest), indent=1)
    pathlib.Path(path).write_bytes(text + b"\n")


def check_manifest(manifest: Manifest, file: object = "manifest.json") -> None:
    """Checks what the schema cannot say: version, unique names, references between objects. Raises ManifestError."""
    if manifest.format_version not in READABLE:
        raise ManifestError(
            file,
            f"has format version {manifest.format_version}, this ig2mj reads {' and '.join(map(str, READABLE))}",
            element="format_version",
            fix="convert the scene again",
        )
    names = [o.name for o in manifest.objects]
    if len(set(names)) != len(names):
        twice = sorted(name for name, count in collections.Counter(names).items() if count > 1)[:10]
        raise ManifestError(file, f"object names occur twice: {', '.join(twice)}", element="objects")
    known = set(names)
    for o in manifest.objects:
        element = f"object '{o.name}'"
        if not o.bodies:
            raise ManifestError(file, "has no bodies", element=element)
        if o.inside is not None:
            _check_inside(o.inside, element, file)
        joints = {j.name for j in o.joints}
        for part in o.parts:
            if part.object not in known:
                raise ManifestError(file, f"names the part '{part.object}', which is not an object", element=element)
        if o.part_of is not None and o.part_of not in known:
            raise ManifestError(file, f"is part of '{o.part_of}', which is not an object", element=element)
        for opening in o.openable:
            if opening.joint not in joints:
                raise ManifestError(file, f"openable joint '{opening.joint}' is not a joint of it", element=element)
        for kind, link in o.links.items():
            if (link.site is None) == (link.geom is None):
                raise ManifestError(file, f"link '{kind}' needs exactly one of site and geom", element=element)


def _check_inside(inside: InsideEntry, element: str, file: object) -> None:
    numbers = [inside.litres, *(v for corner in (*inside.vertices, *inside.rim) for v in corner)]
    if len(inside.vertices) < 4 or len(inside.rim) < 3 or inside.litres <= 0 or not all(map(math.isfinite, numbers)):
        problem = "has an inside without litres, four corners, or three corners of a rim"
        raise ManifestError(file, problem, element=element, fix="convert the scene again")
    if len(inside.vertices) > MAX_CORNERS or len(inside.rim) > MAX_CORNERS:
        raise ManifestError(file, f"has an inside with more than {MAX_CORNERS} corners", element=element)
