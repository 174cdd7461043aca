"""Parts that several families share: carcasses, drawers, doors, handles, legs, feet."""

from __future__ import annotations

import math

from ..shapes.bricks import Solid, arc, block, box, cylinder, hull, join, rod, tube
from ..shapes.materials import Material
from .model import LinkBuilder, ObjectBuilder

GAP = 0.003  # m, between a drawer or door and what it slides past
BOARD = 0.018  # m, furniture board


def carcass(x: float, y: float, z: float, board: float = BOARD, top: bool = True, back: float = 0.008) -> Solid:
    """A cupboard's body open to the front (+x), standing on the origin: floor, sides, back and perhaps top."""
    walls = [
        block((x, board, z), (0, (y - board) / 2, z / 2)),
        block((x, board, z), (0, (board - y) / 2, z / 2)),
        block((x, y - 2 * board, board), (0, 0, board / 2)),
        block((back, y - 2 * board, z - 2 * board), ((back - x) / 2, 0, z / 2)),
    ]
    if top:
        walls.append(block((x, y - 2 * board, board), (0, 0, z - board / 2)))
    return join(walls)


def bow_handle(length: float, reach: float = 0.03, radius: float = 0.006, upright: bool = False) -> Solid:
    """A bar handle on the plane x = 0 reaching to +x, centred; the collision hull is one thin box: the grip."""
    h = length / 2
    posts = [rod((0, s * 0.8 * h, 0), (reach, s * 0.8 * h, 0), radius * 0.8).visual_only() for s in (-1, 1)]
    grip = rod((reach, -h, 0), (reach, h, 0), radius).visual_only()
    hulls = block((2 * radius, length, 2 * radius), (reach, 0, 0)).collision_only()
    whole = join([grip, *posts, hulls])
    return whole.turned("x", 90) if upright else whole


def knob(radius: float = 0.014, reach: float = 0.025) -> Solid:
    """A round knob on the plane x = 0 reaching to +x."""
    return cylinder(radius, reach, 12).turned("y", 90)


def drawer(
    b: ObjectBuilder,
    name: str,
    centre: tuple[float, float, float],
    size: tuple[float, float, float],
    front: tuple[float, float],
    face: Material,
    inside: Material,
    handle: Solid | None,
    metal: Material,
    *,
    travel: float | None = None,
    openable: bool = True,
    wall: float = 0.010,
    face_depth: float = BOARD,
) -> LinkBuilder:
    """A drawer that slides towards +x: floor, back, two sides and a front board, with `GAP` of air around it.

    centre, size: of the room in the carcass that it fills; the front board lies against the room's front plane,
    `front`: its width and height. travel: metres; default: four fifths of the depth.
    """
    sx, sy, sz = size[0] - GAP, size[1] - 2 * GAP, size[2] * 0.8
    cx, cy, cz = centre
    x_front = cx + size[0] / 2
    link = b.slide(name, (cx, cy, cz), (1, 0, 0), travel if travel is not None else 0.8 * size[0], openable)
    low = cz - size[2] / 2 + GAP
    x_mid = x_front - sx / 2
    link.add(block((sx, sy, wall), (x_mid, cy, low + wall / 2)), inside)
    for s in (-1, 1):
        link.add(block((sx, wall, sz - wall), (x_mid, cy + s * (sy - wall) / 2, low + (sz + wall) / 2)), inside)
    back = block((wall, sy - 2 * wall, sz - wall), (x_front - sx + wall / 2, cy, low + (sz + wall) / 2))
    link.add(back, inside)
    link.add(block((face_depth, front[0], front[1]), (x_front + face_depth / 2, cy, cz)), face)
    if handle is not None:
        link.add(handle.at(x_front + face_depth, cy, cz), metal)
    return link


def door(
    b: ObjectBuilder,
    name: str,
    plane: float,
    y: tuple[float, float],
    z: tuple[float, float],
    face: Material,
    handle: Solid | None,
    metal: Material,
    *,
    left: bool = True,
    depth: float = BOARD,
    angle: float = math.pi / 2,
    openable: bool = True,
    leaf: Solid | None = None,
    handle_z: float | None = None,
) -> LinkBuilder:
    """A door that closes the plane x = `plane`, spanning y and z; hinged at the +y edge (left) or the -y edge.

    leaf: its own shape in place of the plain board, centred on the door's middle with its back on x = 0.
    """
    y0, y1 = min(y), max(y)
    middle, height, width = (z[0] + z[1]) / 2, z[1] - z[0], y1 - y0
    # The axis runs along the outer front edge, so that the leaf never swings beyond its own width.
    origin = (plane + depth, y1 if left else y0, middle)
    link = b.hinge(name, origin, (0, 0, 1 if left else -1), angle, openable)
    board = leaf if leaf is not None else block((depth, width, height), (depth / 2, 0, 0))
    link.add(board.at(plane, (y0 + y1) / 2, middle), face)
    if handle is not None:
        at = y0 + 0.12 * width if left else y1 - 0.12 * width
        link.add(handle.at(plane + depth, at, handle_z if handle_z is not None else middle), metal)
    return link


def flap(
    b: ObjectBuilder,
    name: str,
    plane: float,
    width: float,
    z: tuple[float, float],
    face: Material,
    handle: Solid | None,
    metal: Material,
    *,
    y: float = 0.0,
    depth: float = 0.03,
    skin: float = 0.008,
    angle: float = math.pi / 2,
    openable: bool = True,
) -> LinkBuilder:
    """An oven's or dishwasher's door: hinged along its lower edge, closing the plane x = `plane`.

    Its collision hulls are two sheets, `skin` thick, with air between them: solid, it would be heavier than its hinge
    can hold (hinges.friction) and a hand can close.
    """
    middle, height = (z[0] + z[1]) / 2, z[1] - z[0]
    # The axis runs along the outer lower edge, so that the open flap does not reach below its closed place.
    link = b.hinge(name, (plane + depth, y, z[0]), (0, 1, 0), angle, openable)
    link.add(block((depth, width, height), (plane + depth / 2, y, middle)).visual_only(), face)
    for at in (plane + skin / 2, plane + depth - skin / 2):
        link.add(block((skin, width, height), (at, y, middle)).collision_only(), face)
    if handle is not None:
        link.add(handle.at(plane + depth, y, z[1] - 0.08 * height - 0.01), metal)
    return link


def lid(
    b: ObjectBuilder,
    name: str,
    solid: Solid,
    material: Material,
    rear: float,
    z: float,
    *,
    angle: float = 1.9,
    openable: bool = True,
) -> LinkBuilder:
    """A lid that turns up about its rear edge (x = rear, height z); `solid` is given closed, in the object's frame."""
    link = b.hinge(name, (rear, 0, z), (0, -1, 0), angle, openable)
    link.add(solid, material)
    return link


def legs(
    b: ObjectBuilder,
    x: float,
    y: float,
    height: float,
    width: float,
    material: Material,
    *,
    splay: float = 0.0,
    round_: bool = False,
    inset: float = 0.0,
) -> None:
    """Four legs under a plate x by y whose underside is at `height`; splay: how far the feet stand outwards, metres."""
    for sx in (-1, 1):
        for sy in (-1, 1):
            top = (sx * (x / 2 - width / 2 - inset - splay), sy * (y / 2 - width / 2 - inset - splay))
            foot = (top[0] + sx * splay, top[1] + sy * splay)
            if round_:
                b.add(rod((*foot, 0), (*top, height), width / 2), material)
            elif splay:
                b.add(_slanted(foot, top, height, width), material)
            else:
                b.add(box(width, width, height).at(*top), material)


def _slanted(foot: tuple[float, float], top: tuple[float, float], height: float, width: float) -> Solid:
    corners = [(dx * width / 2, dy * width / 2) for dx in (-1, 1) for dy in (-1, 1)]
    return hull(
        [(foot[0] + dx * 0.7, foot[1] + dy * 0.7, 0) for dx, dy in corners]
        + [(top[0] + dx, top[1] + dy, height) for dx, dy in corners]
    )


def ear(radius: float, thickness: float, upright: bool = True) -> Solid:
    """A cup's handle on the axis plane y = 0, reaching to +x from x = 0; centred on z = 0."""
    path = [p * (0.8, 1, 1.15) for p in arc(radius, -80, 80, 7)]
    return tube(path, thickness, 6, hulls=1)


def button(
    b: ObjectBuilder, xyz: tuple[float, float, float], material: Material, radius: float = 0.012, facing: str = "x"
) -> None:
    """A push button: a small disc, visual only, and the toggle_button point in its middle."""
    disc = cylinder(radius, 0.004, 12).visual_only()
    disc = disc.turned("y", 90) if facing == "x" else disc
    b.add(disc.at(*xyz), material)
    b.point("toggle_button", xyz)
