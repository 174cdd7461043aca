"""What a converted robot's layout assigns, for people: base, wheels, arms, grippers, hands, cameras, laser."""

from __future__ import annotations

from ig2mj.agents.urdf.layout import DIFFERENTIAL, FIXED, OMNIDIRECTIONAL, SKID_STEER
from ig2mj.agents.urdf.robot import UrdfRobot

BASE_WORDS = {
    DIFFERENTIAL: "differential drive",
    SKID_STEER: "skid-steer drive",
    OMNIDIRECTIONAL: "omnidirectional drive",
    FIXED: "bolted to the floor",
}


def arms_of(robot: UrdfRobot) -> dict[str, tuple[str, ...]]:
    """Hand -> the joints of the arm that carries it."""
    layout, body = robot.layout, robot.body
    return {hand: tuple(layout.arm[k] for k in body.chain_joints(layout, hand)) for hand in layout.hands}


def summary(robot: UrdfRobot) -> list[tuple[str, str]]:
    """Rows of what it is and what stands for that."""
    layout, description, rays = robot.layout, robot.description, robot.hand_rays()
    arms = arms_of(robot)
    rows = [("base", f"{BASE_WORDS[layout.base]} ({description.base})")]
    if layout.wheels:
        rows.append(("wheels", ", ".join(layout.wheels)))
    for hand, joints in arms.items():
        if joints:
            rows.append(("arm", f"{', '.join(joints)} -> {hand}"))
    carrying = {joint for joints in arms.values() for joint in joints}
    if others := [joint for joint in layout.arm if joint not in carrying]:
        rows.append(("other joints", ", ".join(others)))
    for one in layout.grippers:
        limits = {joint: "lower" if one.closes_low(joint) else "upper" for joint in one.joints}
        rows.append(("gripper", ", ".join(f"{joint} (closed at its {at} limit)" for joint, at in limits.items())))
    rows += [("suction", link) for link in layout.suction]
    palms = {hand.palm: hand for hand in rays}
    for hand in layout.hands:
        found = palms.get(robot.body_name(robot.body.frame(hand)[0]))
        where = "holds nothing" if found is None else "holds at {:.3f} {:.3f} {:.3f} m of it".format(*found.grasp_point)
        rows.append(("hand", f"{hand}: {where}"))
    rows.append(("camera", layout.camera or "none"))
    rows.append(("laser", layout.laser or "none"))
    followers = [joint.name for joint in description.joints if joint.mimics is not None]
    if followers:
        rows.append(("followers", ", ".join(followers)))
    if passive := [joint.name for joint in description.joints if joint.passive]:
        rows.append(("passive", ", ".join(passive)))
    return rows
