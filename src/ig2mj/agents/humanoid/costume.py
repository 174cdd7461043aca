"""What people see of the humanoid: a body, a face, and arms from its shoulders to its hands. Visual only."""

from __future__ import annotations

import itertools

import numpy as np

from ig2mj.agents.humanoid.frames import HANDS, mirrored
from ig2mj.looks import mesh
from ig2mj.looks.costume import Arm, Costume
from ig2mj.looks.mesh import Builder

SHOULDER, WRIST = (-0.03, 0.175, 0.185), (0.0, 0.012, 0.0)
"""m: of the left arm in the frame of the body, and on the palm of the right hand."""

BONE, POLE = 0.30, (-0.55, 0.75, -0.75)
"""m of each bone; where the left elbow points, in the frame of the body."""

WHITE, CLOTH, DARK, JOINT = (0.95, 0.95, 0.94), (0.25, 0.50, 0.60), (0.12, 0.14, 0.18), (0.40, 0.43, 0.47)
GLOW, WARM, CHEEK = (0.55, 0.92, 1.0), (0.96, 0.72, 0.36), (0.93, 0.55, 0.50)


def costume(name: str, cloth: tuple[float | int, float | int, float | int] = CLOTH) -> Costume:
    """The costume of a humanoid of that name. cloth: rgb of what it wears."""
    arms = []
    for hand, side in enumerate((1, -1)):  # left, right
        palm = tuple(float(c) for c in np.asarray(mirrored(hand, (WRIST,)))[0])
        upper, fore = Builder(), Builder()
        upper.paint(cloth, mesh.ball(0.058, (0, 0, 0), 14), mesh.lathe(_tapered(0.052, 0.043, 0.0, 0.17), sides=14))
        upper.paint(WHITE, mesh.lathe(_tapered(0.040, 0.036, 0.16, BONE), sides=14))
        upper.paint(JOINT, mesh.ball(0.040, (0, 0, BONE), 12))
        fore.paint(WHITE, mesh.lathe([(0.036, 0.0), (0.042, 0.08), (0.033, BONE - 0.05)], sides=14))
        fore.paint(WARM, mesh.lathe([(0.034, BONE - 0.06), (0.036, BONE - 0.045), (0.034, BONE - 0.03)], sides=14))
        fore.paint(JOINT, mesh.lathe(_tapered(0.028, 0.024, BONE - 0.05, BONE + 0.005), sides=12))
        pole, at = (POLE[0], side * POLE[1], POLE[2]), (SHOULDER[0], side * SHOULDER[1], SHOULDER[2])
        arms.append(Arm((name, at), (f"{name}_{HANDS[hand]}", palm), BONE, pole, upper, fore))  # type: ignore[arg-type]
    return Costume({name: _body(cloth)}, arms, (name,))


def _tapered(first: float, last: float, start: float, end: float) -> list[tuple[float, float]]:
    return [(first, start), (last, end)]


def _body(cloth: tuple[float | int, float | int, float | int]) -> Builder:
    """Base, trunk and head, in the frame of the body, whose middle is 0.55 m above the floor."""
    build = Builder()
    base = [(0.0, -0.52), (0.165, -0.52), (0.19, -0.49), (0.185, -0.455), (0.15, -0.425), (0.08, -0.41)]
    build.paint(WHITE, mesh.lathe(base, sides=28))
    build.paint(DARK, mesh.lathe([(0.168, -0.545), (0.186, -0.52), (0.19, -0.50)], sides=28))
    build.paint(WARM, mesh.lathe([(0.191, -0.492), (0.1925, -0.485), (0.191, -0.478)], sides=28))
    skirt = [(0.145, -0.40), (0.135, -0.33), (0.11, -0.22), (0.10, -0.12)]
    build.paint(JOINT, mesh.lathe([(0.07, -0.43), (0.06, -0.36)], sides=18))
    build.paint(cloth, mesh.lathe(skirt, sides=26), mesh.lathe([(0.135, -0.395), (0.145, -0.40)], sides=26))
    build.paint(WARM, mesh.lathe([(0.102, -0.13), (0.106, -0.12), (0.102, -0.105)], sides=26))
    trunk = mesh.lathe(
        [(0.10, -0.11), (0.125, -0.02), (0.145, 0.09), (0.142, 0.16), (0.10, 0.225), (0.045, 0.245)], sides=26
    )
    build.paint(cloth, _squashed(trunk, 0.78))
    collar = mesh.lathe([(0.075, 0.232), (0.062, 0.252), (0.050, 0.258)], sides=20)
    build.paint(WHITE, collar.moved((-0.012, 0, 0)))
    build.paint(JOINT, mesh.lathe([(0.036, 0.24), (0.034, 0.30)], sides=14).moved((-0.03, 0, 0)))
    for z in (0.03, 0.09, 0.15):
        build.paint(WHITE, mesh.ball((0.006, 0.011, 0.011), (0.108 - 0.12 * abs(z - 0.09), 0, z), 10))
    _head(build)
    return build


def _head(build: Builder) -> None:
    """Ends behind the robot's eye, which is a camera."""
    middle = (-0.065, 0.0, 0.405)
    build.paint(WHITE, mesh.ball((0.098, 0.118, 0.108), middle, 26))
    build.paint(DARK, mesh.ball((0.062, 0.097, 0.078), (-0.027, 0, 0.40), 26))
    for side in (-1, 1):
        build.paint(GLOW, mesh.ball((0.008, 0.017, 0.023), (0.0265, 0.037 * side, 0.413), 14))
        build.paint((1.0, 1.0, 1.0), mesh.ball((0.004, 0.006, 0.007), (0.0345, 0.037 * side + 0.006, 0.422), 8))
        build.paint(CHEEK, mesh.ball((0.005, 0.012, 0.007), (0.020, 0.060 * side, 0.380), 10))
        build.paint(WARM, mesh.ball((0.034, 0.014, 0.040), (-0.065, 0.118 * side, 0.405), 14))
        build.paint(JOINT, mesh.ball((0.020, 0.010, 0.024), (-0.065, 0.130 * side, 0.405), 12))
    smile = np.linspace(-0.9, 0.9, 7)
    points = [(0.031 - 0.012 * abs(a) ** 2, 0.030 * np.sin(a), 0.384 - 0.016 * np.cos(a)) for a in smile]
    build.paint(GLOW, *(mesh.rod(a, b, 0.0028, 6) for a, b in itertools.pairwise(points)))
    build.paint(JOINT, mesh.rod((-0.075, 0, 0.51), (-0.085, 0, 0.555), 0.005, 8))
    build.paint(WARM, mesh.ball(0.014, (-0.086, 0, 0.562), 12))


def _squashed(part: mesh.Triangles, depth: float) -> mesh.Triangles:
    """Less deep than wide."""
    vertices, normals = part.vertices * (depth, 1.0, 1.0), part.normals / (depth, 1.0, 1.0)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return mesh.Triangles(vertices, normals, part.uv, part.faces)
