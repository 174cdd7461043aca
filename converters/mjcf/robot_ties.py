"""Equalities of an MJCF robot, written for its links: joints that follow others, connections and welds."""

from __future__ import annotations

import mujoco
import numpy as np

from ..bodies.mjcf_robot import MjcfRobot, pose_of

EQUALITY, OBJECT = mujoco.mjtEq, mujoco.mjtObj

TORQUE_SCALE = 10
"""Index of a weld's torque scale in its data, after anchor, position and quaternion."""


def add_ties(robot: MjcfRobot, name: str, bodies: dict[str, mujoco.MjsBody], spec: mujoco.MjSpec) -> None:
    """Adds what ties the parts of a robot to each other.

    What ties it to something else is left out with a warning, and so are equalities of tendons of more than two joints:
    MuJoCo has none between bodies that may sleep.

    Args:
      name: of the robot. bodies: of its links, in `spec`, whose joints are added already.
    """
    for follower in robot.followers:
        one, two = (f"{name}_{robot.joint_name(j)}" for j in (follower.joint, follower.leader))
        equality = spec.add_equality(type=EQUALITY.mjEQ_JOINT, objtype=OBJECT.mjOBJ_JOINT, name1=one, name2=two)
        equality.data[:5] = follower.coefficients
    for eq in np.flatnonzero(robot.model.eq_active0 > 0):
        kind = EQUALITY(int(robot.model.eq_type[eq]))
        if kind in (EQUALITY.mjEQ_CONNECT, EQUALITY.mjEQ_WELD):
            kept = _add_site_tie(robot, name, bodies, spec, int(eq), kind)
        else:
            kept = kind == EQUALITY.mjEQ_JOINT or int(eq) in robot.tendons_as_joints
        if not kept:
            robot.warnings.append(f"equality {eq} ({kind.name[5:].lower()}) is left out")


def _add_site_tie(
    robot: MjcfRobot, name: str, bodies: dict[str, mujoco.MjsBody], spec: mujoco.MjSpec, eq: int, kind: mujoco.mjtEq
) -> bool:
    """A `connect` or a `weld`, between two sites; False: one end of it is no part of the robot."""
    ends = _ends(robot, eq, kind)
    if ends is None:
        return False
    if ends[0][0] == ends[1][0]:
        return True  # both are fixed to one link
    names = []
    for number, (link, pose) in enumerate(ends):
        names.append(f"{name}_{kind.name[5:].lower()}_{eq}_{number}")
        quat = np.zeros(4)
        mujoco.mju_mat2Quat(quat, pose[:3, :3].ravel())
        bodies[link].add_site(name=names[-1], pos=pose[:3, 3], quat=quat, size=[1e-3] * 3, rgba=[0.0] * 4)
    added = spec.add_equality(type=kind, objtype=OBJECT.mjOBJ_SITE, name1=names[0], name2=names[1])
    if kind == EQUALITY.mjEQ_WELD:
        added.data[TORQUE_SCALE] = robot.model.eq_data[eq, TORQUE_SCALE]
    added.solref, added.solimp = robot.model.eq_solref[eq], robot.model.eq_solimp[eq]
    return True


def _ends(robot: MjcfRobot, eq: int, kind: mujoco.mjtEq) -> list[tuple[str, np.ndarray]] | None:
    """The links that move the two ends, and the poses there that are to be one."""
    model, found = robot.model, []
    data, on_sites = model.eq_data[eq], OBJECT(int(model.eq_objtype[eq])) == OBJECT.mjOBJ_SITE
    for number, target in enumerate((int(model.eq_obj1id[eq]), int(model.eq_obj2id[eq]))):
        own = np.eye(4)
        if on_sites:
            body, own = int(model.site_bodyid[target]), pose_of(model.site_pos[target], model.site_quat[target])
        else:
            body = target
            if kind == EQUALITY.mjEQ_CONNECT:
                own[:3, 3] = data[3 * number : 3 * number + 3]
            elif number:  # the anchor, in the second body's frame
                own[:3, 3] = data[:3]
            else:  # the same point in the first body's frame, with the second one's axes
                own = pose_of(data[3:6], data[6:10])
        place = robot.place(body)
        if place is None:
            return None
        found.append((place[0], place[1] @ own))
    return found
