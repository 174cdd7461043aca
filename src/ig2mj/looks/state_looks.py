"""What states change in the looks of a home: tinted materials of objects, and light of lamps that are on.

A renderer multiplies a geom's colour into its texture, which cannot mix a colour in. So a decorated home has, for each
textured material of an object that can be frozen, burnt and so on, further materials in these tints, between which
renderers switch per world.

Axes: T states, G geoms.
"""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
from jaxtyping import Int

from ig2mj.scene.geom_groups import VISIBLE_GROUPS
from ig2mj.scene.scene import Scene

RGB = mujoco.mjtTextureRole.mjTEXROLE_RGB


@dataclasses.dataclass(frozen=True)
class Mixture:
    """(1 - weight) x the object's colour + weight x `colour`, all times `brightness`; colour is 0..1.

    Attributes: ability: of objects that can be in the state.
    """

    ability: str
    weight: float
    colour: tuple[float, float, float] = (0.0, 0.0, 0.0)
    brightness: float = 1.0

    def of(self, rgb: np.ndarray) -> np.ndarray:
        """Colours (0..1) in this tint."""
        return np.clip(((1 - self.weight) * rgb + self.weight * np.asarray(self.colour)) * self.brightness, 0, 1)


MIXTURES = {
    "frozen": Mixture("freezable", 0.8, (1.0, 1.0, 1.0)),
    "burnt": Mixture("burnable", 0.8, (0.0, 0.0, 0.0)),
    "cooked": Mixture("cookable", 0.5, (139 / 255, 69 / 255, 19 / 255)),
    "soaked": Mixture("soakable", 0.5, (0.0, 0.0, 200 / 255)),
    "toggled_on": Mixture("toggleable", 0.0, brightness=1.5),
}
"""State -> how it tints an object, as iGibson tints textures; of those that are true the first is shown."""

LAMP_WORD, LAMP_COLOUR, LAMP_REACH, MOST_LAMPS = "lamp", (0.62, 0.48, 0.30), (1.0, 0.0, 1.1), 4
"""In the category of what gives light when it is on; rgb of that light; its attenuation (constant, linear and
quadratic, per metre); of a home, since OpenGL has eight lights."""

LAMP = "ig2mj/lamp/"
"""How names of their lights begin."""

OF_MATERIAL = (0.5, 0.5, 0.5, 1.0)
"""rgba with which a geom has the colour of its material."""

BELOW_TOP = 0.12
"""m from the top of a lamp to its bulb."""


def add_tinted_materials(spec: mujoco.MjSpec, scene: Scene) -> None:
    """Adds to a spec, which is not compiled yet, the materials between which `tinted_materials` switches."""
    model, owner = scene.model, scene.tables.geom_object
    abilities = [entry.abilities for entry in scene.manifest.objects]
    made: set[tuple[str, int]] = set()
    for geom in np.flatnonzero((owner >= 0) & np.isin(model.geom_group, VISIBLE_GROUPS) & (model.geom_matid >= 0)):
        material = int(model.geom_matid[geom])
        texture = int(model.mat_texid[material, int(RGB)])
        if texture < 0 or model.tex_type[texture] != mujoco.mjtTexture.mjTEXTURE_2D or model.tex_nchannel[texture] < 3:
            continue
        for state, mixture in MIXTURES.items():
            if mixture.ability in abilities[owner[geom]] and (state, material) not in made:
                made.add((state, material))
                _add(spec, model, state, mixture, material, texture)


def _add(spec: mujoco.MjSpec, model: mujoco.MjModel, state: str, mixture: Mixture, material: int, texture: int) -> None:
    name, plain = _name(state, model.material(material).name), spec.material(model.material(material).name)
    channels, start = int(model.tex_nchannel[texture]), int(model.tex_adr[texture])
    height, width = int(model.tex_height[texture]), int(model.tex_width[texture])
    texels = model.tex_data[start : start + height * width * channels].reshape(-1, channels)[:, :3] / 255.0
    colour = np.array(model.mat_rgba[material], float)
    made = spec.add_texture(
        name=name,
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        colorspace=mujoco.mjtColorSpace(int(model.tex_colorspace[texture])),
        width=width,
        height=height,
        nchannel=3,
    )
    made.data = np.round(255 * mixture.of(texels * colour[:3])).astype(np.uint8).tobytes()
    values = {key: getattr(plain, key) for key in ("specular", "shininess", "reflectance", "emission", "texuniform")}
    copy = spec.add_material(name=name, rgba=[1.0, 1.0, 1.0, colour[3]], texrepeat=plain.texrepeat, **values)
    copy.textures[RGB] = name


def _name(state: str, material: str) -> str:
    return f"ig2mj/{state}/{material}"


def tinted_materials(model: mujoco.MjModel, states: tuple[str, ...]) -> Int[np.ndarray, "T G"]:
    """Material of each geom in the tint of each of these states; -1 where it has none, and shows its mean colour."""
    known = {model.material(k).name: k for k in range(model.nmat)}
    names = [model.material(k).name if k >= 0 else "" for k in model.geom_matid]
    return np.array([[known.get(_name(state, name), -1) for name in names] for state in states], np.int32)


def add_lamps(spec: mujoco.MjSpec, scene: Scene) -> None:
    """Adds a light to each lamp that can be switched on; renderers switch it on."""
    lamps = [e for e in scene.manifest.objects if LAMP_WORD in e.category and "toggleable" in e.abilities]
    for entry in lamps[:MOST_LAMPS]:
        middle, size = entry.base_link_offset, entry.bounding_box
        spec.body(entry.bodies[0]).add_light(
            name=f"{LAMP}{entry.name}",
            type=mujoco.mjtLightType.mjLIGHT_SPOT,  # to all sides: MuJoCo's OpenGL has no lights of the type point
            cutoff=180.0,
            exponent=0.0,
            pos=[middle[0], middle[1], middle[2] + size[2] / 2 - BELOW_TOP],
            diffuse=LAMP_COLOUR,
            ambient=[0.0] * 3,
            specular=[0.0] * 3,
            attenuation=LAMP_REACH,
            castshadow=False,
            active=False,
        )


def lamp_lights(model: mujoco.MjModel) -> list[int]:
    """Numbers of the lights of lamps in a model of a decorated home."""
    return [k for k in range(model.nlight) if model.light(k).name.startswith(LAMP)]


def lamp_geoms(model: mujoco.MjModel) -> list[tuple[int, int]]:
    """The lights of lamps, each with a geom of its lamp."""
    return [(k, int(model.body_geomadr[model.light_bodyid[k]])) for k in lamp_lights(model)]
