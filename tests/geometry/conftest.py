"""Random convex pieces, the same ones for MuJoCo and for our functions."""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
import pytest
import scipy.spatial

from ig2mj.scene.tables import PieceKind

VERTICES = 14
PLANES = 24

KINDS = {
    mujoco.mjtGeom.mjGEOM_SPHERE: PieceKind.SPHERE,
    mujoco.mjtGeom.mjGEOM_CAPSULE: PieceKind.CAPSULE,
    mujoco.mjtGeom.mjGEOM_CYLINDER: PieceKind.CYLINDER,
    mujoco.mjtGeom.mjGEOM_BOX: PieceKind.POLYHEDRON,
    mujoco.mjtGeom.mjGEOM_MESH: PieceKind.POLYHEDRON,
}


@dataclasses.dataclass(repr=False)
class Shapes:
    """Some free bodies with one geom each, and the tables that `SceneTables.piece_*` would hold for them."""

    model: mujoco.MjModel
    data: mujoco.MjData
    kind: np.ndarray
    size: np.ndarray
    planes: np.ndarray
    vertices: np.ndarray

    def _repr_pretty_(self, printer, cycle: bool) -> None:
        printer.text(f"{self.count} shapes")  # hypothesis prints arguments of failing examples

    @property
    def count(self) -> int:
        return len(self.kind)

    def scatter(self, rng: np.random.Generator, spread: float) -> tuple[np.ndarray, np.ndarray]:
        """Random poses, set in MuJoCo too; returns world positions [K, 3] and quaternions [K, 4] of the geoms."""
        poses = rng.normal(size=(self.count, 7)) * [*[spread] * 3, 1, 1, 1, 1]
        self.data.qpos[:] = poses.ravel()
        mujoco.mj_normalizeQuat(self.model, self.data.qpos)
        mujoco.mj_kinematics(self.model, self.data)
        quat = np.zeros((self.count, 4))
        for row, mat in zip(quat, self.data.geom_xmat, strict=True):
            mujoco.mju_mat2Quat(row, mat)
        return self.data.geom_xpos.astype(np.float32), quat.astype(np.float32)


def make_shapes(seed: int) -> Shapes:
    """Two of each kind of geom, in random sizes from 2 to 30 cm."""
    rng = np.random.default_rng(seed)
    spec = mujoco.MjSpec()
    for i in range(10):
        shape = list(KINDS)[i % 5]
        body = spec.worldbody.add_body()
        body.add_freejoint()
        if shape == mujoco.mjtGeom.mjGEOM_MESH:
            points = rng.normal(size=(int(rng.integers(6, VERTICES + 1)), 3))
            points *= rng.uniform(0.02, 0.3, 3) / np.linalg.norm(points, axis=1, keepdims=True)
            spec.add_mesh(name=f"hull_{i}", uservert=points.ravel())
            body.add_geom(type=shape, meshname=f"hull_{i}")
        else:
            body.add_geom(type=shape, size=rng.uniform(0.02, 0.3, 3))
    model = spec.compile()
    model.opt.ccd_tolerance, model.opt.ccd_iterations = 1e-9, 200
    rows = [_row(model, geom) for geom in range(model.ngeom)]
    return Shapes(model, mujoco.MjData(model), *(np.array(column) for column in zip(*rows, strict=True)))


def _row(model: mujoco.MjModel, geom: int) -> tuple:
    shape, size = mujoco.mjtGeom(int(model.geom_type[geom])), model.geom_size[geom].astype(np.float32)
    kind = KINDS[shape]
    vertices = np.zeros((VERTICES, 3), np.float32)
    planes = np.tile(np.array([0, 0, 0, 1], np.float32), (PLANES, 1))
    if kind is PieceKind.POLYHEDRON:
        if shape == mujoco.mjtGeom.mjGEOM_MESH:
            mesh = model.geom_dataid[geom]
            points = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]]
        else:
            points = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, 8).T * size
        equations = scipy.spatial.ConvexHull(points).equations
        planes[: len(equations)] = equations * [1, 1, 1, -1]
        vertices[:] = points[0]
        vertices[: len(points)] = points
    return int(kind), size, planes, vertices


@pytest.fixture(scope="session")
def shapes() -> Shapes:
    return make_shapes(7)
