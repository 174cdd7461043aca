"""What robots are tried on (`ig2mj.calibration.robot_trial`): a cube and the post that it lies on, as objects."""

from __future__ import annotations

import pathlib

MASS = 0.2
"""kg of the cube."""

_URDF = """<robot name="{name}"><link name="base">
<inertial><mass value="{mass}"/><inertia ixx="{xx}" iyy="{xx}" izz="{zz}" ixy="0" ixz="0" iyz="0"/></inertial>
<visual><geometry><box size="{edge} {edge} {height}"/></geometry></visual>
<collision><geometry><box size="{edge} {edge} {height}"/></geometry></collision>
</link></robot>
"""


def make_prop(edge: float, height: float) -> pathlib.Path:
    """A folder of the cache with an upright block, m: a cube where edge and height are equal, else a post."""
    from ig2mj_converters.base.cache_folder import cache_folder
    from ig2mj_converters.base.options import ConvertOptions
    from ig2mj_converters.conversion import convert_object

    kind = "cube" if edge == height else "post"
    name = f"{kind}_{round(1000 * edge)}_{round(1000 * height)}"
    out = cache_folder("robots") / "props" / name
    file = out.with_suffix(".urdf")
    file.parent.mkdir(parents=True, exist_ok=True)
    xx, zz = MASS * (edge**2 + height**2) / 12, MASS * edge**2 / 6
    text = _URDF.format(name=name, mass=MASS, xx=xx, zz=zz, edge=edge, height=height)
    if not file.is_file() or file.read_text(encoding="utf-8") != text:
        file.write_text(text, encoding="utf-8")
    if not (out / "manifest.json").is_file():
        convert_object(file, "toy", out, options=ConvertOptions(report=False))
    return out
