"""Rays against merged meshes (`ig2mj.sensors.merged_meshes`), in MJX-Warp's ray caster.

Only the function that finds what a ray hits is ours; the kernel around it is upstream's but for its light
(`ig2mj.sensors.shading`). A ray is first tested against what never moves, in one tree that all worlds share, then, up
to that distance, against what moves, and then against the garden, unless it begins and ends indoors
(`ig2mj.sensors.indoors`): upstream tests all geoms in the order of one tree. Trees of merged meshes are ours
(`ig2mj.sensors.triangle_trees`). Hits are the same up to rounding, but for surfaces in the same place: there upstream
shows the geom with the larger number, and within a merged mesh either is shown.
"""

# Warp's kernels only look like Python, so that type checkers must leave them alone:
# pyright: reportIndexIssue=false, reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportAssignmentType=false, reportReturnType=false, reportOperatorIssue=false
# pyright: reportPrivateUsage=false
# ruff: noqa: SIM102, UP018, RUF046 (of two conditions the first is one of the compiler's; variables, not constants)

import types
from collections.abc import Sequence
from typing import Any, no_type_check

import mujoco
import numpy as np
import warp as wp
from jaxtyping import Bool
from mujoco.mjx.third_party.mujoco_warp._src import bvh, ray

from ig2mj.sensors.merged_meshes import MESH, Tables
from ig2mj.sensors.render_model import NEAR
from ig2mj.sensors.shading import limit_light
from ig2mj.sensors.triangle_rays import Hit, first_triangle
from ig2mj.sensors.triangle_trees import trees_of

PLANE, HFIELD, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX = range(7)
"""Geom types, as in `mujoco.mjtGeom`."""

ELSEWHERE = (0.0, 0.0, 100.0)
"""Metres by which robots are moved while the tree of boxes is made: far from all else."""


def use_merged(
    contexts: Sequence[Any],
    host: mujoco.MjModel,
    tables: Tables,
    nworld: int,
    robots: Bool[np.ndarray, "G"],
    pictures: int,
    changes: Sequence[tuple[str, str]] = (),
) -> None:
    """Lets render contexts cast rays against merged meshes.

    Args:
      contexts: of MuJoCo Warp, of cameras of the render model, made with `tables.absorbed` in no group that is seen.
      robots: geoms that move through the home together. The tree of boxes keeps the shape that it has when it is made,
        so that they have a branch of their own. Their surfaces are not there when seen from behind or from nearer than
        `NEAR` in pictures, as in OpenGL: a camera that is drawn a little further back than the robot's sees through its
        head.
      pictures: cameras that make pictures, the first ones; the others' rays meet every surface of robots.
      changes: of the kernel (`limit_light`).
    """
    assert host.nflex == 0, "flexes' arrays carry the tables"
    for context in contexts:
        shown = context.enabled_geom_ids.numpy()
        known = tables.data_id[shown] >= host.nmesh
        assert known[host.geom_type[shown] == MESH].all(), "the kernel has no code for other meshes"

    def make_cast_ray(geom_ray_types: tuple[int, ...], first_hit: bool = False) -> wp.Function:
        return _cast_ray(geom_ray_types, first_hit, host.ngeom, host.nmesh, tables, bool(robots.any()))

    data = mujoco.MjData(host)
    mujoco.mj_forward(host, data)
    data.geom_xpos[robots] += ELSEWHERE
    known = {name: getattr(host, name) for name in dir(host) if name.startswith(("geom_", "flex_"))}
    trees = trees_of([part.vertices[part.faces] for part in tables.parts])
    as_merged = types.SimpleNamespace(**{**known, "geom_dataid": tables.data_id, "ngeom": host.ngeom})
    for context in contexts:
        with wp.ScopedDevice(context.mesh_bvh_id.device):
            rows = [wp.array(tree, dtype=wp.vec4) for tree in trees]
            half = [np.abs(part.vertices).max(axis=0) for part in tables.parts]
            context.mesh_registry |= {tree.ptr: tree for tree in rows}  # kept as long as their addresses
            own = context.mesh_bvh_id.numpy()[: host.nmesh]
            ids = np.concatenate([own, np.array([tree.ptr for tree in rows], np.uint64)])
            context.mesh_bvh_id = wp.array(ids, dtype=wp.uint64)
            sizes = np.concatenate([context.mesh_bounds_size.numpy()[: host.nmesh].reshape(-1, 3), half])
            context.mesh_bounds_size = wp.array(sizes.astype(np.float32), dtype=wp.vec3)
            context.flex_geom_flexid = wp.array(tables.face_geom, dtype=int)
            numbers = np.concatenate([tables.geom_face, tables.geom_mesh, tables.part_face, robots])
            context.flex_geom_edgeid = wp.array(numbers.astype(np.int32), dtype=int)
            context.geom_ray_types = tuple(sorted({*context.geom_ray_types, MESH}))
            bvh.build_scene_bvh(as_merged, data, context, nworld)
            limit_light(context, host.nlight, make_cast_ray, [*changes, _marked(pictures)])


_FAR = '      max_cam_dist,\n      wp.static(rc_static["enable_backface_culling"]),\n'


def _marked(pictures: int) -> tuple[str, str]:
    """The change of the kernel by which rays of other cameras than those of pictures have a negative reach."""
    return _FAR, _FAR.replace("max_cam_dist", f"wp.where(camid < {pictures}, max_cam_dist, -max_cam_dist)")


@wp.func
@no_type_check
def _surface(
    met: Hit, first: int, face_geom: wp.array[int], tables: wp.array[int], ngeom: int
) -> tuple[int, float, wp.vec3, float, float, int, int]:
    """What a ray has met, as upstream's kernel takes it; the normal in the mesh's frame.

    Args:
      first: of the mesh's faces, among those of all parts.
    """
    geom = face_geom[first + int(met[3])]
    normal = wp.vec3(met[4], met[5], met[6])
    return geom, met[0], normal, met[1], met[2], int(met[3]) - tables[geom], tables[ngeom + geom]


@no_type_check
def _cast_ray(
    kinds: tuple[int, ...], first_hit: bool, ngeom: int, nmesh: int, known: Tables, robots: bool
) -> wp.Function:
    """The function for the kinds of geoms that have boxes. With `first_hit` any hit nearer than `max_dist` will do.
    `robots`: there are some.

    Upstream's arguments are kept; two arrays of flexes, of which there are none, hold the tables of merged meshes, and
    `max_dist` is negative for rays that are of no picture (`_marked`).
    """

    still, garden = known.still, known.garden
    last = nmesh + len(known.parts) - 1
    last_face = int(known.part_face[-1])
    of_robots = 2 * ngeom + len(known.part_face)
    boxes = len(known.indoors)
    corners = wp.types.vector(length=max(6 * boxes, 1), dtype=float)(*(known.indoors.ravel() if boxes else (0.0,)))
    primitives = any(kind in kinds for kind in (PLANE, SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX))

    @wp.func
    def cast_ray(
        geom_type: wp.array[int],
        geom_dataid: wp.array2d[int],
        geom_matid: wp.array2d[int],
        geom_size: wp.array2d[wp.vec3],
        geom_rgba: wp.array2d[wp.vec4],
        flex_vertadr: wp.array[int],
        flex_edge: wp.array[wp.vec2i],
        flex_radius: wp.array[float],
        mat_rgba: wp.array2d[wp.vec4],
        geom_xpos_in: wp.array2d[wp.vec3],
        geom_xmat_in: wp.array2d[wp.mat33],
        flexvert_xpos_in: wp.array2d[wp.vec3],
        bvh_id: wp.uint64,
        group_root: int,
        worldid: int,
        bvh_ngeom: int,
        flex_bvh_ngeom: int,
        enabled_geom_ids: wp.array[int],
        mesh_bvh_id: wp.array[wp.uint64],
        hfield_bvh_id: wp.array[wp.uint64],
        flex_rgba: wp.array[wp.vec4],
        face_geom: wp.array[int],
        tables: wp.array[int],
        flex_bvh_id: wp.array[wp.uint64],
        flex_group_root: wp.array2d[int],
        origin: wp.vec3,
        direction: wp.vec3,
        max_dist: float,
        cull_backfaces: bool,
    ) -> tuple[int, float, wp.vec3, float, float, int, int]:
        dist = wp.abs(max_dist)
        pictured = max_dist > 0.0
        normal = wp.vec3(0.0, 0.0, 0.0)
        geom_id = int(-1)
        bary_u = float(0.0)
        bary_v = float(0.0)
        face = int(-1)
        mesh_id = int(-1)
        if wp.static(still):
            met = first_triangle(mesh_bvh_id[wp.static(nmesh)], origin, direction, dist, cull_backfaces)
            if met[0] >= 0.0:
                geom_id, dist, normal, bary_u, bary_v, face, mesh_id = _surface(met, 0, face_geom, tables, ngeom)
                if wp.static(first_hit):
                    return geom_id, dist, normal, bary_u, bary_v, face, mesh_id

        query = wp.bvh_query_ray(bvh_id, origin, direction, group_root)
        box = int(0)
        while wp.bvh_query_next(query, box, dist * (1.0 + wp.static(ray.RAY_TOL_REL)) + wp.static(ray.RAY_TOL_ABS)):
            reach = dist * (1.0 + wp.static(ray.RAY_TOL_REL)) + wp.static(ray.RAY_TOL_ABS)
            geom = enabled_geom_ids[box - worldid * bvh_ngeom]
            kind = geom_type[geom]
            pos = geom_xpos_in[worldid, geom]
            mat = geom_xmat_in[worldid, geom]
            d = float(-1.0)
            n = wp.vec3(0.0, 0.0, 0.0)
            u = float(0.0)
            v = float(0.0)
            f = int(-1)
            merged = int(-1)
            behind = cull_backfaces
            skipped = float(0.0)
            if wp.static(robots and not first_hit):
                if pictured and tables[wp.static(of_robots) + geom] != 0:
                    behind = True
                    skipped = wp.static(NEAR)
            start = origin + skipped * direction
            if wp.static(MESH in kinds):
                if kind == wp.static(MESH):
                    which = geom_dataid[worldid % geom_dataid.shape[0], geom]
                    inverse = wp.transpose(mat)
                    met = first_triangle(
                        mesh_bvh_id[which], inverse @ (start - pos), inverse @ direction, reach, behind
                    )
                    if met[0] >= 0.0:
                        first = tables[wp.static(2 * ngeom - nmesh) + which]
                        geom, d, n, u, v, f, merged = _surface(met, first, face_geom, tables, ngeom)
                        n = mat @ n
            if wp.static(primitives):
                if kind != wp.static(MESH):
                    size = geom_size[worldid % geom_size.shape[0], geom]
                    if wp.static(PLANE in kinds):
                        if kind == wp.static(PLANE):
                            d, n = ray.ray_plane(pos, mat, size, start, direction)
                    if wp.static(SPHERE in kinds):
                        if kind == wp.static(SPHERE):
                            d, n = ray.ray_sphere(pos, size[0] * size[0], start, direction)
                    if wp.static(CAPSULE in kinds):
                        if kind == wp.static(CAPSULE):
                            d, n = ray.ray_capsule(pos, mat, size, start, direction)
                    if wp.static(ELLIPSOID in kinds):
                        if kind == wp.static(ELLIPSOID):
                            d, n = ray.ray_ellipsoid(pos, mat, size, start, direction)
                    if wp.static(CYLINDER in kinds):
                        if kind == wp.static(CYLINDER):
                            d, n = ray.ray_cylinder(pos, mat, size, start, direction)
                    if wp.static(BOX in kinds):
                        if kind == wp.static(BOX):
                            d, _sides, n = ray.ray_box(pos, mat, size, start, direction)
            if behind and d >= 0.0 and wp.dot(direction, n) > 0.0:
                d = -1.0
            if d >= 0.0:
                d = d + skipped
            if wp.static(first_hit):
                if d >= 0.0 and d < dist:
                    return geom, d, n, u, v, f, merged
            else:
                # Where two are as near, the geom with the larger number is shown, as in MuJoCo's OpenGL.
                same = wp.static(ray.RAY_TOL_REL) * wp.max(dist, 1.0)
                nearer = (d < dist - same) or (wp.abs(d - dist) <= same and (geom_id < 0 or geom > geom_id))
                if d >= 0.0 and nearer:
                    dist = d
                    normal = n
                    geom_id = geom
                    bary_u = u
                    bary_v = v
                    face = f
                    mesh_id = merged
        if wp.static(garden):
            indoors = bool(False)
            if wp.static(boxes > 0):
                end = origin + dist * direction
                rooms = wp.static(corners)
                for k in range(wp.static(boxes)):
                    low = wp.vec3(rooms[6 * k], rooms[6 * k + 1], rooms[6 * k + 2])
                    high = wp.vec3(rooms[6 * k + 3], rooms[6 * k + 4], rooms[6 * k + 5])
                    both = wp.min(origin, end) - low
                    far = high - wp.max(origin, end)
                    if wp.min(both) > 0.0 and wp.min(far) > 0.0:
                        indoors = True
            if not indoors:
                met = first_triangle(mesh_bvh_id[wp.static(last)], origin, direction, dist, cull_backfaces)
                if met[0] >= 0.0:
                    geom_id, dist, normal, bary_u, bary_v, face, mesh_id = _surface(
                        met, last_face, face_geom, tables, ngeom
                    )
        return geom_id, dist, normal, bary_u, bary_v, face, mesh_id

    return cast_ray
