"""What is around a home: a lawn with a path, hedges, trees, and the sky."""

from __future__ import annotations

import math

import numpy as np

from ig2mj.looks import mesh
from ig2mj.looks.home_plan import HomePlan, seed_of
from ig2mj.looks.light import Light
from ig2mj.looks.materials import Material, fractal, grass, shaded, sky, stone
from ig2mj.looks.mesh import Builder

GROUND, FAR, DOME = -0.08, 26.0, 40.0
"""m: height of the lawn, how far it reaches, radius of the sky."""

GARDEN = 3.6
"""m from the house to the hedge."""


def add_outside(build: Builder, plan: HomePlan, light: Light, night: bool) -> None:
    """Adds the surroundings of a home."""
    rng = np.random.default_rng(seed_of(plan.name, "garden"))
    middle, dark = (plan.low + plan.high) / 2, (*light.outside, 1.0)
    lawn = Material("lawn", grass(seed_of(plan.name)), rgba=dark)
    low, size = middle - FAR, 2 * FAR
    build.add(lawn, mesh.sheet((*low, GROUND), (size, 0, 0), (0, size, 0), (0, 0, size / 4, size / 4)))
    dome = Material("sky", sky(night), emission=1.0)
    build.add(dome, _dome(middle))
    green = Material("hedge", shaded((0.27, 0.44, 0.23), fractal((128, 128), (32, 32), rng, 3), 0.38), rgba=dark)
    bark = (0.40 * light.outside[0], 0.30 * light.outside[1], 0.22 * light.outside[2])
    a, b = plan.low - GARDEN, plan.high + GARDEN
    gates = [d.solid.middle[:2] for d in plan.doors if d.outside]
    for axis in (0, 1):
        for at in (a[axis], b[axis]):
            spots = np.arange(a[1 - axis], b[1 - axis] + 0.1, 0.9)
            for spot in spots:
                pos = np.zeros(2)
                pos[axis], pos[1 - axis] = at, spot
                if any(abs(pos[1 - axis] - g[1 - axis]) < 1.0 and abs(at - g[axis]) < GARDEN + 0.8 for g in gates):
                    continue
                size3 = np.array([0.34, 0.34, 0.55]) + rng.uniform(-0.03, 0.05, 3)
                size3[1 - axis] += 0.2
                build.add(green, mesh.ball(size3, (*pos, GROUND + 0.4), 8))
    paving = Material("paving", stone((0.72, 0.69, 0.63), seed_of(plan.name, "path")), rgba=dark)
    for door in (d for d in plan.doors if d.outside):
        face, along = door.face, sum(door.along) / 2
        for k in range(9):
            p = face.point(along + float(rng.uniform(-0.05, 0.05)), -(0.9 + 0.6 * k), GROUND + 0.012)
            build.add(paving, mesh.sheet((p[0] - 0.45, p[1] - 0.26, p[2]), (0.9, 0, 0), (0, 0.52, 0), (0, 0, 1, 0.6)))
    for k in range(9):
        angle = 2 * math.pi * (k + float(rng.uniform(-0.25, 0.25))) / 9
        reach = float(np.linalg.norm(plan.high - plan.low)) / 2 + GARDEN + float(rng.uniform(2.5, 6.0))
        x, y = middle + reach * np.array([math.cos(angle), math.sin(angle)])
        tall = float(rng.uniform(2.6, 4.4))
        build.paint(bark, mesh.rod((x, y, GROUND), (x, y, 0.6 * tall), 0.14, 7))
        for dx, dy, z, r in ((0, 0, 0.78, 0.34), (0.22, 0.1, 0.62, 0.26), (-0.2, -0.12, 0.66, 0.27)):
            build.add(green, mesh.ball(r * tall, (x + dx * tall, y + dy * tall, z * tall), 9))
    for window in (w for w in plan.windows if w.outside):
        place = window.face.point(sum(window.along) / 2, -0.75, GROUND + 0.1)
        for k in range(3):
            offset = np.zeros(3)
            offset[1 - window.face.axis] = 0.45 * (k - 1)
            build.add(green, mesh.ball((0.28, 0.28, 0.32), place + offset, 7))
            for _ in range(5):
                flower = place + offset + [*rng.uniform(-0.2, 0.2, 2), 0.24 + float(rng.uniform(0, 0.08))]
                hue = (
                    np.array([(0.90, 0.45, 0.50), (0.95, 0.85, 0.50), (0.85, 0.80, 0.95)][int(rng.integers(3))])
                    * light.outside
                )
                build.paint((float(hue[0]), float(hue[1]), float(hue[2])), mesh.ball(0.035, flower, 5))


def _dome(middle: np.ndarray) -> mesh.Triangles:
    """Seen from inside."""
    t = np.linspace(-0.04, math.pi / 2, 9)
    made = mesh.lathe([(DOME * math.cos(a), DOME * math.sin(a)) for a in t], (*middle, 0.0), 32)
    up = np.clip(
        np.arctan2(made.vertices[:, 2], DOME * np.cos(np.arcsin(np.clip(made.vertices[:, 2] / DOME, -1, 1))))
        / (math.pi / 2),
        0.005,
        0.985,
    )
    return mesh.Triangles(made.vertices, -made.normals, np.stack([2 * made.uv[:, 0], up], 1), made.faces[:, ::-1])
