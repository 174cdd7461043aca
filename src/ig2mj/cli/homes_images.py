"""`ig2mj homes images`, `tour` and `sheet`: images and videos of homes, and sheets of models."""

from __future__ import annotations

import pathlib
from typing import Annotated

import tyro

from ig2mj.cli.common.homes import entries_of, shipped_homes

Flag = Annotated[bool, tyro.conf.FlagCreatePairsOff]


def sheet(
    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="PNG")],
    only: tuple[str, ...] = (),
    models: int = 1,
    seed: int = 0,
    opened: Flag = False,
    collision: Flag = False,
) -> None:
    """Render a contact sheet of models; needs OpenGL (see `ig2mj doctor`).

    Args:
      out: output image.
      only: only these categories; default: all.
      models: number of models of each category.
      seed: random seed of all variation.
      opened: show doors, drawers and lids open.
      collision: show the collision hulls instead of the visual meshes.
    """
    from ig2mj_homes.objects.catalogue import build_model
    from ig2mj_homes.sheet import contact_sheet

    from ig2mj.cli.common.files import check_image
    from ig2mj.errors import Ig2mjError
    from ig2mj.process.opengl import use_opengl

    if models < 1:
        raise Ig2mjError(f"--models {models}: at least one is needed")
    entries = entries_of(only)
    check_image(out)
    use_opengl()
    chosen = [build_model(e, k, seed) for e in entries for k in range(min(models, e.count + e.extra))]
    contact_sheet(chosen, opened=opened, collision=collision).save(out)
    print(f"{out}: {len(chosen)} model{'s' * (len(chosen) != 1)}")


def images(
    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="DIR")],
    home: tuple[str, ...] = (),
    rooms: Flag = False,
    looks: str = "day",
) -> None:
    """Render contact sheets of the homes: DIR/homes.jpg from above, and DIR/rooms_HOME.jpg of the rooms from inside.

    Args:
      out: output folder.
      home: names or folders of homes; default: all that ship with ig2mj.
      rooms: also render the rooms, one sheet per home.
      looks: "day", "night", or "plain" (without decoration).
    """
    from ig2mj.scene.scene import load_scene
    from ig2mj.viewer.home_sheet import from_above, rooms_inside

    scenes = [load_scene(name, looks=looks) for name in home or [h["home"] for h in shipped_homes()]]
    scenes.sort(key=lambda scene: scene.tables.num_objects)
    out.mkdir(parents=True, exist_ok=True)
    sheets = {"homes.jpg": from_above(scenes)}
    if rooms:
        sheets |= {f"rooms_{scene.name}.jpg": rooms_inside([scene]) for scene in scenes}
    for name, sheet in sheets.items():
        sheet.save(out / name, quality=82)
        print(out / name)


def tour(
    home: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="HOME")],
    video: Annotated[pathlib.Path, tyro.conf.arg(metavar="FILE")],
    looks: str = "day",
    size: Annotated[tuple[int, int], tyro.conf.arg(metavar="W H")] = (1280, 720),
) -> None:
    """Write a video of a walk through a home: from above, then room after room through open doors.

    Args:
      home: name or folder of a home.
      video: output file: .mp4, .gif or .webp.
      looks: "day", "night", or "plain" (without decoration).
      size: width and height in pixels.
    """
    from ig2mj.cli.common.files import check_video
    from ig2mj.cli.common.printing import add_bar, progress_bar
    from ig2mj.errors import Ig2mjError
    from ig2mj.process.opengl import use_opengl
    from ig2mj.scene.scene import load_scene
    from ig2mj.viewer.tour import film_tour

    if min(size) < 2:
        raise Ig2mjError(f"--size {size[0]} {size[1]}: at least 2 x 2 pixels")
    check_video(video)
    scene = load_scene(home, looks=looks)
    use_opengl()
    with progress_bar() as bar:
        count = film_tour(scene, video, size=size, progress=add_bar(bar, f"tour of {scene.name}"))
    print(f"{video}: {count} frames, {count / 30:.0f} s")
