"""Where added objects come to rest on their slab, so that they are at rest when the scene is loaded.

A model stands on its lowest point, which may be too small to bear it: an apple rolls off it onto its side. A small
model of the slab and what stands there, without visual geoms, is stepped until it sleeps.
"""

from __future__ import annotations

import copy
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence

import mujoco
import numpy as np
from jaxtyping import Float

STIRS = 0.002
"""Metres. An object whose centre of mass moves farther than this is not at rest where its model puts it."""

SECONDS = 10.0
"""Simulated seconds within which it must have come to rest; else it stays where its model puts it."""

ROUNDS = 3
"""Times that rounded poses are tried for whether they rest."""

DECIMALS = 5
"""Digits behind the point (m, unit quaternion) to which poses are rounded: they are the same on every processor."""

UNSEEN = ("site", "camera", "light")


def rest(
    root: ElementTree.Element, slab: ElementTree.Element, bodies: Sequence[ElementTree.Element], start: Sequence[float]
) -> Float[np.ndarray, "nq"]:
    """Positions at which bodies on a slab are at rest.

    Args:
      root: MJCF with absolute paths that has the assets, defaults, contacts and equalities of the bodies.
      slab: the body that they stand on. bodies: free ones, in `root`. start: their positions (qpos), in this order.

    Returns:
      Positions in the same order: those of an object that does not stir, or does not come to rest, unchanged.
    """
    try:
        model = mujoco.MjModel.from_xml_string(ElementTree.tostring(_extract(root, slab, bodies), encoding="unicode"))
    except ValueError:  # what MuJoCo cannot read is reported when the whole scene is compiled
        return np.array(start, float)
    model.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_SLEEP
    data = mujoco.MjData(model)
    tree, joints = model.body_treeid, model.jnt_bodyid
    roots = [model.body(str(body.get("name"))).id for body in bodies]
    given = np.array(start, float)
    for _ in range(ROUNDS):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = given
        mujoco.mj_forward(model, data)
        before = np.array(data.subtree_com[roots])
        farthest = np.zeros(len(roots))
        for _ in range(round(SECONDS / model.opt.timestep)):
            mujoco.mj_step(model, data)
            farthest = np.maximum(farthest, np.linalg.norm(data.subtree_com[roots] - before, axis=1))
            if (data.tree_asleep >= 0).all():
                break
        stirring = [r for r, way in zip(roots, farthest, strict=True) if way > STIRS and data.tree_asleep[tree[r]] >= 0]
        if not stirring:
            break
        for r in stirring:
            for joint in np.flatnonzero(tree[joints] == tree[r]):
                at = int(model.jnt_qposadr[joint])
                width = 7 if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_FREE else 1
                given[at : at + width] = np.round(data.qpos[at : at + width], DECIMALS)
    return given


def _extract(
    root: ElementTree.Element, slab: ElementTree.Element, bodies: Sequence[ElementTree.Element]
) -> ElementTree.Element:
    """MJCF of the slab and the bodies alone, without what is only seen."""
    small = ElementTree.Element("mujoco")
    for tag in ("compiler", "option", "default"):
        small.extend(copy.deepcopy(e) for e in root.findall(tag))
    for geom in small.iter("geom"):
        geom.attrib.pop("material", None)
    world = ElementTree.Element("worldbody")
    world.append(slab)
    for body in bodies:
        solid = copy.deepcopy(body)
        for parent in list(solid.iter("body")):
            for child in list(parent):
                if child.tag in UNSEEN or (child.tag == "geom" and child.get("class", "").endswith("visual")):
                    parent.remove(child)
                child.attrib.pop("material", None)
        world.append(solid)
    meshes = {geom.get("mesh") for geom in world.iter("geom")}
    assets = ElementTree.SubElement(small, "asset")
    assets.extend(e for section in root.findall("asset") for e in section.iter("mesh") if e.get("name") in meshes)
    small.append(world)
    names = {body.get("name") for body in world.iter("body")} | {joint.get("name") for joint in world.iter("joint")}
    for tag in ("contact", "equality"):
        kept = ElementTree.SubElement(small, tag)
        for element in (e for section in root.findall(tag) for e in section):
            if all(element.get(a, "") in names for a in ("body1", "body2", "joint1") if a in element.attrib):
                kept.append(element)
    return small
