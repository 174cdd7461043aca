"""The scene as cameras see it: a model of its own that nothing moves in, so that images cost physics nothing.

It has the scene's bodies, geoms, cameras, lights and materials with the scene's ids, no joints, and behind the last
geom a number of free *slots*: small shapes that become particles, surfaces of contents, spots, streams and flames.
"""

from __future__ import annotations

from collections.abc import Sequence

import mujoco
import numpy as np
from jaxtyping import Float, Int

from ig2mj.errors import EngineError
from ig2mj.looks.visual import decorate
from ig2mj.scene.scene import PLAIN, Scene
from ig2mj.worlds.draw import SPARE_LIGHTS

BACKGROUND = (0.86, 0.90, 0.94, 1.0)
"""rgba where nothing is hit."""

NEAR = 0.01
"""m: robots are not seen from nearer. MuJoCo's own near plane grows with the scene; a hand before the eye would be
cut."""

NOWHERE = (0.0, 0.0, -50.0)
"""Metres, world frame: where slots are that show nothing."""


SPARE_LIGHT = (0.4, 0.4, 0.38)
"""rgb of a light that is on only in some worlds."""

SPARE_DIRECTIONS = ((0.55, 0.3, -0.78), (-0.5, -0.35, -0.79))
"""Unit, world frame: of those lights."""

assert len(SPARE_DIRECTIONS) == SPARE_LIGHTS

SPARE_NAME, CAMERA_LIGHT = "ig2mj/spare_light_{}", "ig2mj/camera_light"
"""Names of those lights, and of the one whose colour is that of the light at the camera."""


def make_render_model(
    scene: Scene, slots: Sequence[mujoco.mjtGeom], cameras: Sequence[str] = (), looks: str = PLAIN, lights: bool = False
) -> mujoco.MjModel:
    """Compiles the render model; behind the scene's geoms come those of its looks (`ig2mj.looks`), then the slots.

    Args:
      slots: types of their geoms.
      cameras: names of cameras that are added behind the scene's own, for poses that are given with each image.
      lights: adds `SPARE_LIGHTS`, and one more whose colour is that of the light at the camera. A model's lights are in
        the order of their bodies, so that lamps come behind these (`drawn_lights`).

    Raises:
      EngineError: the scene on disk is no longer the one that was loaded.
    """
    spec = scene.spec()
    for elements in (spec.keys, spec.equalities, spec.actuators, spec.sensors, spec.tendons, spec.excludes, spec.pairs):
        for element in list(elements):
            spec.delete(element)
    for joint in list(spec.joints):
        spec.delete(joint)
    decorate(spec, scene, looks, fine=False)
    body = spec.worldbody.add_body(name="ig2mj/particles")
    for k, kind in enumerate(slots):
        body.add_geom(
            name=f"ig2mj/particle_{k}",
            type=kind,
            size=[0.01, 0.01, 0.01],
            pos=list(NOWHERE),
            contype=0,
            conaffinity=0,
            group=0,
        )
    for name in cameras:
        body.add_camera(name=name)
    added = [
        *((SPARE_NAME.format(k), axis) for k, axis in enumerate(SPARE_DIRECTIONS)),
        (CAMERA_LIGHT, (0.0, 0.0, -1.0)),
    ]
    for name, direction in added if lights else ():
        spec.worldbody.add_light(
            name=name,
            type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
            dir=list(direction),
            diffuse=list(SPARE_LIGHT),
            specular=[0.1] * 3,
            ambient=[0.0] * 3,
            castshadow=False,
        )
    model = spec.compile()
    known = scene.model
    if model.ngeom < known.ngeom + len(slots) or (model.geom_bodyid[: known.ngeom] != known.geom_bodyid).any():
        raise EngineError(f"scene '{scene.name}' in {scene.folder} changed since it was loaded (load it again)")
    return model


def drawn_lights(host: mujoco.MjModel, scene: mujoco.MjModel) -> Int[np.ndarray, "L"]:
    """For each light of a scene's render model, which of what is drawn for lights (`ig2mj.worlds.draw.Draw`) is its.

    A light that looks add shares the draw of the scene's first light, or that of the light at the camera where the
    scene has none. A body's own lights come before those that looks add to it.
    """
    found, own = np.full(host.nlight, 1 if scene.nlight else 0), 1 + np.arange(scene.nlight)
    for body in np.unique(scene.light_bodyid):
        numbers = own[scene.light_bodyid == body]
        found[np.flatnonzero(host.light_bodyid == body)[: len(numbers)]] = numbers
    for light in range(host.nlight):
        name = host.light(light).name
        if name == CAMERA_LIGHT:
            found[light] = 0
        for k in range(SPARE_LIGHTS):
            if name == SPARE_NAME.format(k):
                found[light] = 1 + scene.nlight + k
    return found


def mean_colours(model: mujoco.MjModel, geoms: Int[np.ndarray, "G"]) -> Float[np.ndarray, "G 4"]:
    """rgba (0..1) of these geoms: their own, or their material's times the mean of the material's texture."""
    rgba = np.array(model.geom_rgba[geoms], np.float32)
    material = model.geom_matid[geoms]
    for number in np.unique(material[material >= 0]):
        rgba[material == number] = _material_colour(model, int(number))
    return rgba


def _material_colour(model: mujoco.MjModel, material: int) -> Float[np.ndarray, "4"]:
    colour = np.array(model.mat_rgba[material], np.float32)
    texture = int(model.mat_texid[material, int(mujoco.mjtTextureRole.mjTEXROLE_RGB)])
    if texture >= 0 and model.tex_nchannel[texture] >= 3 and model.tex_adr[texture] >= 0:
        channels = int(model.tex_nchannel[texture])
        size = int(model.tex_height[texture] * model.tex_width[texture]) * channels
        start = int(model.tex_adr[texture])
        colour[:3] *= model.tex_data[start : start + size].reshape(-1, channels)[:, :3].mean(axis=0) / 255
    return colour
