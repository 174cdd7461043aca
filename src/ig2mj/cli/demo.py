"""`ig2mj demo`: converts the small home, simulates it, cooks a fish in it, and lets a robot cook."""

from __future__ import annotations

import contextlib
import functools
import pathlib
import time
from collections.abc import Callable
from concurrent.futures import Future
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from ig2mj.files.shell import command

if TYPE_CHECKING:
    from rich.console import Console

    from ig2mj.callbacks import ProgressCallback
    from ig2mj.showcase.expert_video import Filmed

Step = Callable[[str], "ProgressCallback"]
"""Opens a progress bar with a title."""


def run(
    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="DIR")] = pathlib.Path("out/demo"),
    jobs: int = 2,
) -> int:
    """Convert a small home, simulate it, cook a fish and freeze milk in it, and let a robot cook a steak.

    Leaves DIR/dataset (the source), DIR/small_home (the scene and report.html), DIR/images and DIR/cooking
    (temperatures as CSV, JSON and a plot, images, a video), and DIR/expert.mp4: in the shipped home birch a scripted
    expert brings a steak to the stove until it is cooked.

    Args:
      out: output folder.
      jobs: number of processes.
    """
    from ig2mj.install_hint import require_extras

    require_extras("convert", "demo")
    from ig2mj_homes.furnish import small_home

    from ig2mj.cli.common.printing import add_bar, progress_bar, stdout_console
    from ig2mj.errors import Ig2mjError
    from ig2mj.process.spawning import processes_for, worker_processes
    from ig2mj.showcase import expert_video

    if jobs < 1:
        raise Ig2mjError(f"--jobs {jobs}: at least one process is needed")
    start = time.perf_counter()
    console = stdout_console()
    scene = out / small_home.NAME
    with progress_bar() as bar:
        step = functools.partial(add_bar, bar)
        failed = _convert(console, step, small_home.NAME, out / "dataset", scene, jobs)
        with contextlib.ExitStack() as stack:
            film = out / "expert.mp4"
            watched = None
            if jobs > 1 and processes_for(2) > 1:
                watched = stack.enter_context(worker_processes(1, ctrl_c=True)).submit(expert_video.film, film)
            _look(console, step, scene, out / "images")
            failed += _cook(console, step, scene, out / "cooking")
            failed += _watch_expert(console, step, film, watched)
    console.print(f"{time.perf_counter() - start:.0f} s. Look around in it: [bold]{command('view', scene)}[/]")
    return 1 if failed else 0


def _convert(console: Console, step: Step, name: str, dataset: pathlib.Path, scene: pathlib.Path, jobs: int) -> int:
    """Builds the home's dataset, converts it with checks and a report; number of failed checks."""
    from ig2mj_converters.base.options import ConvertOptions
    from ig2mj_converters.conversion import convert_scene
    from ig2mj_homes.dataset.material_library import write_material_library
    from ig2mj_homes.dataset.root import write_models
    from ig2mj_homes.furnish import small_home

    from ig2mj.viewer.offscreen import FreeView, render

    step("building the source")(0, None, "")
    needed = small_home.models()
    write_models(dataset, needed)
    write_material_library(dataset)
    small_home.build(dataset)
    console.print(f"[bold]source[/]     {dataset}: {sum(map(len, needed.values()))} models, scene '{name}'")

    options = ConvertOptions(jobs=jobs, renderer=render, view=FreeView, progress=step("converting"))
    outcome = convert_scene(dataset, name, scene, options=options)
    failed = [check for check in outcome.checks if not check.passed]
    summary = f"{len(outcome.checks) - len(failed)} of {len(outcome.checks)} checks passed"
    cached = " (nothing has changed: taken from the cache)" if outcome.cached else ""
    console.print(f"[bold]converted[/]  {scene / 'scene.xml'}: {outcome.objects} objects, {summary}{cached}")
    for check in failed:
        console.print(f"           check {check.name}: {check.summary}")
    console.print(f"[bold]report[/]     {scene / 'report.html'}")
    return len(failed)


def _look(console: Console, step: Step, scene: pathlib.Path, folder: pathlib.Path) -> None:
    """Simulates the home for two seconds, lists its objects, renders images."""
    from ig2mj.cli.common.printing import make_table
    from ig2mj.showcase import first_home

    began = time.perf_counter()
    world, moved = first_home.load_and_run(scene)
    seconds = time.perf_counter() - began
    console.print(f"[bold]ran[/]        {world.time:.1f} s of physics in {seconds:.1f} s, loading included; "
                  f"nothing moved more than {moved * 1000:.1f} mm")  # fmt: skip
    step("taking images")(0, None, "")
    images = first_home.take_images(world, folder)
    step("asking the predicates")(0, None, "what stands where (the first time compiles)")
    places = first_home.what_stands_where(world)
    rows = [(place.object, place.relation, place.support, place.room) for place in places]
    console.print(make_table("what stands where", ("object", "is", "what", "room"), rows))
    for file in images:
        console.print(f"[bold]image[/]    {file}")


def _cook(console: Console, step: Step, scene: pathlib.Path, folder: pathlib.Path) -> int:
    """Cooks; writes table, plot, images and video; number of expected events that did not happen."""
    from ig2mj.process.settings import GL_INSTALL_HINT
    from ig2mj.showcase import cooking
    from ig2mj.showcase.cooking_images import KitchenCameras, MomentSheet
    from ig2mj.showcase.cooking_plot import plot
    from ig2mj.showcase.cooking_video import CookingVideo
    from ig2mj.showcase.kitchen import enter_kitchen
    from ig2mj.viewer.offscreen import default_backend

    report = step("cooking")
    report(0, None, "compiling the states")
    world, kitchen = enter_kitchen(scene)
    folder.mkdir(parents=True, exist_ok=True)
    cameras = KitchenCameras(world, kitchen)
    sheet = MomentSheet(cameras, kitchen)
    filmed = default_backend() != "warp"  # its images take seconds
    video = CookingVideo(folder / "cooking.mp4", cameras, kitchen) if filmed else None

    def watch(log: Any, changed: Any) -> None:
        if video:
            video.see(log)
        sheet.see(f"{log.times[-1]:.1f} s", changed if log.steps else None)
        report(log.steps, None, f"{log.times[-1]:.0f} s" + (f", {changed[-1]}" if changed else ""))

    began = time.perf_counter()
    try:
        log = cooking.cook(world, kitchen, watch)
    finally:
        if video:
            video.close()
    log.write_csv(folder / "temperatures.csv")
    log.write_json(folder / "temperatures.json")
    plot(log, kitchen, folder / "temperatures.png")
    sheet.write(folder / "moments.png")
    seconds = time.perf_counter() - began
    console.print(log.table())
    console.print(
        f"[bold]cooked[/]     {log.times[-1] - log.times[0]:.1f} s of the kitchen in {seconds:.1f} s, images included"
    )
    for word, name in (("numbers", "temperatures.csv"), ("numbers", "temperatures.json"), ("plot", "temperatures.png"),
                       ("images", "moments.png"), *([("video", "cooking.mp4")] if filmed else [])):  # fmt: skip
        console.print(f"[bold]{word:<10}[/] {folder / name}")
    if not filmed:
        console.print(f"[bold]video[/]      none: it needs OpenGL ({GL_INSTALL_HINT})")
    absent = cooking.missing(log, kitchen)
    for what in absent:
        console.print(f"           did not happen: {what}")
    return len(absent)


def _watch_expert(console: Console, step: Step, file: pathlib.Path, watched: Future[Filmed] | None) -> int:
    """The video of an expert, which another process may be writing; 1 if the steak is not cooked in the end."""
    from ig2mj.process.settings import GL_INSTALL_HINT
    from ig2mj.showcase import expert_video

    report = step("a robot cooks")
    report(0, None, "")
    filmed = watched.result() if watched is not None else expert_video.film(file, report)
    ending = "cooks the steak" if filmed.cooked else "does not cook the steak"
    console.print(f"[bold]expert[/]     the humanoid {ending} in {filmed.seconds:.1f} s")
    console.print(f"[bold]video[/]      {file if filmed.video else f'none: it needs OpenGL ({GL_INSTALL_HINT})'}")
    return 0 if filmed.cooked else 1
