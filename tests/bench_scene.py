"""The smallest scene that has one of everything engines differ in: a table, objects on it, a blade, a weld, a hand.

`write_bench(folder)` writes it in the project's own format, `add_pusher` is its agent. World frame, metres; the table's
top is z = 0.4. Every shape is a box or a sphere, so that the JAX engine can run it too.
"""

from __future__ import annotations

import pathlib

import mujoco

from ig2mj.scene import manifest as mf

TOP = 0.4
"""Height of the table's surface."""

HALF = 0.05
"""Half edge of the box."""

COLLISION = 'group="3" friction="0.25 0.005 0.0001" gap="0.003" margin="0"'

HAND_START = (0.0, 0.0, 0.8)


def bench_xml(
    small: bool = False, cone: str = "pyramidal", integrator: str = "implicitfast", sleep: str = "enable"
) -> str:
    """The MJCF text with the flags asked for. `small`: only table, box and knife."""
    lid = f"""<body name="box_lid" pos="-0.35 0 {TOP + 0.03}">
      <freejoint name="box_lid/free"/>
      <geom name="box_lid/collision_0" type="box" size="0.04 0.04 0.03" density="500" {COLLISION}/>
    </body>
    <body name="hatch" pos="0 0.8 0.3">
      <body name="hatch_flap" pos="0 0 0">
        <joint name="hatch_hinge" type="hinge" axis="0 0 1" range="0 1.5" limited="true" damping="0.05"/>
        <geom name="hatch_flap/collision_0" type="box" size="0.1 0.01 0.1" pos="0.1 0 0" density="300" {COLLISION}/>
      </body>
    </body>"""
    return f"""<mujoco model="bench">
  <compiler angle="radian" inertiagrouprange="3 3"/>
  <option timestep="{1 / 120!r}" gravity="0 0 -9.8" cone="{cone}" integrator="{integrator}">
    <flag sleep="{sleep}"/>
  </option>
  <worldbody>
    <light pos="0 0 3" dir="0 0 -1"/>
    <camera name="front" pos="0 -1.2 0.9" xyaxes="1 0 0 0 0.5 1" fovy="50"/>
    <body name="table" pos="0 0 0.35">
      <geom name="table/collision_0" type="box" size="0.6 0.4 0.05" {COLLISION}/>
      <geom name="table/visual_0" type="box" size="0.6 0.4 0.05" contype="0" conaffinity="0" group="0" mass="0"/>
    </body>
    <body name="box" pos="0 0 {TOP + HALF}">
      <freejoint name="box/free"/>
      <geom name="box/collision_0" type="box" size="0.05 0.05 0.05" density="500" {COLLISION}/>
      <geom name="box/visual_0" type="box" size="0.05 0.05 0.05" contype="0" conaffinity="0" group="0" mass="0"/>
    </body>
    <body name="knife" pos="0.3 0 {TOP + 0.02}">
      <freejoint name="knife/free"/>
      <geom name="knife/slicer" type="box" size="0.08 0.02 0.02" density="800" {COLLISION}/>
      <geom name="knife/visual_0" type="box" size="0.08 0.02 0.02" contype="0" conaffinity="0" group="0" mass="0"/>
    </body>
    {"" if small else lid}
  </worldbody>
  <equality><weld name="knife/box" body1="knife" body2="box" relpose="-0.3 0 0.1 1 0 0 0" active="false"/></equality>
</mujoco>
"""


def bench_manifest(small: bool = False) -> mf.Manifest:
    """The manifest that belongs to `bench_xml`."""
    food = {"cook_temperature": 70.0}

    def entry(name: str, category: str, size: tuple[float, float, float], **more) -> mf.ObjectEntry:
        more.setdefault("bodies", [name])
        more.setdefault("fixed", False)
        return mf.ObjectEntry(name=name, category=category, model="bench", bounding_box=size, mass=0.5, **more)

    objects = [
        entry("table", "table", (1.2, 0.8, 0.1), fixed=True, abilities={"dustyable": {}}),
        entry(
            "box",
            "carton",
            (0.1, 0.1, 0.1),
            bodies=["box"] if small else ["box", "box_lid"],
            abilities={"cookable": food, "burnable": {"burn_temperature": 200.0}, "freezable": {}, "soakable": {}},
        ),
        entry(
            "knife",
            "carving_knife",
            (0.16, 0.04, 0.04),
            links={"slicer": mf.LinkEntry(geom="knife/slicer")},
            abilities={"slicer": {}},
        ),
        entry(
            "hatch",
            "door",
            (0.2, 0.02, 0.2),
            fixed=True,
            bodies=["hatch", "hatch_flap"],
            joints=[mf.JointEntry("hatch_hinge", "hinge", (0.0, 1.5))],
            openable=[mf.OpenableEntry("hatch_hinge", 0.0, 1.5)],
            abilities={"openable": {}},
        ),
    ]
    return mf.Manifest(format_version=mf.FORMAT_VERSION, name="bench", objects=objects[:3] if small else objects)


def write_bench(folder: pathlib.Path, small: bool = False, **flags: str) -> pathlib.Path:
    """Writes the scene into `folder` (made where absent) and returns the folder; `flags` go to `bench_xml`."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scene.xml").write_text(bench_xml(small, **flags))
    mf.save_manifest(bench_manifest(small), folder / "manifest.json")
    return folder


def add_pusher(spec: mujoco.MjSpec) -> mf.AgentEntry:
    """A ball on three driven slides, with a camera, and an inactive weld to the box and one to the knife.

    Controls [3]: metres from `HAND_START` along x, y and z.
    """
    palm = spec.worldbody.add_body(name="hand", pos=list(HAND_START), gravcomp=1)
    for axis, letter in zip(([1, 0, 0], [0, 1, 0], [0, 0, 1]), "xyz", strict=True):
        palm.add_joint(name=f"hand_{letter}", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    palm.add_geom(
        name="hand/collision_0",
        type=mujoco.mjtGeom.mjGEOM_SPHERE,
        size=[0.04, 0, 0],
        mass=1.0,
        friction=[1.0, 0.005, 0.0001],
        gap=0.003,
        group=3,
    )
    palm.add_camera(name="hand/eye", pos=[0, -0.1, 0.1], fovy=70.0)
    for letter in "xyz":
        servo = spec.add_actuator(
            name=f"hand_{letter}",
            target=f"hand_{letter}",
            trntype=mujoco.mjtTrn.mjTRN_JOINT,
            forcelimited=mujoco.mjtLimited.mjLIMITED_TRUE,
            forcerange=[-300, 300],
        )
        servo.set_to_position(kp=1000.0, dampratio=1.0)
    for held in ("box", "knife"):
        weld = spec.add_equality(
            name=f"hand/{held}",
            type=mujoco.mjtEq.mjEQ_WELD,
            objtype=mujoco.mjtObj.mjOBJ_BODY,
            name1="hand",
            name2=held,
            active=False,
        )
        weld.data[:11] = [0, 0, 0, 0, 0, -0.1, 1, 0, 0, 0, 1.0]
    return mf.AgentEntry(name="hand", body="hand", camera="hand/eye", fingers=["hand"], hands=["hand"])
