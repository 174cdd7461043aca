"""A home made by code for benchmarks: as many objects as asked for, furniture with drawers and doors among them."""

from __future__ import annotations

import pathlib

import numpy as np
import scipy.spatial

from ig2mj.scene import manifest as mf

COLLISION = 'group="3" friction="0.25 0.005 0.0001" gap="0.003" margin="0"'
HULL_VERTICES = 24


def write_home(folder: pathlib.Path, num_objects: int, seed: int = 0) -> pathlib.Path:
    """Writes scene.xml and manifest.json of a home with `num_objects` objects, and returns the folder.

    One object in six is furniture (a cabinet with a drawer and a door, or a table); the objects on it are hulls of 24
    corners, boxes and cylinders. Fifteen of them stand on each piece until all
    are placed. All of it comes to rest within two seconds.
    """
    rng = np.random.default_rng(seed)
    furniture = max(1, (num_objects - 1) // 6)
    columns = int(np.ceil(np.sqrt(furniture)))
    bodies, excludes, entries = [_floor()], [], [_entry("floor", "floors", (100, 100, 1), fixed=True)]
    spots = []
    for k in range(furniture):
        x, y = 2.0 * (k % columns), 2.0 * (k // columns)
        name, cabinet = f"furniture_{k}", k % 2 == 0
        bodies.append(_cabinet(name, x, y) if cabinet else _table(name, x, y))
        parts = [f"{name}_drawer", f"{name}_door"] if cabinet else []
        excludes += [(name, p) for p in parts] + ([tuple(parts)] if cabinet else [])
        joints = [mf.JointEntry(f"{p}_joint", t, (0.0, 0.3)) for p, t in zip(parts, ("slide", "hinge"), strict=False)]
        opening = [mf.OpenableEntry(j.name, 0.0, 0.3) for j in joints]
        entries.append(_entry(name, "bottom_cabinet", (1, 0.6, 0.8), fixed=True, joints=joints, openable=opening))
        spots += [(x + dx, y + dy, 0.8) for dx in (-0.4, -0.2, 0.0, 0.2, 0.4) for dy in (-0.2, 0.0, 0.2)]
    meshes = []
    for k in range(num_objects - len(entries)):
        x, y, z = spots[k]
        name = f"thing_{k}"
        shape, size = [("mesh", f'mesh="{name}"'), ("box", 'size="0.05 0.04 0.03"'), ("cylinder", 'size="0.03 0.05"')][
            k % 3
        ]
        if shape == "mesh":
            meshes.append(f'<mesh name="{name}" vertex="{_hull(rng)}"/>')
        geom = f'<geom name="{name}/collision_0" type="{shape}" {size} density="500" {COLLISION}/>'
        bodies.append(f'<body name="{name}" pos="{x} {y} {z + 0.06}"><freejoint name="{name}/free"/>{geom}</body>')
        entries.append(_entry(name, "apple", (0.1, 0.1, 0.1)))
    exclude = "".join(f'<exclude body1="{a}" body2="{b}"/>' for a, b in excludes)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scene.xml").write_text(
        f'<mujoco><compiler angle="radian"/>'
        f'<option timestep="{1 / 120!r}" gravity="0 0 -9.8" integrator="implicitfast">'
        f'<flag sleep="enable"/></option><asset>{"".join(meshes)}</asset>'
        f"<worldbody>{''.join(bodies)}</worldbody><contact>{exclude}</contact></mujoco>"
    )
    manifest = mf.Manifest(mf.FORMAT_VERSION, f"made_{num_objects}", entries)
    mf.save_manifest(manifest, folder / "manifest.json")
    return folder


def _entry(name: str, category: str, size: tuple[float, float, float], **more) -> mf.ObjectEntry:
    fixed = more.pop("fixed", False)
    return mf.ObjectEntry(name, category, "made", [name], fixed, size, 1.0, **more)


def _hull(rng: np.random.Generator) -> str:
    """Corners of a flat-bottomed hull, 6 cm wide."""
    points = rng.normal(size=(HULL_VERTICES, 3))
    points *= 0.04 / np.linalg.norm(points, axis=1, keepdims=True)
    points[:, 2] = np.maximum(points[:, 2], -0.02)
    corners = points[scipy.spatial.ConvexHull(points).vertices]
    return " ".join(f"{v:.5f}" for v in corners.ravel())


def _box(body: str, number: int, size: str, pos: str) -> str:
    return f'<geom name="{body}/collision_{number}" type="box" size="{size}" pos="{pos}" density="300" {COLLISION}/>'


def _floor() -> str:
    """Without walls and so wide that nothing rolls off it; so deep that nothing is pressed out at its underside."""
    return f'<body name="floor" pos="0 0 -0.5">{_box("floor", 0, "50 50 0.5", "0 0 0")}</body>'


def _table(name: str, x: float, y: float) -> str:
    legs = [(0.45, 0.25), (0.45, -0.25), (-0.45, 0.25), (-0.45, -0.25)]
    geoms = [_box(name, 0, "0.5 0.3 0.02", "0 0 0.78")]
    geoms += [_box(name, k + 1, "0.02 0.02 0.38", f"{lx} {ly} 0.38") for k, (lx, ly) in enumerate(legs)]
    return f'<body name="{name}" pos="{x} {y} 0">{"".join(geoms)}</body>'


def _cabinet(name: str, x: float, y: float) -> str:
    sides = [
        ("0.5 0.3 0.01", "0 0 0.01"),
        ("0.5 0.3 0.01", "0 0 0.4"),
        ("0.5 0.3 0.01", "0 0 0.79"),
        ("0.5 0.01 0.38", "0 0.29 0.4"),
        ("0.01 0.28 0.38", "0.49 0 0.4"),
        ("0.01 0.28 0.38", "-0.49 0 0.4"),
    ]
    drawer, door = f"{name}_drawer", f"{name}_door"
    inside = [("0.45 0.25 0.005", "0 0 -0.12"), ("0.46 0.01 0.15", "0 -0.27 0")]
    return (
        f'<body name="{name}" pos="{x} {y} 0">'
        + "".join(_box(name, k, size, pos) for k, (size, pos) in enumerate(sides))
        + f'<body name="{drawer}" pos="0 -0.02 0.6"><joint name="{drawer}_joint" type="slide" axis="0 -1 0" '
        'range="0 0.3" limited="true" frictionloss="2"/>'
        + "".join(_box(drawer, k, size, pos) for k, (size, pos) in enumerate(inside))
        + f'</body><body name="{door}" pos="-0.48 -0.31 0.2"><joint name="{door}_joint" type="hinge" axis="0 0 -1" '
        'range="0 1.6" limited="true" frictionloss="1"/>'
        + _box(door, 0, "0.47 0.01 0.18", "0.47 0 0")
        + "</body></body>"
    )
