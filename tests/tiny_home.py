"""A small home for tests: one room, furniture with joints, objects to put, to cut, to heat and to clean.

`write_tiny_home(folder)` writes `scene.xml`, `manifest.json` and `rooms.npz` in the project's own format, with no
converter involved. World frame: the room spans x, y in [-2, 2] (m), the floor's top is z = 0.
"""

from __future__ import annotations

import math
import pathlib

import numpy as np

from ig2mj.scene import manifest as mf

TABLE_TOP = 0.5
"""Height of the table's surface, m."""

COLLISION = 'group="3" friction="0.25 0.005 0.0001" gap="0.003" margin="0"'
VISUAL = 'group="0" contype="0" conaffinity="0"'

HULL = np.array(
    [
        (s * x, t * y, u * z)
        for x, y, z in ((0, 1, 1.618), (1, 1.618, 0), (1.618, 0, 1))
        for s, t, u in (
            (1, 1, 1),
            (1, 1, -1),
            (1, -1, 1),
            (1, -1, -1),
            (-1, 1, 1),
            (-1, 1, -1),
            (-1, -1, 1),
            (-1, -1, -1),
        )
    ]
)
"""Corners of an icosahedron with circumradius 1.9 (some twice)."""


def _corners(vertices: np.ndarray) -> str:
    return " ".join(f"{v:.6g}" for v in np.unique(np.round(vertices, 6), axis=0).ravel())


def _half(sign: int) -> np.ndarray:
    """Corners of half an apple, cut in the plane x = 0, flat side at x = 0."""
    ring = [(0.0, 0.03 * math.cos(a), 0.03 * math.sin(a)) for a in np.linspace(0, 2 * math.pi, 8, endpoint=False)]
    cap = [(sign * 0.025, 0.012 * y, 0.012 * z) for y, z in ((1, 1), (1, -1), (-1, 1), (-1, -1))]
    return np.array(ring + cap)


def _body(name: str, pos: str, inner: str, *, free: bool, quat: str = "1 0 0 0") -> str:
    joint = f'<freejoint name="{name}/free"/>' if free else ""
    return f'<body name="{name}" pos="{pos}" quat="{quat}">{joint}{inner}</body>\n'


def _box(body: str, number: int, size: str, pos: str = "0 0 0", density: float = 300) -> str:
    """A collision box and the same box to look at."""
    return (
        f'<geom name="{body}/collision_{number}" type="box" size="{size}" pos="{pos}" density="{density}" {COLLISION}/>'
        f'<geom name="{body}/visual_{number}" type="box" size="{size}" pos="{pos}" mass="0" {VISUAL}/>'
    )


def _primitive(body: str, kind: str, size: str, density: float = 300) -> str:
    return f'<geom name="{body}/collision_0" type="{kind}" size="{size}" density="{density}" {COLLISION}/>'


def _mesh(body: str, mesh: str, density: float = 600) -> str:
    return f'<geom name="{body}/collision_0" type="mesh" mesh="{mesh}" density="{density}" {COLLISION}/>'


def scene_xml() -> str:
    """The MJCF text."""
    table = _box("table", 0, "0.4 0.3 0.02", f"0 0 {TABLE_TOP - 0.02}") + "".join(
        _box("table", k + 1, "0.02 0.02 0.23", f"{x} {y} 0.23")
        for k, (x, y) in enumerate(((0.35, 0.25), (0.35, -0.25), (-0.35, 0.25), (-0.35, -0.25)))
    )
    cabinet = (
        _box("cabinet", 0, "0.25 0.3 0.01", "0 0 0.01")  # bottom, middle shelf, top, two sides, back
        + _box("cabinet", 1, "0.25 0.3 0.01", "0 0 0.4")
        + _box("cabinet", 2, "0.25 0.3 0.01", "0 0 0.79")
        + _box("cabinet", 3, "0.25 0.01 0.4", "0 0.29 0.4")
        + _box("cabinet", 4, "0.25 0.01 0.4", "0 -0.29 0.4")
        + _box("cabinet", 5, "0.01 0.3 0.4", "0.24 0 0.4")
        + '<body name="cabinet_drawer" pos="-0.02 0 0.6">'
        '<joint name="cabinet_drawer_slide" type="slide" axis="-1 0 0" range="0 0.3" limited="true" frictionloss="2"/>'
        + _box("cabinet_drawer", 0, "0.21 0.26 0.005", "0 0 -0.08")
        + _box("cabinet_drawer", 1, "0.01 0.27 0.09", "-0.22 0 0")
        + _box("cabinet_drawer", 2, "0.01 0.26 0.08", "0.2 0 0")
        + _box("cabinet_drawer", 3, "0.21 0.005 0.08", "0 0.255 0")
        + _box("cabinet_drawer", 4, "0.21 0.005 0.08", "0 -0.255 0")
        + "</body>"
        + '<body name="cabinet_door" pos="-0.26 0.29 0.2">'
        '<joint name="cabinet_door_hinge" type="hinge" axis="0 0 -1" range="0 1.6" limited="true" frictionloss="1"/>'
        + _box("cabinet_door", 0, "0.01 0.28 0.18", "0 -0.28 0")
        + "</body>"
    )
    knife = (
        _box("knife", 0, "0.05 0.012 0.012", "-0.05 0 0", density=700)
        + f'<geom name="knife/slicer" type="box" size="0.06 0.002 0.015" pos="0.06 0 0" density="2000" {COLLISION}/>'
    )
    stove = (
        _box("stove", 0, "0.3 0.3 0.4", "0 0 0.4")
        + '<site name="stove/heat_source" pos="0 0 0.85"/><site name="stove/toggle_button" pos="-0.3 0 0.7"/>'
    )
    sink = (
        _box("sink", 0, "0.25 0.2 0.35", "0 0 0.35")
        + '<site name="sink/water_source" pos="0 0 1.0"/><site name="sink/water_sink" pos="0 0 0.72"/>'
    )
    sponge = (
        _box("sponge", 0, "0.05 0.03 0.015", density=80)
        + f'<geom name="sponge/cleaning_tool_area" type="box" size="0.05 0.03 0.005" pos="0 0 -0.015" mass="0" '
        f"{COLLISION}/>"
    )
    walls = "".join(
        _box("walls", k, size, pos)
        for k, (size, pos) in enumerate(
            (("0.05 2.1 1.2", "2.05 0 1.2"), ("0.05 2.1 1.2", "-2.05 0 1.2"), ("2 0.05 1.2", "0 2.05 1.2"))
        )
    )
    bodies = (
        _body("floor", "0 0 -0.05", _box("floor", 0, "2 2 0.05"), free=False)
        + _body("walls", "0 0 0", walls, free=False)
        + _body("table", "0 0 0", table, free=False)
        + _body("box", f"0.1 0 {TABLE_TOP + 0.05}", _box("box", 0, "0.05 0.05 0.05"), free=True)
        + _body("cabinet", "1.5 0 0", cabinet, free=False)
        + _body("book", "1.48 0 0.545", _box("book", 0, "0.08 0.06 0.02"), free=True)
        + _body("knife", f"-0.2 -0.15 {TABLE_TOP + 0.015}", knife, free=True)
        + _body("apple", f"-0.2 0.1 {TABLE_TOP + 0.03}", _mesh("apple", "apple"), free=True)
        + _body("apple_half_0", "30 0 0.03", _mesh("apple_half_0", "apple_half_0"), free=True, quat="0.7071 0 0.7071 0")
        + _body(
            "apple_half_1", "31 0 0.03", _mesh("apple_half_1", "apple_half_1"), free=True, quat="0.7071 0 -0.7071 0"
        )
        + _body("ball", "-1 -1 0.1", _primitive("ball", "sphere", "0.1"), free=True)
        + _body("can", f"0.3 0.2 {TABLE_TOP + 0.06}", _primitive("can", "cylinder", "0.03 0.06"), free=True)
        + _body("rod", "-1 1 0.02", _primitive("rod", "capsule", "0.02 0.15"), free=True, quat="0.7071 0 0.7071 0")
        + _body("stove", "0 1.6 0", stove, free=False)
        + _body("pan", "0 1.6 0.815", _box("pan", 0, "0.1 0.1 0.015", density=1000), free=True)
        + _body("sink", "-1.6 0 0", sink, free=False)
        + _body("sponge", "0.25 -0.2 0.52", sponge, free=True)
    )
    family = ("cabinet", "cabinet_drawer", "cabinet_door")
    excludes = "".join(f'<exclude body1="{a}" body2="{b}"/>' for k, a in enumerate(family) for b in family[k + 1 :])
    return f"""<mujoco model="tiny_home">
  <compiler angle="radian" inertiagrouprange="3 3"/>
  <option timestep="{1 / 120!r}" gravity="0 0 -9.8"><flag sleep="enable"/></option>
  <asset>
    <mesh name="apple" vertex="{_corners(HULL * 0.03 / 1.618)}"/>
    <mesh name="apple_half_0" vertex="{_corners(_half(1))}"/>
    <mesh name="apple_half_1" vertex="{_corners(_half(-1))}"/>
  </asset>
  <worldbody>
    <light pos="0 0 3" dir="0 0 -1"/>
    <camera name="overview" pos="-3 -3 3" xyaxes="0.7071 -0.7071 0 0.35 0.35 0.87"/>
    <geom name="parking" type="box" pos="30 0 -0.05" size="5 5 0.05" {COLLISION}/>
{bodies}  </worldbody>
  <contact>{excludes}</contact>
</mujoco>
"""


def _object(name: str, category: str, size: tuple[float, float, float], *, mass: float, **more) -> mf.ObjectEntry:
    return mf.ObjectEntry(
        name=name,
        category=category,
        model="tiny",
        bodies=more.pop("bodies", [name]),
        fixed=more.pop("fixed", False),
        bounding_box=size,
        mass=mass,
        rooms=["kitchen_0"],
        **more,
    )


def home_manifest() -> mf.Manifest:
    """The manifest that belongs to `scene_xml`."""
    dirt = {"dustyable": {}, "stainable": {}}
    food = {
        "cookable": {"cook_temperature": 70.0},
        "burnable": {"burn_temperature": 200.0},
        "freezable": {"freeze_temperature": 0.0},
    }
    objects = [
        _object("floor", "floors", (4, 4, 0.1), mass=480.0, fixed=True, abilities=dict(dirt)),
        _object("walls", "walls", (4.2, 4.2, 2.4), mass=1000.0, fixed=True, base_link_offset=(0, 0, 1.2)),
        _object("table", "table", (0.8, 0.6, 0.5), mass=7.0, fixed=True, base_link_offset=(0, 0, 0.25), abilities=dirt),
        _object("box", "carton", (0.1, 0.1, 0.1), mass=0.3),
        _object(
            "cabinet",
            "bottom_cabinet",
            (0.52, 0.6, 0.8),
            mass=30.0,
            fixed=True,
            base_link_offset=(-0.01, 0, 0.4),
            bodies=["cabinet", "cabinet_drawer", "cabinet_door"],
            joints=[
                mf.JointEntry("cabinet_drawer_slide", "slide", (0.0, 0.3)),
                mf.JointEntry("cabinet_door_hinge", "hinge", (0.0, 1.6)),
            ],
            openable=[
                mf.OpenableEntry("cabinet_drawer_slide", 0.0, 0.3),
                mf.OpenableEntry("cabinet_door_hinge", 0.0, 1.6),
            ],
            abilities={"openable": {}},
        ),
        _object("book", "notebook", (0.16, 0.12, 0.04), mass=0.23, abilities={"dustyable": {}}),
        _object(
            "knife",
            "carving_knife",
            (0.22, 0.024, 0.03),
            mass=0.07,
            base_link_offset=(0.01, 0, 0),
            links={"slicer": mf.LinkEntry(geom="knife/slicer")},
            abilities={"slicer": {}},
        ),
        _object(
            "apple",
            "apple",
            (0.06, 0.06, 0.06),
            mass=0.05,
            parts=[
                mf.PartEntry("apple_half_0", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)),
                mf.PartEntry("apple_half_1", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)),
            ],
            abilities={**food, "sliceable": {"slice_force": 10.0}},
        ),
        *(
            _object(
                f"apple_half_{k}",
                "half_apple",
                (0.025, 0.06, 0.06),
                mass=0.02,
                part_of="apple",
                parked=True,
                abilities=food,
            )
            for k in range(2)
        ),
        _object("ball", "soccer_ball", (0.2, 0.2, 0.2), mass=1.2),
        _object("can", "beer_can", (0.06, 0.06, 0.12), mass=0.1),
        _object("rod", "broomstick", (0.04, 0.04, 0.34), mass=0.12),
        _object(
            "stove",
            "stove",
            (0.6, 0.6, 0.8),
            mass=80.0,
            fixed=True,
            base_link_offset=(0, 0, 0.4),
            links={
                "heat_source": mf.LinkEntry(site="stove/heat_source"),
                "toggle_button": mf.LinkEntry(site="stove/toggle_button"),
            },
            abilities={
                "toggleable": {},
                "heatSource": {
                    "temperature": 500.0,
                    "heating_rate": 0.02,
                    "distance_threshold": 0.2,
                    "requires_toggled_on": True,
                },
            },
        ),
        _object("pan", "frying_pan", (0.2, 0.2, 0.03), mass=1.2, abilities={"stainable": {}}),
        _object(
            "sink",
            "sink",
            (0.5, 0.4, 0.7),
            mass=40.0,
            fixed=True,
            base_link_offset=(0, 0, 0.35),
            links={
                "water_source": mf.LinkEntry(site="sink/water_source"),
                "water_sink": mf.LinkEntry(site="sink/water_sink"),
            },
            abilities={"waterSource": {}, "toggleable": {}},
        ),
        _object(
            "sponge",
            "scrub_brush",
            (0.1, 0.06, 0.035),
            mass=0.03,
            base_link_offset=(0, 0, -0.0025),
            links={"cleaning_tool_area": mf.LinkEntry(geom="sponge/cleaning_tool_area")},
            abilities={"cleaningTool": {}, "soakable": {}},
        ),
    ]
    return mf.Manifest(
        format_version=mf.FORMAT_VERSION,
        name="tiny_home",
        objects=objects,
        rooms=mf.RoomsEntry(instances={"kitchen_0": mf.RoomEntry("kitchen")}),
        source={"generator": "tests/tiny_home.py"},
    )


def write_tiny_home(folder: pathlib.Path) -> pathlib.Path:
    """Writes the home into `folder` (made where absent) and returns the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scene.xml").write_text(scene_xml())
    mf.save_manifest(home_manifest(), folder / "manifest.json")
    return folder
