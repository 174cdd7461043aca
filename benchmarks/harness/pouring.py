"""A scene in which a fixed, tilted jug pours into a glass on a floor, as a folder in the project's format."""

from __future__ import annotations

import pathlib

import numpy as np

from ig2mj.scene import manifest as mf

WALL = 0.004
"""m: half the thickness of walls."""

JUG = (0.05, 0.05, 0.1)
"""Half sizes of its inside, m: 2 litres."""

GLASS = (0.0355, 0.0355, 0.02975)
"""The same: 0.3 litres."""


def _tub(x: float, y: float, z: float) -> list[tuple[tuple[float, ...], tuple[float, ...]]]:
    """Boxes (centre, half size) of a box without a lid."""
    return [
        ((0, 0, -z - WALL), (x + 2 * WALL, y + 2 * WALL, WALL)),
        ((x + WALL, 0, 0), (WALL, y, z)),
        ((-x - WALL, 0, 0), (WALL, y, z)),
        ((0, y + WALL, 0), (x + 2 * WALL, WALL, z)),
        ((0, -y - WALL, 0), (x + 2 * WALL, WALL, z)),
    ]


def _inside(x: float, y: float, z: float) -> mf.InsideEntry:
    corners = [
        (float(a * x), float(b * y), float(c * z)) for c in (-1, 1) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
    ]
    return mf.InsideEntry(litres=8000.0 * x * y * z, vertices=corners, rim=corners[4:])


def write_pouring(
    folder: pathlib.Path, litres: float = 1.0, degrees: float = 110.0, glass: tuple[float, float, float] = GLASS
) -> pathlib.Path:
    """Writes it; the folder. `litres` of water in the jug, which is tilted by `degrees` about y. `glass`: half sizes of
    the glass's inside, m."""
    folder.mkdir(parents=True, exist_ok=True)
    half = np.deg2rad(degrees) / 2
    places = [
        ("floor", [((0, 0, -0.05), (3, 3, 0.05))], (0, 0, 0), (1, 0, 0, 0), False),
        ("jug", _tub(*JUG), (0, 0, 0.5), (float(np.cos(half)), 0, float(np.sin(half)), 0), False),
        ("glass", _tub(*glass), (0.15, 0, glass[2] + 2 * WALL), (1, 0, 0, 0), True),
    ]
    bodies = []
    for name, boxes, pos, quat, free in places:
        geoms = "".join(
            f'<geom type="box" size="{_text(size)}" pos="{_text(centre)}" density="300" group="3" gap="0.003"/>'
            for centre, size in boxes
        )
        joint = f'<freejoint name="{name}/free"/>' if free else ""
        bodies.append(f'<body name="{name}" pos="{_text(pos)}" quat="{_text(quat)}">{joint}{geoms}</body>')
    option = '<option timestep="0.008333333333333333"><flag sleep="enable"/></option>'
    (folder / "scene.xml").write_text(f"<mujoco>{option}<worldbody>{''.join(bodies)}</worldbody></mujoco>")

    def entry(name: str, category: str, fixed: bool, **more) -> mf.ObjectEntry:
        size = (0.1, 0.1, 0.1)
        return mf.ObjectEntry(
            name=name, category=category, model="m", bodies=[name], fixed=fixed, bounding_box=size, mass=0.3, **more
        )

    objects = [
        entry("floor", "floors", True),
        entry("jug", "carafe", True, inside=_inside(*JUG), state={"volume": {"water": litres}}),
        entry("glass", "glass", False, inside=_inside(*glass)),
    ]
    made = mf.Manifest(format_version=mf.FORMAT_VERSION, name="pouring", objects=objects, substances=["water"])
    mf.save_manifest(made, folder / "manifest.json")
    return folder


def _text(values) -> str:
    return " ".join(map(str, values))
