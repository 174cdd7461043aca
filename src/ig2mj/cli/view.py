"""`ig2mj view SCENE`: opens a scene in MuJoCo's viewer, or writes a picture of it without a display."""

from __future__ import annotations

import pathlib
from typing import Annotated

import tyro

Vec3 = tuple[float, float, float]


def run(
    scene: Annotated[pathlib.Path, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")],
    picture: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    camera: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None,
    eye: Annotated[Vec3 | None, tyro.conf.arg(name="from", metavar="X Y Z")] = None,
    target: Annotated[Vec3 | None, tyro.conf.arg(name="at", metavar="X Y Z")] = None,
    size: Annotated[tuple[int, int], tyro.conf.arg(metavar="W H")] = (1280, 960),
    seconds: Annotated[float, tyro.conf.arg(metavar="S")] = 0.0,
    collision: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    paused: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> None:
    """Open a scene in MuJoCo's viewer, or write a picture of it.

    In the window: Space pauses, Enter lists the keys.

    Args:
      scene: folder of a converted scene, its scene.xml, or the name of a home that comes with ig2mj.
      picture: write this picture file instead of opening a window; needs no display.
      camera: picture: from this camera of the scene.
      eye: picture: from this point (metres).
      target: picture: towards this point (metres).
      size: picture: width and height in pixels.
      seconds: let this much time pass before the picture or the window.
      collision: draw the collision geometry instead of the visual one (picture only; key 3 in the window).
      paused: open the window paused.
    """
    _check(picture, camera, eye, target, size, seconds)
    if picture is not None:
        _write_picture(scene, picture, camera, eye, target, size, seconds, collision)
        return
    from ig2mj.simulation import Simulation

    world = Simulation(scene)
    if seconds > 0:
        world.step(count=round(seconds * 30))
    world.launch_viewer(paused=paused)


def _check(picture, camera, eye, target, size, seconds) -> None:
    import math

    from ig2mj.errors import Ig2mjError

    numbers = [*(eye or ()), *(target or ()), seconds]
    if camera is not None and (eye or target):
        raise Ig2mjError("give either --camera or --from and --at")
    if (eye is None) != (target is None):
        raise Ig2mjError("--from and --at belong together")
    if eye is not None and eye == target:
        raise Ig2mjError("--from and --at are the same point")
    if not all(math.isfinite(n) for n in numbers) or seconds < 0:
        raise Ig2mjError("--from, --at and --seconds must be finite, and --seconds not negative")
    if not all(1 <= n <= 8192 for n in size):
        raise Ig2mjError("--size must be between 1 and 8192 pixels")
    if picture is None and (camera is not None or eye is not None):
        raise Ig2mjError("--camera, --from and --at are for --picture; in the window the mouse moves the camera")
    if picture is not None:
        from PIL import Image

        if picture.suffix.lower() not in Image.registered_extensions():
            raise Ig2mjError(f"{picture}: is no kind of picture that can be written (use .png or .jpg)")
        if not picture.parent.is_dir():
            raise Ig2mjError(f"{picture}: the folder {picture.parent} does not exist")


def _view(home, data, camera: str | None, eye: Vec3 | None, target: Vec3 | None):
    """A camera's name, or a free view: from a point, or of the whole scene."""
    import math

    from ig2mj.viewer.offscreen import FreeView
    from ig2mj.viewer.overview import home_overview

    if camera is not None:
        return camera
    if eye is None or target is None:
        return home_overview(home, data)
    dx, dy, dz = (t - e for t, e in zip(target, eye, strict=True))
    flat = math.hypot(dx, dy)
    return FreeView(
        lookat=target,
        distance=math.hypot(flat, dz),
        azimuth=math.degrees(math.atan2(dy, dx)) if flat > 0 else 90.0,
        elevation=math.degrees(math.atan2(dz, flat)),
    )


def _write_picture(scene, file, camera, eye, target, size, seconds, collision) -> None:
    """MuJoCo alone is enough for a picture: the scene's start, `seconds` later."""
    import sys

    import mujoco
    from PIL import Image

    from ig2mj.scene.scene import load_scene
    from ig2mj.viewer.offscreen import VISIBLE_GROUPS, default_backend, render

    home = load_scene(scene)
    data = mujoco.MjData(home.model)
    if home.model.nkey:
        mujoco.mj_resetDataKeyframe(home.model, data, 0)
    mujoco.mj_forward(home.model, data)
    if seconds > 0:
        mujoco.mj_step(home.model, data, nstep=max(1, round(seconds / home.model.opt.timestep)))
    view = _view(home, data, camera, eye, target)
    backend = default_backend()
    groups = (3,) if collision else VISIBLE_GROUPS
    image = render(home.model, data, view, width=size[0], height=size[1], groups=groups, backend=backend)
    Image.fromarray(image).save(file)
    print(f"wrote {file} ({size[0]} x {size[1]}, drawn with {backend})", file=sys.stderr)
