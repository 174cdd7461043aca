"""What people see of the TurtleBot next to its own geoms: a bumper, lights, screws and a laptop. Visual only."""

from __future__ import annotations

import math

from ig2mj.looks import mesh
from ig2mj.looks.costume import Costume
from ig2mj.looks.mesh import Builder

PLATE, RIM, SILVER = (0.20, 0.21, 0.23), (0.30, 0.31, 0.33), (0.72, 0.73, 0.75)
BRAND, SCREEN, LAMP = (0.45, 0.68, 0.22), (0.30, 0.55, 0.72), (0.35, 0.95, 0.45)


def costume(name: str, plates: tuple[tuple[float, float], ...]) -> Costume:
    """The costume of a TurtleBot of that name. plates: height and radius of each, m."""
    build = Builder()
    build.paint(RIM, mesh.lathe([(0.1785, 0.040), (0.1800, 0.054), (0.1785, 0.068)], sides=40))
    build.paint(BRAND, mesh.lathe([(0.1765, 0.074), (0.1775, 0.079), (0.1765, 0.084)], sides=40))
    for height, radius in plates:
        ring = [(radius, height + 0.0085), (radius + 0.0015, height + 0.012), (radius, height + 0.0155)]
        build.paint(SILVER, mesh.lathe(ring, sides=36).moved((-0.01, 0, 0)))
        top = mesh.lathe([(radius - 0.002, height + 0.0156), (0.0, height + 0.0156)], sides=36)
        build.paint(PLATE, top.moved((-0.01, 0, 0)))
        for k in range(10):
            for r in (0.45, 0.75):
                x, y = r * radius * math.cos(0.63 * k + r), r * radius * math.sin(0.63 * k + r)
                build.paint(
                    (0.07, 0.07, 0.08), mesh.lathe([(0.006, 0.0), (0.0, 0.0002)], (x - 0.01, y, height + 0.016), 8)
                )
    for k, y in enumerate((-0.05, -0.03, -0.01)):
        build.paint((LAMP, BRAND, (0.95, 0.65, 0.25))[k], mesh.ball((0.003, 0.005, 0.005), (0.172, y, 0.09), 8))
    build.paint(SILVER, mesh.box((-0.045, 0, 0.418), (0.15, 0.2, 0.012)))  # a closed laptop behind the camera
    build.paint((0.60, 0.61, 0.63), mesh.box((-0.045, 0, 0.4265), (0.15, 0.2, 0.005)))
    build.paint(BRAND, mesh.lathe([(0.014, 0.0), (0.0, 0.0003)], (-0.045, 0, 0.4292), 12))
    build.paint((0.13, 0.14, 0.16), mesh.box((0.0, 0, 0.462), (0.058, 0.276, 0.004)))
    for y in (-0.06, -0.02, 0.03):
        lens = mesh.ball((0.004, 0.0085, 0.0085), (0.033, y, 0.442), 12)
        build.paint(SCREEN if y > -0.03 else (0.55, 0.15, 0.18), lens)
    return Costume({name: build})
