"""A picture of a converted robot: on the left as it looks, on the right with its parts in colours.

Base blue, wheels yellow, arms grey, fingers orange, hands' grasp points as green balls, the camera as a cyan arrow, the
laser as a red ball.
"""

from __future__ import annotations

import mujoco
import numpy as np
from PIL import Image, ImageDraw

from ig2mj.agents.urdf import UrdfRobot
from ig2mj.viewer.offscreen import FreeView, render

WIDTH, HEIGHT = 560, 560

COLOURS = {
    "base": (0.25, 0.45, 0.85),
    "wheels": (0.95, 0.8, 0.1),
    "arm": (0.62, 0.64, 0.66),
    "fingers": (0.95, 0.45, 0.1),
    "grasp point": (0.1, 0.8, 0.2),
    "camera": (0.1, 0.8, 0.9),
    "laser": (0.9, 0.1, 0.15),
}

MARK = 0.04
"""Radius of a mark, as a share of the robot's size."""


def robot_picture(robot: UrdfRobot) -> Image.Image:
    """Both views, side by side, with a legend."""
    plain, parts = _compiled(robot, marked=False), _compiled(robot, marked=True)
    sheet = Image.new("RGB", (2 * WIDTH, HEIGHT), "white")
    for place, model in enumerate((plain, parts)):
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_forward(model, data)
        low, high = _bounds(model, data)
        size = float(np.linalg.norm(high - low))
        view = FreeView(tuple((low + high) / 2), 1.25 * max(size, 0.2), azimuth=145.0, elevation=-18.0)
        sheet.paste(Image.fromarray(render(model, data, view, width=WIDTH, height=HEIGHT)), (place * WIDTH, 0))
    draw = ImageDraw.Draw(sheet)
    for row, (name, colour) in enumerate(COLOURS.items()):
        y = 10 + 18 * row
        draw.rectangle((WIDTH + 10, y, WIDTH + 22, y + 12), fill=tuple(round(255 * c) for c in colour))
        draw.text((WIDTH + 28, y), name, fill="black")
    return sheet


def _compiled(robot: UrdfRobot, marked: bool) -> mujoco.MjModel:
    """The robot alone on a floor."""
    spec = mujoco.MjSpec()
    spec.visual.headlight.ambient, spec.visual.headlight.diffuse = [0.35] * 3, [0.45] * 3
    getattr(spec.visual, "global").offwidth, getattr(spec.visual, "global").offheight = 1920, 1080
    sky = {"type": mujoco.mjtTexture.mjTEXTURE_SKYBOX, "builtin": mujoco.mjtBuiltin.mjBUILTIN_FLAT}
    spec.add_texture(name="sky", rgb1=[0.8, 0.87, 0.94], rgb2=[0.8, 0.87, 0.94], width=64, height=64, **sky)
    spec.worldbody.add_light(
        castshadow=False, type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, pos=[0, 0, 3], dir=[0.4, 0.5, -1]
    )
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[3, 3, 0.1], rgba=[0.86, 0.88, 0.9, 1])
    entry = robot.attach(spec, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    if marked:
        _mark(robot, spec, entry.laser)
    return spec.compile()


def _mark(robot: UrdfRobot, spec: mujoco.MjSpec, laser: tuple[float, float, float] | None) -> None:
    layout, frames = robot.layout, robot.description.frames
    low, high = np.zeros(3), np.zeros(3)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    low, high = _bounds(model, data)
    radius = MARK * float(np.linalg.norm(high - low)) / 2
    wheels = {robot.description.joint(name).child for name in layout.wheels}
    moved = {link for link in frames if robot.body.joints_to({frames[link].on}) & set(layout.arm)}
    for link in {frame.on for frame in frames.values()}:
        kind = "wheels" if link in wheels else "fingers" if link in robot.finger_links else "base"
        kind = "arm" if kind == "base" and link in moved else kind
        body = spec.body(robot.body_name(link))
        for geom in body.geoms:
            if geom.group <= 2:
                geom.material, geom.rgba = "", [*COLOURS[kind], 1.0]

    def ball(body: mujoco.MjsBody, pos: np.ndarray, kind: str, end: np.ndarray | None = None) -> None:
        shape = {"type": mujoco.mjtGeom.mjGEOM_SPHERE, "pos": pos, "size": [radius, 0, 0]}
        if end is not None:
            shape = {"type": mujoco.mjtGeom.mjGEOM_CAPSULE, "fromto": [*pos, *end], "size": [radius / 2, 0, 0]}
        body.add_geom(contype=0, conaffinity=0, mass=0.0, rgba=[*COLOURS[kind], 1.0], **shape)

    for hand in robot.hand_rays():
        ball(spec.body(hand.palm), np.asarray(hand.grasp_point), "grasp point")
    if layout.camera is not None:
        camera = spec.camera(f"{robot.name}/eye")
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, np.asarray(camera.quat, float))
        ahead = -turn.reshape(3, 3)[:, 2] * 5 * radius
        ball(camera.parent, np.asarray(camera.pos), "camera", np.asarray(camera.pos) + ahead)
    if laser is not None:
        ball(spec.body(robot.name), np.asarray(laser), "laser")


def _bounds(model: mujoco.MjModel, data: mujoco.MjData) -> tuple[np.ndarray, np.ndarray]:
    """Box round everything but the floor, m."""
    own = np.flatnonzero(model.geom_bodyid > 0)
    centre, reach = data.geom_xpos[own], model.geom_rbound[own][:, None]
    return (centre - 0.7 * reach).min(0), (centre + 0.7 * reach).max(0)
