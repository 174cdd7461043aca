"""An object of one's own for tests: a cup of one cylinder, 8 cm high, its frame in its middle."""

from __future__ import annotations

import pathlib

CUP = """<robot name="cup"><link name="base_link">
<inertial><mass value="0.2"/><inertia ixx="2e-4" iyy="2e-4" izz="2e-4" ixy="0" ixz="0" iyz="0"/></inertial>
<visual><geometry><cylinder radius="0.035" length="0.08"/></geometry>
<material name="clay"><color rgba="0.75 0.3 0.15 1"/></material></visual>
<collision><geometry><cylinder radius="0.035" length="0.08"/></geometry></collision>
</link></robot>"""

HALF = 0.04
"""m: half of its height."""


def write_cup(folder: pathlib.Path, name: str = "cup", **options) -> pathlib.Path:
    """The folder `name` that `ig2mj convert object` writes for it; options of `convert_object`."""
    return write_object(folder, name, CUP, **options)


def write_object(folder: pathlib.Path, name: str, text: str, **options) -> pathlib.Path:
    """The same for the text of a URDF."""
    from ig2mj_converters.base.options import ConvertOptions
    from ig2mj_converters.conversion import convert_object

    urdf = folder / f"{name}.urdf"
    urdf.write_text(text)
    given = {"category": "mug", **options}
    convert_object(urdf, given.pop("category"), folder / name, options=ConvertOptions(report=False), **given)
    return folder / name


TABLE = """<robot name="side_table"><link name="base_link">
<visual><origin xyz="0 0 0.25"/><geometry><box size="0.4 0.6 0.5"/></geometry>
<material name="clay"><color rgba="0.3 0.45 0.6 1"/></material></visual>
<collision><origin xyz="0 0 0.25"/><geometry><box size="0.4 0.6 0.5"/></geometry></collision>
</link></robot>"""


def write_table(folder: pathlib.Path, name: str = "side_table") -> pathlib.Path:
    """The folder `name` of a fixed table, 0.5 m high, whose front looks along x."""
    return write_object(folder, name, TABLE, category="coffee_table", fixed=True)
