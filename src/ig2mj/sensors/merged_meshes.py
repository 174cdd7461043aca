"""The meshes of rigid parts of a scene merged: one mesh for all that never moves, one for each part that does.

MJX-Warp's ray caster has a tree of boxes for each world, with a box for each geom, and a tree of triangles for each
mesh asset. A ray that looks across a room enters the boxes of walls, floor, ceiling and most furniture, and looks for a
triangle in each, in no particular order. Merged meshes have one tree for all of them, which all worlds share.

Axes: V vertices, F triangles, G geoms, B bodies of the scene, N boxes.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from ig2mj.looks.visual import COSTUMES, OUTSIDE
from ig2mj.scene.rooms import Rooms
from ig2mj.sensors.indoors import indoor_boxes

MESH = int(mujoco.mjtGeom.mjGEOM_MESH)

HIDDEN = 31
"""Group of geoms that have no box of their own; no scene has so many groups."""


def mergeable(host: mujoco.MjModel) -> bool:
    """Whether our rays (`ig2mj.sensors.ray_caster`) see all that a render model can show: they know no flexes and no
    height fields."""
    return host.nflex == 0 and not (host.geom_type == mujoco.mjtGeom.mjGEOM_HFIELD).any()


@dataclasses.dataclass(frozen=True)
class RigidPart:
    """Meshes that move as one.

    Attributes:
      geom: in whose frame the vertices are; -1 for what never moves and for the garden, whose vertices are in the world
        frame.
      geoms: whose triangles these are, one geom's after the other's.
      vertices: metres. faces: vertices of triangles. face_geom: whose each is.
    """

    geom: int
    geoms: tuple[int, ...]
    vertices: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]
    face_geom: Int[np.ndarray, "F"]


def rigid_parts(
    host: mujoco.MjModel,
    scene: mujoco.MjModel,
    groups: Sequence[int],
    covered: Mapping[int, Bool[np.ndarray, "F"]] = MappingProxyType({}),
) -> list[RigidPart]:
    """The parts of a render model: what never moves, what does, the garden; each where there is one, in this order.

    Meshes that are invisible (alpha 0) in the compiled scene are in no part.

    Args:
      host: the render model, which has no joints. scene: the model that it was made from, with the same bodies first.
      groups: of geoms that are seen. covered: by geom, which triangles are never seen.
    """
    data = mujoco.MjData(host)
    mujoco.mj_forward(host, data)
    seen = np.isin(host.geom_group, list(groups)) & (host.geom_type == MESH) & (alpha(host) > 0)
    around = host.nbody + host.ngeom
    by_body: dict[int, list[int]] = {}
    for geom in np.flatnonzero(seen):
        if geom >= scene.ngeom and host.body(host.geom_bodyid[geom]).name == COSTUMES:
            by_body[host.nbody + int(geom)] = [int(geom)]  # moves by itself
            continue
        if geom >= scene.ngeom and host.geom(geom).name.startswith(f"ig2mj/{OUTSIDE}"):
            by_body.setdefault(around, []).append(int(geom))  # few rays leave the house: a tree of its own
            continue
        body = int(scene.geom_bodyid[geom]) if geom < scene.ngeom else 0  # what else looks add stands still
        welded = int(scene.body_weldid[body])
        mocap = int(scene.body_mocapid[scene.body_rootid[body]]) >= 0
        by_body.setdefault(welded if welded or not mocap else body, []).append(int(geom))
    return [_part(host, data, geoms, covered, 0 < body < around) for body, geoms in sorted(by_body.items())]


def robot_geoms(host: mujoco.MjModel, body_agent: Int[np.ndarray, "B"]) -> Bool[np.ndarray, "G"]:
    """Geoms of a render model that move with a robot: its own, and what it wears.

    Args:
      body_agent: of the bodies of the scene, which are the first of the render model: the robot that each is of, or -1.
    """
    of_bodies = np.zeros(host.nbody, bool)
    of_bodies[: len(body_agent)] = body_agent >= 0
    of_bodies |= np.array([host.body(body).name == COSTUMES for body in range(host.nbody)])
    return of_bodies[host.geom_bodyid]


def alpha(model: mujoco.MjModel) -> Float[np.ndarray, "G"]:
    """Opacity of geoms: their material's where they have no colour of their own."""
    found = np.array(model.geom_rgba[:, 3], np.float32)
    plain = (model.geom_matid >= 0) & (model.geom_rgba == np.array([0.5, 0.5, 0.5, 1.0], np.float32)).all(axis=1)
    found[plain] = model.mat_rgba[model.geom_matid[plain], 3]
    return found


def _part(
    host: mujoco.MjModel,
    data: mujoco.MjData,
    geoms: list[int],
    covered: Mapping[int, Bool[np.ndarray, "F"]],
    moves: bool,
) -> RigidPart:
    vertices, faces, owners, count = [], [], [], 0
    for geom in geoms:
        mesh = int(host.geom_dataid[geom])
        points = slice(host.mesh_vertadr[mesh], host.mesh_vertadr[mesh] + host.mesh_vertnum[mesh])
        corners = slice(host.mesh_faceadr[mesh], host.mesh_faceadr[mesh] + host.mesh_facenum[mesh])
        in_world = host.mesh_vert[points] @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        vertices.append(in_world)
        own = host.mesh_face[corners]
        if geom in covered:  # a triangle without area keeps the numbers of the others
            own = np.where(covered[geom][:, None], own[:, :1], own)
        faces.append(own + count)
        owners.append(np.full(len(faces[-1]), geom))
        count += len(in_world)
    # The box around a mesh is centred on its frame: the geom is taken in whose frame it is smallest.
    frames: list[np.ndarray] = [np.concatenate(vertices)]
    if moves:
        turned = data.geom_xmat.reshape(-1, 3, 3)
        frames = [(frames[0] - data.geom_xpos[geom]) @ turned[geom] for geom in geoms]
    best = int(np.argmin([np.prod(np.abs(frame).max(axis=0)) for frame in frames]))
    return RigidPart(
        geom=geoms[best] if moves else -1,
        geoms=tuple(geoms),
        vertices=frames[best].astype(np.float32),
        faces=np.concatenate(faces).astype(np.int32),
        face_geom=np.concatenate(owners).astype(np.int32),
    )


@dataclasses.dataclass(frozen=True)
class Tables:
    """How a triangle of a merged mesh is found in its geom's own.

    Attributes:
      parts: whose meshes are numbered behind those of the model, in this order.
      data_id: of geoms: the merged mesh of those that stand for a part, else as in the model.
      face_geom: geoms of the triangles of all parts. part_face: each part's first triangle among them.
      geom_face: each geom's first triangle in its part. geom_mesh: its own mesh.
      indoors: low and high corners of boxes that nothing of the garden is in, m.
    """

    parts: tuple[RigidPart, ...]
    data_id: Int[np.ndarray, "G"]
    face_geom: Int[np.ndarray, "F"]
    part_face: Int[np.ndarray, "P"]
    geom_face: Int[np.ndarray, "G"]
    geom_mesh: Int[np.ndarray, "G"]
    indoors: Float[np.ndarray, "N 2 3"]

    @property
    def still(self) -> bool:
        """The first part is what never moves."""
        return bool(self.parts) and self.parts[0].geom < 0

    @property
    def garden(self) -> bool:
        """The last part, and not the first, is what is around the home."""
        return len(self.parts) > 1 and self.parts[-1].geom < 0

    @property
    def absorbed(self) -> Int[np.ndarray, "n"]:
        """Geoms that need no box of their own."""
        return np.array([g for part in self.parts for g in part.geoms if g != part.geom], int)


def tables_of(host: mujoco.MjModel, parts: Sequence[RigidPart], rooms: Rooms | None = None) -> Tables:
    """Tables of these parts of a render model; rooms: of the home."""
    data_id, first = np.array(host.geom_dataid, np.int32), np.zeros(host.ngeom, np.int32)
    sizes = [len(part.faces) for part in parts]
    for number, part in enumerate(parts):
        if part.geom >= 0:
            data_id[part.geom] = host.nmesh + number
        for geom in part.geoms:
            first[geom] = np.argmax(part.face_geom == geom)
    tables = Tables(
        parts=tuple(parts),
        data_id=data_id,
        face_geom=np.concatenate([part.face_geom for part in parts]) if parts else np.zeros(0, np.int32),
        part_face=(np.cumsum(sizes) - sizes).astype(np.int32),
        geom_face=first,
        geom_mesh=np.array(host.geom_dataid, np.int32),
        indoors=np.zeros((0, 2, 3)),
    )
    if rooms is None or not (tables.still and tables.garden):
        return tables
    around = parts[-1].vertices[parts[-1].faces]
    return dataclasses.replace(tables, indoors=indoor_boxes(rooms, parts[0].vertices, around))
