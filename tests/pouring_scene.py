"""A small scene in which a fixed, tilted jug pours water into a glass, as a folder in the project's format."""

from __future__ import annotations

import pathlib

from substance_world import FLOOR, GLASS, JUG, WALL, inside, tilted, tub

from ig2mj.scene import manifest as mf


def _body(name: str, size, pos, quat=(1, 0, 0, 0), *, free: bool) -> str:
    boxes = "".join(
        f'<geom type="box" size="{" ".join(map(str, half))}" pos="{" ".join(map(str, centre))}" density="300" '
        'group="3" gap="0.003" margin="0"/>'
        for centre, half in size
    )
    joint = f'<freejoint name="{name}/free"/>' if free else ""
    at, turn = " ".join(map(str, pos)), " ".join(map(str, quat))
    return f'<body name="{name}" pos="{at}" quat="{turn}">{joint}{boxes}</body>'


def write_pouring_scene(folder: pathlib.Path, degrees: float = 110, litres: float = 0.6) -> pathlib.Path:
    """Writes it; the folder. `litres` of water in the jug."""
    folder.mkdir(parents=True, exist_ok=True)
    bodies = [
        _body("floor", FLOOR.boxes, (0, 0, 0), free=False),
        _body("jug", tub(*JUG), (0, 0, 0.5), tilted(degrees), free=False),
        _body("glass", tub(*GLASS), (0.15, 0, GLASS[2] + 2 * WALL), free=True),
    ]
    option = '<option timestep="0.008333333333333333"><flag sleep="enable"/></option>'
    text = f"<mujoco>{option}<worldbody>{''.join(bodies)}</worldbody></mujoco>"
    (folder / "scene.xml").write_text(text)

    def entry(name: str, category: str, fixed: bool, **more) -> mf.ObjectEntry:
        box = (0.1, 0.1, 0.1)
        return mf.ObjectEntry(
            name=name, category=category, model="m", bodies=[name], fixed=fixed, bounding_box=box, mass=0.3, **more
        )

    objects = [
        entry("floor", "floors", True),
        entry("jug", "carafe", True, inside=inside(*JUG), state={"volume": {"water": litres}}),
        entry("glass", "glass", False, inside=inside(*GLASS)),
    ]
    made = mf.Manifest(format_version=mf.FORMAT_VERSION, name="pouring", objects=objects, substances=["water"])
    mf.save_manifest(made, folder / "manifest.json")
    return folder
