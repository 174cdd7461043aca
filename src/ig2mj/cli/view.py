"""`ig2mj view SCENE`: opens a scene in MuJoCo's viewer, or writes an image of it without a display."""

from __future__ import annotations

import pathlib
from typing import TYPE_CHECKING, Annotated

import tyro

from ig2mj.cli.common.deprecated import renamed_options
from ig2mj.cli.common.objects import AddedObjects
from ig2mj.cli.common.own_robot import NONE, Own, choose_robot
from ig2mj.cli.common.tasks import TaskOption, use_task
from ig2mj.errors import Ig2mjError
from ig2mj.process.gc_pause import GC_PAUSED

if TYPE_CHECKING:
    from ig2mj.scene.scene import Scene

Vec3 = tuple[float, float, float]

VIDEOS = (".mp4", ".gif", ".webp")
"""As `ig2mj.viewer.video.FORMATS`."""


@renamed_options({"--picture": "--image"})
def run(
    scene: Annotated[pathlib.Path | None, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")] = None,
    image: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    camera: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None,
    eye: Annotated[Vec3 | None, tyro.conf.arg(name="from", metavar="X Y Z")] = None,
    target: Annotated[Vec3 | None, tyro.conf.arg(name="at", metavar="X Y Z")] = None,
    size: Annotated[tuple[int, int], tyro.conf.arg(metavar="W H")] = (1280, 960),
    seconds: Annotated[float, tyro.conf.arg(metavar="S")] = 0.0,
    collision: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    paused: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    dump: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    video: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    pool: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="POOL.npz")] = None,
    row: int = 0,
    object: AddedObjects = (),
    robot: str | None = None,
    own: Own = NONE,
    robot_at: Annotated[Vec3, tyro.conf.arg(metavar="X Y DEGREES")] = (0.0, 0.0, 0.0),
    policy: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None,
    task: TaskOption = None,
    looks: str = "day",
) -> None:
    """Open a scene in MuJoCo's viewer, or write an image of it.

    In the window: Space pauses, Enter lists the keys.

    Args:
      scene: folder of a converted scene, its scene.xml, or the name of a home that comes with ig2mj.
      image: write this image file instead of opening a window; needs no display.
      camera: with --image: the name of the scene's camera to render from.
      eye: with --image: the position of the camera, metres.
      target: with --image: the point to look at, metres.
      size: with --image: width and height in pixels.
      seconds: simulate this many seconds first.
      collision: draw the collision geometry instead of the visual one (images only; key 3 in the window).
      paused: open the window paused.
      dump: replay the last steps of a world that became non-finite, from the file that debug mode wrote; with
        --image, render the last finite step.
      video: write the dump, or an episode of the policy, as a video (.mp4, .gif) instead of opening a window; of a
        policy also as a film strip (.png, .jpg).
      pool: page through the start states (rows) of a pool of this scene with the arrow keys; with --image, render one
        row.
      row: the row of the pool, or the policy's start state, to begin with.
      object: {object}.
      robot: a robot to add to the scene: {robots}, or a folder that `ig2mj convert robot` wrote.
      robot_at: its position (metres) and its angle from the x axis (degrees).
      policy: instead of a scene: watch a trained policy, by the name of one that ships (`ig2mj policies list`) or the
        folder of a run.
      task: the policy's task, if it is defined in a file of yours; this imports the file.
      looks: how a scene is shown: day, night, or plain (without decoration).
    """
    if policy is not None:
        from ig2mj.cli.view_policy import view_policy

        use_task(task)
        _only_policy(scene, image, dump, pool, camera, eye, target, seconds, collision, object)
        view_policy(policy, video, row, paused)
        return
    if task is not None:
        raise Ig2mjError("--task is of a policy: it needs --policy")
    if scene is None:
        raise Ig2mjError("name a scene, or a policy with --policy (`ig2mj homes list` names homes)")
    robot = choose_robot(robot, own)
    if robot is not None and (dump is not None or pool is not None):
        raise Ig2mjError("a robot cannot be combined with --dump or --pool")
    _check(image or video, camera, eye, target, size, seconds)
    if dump is not None:
        _replay(scene, object, dump, image, video, camera, eye, target, size, seconds, collision, paused)
        return
    if video is not None:
        raise Ig2mjError("--video needs --dump or --policy")
    if pool is not None:
        if seconds > 0 or object:
            raise Ig2mjError("--pool cannot be combined with --seconds and --object: a pool knows its objects")
        _page_through(scene, pool, row, image, camera, eye, target, size, collision)
        return
    if row:
        raise Ig2mjError("--row needs --pool or --policy")
    if image is not None:
        home = _with_robot(scene, object, robot, robot_at, looks)
        _write_image(home, image, camera, eye, target, size, seconds, collision)
        return
    import sys

    from ig2mj.cli.common.worlds import simulate
    from ig2mj.scene.paths import model_file
    from ig2mj.viewer.interactive import check_display

    model_file(scene)
    check_display()
    print(f"loading {scene}; the viewer opens when it is ready", file=sys.stderr, flush=True)
    with GC_PAUSED:
        from ig2mj.simulation import Simulation

        world = Simulation(_with_robot(scene, object, robot, robot_at, looks))
    simulate(lambda count: world.step(count=count), seconds, world.engine.substeps * world.engine.timestep)
    world.launch_viewer(paused=paused)


def _only_policy(scene, *others) -> None:
    if scene is not None:
        raise Ig2mjError("--policy shows the home of its task; leave SCENE out")
    if any(others):
        raise Ig2mjError("--policy can be combined only with --video, --row and --paused")


def _check(image, camera, eye, target, size, seconds) -> None:
    import math

    from ig2mj.cli.common.worlds import check_seconds

    check_seconds(seconds)
    numbers = [*(eye or ()), *(target or ())]
    if camera is not None and (eye or target):
        raise Ig2mjError("give either --camera or --from and --at")
    if (eye is None) != (target is None):
        raise Ig2mjError("--from and --at must be given together")
    if eye is not None and eye == target:
        raise Ig2mjError("--from and --at are the same point")
    if not all(math.isfinite(n) for n in numbers):
        raise Ig2mjError("--from and --at must be finite")
    if not all(1 <= n <= 8192 for n in size):
        raise Ig2mjError("--size must be between 1 and 8192 pixels")
    if image is None and (camera is not None or eye is not None):
        raise Ig2mjError("--camera, --from and --at are for --image; in the window the mouse moves the camera")
    if image is not None:
        from ig2mj.cli.common.files import check_image

        check_image(image, VIDEOS)


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


def _replay(scene, objects, dump, image, video, camera, eye, target, size, seconds, collision, paused) -> None:
    import sys

    from PIL import Image

    from ig2mj.looks import visual_of
    from ig2mj.scene.geom_groups import VISIBLE_GROUPS
    from ig2mj.scene.scene import load_scene
    from ig2mj.viewer.offscreen import render
    from ig2mj.viewer.replay import Replay

    if (image is not None and video is not None) or seconds > 0:
        raise Ig2mjError("--dump takes one of --image and --video, and no --seconds")
    if video is not None and video.suffix.lower() not in VIDEOS:
        raise Ig2mjError(f"{video}: is not a video format that can be written (use {' or '.join(VIDEOS)})")
    replay = Replay(load_scene(scene, objects=objects), dump)
    print(f"{dump}: {len(replay)} steps; {replay.note.get('text', '')}", file=sys.stderr)
    if image is None and video is None:
        replay.launch(paused=paused)
        return
    step = replay.show_last()
    view = _view(replay.scene, replay.data, camera, eye, target)
    if video is not None:
        count = replay.video(video, view, width=size[0], height=size[1])
        print(f"wrote {video} ({count} steps)", file=sys.stderr)
        return
    assert image is not None
    groups = (3,) if collision else VISIBLE_GROUPS
    visual = visual_of(replay.scene, "plain" if collision else None)
    data = visual.data(replay.scene.model, replay.data)
    pixels = render(visual.model, data, view, width=size[0], height=size[1], groups=groups)
    Image.fromarray(pixels).save(image)
    print(f"wrote {image} (step {step + 1} of {len(replay)})", file=sys.stderr)


def _page_through(scene, pool, row, image, camera, eye, target, size, collision) -> None:
    import sys

    from ig2mj.scene.geom_groups import VISIBLE_GROUPS
    from ig2mj.viewer.pool_pages import PoolPages
    from ig2mj.worlds.pool import load_pool, load_pool_scene

    loaded = load_pool_scene(pool, scene)
    rows = load_pool(pool, loaded)
    if not 0 <= row < rows.size:
        raise Ig2mjError(f"--row {row}: {pool} has rows 0 to {rows.size - 1}")
    pages = PoolPages(loaded, rows, at=row)
    if image is None:
        pages.launch()
        return
    groups = (3,) if collision else VISIBLE_GROUPS
    pages.picture(image, _view(loaded, pages.data, camera, eye, target), size=size, groups=groups)
    print(f"wrote {image} (row {row} of {rows.size})", file=sys.stderr)


def _with_robot(scene: pathlib.Path, objects: tuple[str, ...], robot: str | None, at: Vec3, looks: str) -> Scene:
    """The scene with objects, and with a robot if one is given."""
    import math

    from ig2mj.cli.common.objects import load_home

    if robot is None:
        return load_home(scene, objects, looks=looks)
    from ig2mj.agents.registry import make_robot

    return load_home(scene, objects, [make_robot(robot).at(at[0], at[1], math.radians(at[2]))], looks)


def _write_image(home, file, camera, eye, target, size, seconds, collision) -> None:
    """MuJoCo alone is enough for an image: the scene's start, `seconds` later."""
    import sys

    import mujoco
    from PIL import Image

    from ig2mj.cli.common.worlds import simulate
    from ig2mj.looks import visual_of
    from ig2mj.scene.geom_groups import VISIBLE_GROUPS
    from ig2mj.viewer.offscreen import default_backend, render

    data = home.start_data()
    step = home.model.opt.timestep
    simulate(lambda count: mujoco.mj_step(home.model, data, nstep=count), max(seconds, step) if seconds else 0.0, step)
    view = _view(home, data, camera, eye, target)
    backend = default_backend()
    groups = (3,) if collision else VISIBLE_GROUPS
    visual = visual_of(home, "plain" if collision else None)
    seen = visual.data(home.model, data)
    image = render(visual.model, seen, view, width=size[0], height=size[1], groups=groups, backend=backend)
    Image.fromarray(image).save(file)
    print(f"wrote {file} ({size[0]} x {size[1]}, rendered with {backend})", file=sys.stderr)
