"""Contacts of MuJoCo Warp are checked against their geoms: strays are dropped, slanted normals on faces corrected.

Its convex collision works in single precision. Where a small object rests on a wide box by a hundredth of a millimetre,
as everything does on a floor, it has two faults:

- Rarely a contact lies metres away from the object. Such a lever makes the solver's matrix singular, and the world
  is lost (not finite) or the object flies off. A contact belongs within the bounding boxes of both geoms; one that
  lies outside by more than its own depth is dropped, and the pair's next step gives a sound one.
- In up to one of twenty steps (floor of 12 m, object nearly flat) a normal is not the floor's. Where a shallow
  contact lies on a box's face, further from its edges than it is deep, the shortest way out is across that face: the
  normal is set to the face's.
"""

# Warp's kernels only look like Python, so that type checkers must leave them alone:
# pyright: reportIndexIssue=false, reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false
# pyright: reportGeneralTypeIssues=false, reportOperatorIssue=false

from typing import Any, no_type_check

import mujoco
import warp as wp

from ig2mj.engine.contact_filter import DROPPED_DISTANCE

TOLERANCE = 0.002
"""Metres that a contact may lie outside a geom's bounding box, in addition to half its distance."""

SHALLOW, ON_FACE, FROM_EDGE = 0.001, 0.002, 0.005
"""Metres: normals are looked at where a contact is less deep (or less far) than the first, lies closer to a face of a
box than the second, and further from its edges than the third."""

UPRIGHT = 0.999
"""Cosine between a contact's normal and the face's above which the normal is kept."""

PLANE, HEIGHT_FIELD = int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD)
BOX = int(mujoco.mjtGeom.mjGEOM_BOX)


@wp.func
@no_type_check
def _outside(local: wp.vec3, center: wp.vec3, half: wp.vec3, slack: float) -> bool:
    away = wp.vec3(wp.abs(local[0] - center[0]), wp.abs(local[1] - center[1]), wp.abs(local[2] - center[2])) - half
    return wp.max(away) > slack


@wp.func
@no_type_check
def _face(local: wp.vec3, half: wp.vec3) -> wp.vec3:
    """Outward normal, in a box's frame, of the face that a point lies on away from the edges; zero if there is none."""
    gap = wp.vec3(half[0] - wp.abs(local[0]), half[1] - wp.abs(local[1]), half[2] - wp.abs(local[2]))
    normal = wp.vec3(0.0, 0.0, 0.0)
    for axis in range(3):
        inward = wp.min(gap[(axis + 1) % 3], gap[(axis + 2) % 3])
        if wp.abs(gap[axis]) < wp.static(ON_FACE) and inward > wp.static(FROM_EDGE):
            normal[axis] = wp.sign(local[axis])
    return normal


@wp.kernel(enable_backward=False)
@no_type_check
def _mend(
    geom_type: wp.array[int],
    geom_size: wp.array2d[wp.vec3],
    geom_aabb: wp.array3d[wp.vec3],
    geom_xpos: wp.array2d[wp.vec3],
    geom_xmat: wp.array2d[wp.mat33],
    count: wp.array[int],
    geom: wp.array[wp.vec2i],
    pos: wp.array[wp.vec3],
    worldid: wp.array[int],
    stride: int,
    dist: wp.array[float],
    frame: wp.array[wp.mat33],
):
    first = wp.tid()
    for contact in range(first, wp.min(count[0], dist.shape[0]), stride):
        world = worldid[contact]
        stray = bool(False)  # noqa: UP018 (a variable of the kernel, not a constant)
        normal = frame[contact][0]
        face = wp.vec3(0.0, 0.0, 0.0)
        for side in range(2):
            g = geom[contact][side]
            if g >= 0 and geom_type[g] != wp.static(PLANE) and geom_type[g] != wp.static(HEIGHT_FIELD):
                local = wp.transpose(geom_xmat[world, g]) * (pos[contact] - geom_xpos[world, g])
                box = world % geom_aabb.shape[0]
                slack = wp.static(TOLERANCE) + 0.5 * wp.abs(dist[contact])
                outside = _outside(local, geom_aabb[box, g, 0], geom_aabb[box, g, 1], slack)
                if outside or not wp.isfinite(wp.length(local)):
                    stray = True
                elif geom_type[g] == wp.static(BOX) and wp.abs(dist[contact]) < wp.static(SHALLOW):
                    found = geom_xmat[world, g] * _face(local, geom_size[world % geom_size.shape[0], g])
                    if wp.length(found) > 0.5:
                        face = found * (1.0 - 2.0 * float(side))  # normals point from the first geom to the second
        if stray:
            dist[contact] = wp.static(DROPPED_DISTANCE)
        elif wp.length(face) > 0.5 and wp.dot(face, normal) < wp.static(UPRIGHT):
            other = wp.vec3(1.0, 0.0, 0.0)
            if wp.abs(face[0]) > 0.5:
                other = wp.vec3(0.0, 1.0, 0.0)
            tangent = wp.normalize(other - wp.dot(other, face) * face)
            frame[contact] = wp.matrix_from_rows(face, tangent, wp.cross(face, tangent))


def mend_contacts(m: Any, d: Any) -> None:
    """Marks stray contacts of all worlds as far apart, and sets slanted normals on faces upright.

    Args:
      m, d: of MuJoCo Warp, after collision detection.
    """
    contact = d.contact
    threads = max(1, min(d.naconmax, 1 << 17))
    wp.launch(
        _mend,
        dim=threads,
        inputs=[
            m.geom_type,
            m.geom_size,
            m.geom_aabb,
            d.geom_xpos,
            d.geom_xmat,
            d.nacon,
            contact.geom,
            contact.pos,
            contact.worldid,
            threads,
        ],
        outputs=[contact.dist, contact.frame],
    )
