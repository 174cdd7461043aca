"""GJK in a quarter of the code: upstream's functions with the triangle's case once instead of ten times.

Warp writes all functions of a kernel into one, and each place that calls a function gets a copy. MuJoCo Warp's GJK
holds the closest point of a triangle five times, and is itself called twice (for shapes without their margins or radii
and, where those are in each other, for whole ones). All threads of a processor share a small cache for code. Here both
are loops around one call; the arithmetic is the same.
"""

# Warp's kernels only look like Python, so that type checkers must leave them alone:
# pyright: reportIndexIssue=false, reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportOperatorIssue=false, reportReturnType=false, reportPrivateUsage=false

from __future__ import annotations

import inspect
import textwrap
from typing import Any, no_type_check

import warp as wp
from mujoco.mjx.third_party.mujoco_warp._src import collision_gjk
from mujoco.mjx.third_party.mujoco_warp._src.collision_core import Geom
from mujoco.mjx.third_party.mujoco_warp._src.collision_gjk import (
    _S1D,
    _S2D,
    FLOAT_MAX,
    GJKResult,
    _det3,
    _discrete_geoms,
    _inflate,
    _same_sign,
    _supports_multiccd,
)
from mujoco.mjx.third_party.mujoco_warp._src.types import GeomType, mat43

from ig2mj.engine.warp.patches.sources import defined

SPHERE, CAPSULE = int(GeomType.SPHERE), int(GeomType.CAPSULE)


@wp.func
@no_type_check
def closest_of_simplex(n: int, simplex: mat43) -> wp.vec4:
    """In place of `_subdistance`: barycentric coordinates of the point nearest to the origin."""
    if n == 1:
        return wp.vec4(1.0, 0.0, 0.0, 0.0)
    if n == 2:
        line = _S1D(simplex[0], simplex[1])
        return wp.vec4(line[0], line[1], 0.0, 0.0)
    beyond = wp.vec4i(0, 0, 0, 0)  # which faces of a tetrahedron the origin does not lie inside of
    face = wp.int32(3)
    if n == 4:
        minors = wp.vec4(
            -_det3(simplex[1], simplex[2], simplex[3]),
            _det3(simplex[0], simplex[2], simplex[3]),
            -_det3(simplex[0], simplex[1], simplex[3]),
            _det3(simplex[0], simplex[1], simplex[2]),
        )
        volume = minors[0] + minors[1] + minors[2] + minors[3]
        for k in range(4):
            beyond[k] = _same_sign(volume, minors[k])
        if beyond[0] and beyond[1] and beyond[2] and beyond[3]:
            return wp.vec4(minors[0] / volume, minors[1] / volume, minors[2] / volume, minors[3] / volume)
        face = wp.int32(0)
    result = wp.vec4(0.0, 0.0, 0.0, 0.0)
    least = wp.float32(FLOAT_MAX)
    while face < 4:  # the face without this vertex
        if n == 3 or beyond[face] == 0:
            a = simplex[1] if face == 0 else simplex[0]
            b = simplex[2] if face <= 1 else simplex[1]
            c = simplex[3] if face <= 2 else simplex[2]
            found = _S2D(a, b, c)
            x = found[0] * a + found[1] * b + found[2] * c
            distance = wp.dot(x, x)
            if face == 0 or n == 3 or distance < least:
                least = distance
                result[0] = 0.0 if face == 0 else found[0]
                result[1] = found[0] if face == 0 else (0.0 if face == 1 else found[1])
                result[2] = found[1] if face <= 1 else (0.0 if face == 2 else found[2])
                result[3] = found[2] if face <= 2 else 0.0
        face += 1
    return result


def _rebuilt(function: wp.Function, **names: Any) -> wp.Function:
    """A function of MuJoCo Warp's that calls others by these names."""
    upstream: Any = function.func
    text = textwrap.dedent(inspect.getsource(upstream)).split("\n", 1)[1]  # without its decorator
    return wp.func(defined(upstream.__name__, text, {**upstream.__globals__, **names, "__name__": __name__}))


small_gjk = _rebuilt(collision_gjk.gjk, _subdistance=closest_of_simplex)


@wp.func
@no_type_check
def _radius(geom: Geom, kind: int, margin: bool) -> float:
    """How much GJK's first attempt takes off a geom all around."""
    if kind == wp.static(SPHERE) or kind == wp.static(CAPSULE):
        return geom.size[0] + 0.5 * geom.margin
    if margin:
        return 0.5 * geom.margin
    return 0.0


@wp.func
@no_type_check
def _without(geom: Geom, kind: int, margin: bool) -> Geom:
    """A geom without that."""
    if kind == wp.static(SPHERE) or kind == wp.static(CAPSULE):
        geom.margin = 0.0
        geom.size = wp.vec3(0.0, geom.size[1], geom.size[2])
    elif margin:
        geom.margin = 0.0
    return geom


@wp.func
@no_type_check
def distance_phase(
    tolerance: float,
    cutoff: float,
    gjk_iterations: int,
    geom1: Geom,
    geom2: Geom,
    geomtype1: int,
    geomtype2: int,
    x_1: wp.vec3,
    x_2: wp.vec3,
):
    """In place of `gjk_phase`."""
    empty = GJKResult()
    margin1 = geom1.margin
    margin2 = geom2.margin
    size1 = geom1.size
    size2 = geom2.size
    faces = _supports_multiccd(geom1, geom2, geomtype1, geomtype2) and (margin1 > 0.0 or margin2 > 0.0)
    off1 = _radius(geom1, geomtype1, faces)
    off2 = _radius(geom2, geomtype2, faces)
    off = off1 + off2
    bare = off > 0.0
    if bare:
        cutoff += off
        geom1 = _without(geom1, geomtype1, faces)
        geom2 = _without(geom2, geomtype2, faces)
    again = wp.int32(1)
    result = GJKResult()
    while again > 0:
        again = wp.int32(0)
        discrete = _discrete_geoms(geomtype1, geomtype2) and (geom1.margin == 0.0 and geom2.margin == 0.0)
        result = small_gjk(tolerance, gjk_iterations, geom1, geom2, x_1, x_2, geomtype1, geomtype2, cutoff, discrete)
        geom1.index = result.index1
        geom2.index = result.index2
        geom1.margin = margin1
        geom1.size = size1
        geom2.margin = margin2
        geom2.size = size2
        if bare and result.dist <= tolerance:  # they are in each other: once more with whole shapes
            bare = False
            cutoff -= off
            again = wp.int32(1)
    if bare:
        if result.dist == FLOAT_MAX:
            return False, result.dist, 1, result.x1, result.x2, empty, geom1, geom2
        dist, x1, x2 = _inflate(result, geom1, geom2, geomtype1, geomtype2, off1, off2)
        return False, dist, 1, x1, x2, result, geom1, geom2
    if result.dist > tolerance or result.dim < 2 or result.separated:
        return False, result.dist, 1, result.x1, result.x2, empty, geom1, geom2
    return True, result.dist, 1, result.x1, result.x2, result, geom1, geom2
