"""`ig2mj demos video FILE` and `gallery FOLDER`: what a planner did, as videos, strips of images and a page."""

from __future__ import annotations

import pathlib
from typing import Annotated

import tyro


def video(
    file: Annotated[pathlib.Path, tyro.conf.Positional, tyro.conf.arg(metavar="FILE")],
    out: pathlib.Path,
    run: int = -1,
    speed: float = 3.0,
    rate: float = 15.0,
    size: Annotated[tuple[int, int], tyro.conf.arg(metavar="W H")] = (640, 480),
) -> int:
    """Write a run of a plan (`ig2mj solve --record FILE`) as a video; the camera follows the robot.

    Args:
      file: the recording.
      out: video (.mp4, .gif, .webp), or a strip of five images (.png, .jpg).
      run: number of the run; -1: the first that succeeds.
      speed: times real time.
      rate: images in a second.
      size: width and height of an image, pixels.
    """
    from ig2mj.cli.common.files import check_video
    from ig2mj.demos.reader import Recording
    from ig2mj.errors import Ig2mjError
    from ig2mj.process.progress import progress
    from ig2mj.showcase.film_strip import ENDINGS
    from ig2mj.showcase.recorded_plan import write_video

    if not (0 < speed < 1000 and 0 < rate <= 60) or not all(16 <= n <= 4096 for n in size):
        raise Ig2mjError("--speed is above 0, --rate above 0 and at most 60, --size from 16 to 4096 pixels")
    check_video(out, ENDINGS)
    with Recording(file) as recording, progress(f"rendering {file.name}") as report:
        number = None if run < 0 else run
        plan = write_video(recording, out, number, speed=speed, rate=rate, size=size, progress=report)
    print(f"{out}: {len(plan.steps)} primitives, {plan.seconds:.0f} s of simulated time")
    return 0


def gallery(
    files: Annotated[tuple[pathlib.Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="FILE|FOLDER")],
    out: pathlib.Path,
    images: pathlib.Path | None = None,
    jobs: int = 1,
) -> int:
    """Write a page with a strip of images for each recording of a plan that succeeds.

    Args:
      files: recordings, or folders of them.
      out: the page, a Markdown file.
      images: folder of the strips; default: images/gallery next to the page.
      jobs: processes that render, each with a home in memory.
    """
    from ig2mj.cli.common.files import check_output
    from ig2mj.cli.demos_folder import files_of
    from ig2mj.errors import Ig2mjError
    from ig2mj.process.progress import progress
    from ig2mj.showcase.recorded_plan import write_gallery

    if jobs < 1:
        raise Ig2mjError("--jobs is at least 1")
    if not files:
        raise Ig2mjError("name recordings, or folders of them (`ig2mj solve ACTIVITY --record FILE`)")
    check_output(out)
    found = [one for file in files for one in files_of(file)]
    with progress("rendering strips") as report:
        count = write_gallery(found, out, images or out.parent / "images" / "gallery", report, jobs=jobs)
    print(f"{out}: {count} of {len(found)} recordings have a success")
    return 0 if count else 1
