"""The tiny dataset's house: a plain scene file and a cached BEHAVIOR scene with a sliced apple.

The house spans x in [-2, 2], y in [-1.5, 1.5] m, floor top at z = 0; a wall at x = 0 with a door hole (y in
[-0.5, 0.5], up to 2 m) parts the kitchen (x < 0) from the bedroom.
"""

from __future__ import annotations

import json
import math
import pathlib
from xml.sax.saxutils import quoteattr

import numpy as np
from PIL import Image
from tiny_geometry import box, number_text, write_obj

SCENE = "tiny_int"
TASK_FILE = f"{SCENE}_task_slicing_fruit_0_7_fixed_furniture"


def instance_xml(
    name: str, category: str, model: str, xyz, *, fixed: bool = True, yaw: float = 0.0, rooms: str = "", **attributes
) -> str:
    """One `<link>` of a scene file and its joint."""
    extra = "".join(f" {key}={quoteattr(value)}" for key, value in attributes.items())
    room = f' room="{rooms}"' if rooms else ""
    joint = f'<joint name="j_{name}" type="{"fixed" if fixed else "floating"}">'
    joint += f'<origin xyz="{number_text(xyz)}" rpy="0 0 {yaw}"/><child link="{name}"/><parent link="world"/></joint>'
    return f'<link name="{name}" category="{category}" model="{model}"{room}{extra}/>{joint}'


def scene_xml(*instances: str) -> str:
    """A scene file: world, building parts, instances."""
    parts = "".join(instance_xml(part, part, SCENE, (0, 0, 0)) for part in ("walls", "floors", "ceilings"))
    return f'<robot name="igibson_scene"><link name="world"/>{parts}{"".join(instances)}</robot>\n'


def furniture() -> list[str]:
    """The pieces of furniture that every scene file of the house holds."""
    return [
        instance_xml(
            "bottom_cabinet_0", "bottom_cabinet", "cab0", (-1.6, 1.0, 0.41), rooms="kitchen_0",
            bounding_box="0.61 0.5 0.8",
        ),
        instance_xml("fridge_0", "fridge", "fr0", (-1.6, -1.1, 0.9), rooms="kitchen_0", bounding_box="0.6 0.72 1.76"),
        instance_xml("stove_0", "stove", "st0", (-0.8, 1.1, 0.451), rooms="kitchen_0", bounding_box="0.6 0.6 0.9"),
        instance_xml("sink_0", "sink", "si0", (-0.8, -1.2, 0.601), rooms="kitchen_0", bounding_box="0.6 0.5 0.4"),
        instance_xml(
            "breakfast_table_0", "breakfast_table", "tab0", (-1.0, 0.0, 0.351), rooms="kitchen_0", yaw=math.pi / 2,
            fixed=False, bounding_box="1.0 0.8 0.7",
        ),
        instance_xml("bed_0", "bed", "bed0", (1.0, 0.6, 0.251), rooms="bedroom_0", bounding_box="2.0 1.4 0.5"),
    ]  # fmt: skip


def write_house(folder: pathlib.Path) -> None:
    urdf = folder / "urdf"
    urdf.mkdir(parents=True)
    _write_building(folder)
    loose = [
        instance_xml("apple_0", "apple", "ap0", (-1.0, 0.2, 0.745), fixed=False, rooms="kitchen_0", scale="1 1 1"),
        instance_xml("knife-kn0-0", "carving_knife", "kn0", (-1.0, -0.2, 0.75), fixed=False, rooms="kitchen_0"),
    ]
    (urdf / f"{SCENE}_best.urdf").write_text(scene_xml(*furniture(), *loose))
    (urdf / f"{TASK_FILE}.urdf").write_text(scene_xml(*furniture(), *cached_instances()))
    layout, misc = folder / "layout", folder / "misc"
    layout.mkdir()
    misc.mkdir()
    (misc / "bbox_overlap.json").write_text(json.dumps([["apple_0", "breakfast_table_0"]]))
    semantic, instances = np.zeros((400, 400), np.uint8), np.zeros((400, 400), np.uint8)
    semantic[50:350, 0:195], instances[50:350, 0:195] = 3, 1
    semantic[50:350, 205:400], instances[50:350, 205:400] = 2, 2
    free = np.where(semantic > 0, 255, 0).astype(np.uint8)
    for name, image in (("semseg", semantic), ("insseg", instances), ("trav", free), ("trav_no_obj", free)):
        Image.fromarray(image).save(layout / f"floor_{name}_0.png")


def cached_instances() -> list[str]:
    """A sliced apple with states, dust and stains, a knife, an agent: what a cached BEHAVIOR scene adds."""
    stain = {"dirt_dump": [None] * 20, "random_bbox_dims": [[0.01, 0.02, 0.004]] * 20}
    whole_states = {
        "Temperature": 23.0, "MaxTemperature": -math.inf, "Sliced": True, "Soaked": False, "Cooked": None
    }  # fmt: skip
    half_states = {"Temperature": [60.0, 61.0], "MaxTemperature": [75.5, 76.5], "Sliced": [True, True]}
    multiplexer = {"current_index": 1, "sub_states": [whole_states, half_states]}
    offsets = [[[0.001, 0, 0], [0, 0, 0, 1]], [[-0.001, 0, 0], [0, 0, 1, 0]]]
    sink_states = {
        "ToggledOn": {"value": True, "hand_in_marker_steps": 2},
        "WaterSource": {
            "sizes": [[0.02] * 3], "colors": [[0, 0, 1]], "steps_since_last_drop_step": math.inf,
            "particle_poses": [None, [[-0.8, -1.1, 0.9], [0, 0, 0, 1]]],
        },
    }  # fmt: skip
    cached = [
        instance_xml(
            "apple_7", "apple", "ap0", (-100, -100, -100), fixed=False, scale="1 1 1", multiplexer="apple_7_multiplexer"
        ),
        instance_xml(
            "apple_7_part_0", "half_apple", "hap0", (-0.98, 0.2, 0.745), fixed=False, scale="1 1 1",
            grouper="apple_7_multiplexer_grouper",
        ),
        instance_xml(
            "apple_7_part_1", "half_apple", "hap0", (-1.06, 0.2, 0.745), fixed=False, scale="1 1 1", yaw=math.pi,
            grouper="apple_7_multiplexer_grouper",
        ),
        instance_xml(
            "apple_7_multiplexer_grouper", "grouper", "grouper", (0, 0, 0), multiplexer="apple_7_multiplexer",
            pose_offsets=json.dumps(offsets),
        ),
        instance_xml(
            "apple_7_multiplexer", "multiplexer", "multiplexer", (0, 0, 0), current_index="1",
            object_scope="apple.n.01_1", states=json.dumps(multiplexer),
        ),
        instance_xml(
            "carving_knife_3", "carving_knife", "kn0", (-1.0, -0.2, 0.725), fixed=False, object_scope="knife.n.01_1",
            scale="1 1 1", states=json.dumps({"Soaked": True, "Temperature": 30.5}),
        ),
        instance_xml(
            "agent", "agent", "BehaviorRobot", (1.0, -0.8, 1.0), fixed=False, object_scope="agent.n.01_1",
        ),
        instance_xml(
            "sink_9", "sink", "si0", (1.6, -1.2, 0.601), rooms="bedroom_0", bounding_box="0.6 0.5 0.4",
            object_scope="sink.n.01_1", states=json.dumps(sink_states),
        ),
        instance_xml(
            "breakfast_table_9", "breakfast_table", "tab0", (1.2, -0.6, 0.351), fixed=False, rooms="bedroom_0",
            bounding_box="1.0 0.8 0.7",
            states=json.dumps({
                "Dusty": {"particles": [
                    None,
                    ["breakfast_table_9", [1.3, -0.5, 0.702], [0, 0, 0, 1]],
                    [None, [1.0, -0.6, 0.702], [0, 0, 0, 1]],
                ]},
                "Stained": {"particles": stain},
            }),
        ),
        instance_xml(
            "bottom_cabinet_9", "bottom_cabinet", "cab0", (1.6, -0.2, 1.5), rooms="bedroom_0",
            bounding_box="0.61 0.5 0.8",
            joint_positions=json.dumps([{
                "bottom_cabinet_9_joint_0": 0.25, "bottom_cabinet_9_joint_1": 9.0, "j_bottom_cabinet_9": 0.0,
            }]),
        ),
    ]  # fmt: skip
    return cached


def _write_building(folder: pathlib.Path) -> None:
    walls = [
        box((4.2, 0.1, 2.5), (0, -1.55, 1.25)),
        box((4.2, 0.1, 2.5), (0, 1.55, 1.25)),
        box((0.1, 3.0, 2.5), (-2.05, 0, 1.25)),
        box((0.1, 3.0, 2.5), (2.05, 0, 1.25)),
        box((0.1, 1.0, 2.5), (0, -1.0, 1.25)),
        box((0.1, 1.0, 2.5), (0, 1.0, 1.25)),
        box((0.1, 1.0, 0.5), (0, 0, 2.25)),
    ]
    floors = [box((4.2, 3.2, 0.2), (0, 0, -0.1))]
    ceilings = [box((4.2, 3.2, 0.1), (0, 0, 2.55))]
    for part, meshes in (("wall", walls), ("floor", floors), ("ceiling", ceilings)):
        text = '<inertial><mass value="10000"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
        for i, mesh in enumerate(meshes):
            for kind, suffix in (("visual", "vm"), ("collision", "cm")):
                file = f"shape/{kind}/{part}_{i}_{suffix}.obj"
                write_obj(folder / file, [("", mesh)])
                text += f'<{kind}><geometry><mesh filename="{file}"/></geometry></{kind}>'
        name = f"{SCENE}_{part}s"
        (folder / "urdf" / f"{name}.urdf").write_text(
            f'<robot name="{name}"><link name="base_link">{text}</link></robot>'
        )
