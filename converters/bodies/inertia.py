"""Mass, centre of mass and inertia of an object's links."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
import trimesh

from ..base.description import Inertial, Link, ObjectModel
from .joint_limits import is_locked
from .kinematics import link_poses, model_bounds, shape_bounds
from .solids import SolidMoments, combine, hull_volume, joined, shape_solids, signed_volume

MassRule = Literal["dataset", "object", "robot"]
"""What the inertials of a URDF count for.

dataset: nothing, for an object of a dataset that has a bounding box, unless its metadata.json says `keep_inertials`
  (iGibson overwrites them; building parts and objects without a box are excepted).
object: they are kept; a body that none of them gives a mass gets its share by density.
robot: they are kept; a body that none of them gives a mass has none.

Where they come to no mass at all, the density rule holds for all three.
"""

DEFAULT_DENSITY = 67.0
"""kg per m^3 of the bounding box, of a category without a spec."""
BULLET_MARGIN = 0.001
"""m: what Bullet adds to each side of a mesh's box."""
MIN_MASS = 1e-3
"""kg: what a moving body without mass is given; MuJoCo refuses none."""
EDGE = 0.01
"""Share of an object's size by which its centre of mass should at least lie inside of its box."""
MIN_RADIUS = 0.01
"""m: size of a body that has mass and no shape."""
TINY = 1e-3
"""A mesh's signed volume below this share of its hull's is taken for a double-sided or inside-out surface."""


def link_inertials(
    model: ObjectModel, density: float | None, bullet: bool = False, rule: MassRule = "object"
) -> dict[str, Inertial]:
    """Inertials of all links of a model that `scaling.scale_model` returned.

    By density: the mass of the whole is density x scaled bounding box, split over the links by the volume of their
    collision shapes, and the centre of mass is the volume's where the mesh is watertight, else the surface's.
    By the URDF: its inertials are kept. A link without one weighs nothing where another link of its rigid body (links
    joined by fixed joints) has one. See `MassRule` for which of the two counts. Bodies without mass get `MIN_MASS`.

    Args:
      model: the scaled model. Warnings are appended to `model.warnings`.
      density: kg per m^3 of the bounding box, of the category; None: `DEFAULT_DENSITY`, with a warning.
      bullet: inertia by Bullet's formula on the axis-aligned box instead of the true one of the convex hulls.
      rule: what the URDF's own inertials count for.

    Returns:
      link name -> Inertial (link frame), for every link. Fixed-joint children are separate: merging is the builder's.
    """
    bodies = _rigid_bodies(model)
    given = {name: link.inertial for name, link in model.links.items() if link.inertial is not None}
    stated = sum(inertial.mass for inertial in given.values())
    discarded = rule == "dataset" and model.metadata.bbox_size is not None and not model.metadata.keep_inertials
    if discarded or stated <= 0:
        light, given = list(model.links), {}
    else:
        empty = [] if rule == "robot" else [members for members in bodies.values() if not _mass_of(members, given)]
        light = [name for members in empty for name in members]
    shares: dict[str, float] = {}
    if light and (size := _size(model)) is not None:
        total = (DEFAULT_DENSITY if density is None else density) * float(np.prod(size))
        shares = {name: mass for name, mass in _split_mass(model, total).items() if name in set(light)}
        _warn_of_density(model, total, stated, density, shares, discarded)
    result = {}
    for name, link in model.links.items():
        if name in shares or name not in given:
            result[name] = _computed(link, shares.get(name, 0.0), bullet)
        else:
            members = next(body for body in bodies.values() if name in body)
            result[name] = _kept(link, given[name], members, model, bullet)
            alone = rule == "object" and len(model.links) == 1 and given[name].mass > 0
            if alone and (edge := _off_centre(link, given[name])):
                model.warnings.append(f"link '{name}': {edge}")
    _give_least_mass(model, bodies, result)
    return result


def _warn_of_density(
    model: ObjectModel,
    total: float,
    stated: float,
    density: float | None,
    shares: dict[str, float],
    discarded: bool,
) -> None:
    """Says where the density rule takes the place of what a URDF says, or of what it should say.

    total: kg of the whole by the rule. stated: kg that the URDF's inertials come to.
    """
    own = any(link.inertial is not None for link in model.links.values())
    if discarded:
        if stated > 0:
            model.warnings.append(
                f"the URDF's mass of {stated:.3g} kg is replaced by {total:.3g} kg (density of the category times the "
                "bounding box), as in iGibson's datasets"
            )
    elif stated <= 0 and (own or density is None):
        lacks = "the URDF's inertials have no mass" if own else "the URDF has no inertials"
        used = DEFAULT_DENSITY if density is None else density
        model.warnings.append(f"{lacks}; {total:.3g} kg assigned ({used:g} kg/m3 of the bounding box), split by volume")
    elif stated > 0:
        for name, mass in shares.items():
            if mass > 0:
                model.warnings.append(f"link '{name}' has no mass; {mass:.3g} kg assigned in proportion to its size")


def _rigid_bodies(model: ObjectModel) -> dict[str, list[str]]:
    """First link -> the links of each rigid body: those joined by fixed joints, or by joints without room to move."""
    rigid = {j.child: j.parent for j in model.joints.values() if j.type == "fixed" or is_locked(j)}
    root: dict[str, str] = {}
    for name in link_poses(model):  # parents come before their children
        root[name] = root[rigid[name]] if name in rigid else name
    bodies: dict[str, list[str]] = {}
    for name in model.links:
        bodies.setdefault(root[name], []).append(name)
    return bodies


def _mass_of(members: Sequence[str], given: Mapping[str, Inertial]) -> float:
    return sum(given[name].mass for name in members if name in given)


def _size(model: ObjectModel) -> np.ndarray | None:
    """The bounding box [3] that the density refers to: metadata.json's, else that of the collision shapes."""
    if model.metadata.bbox_size is not None:
        return model.metadata.bbox_size
    box = model_bounds(model)
    return None if box is None else np.maximum(box[1] - box[0], MIN_RADIUS)


def link_com(link: Link) -> np.ndarray | None:
    """Centre of mass [3] by iGibson's rule, in the link frame, from the collision meshes (mesh scale applied).

    `center_mass` where trimesh calls the merged mesh watertight, else the centroid of the surface. Only where a link
    has no mesh do its primitives count. None for a link without collision shapes.
    """
    parts = []
    for shape in link.collisions:
        if not shape.meshes:
            continue
        body = joined(shape.meshes)
        body.apply_transform(shape.pose @ np.diag([*shape.scale, 1.0]))
        volume = abs(signed_volume(body))
        solid = body.is_watertight and volume > MIN_RADIUS**3 * 1e-6
        parts.append((volume if solid else body.area, body.center_mass if solid else _surface_centre(body)))
    if len(parts) == 1:
        return np.array(parts[0][1])
    if parts:  # several meshes in one link: iGibson refuses them; here all count as one surface or one solid
        weights = np.array([max(w, 1e-12) for w, _ in parts])
        return np.einsum("i,ij->j", weights / weights.sum(), np.array([c for _, c in parts]))
    whole = combine([s for shape in link.collisions if shape.kind != "mesh" for s in shape_solids(shape)])
    return None if whole is None else whole.centre


def _surface_centre(body: trimesh.Trimesh) -> np.ndarray:
    """The surface's centre; the vertices' mean where there is no surface."""
    return np.asarray(body.centroid if body.area > 0 else body.vertices.mean(axis=0))


def _split_mass(model: ObjectModel, total: float) -> dict[str, float]:
    """Mass per link, by the signed volume of its meshes, or by hulls where any of those is not positive.

    Primitives count only where the object has no bounding box in metadata.json, or no mesh: in iGibson they weigh
    nothing, and its own objects must keep their masses.
    """
    signed, hulls = {}, {}
    for name, link in model.links.items():
        meshes = [m for shape in link.collisions for m in shape.meshes]
        signed[name] = signed_volume(joined(meshes)) if meshes else 0.0
        hulls[name] = sum(hull_volume(m) for m in meshes)
    with_mesh = [name for name, link in model.links.items() if any(s.meshes for s in link.collisions)]
    volumes = signed
    if any(signed[name] <= TINY * hulls[name] for name in with_mesh):
        volumes = hulls
        model.warnings.append("a collision mesh encloses no volume: masses are split by the volumes of convex hulls")
    primitives = {
        name: sum(s.volume for shape in link.collisions if shape.kind != "mesh" for s in shape_solids(shape))
        for name, link in model.links.items()
    }
    if model.metadata.bbox_size is None:
        volumes = {name: volume + primitives[name] for name, volume in volumes.items()}
    if sum(volumes.values()) <= 0:
        volumes = {
            name: sum(s.volume for shape in link.collisions for s in shape_solids(shape))
            for name, link in model.links.items()
        }
    if model.category == "lamp":  # iGibson's own exception
        volumes = volumes | {model.base: 10 * volumes[model.base]}
    whole = sum(volumes.values())
    if whole <= 0:
        return {name: total if name == model.base else 0.0 for name in model.links}
    return {name: total * v / whole for name, v in volumes.items()}


def _computed(link: Link, mass: float, bullet: bool) -> Inertial:
    com = link.com if link.com is not None else link_com(link)
    pose = np.eye(4)
    if com is not None:
        pose[:3, 3] = com
    return Inertial(mass, _tensor(link, mass, pose, bullet), pose)


def _kept(link: Link, given: Inertial, members: Sequence[str], model: ObjectModel, bullet: bool) -> Inertial:
    """The URDF's inertial, or its mass with a computed tensor where no rigid body of this size has that tensor.

    members: the links of the rigid body that the link is a part of.
    """
    if given.mass == 0:
        return Inertial(0.0, np.zeros((3, 3)), given.pose.copy())
    problem = "impossible inertia in the URDF"
    if is_possible(given.inertia):
        problem = _too_wide(link, given, members, model)
    if not bullet and not problem:
        return given
    if not bullet and np.any(given.inertia):
        model.warnings.append(f"link '{link.name}': {problem}; recomputed from its geometry")
    return Inertial(given.mass, _tensor(link, given.mass, given.pose, bullet), given.pose.copy())


def _too_wide(link: Link, given: Inertial, members: Sequence[str], model: ObjectModel) -> str:
    """What is wrong with an inertia whose mass would have to lie outside the body: a placeholder; else ''.

    The body counts, not the link: the inertial of a whole robot may be that of a frame without a shape of its size.
    """
    if not link.collisions and not link.visuals:
        return ""  # what it is the inertia of has other frames
    poses, boxes = link_poses(model), []
    to_link = np.linalg.inv(poses[link.name])
    for other in (model.links[name] for name in members):
        frame = to_link @ poses[other.name]
        boxes += [b for s in other.collisions or other.visuals if (b := shape_bounds(s, frame)) is not None]
    if not boxes:
        return ""
    size = np.max([b[1] for b in boxes], axis=0) - np.min([b[0] for b in boxes], axis=0)
    half = 0.5 * float(np.linalg.norm(size))
    radius = float(np.sqrt(np.linalg.eigvalsh(given.inertia)[2] / given.mass))
    if radius <= half:
        return ""
    return f"implausible inertia in the URDF (radius of gyration {radius:.2g} m for a {2 * half:.2g} m link)"


def _off_centre(link: Link, given: Inertial) -> str:
    """What is wrong with a centre of mass on the surface of the link's box, or outside of it; else ''.

    Relations such as on_top look up and down from there, so that a support right below is not seen.
    """
    boxes = [b for shape in link.collisions if (b := shape_bounds(shape, np.eye(4))) is not None]
    if not boxes:
        return ""
    com, low, high = given.pose[:3, 3], np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)
    edge = EDGE * (high - low)
    if np.all(com >= low + edge) and np.all(com <= high - edge):
        return ""
    where = " ".join(f"{v:.3g}" for v in com)
    return f"the centre of mass ({where}) is not inside of the shape: give <inertial> its <origin>"


def is_possible(inertia: np.ndarray) -> bool:
    """Positive definite, and no principal moment larger than the sum of the other two (to 0.1 %)."""
    a, b, c = np.linalg.eigvalsh(inertia)
    return bool(a > 1e-14 and a + b >= c * (1 - 1e-3))


def _tensor(link: Link, mass: float, pose: np.ndarray, bullet: bool) -> np.ndarray:
    """Inertia [3, 3] in the axes of `pose`."""
    if mass == 0:
        return np.zeros((3, 3))
    if bullet:
        return mass * _box_tensor(link, np.linalg.inv(pose))
    solid = combine([s for shape in link.collisions for s in shape_solids(shape)])
    solid = solid or combine([s for shape in link.visuals for s in shape_solids(shape)])
    rotation = pose[:3, :3]
    return rotation.T @ (solid or _ball()).inertia(mass) @ rotation


def _box_tensor(link: Link, to_inertial: np.ndarray) -> np.ndarray:
    """Bullet's inertia per mass: of the shapes' box in the inertial frame, m / 12 (ly^2 + lz^2, ...)."""
    boxes = []
    for shape in link.collisions:
        box = shape_bounds(shape, to_inertial)
        if box is not None:
            margin = BULLET_MARGIN if shape.kind == "mesh" else 0.0
            boxes.append(box + np.array([[-margin], [margin]]))
    if not boxes:
        return _ball().inertia(1.0)
    low, high = np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)
    squares = (high - low) ** 2
    return np.diag(squares.sum() - squares) / 12


def _ball() -> SolidMoments:
    return SolidMoments(4 / 3 * np.pi * MIN_RADIUS**3, np.zeros(3), np.eye(3) * MIN_RADIUS**2 / 5)


def _give_least_mass(model: ObjectModel, bodies: Mapping[str, Sequence[str]], inertials: dict[str, Inertial]) -> None:
    """Gives `MIN_MASS` to the first link of every rigid body that has no mass."""
    for root, members in bodies.items():
        if _mass_of(members, inertials) >= MIN_MASS * 1e-3:
            continue
        given = inertials[root]
        inertials[root] = Inertial(MIN_MASS, _tensor(model.links[root], MIN_MASS, given.pose, False), given.pose)
        what = "the base has no mass (Bullet would make it static)" if root == model.base else f"'{root}' has no mass"
        model.warnings.append(f"{what}; {MIN_MASS:g} kg assigned")
