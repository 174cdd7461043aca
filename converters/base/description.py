"""What the readers hand to the builders: plain descriptions of objects and scenes, before any MuJoCo.

Readers (`urdf`, `scene_urdf`, `dataset`, `mesh_files`) fill these; `scaling`, `inertia`, `hulls` and `mjcf` consume
them. Everything is in the source's unscaled units (metres) and in link frames. Poses are 4x4 matrices; quaternions
have been turned from x-y-z-w to w-x-y-z here, at the border.
"""

from __future__ import annotations

import dataclasses
import pathlib
from typing import Any

import numpy as np

from ig2mj.knowledge.overrides import Changes

ROBOT_CATEGORY = "agent"
"""iGibson's category of robots, which are no objects of the household: no synset has it."""

Rgba = tuple[float, float, float, float]


@dataclasses.dataclass(frozen=True)
class PackedImage:
    """An image that lies inside another file (a GLB). name: for messages and file names. content: the image file."""

    name: str
    content: bytes = dataclasses.field(repr=False)


@dataclasses.dataclass
class Mesh:
    """Triangles. vertices [n, 3] float64, faces [m, 3] int; name is the `o`/`g` group's, or ''."""

    vertices: np.ndarray
    faces: np.ndarray
    name: str = ""


@dataclasses.dataclass
class Shape:
    """One `<collision>` or `<visual>`.

    Attributes:
      kind: "mesh", "box", "cylinder", "sphere" or "capsule".
      pose: 4x4, the element's `<origin>` in the link frame.
      size: full edge lengths of a box; (radius, length) of a cylinder or capsule; (radius,) of a sphere.
      meshes: of a mesh: one per `o`/`g` group, in MESH coordinates after unit and axis conversion, before `scale`.
      grouped: the file had groups; each is a convex piece by iGibson's convention.
      scale: the element's mesh scale, per axis.
      file: where the mesh came from. encrypted: it is there but unreadable by design; `meshes` is empty.
      rgba: flat colour, where the source had one. texture: image and uv per vertex, where usable.
      was_primitive: a mesh that an uneven scale made of a primitive.
    """

    kind: str
    pose: np.ndarray = dataclasses.field(default_factory=lambda: np.eye(4))
    size: tuple[float, ...] = ()
    meshes: list[Mesh] = dataclasses.field(default_factory=list)
    grouped: bool = False
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    file: pathlib.Path | None = None
    encrypted: bool = False
    name: str = ""
    rgba: Rgba | None = None
    texture: pathlib.Path | PackedImage | None = None
    uv: list[np.ndarray] | None = None  # per mesh [n, 2]
    was_primitive: bool = False


@dataclasses.dataclass
class Inertial:
    """An URDF `<inertial>`: pose 4x4 in the link frame, mass, inertia 3x3 in that pose's axes."""

    mass: float
    inertia: np.ndarray
    pose: np.ndarray = dataclasses.field(default_factory=lambda: np.eye(4))


@dataclasses.dataclass
class Link:
    """com: centre of mass by iGibson's rule in the link frame; `scaling.scale_model` fills it (see `inertia`)."""

    name: str
    collisions: list[Shape] = dataclasses.field(default_factory=list)
    visuals: list[Shape] = dataclasses.field(default_factory=list)
    inertial: Inertial | None = None
    com: np.ndarray | None = None


@dataclasses.dataclass
class Mimic:
    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclasses.dataclass
class Joint:
    """type: fixed, revolute, prismatic, continuous or floating. `origin` 4x4 of the child in the parent at q = 0."""

    name: str
    type: str
    parent: str
    child: str
    origin: np.ndarray
    axis: np.ndarray
    lower: float | None = None
    upper: float | None = None
    damping: float = 0.0
    friction: float = 0.0
    effort: float | None = None
    velocity: float | None = None
    mimic: Mimic | None = None


@dataclasses.dataclass
class MetaLink:
    """An annotated link of metadata.json, in the base link's frame, unscaled. geometry None: a point; else "box"."""

    name: str
    xyz: np.ndarray
    rpy: np.ndarray = dataclasses.field(default_factory=lambda: np.zeros(3))
    size: np.ndarray | None = None
    geometry: str | None = None


@dataclasses.dataclass
class ObjectPart:
    """One half of a sliceable: base pose in the whole's base frame, unscaled."""

    category: str
    model: str
    pos: np.ndarray
    quat: np.ndarray  # w, x, y, z


@dataclasses.dataclass
class StableOrientation:
    quat: np.ndarray  # w, x, y, z
    prob: float
    size: np.ndarray


@dataclasses.dataclass
class Metadata:
    """misc/metadata.json (iGibson's dataset format). bbox None: no scaling information.

    keep_inertials: an addition of ig2mj: the URDF's inertials are meant, also within a dataset.
    """

    bbox_size: np.ndarray | None = None
    base_link_offset: np.ndarray | None = None
    orientations: list[StableOrientation] = dataclasses.field(default_factory=list)
    links: dict[str, MetaLink] = dataclasses.field(default_factory=dict)
    openable_joints: list[tuple[str, int]] = dataclasses.field(default_factory=list)  # (joint name, direction +-1)
    openable_both_sides: bool = False
    keep_inertials: bool = False
    object_parts: list[ObjectPart] = dataclasses.field(default_factory=list)
    raw: dict[str, Any] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass
class ObjectModel:
    """An object's URDF, parsed and checked: a tree of links (a forest once floating joints are cut).

    title: the name that the URDF gives itself, or ''.
    abilities: changes of what its category can do (`ig2mj.knowledge.overrides`), of a file of annotations.
    """

    category: str
    model: str
    file: pathlib.Path
    links: dict[str, Link]
    joints: dict[str, Joint]
    base: str
    metadata: Metadata = dataclasses.field(default_factory=Metadata)
    warnings: list[str] = dataclasses.field(default_factory=list)
    title: str = ""
    abilities: Changes = dataclasses.field(default_factory=dict)


@dataclasses.dataclass
class Instance:
    """One `<link>` of a scene URDF with its joint (iGibson's dataset format).

    pose: 4x4, of the bounding-box centre (of the base link where the model has no bounding box).
    Exactly one of bounding_box and scale is set, or neither (scale 1).
    kind: "object", "building" (walls, floors, ceilings), "multiplexer", "grouper", "agent", "agent_pose".
    """

    name: str
    category: str
    model: str
    pose: np.ndarray
    fixed: bool
    kind: str = "object"
    random_group: str | None = None
    bounding_box: np.ndarray | None = None
    scale: np.ndarray | None = None
    rooms: list[str] = dataclasses.field(default_factory=list)
    object_scope: str | None = None
    base_poses: list | None = None
    base_velocities: list | None = None
    joint_states: dict[str, tuple[float, float]] | None = None
    states: dict[str, Any] | None = None
    multiplexer: str | None = None  # on a whole or a grouper: its multiplexer
    grouper: str | None = None  # on a half: its grouper
    current_index: int = 0  # of a multiplexer: 0 whole, 1 sliced
    pose_offsets: list | None = None  # of a grouper: per part (pos, quat wxyz)
    attributes: dict[str, str] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass
class RoomMaps:
    """layout/*.png, read (iGibson's dataset format). Row is y, column is x, row 0 is the lowest y."""

    room_map: np.ndarray  # [n, n] int16 at `resolution`: index + 1 into `names`, 0 none
    names: list[str]
    types: list[str]
    resolution: float
    traversable: np.ndarray | None = None  # [n, n] bool at `trav_resolution`, floor_trav_0
    traversable_no_obj: np.ndarray | None = None
    trav_resolution: float = 0.1


@dataclasses.dataclass
class SceneDescription:
    name: str
    file: pathlib.Path
    instances: list[Instance]
    rooms: RoomMaps | None = None
    overlaps_allowed: set[frozenset[str]] = dataclasses.field(default_factory=set)  # misc/bbox_overlap.json
    warnings: list[str] = dataclasses.field(default_factory=list)
