"""`ig2mj demo`: the small home from its URDF source to a running scene, with a picture and a report."""

from __future__ import annotations

import pathlib
import time
from typing import Annotated

import tyro


def run(
    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="DIR")] = pathlib.Path("out/demo"),
    jobs: int = 2,
) -> int:
    """Build the small home's dataset, convert it, run it, tell what stands where.

    Leaves DIR/dataset (the source), DIR/small_home (the scene and report.html) and DIR/pictures.

    Args:
      out: folder for everything the demo makes.
      jobs: processes.
    """
    from ig2mj_homes import small_home
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
    from rich.table import Table

    from ig2mj.demos import first_home
    from ig2mj.errors import Ig2mjError

    if jobs < 1:
        raise Ig2mjError(f"--jobs {jobs}: at least one process is needed")
    start = time.perf_counter()
    console = Console()
    columns = (TextColumn("[bold]{task.description}"), BarColumn(bar_width=24), MofNCompleteColumn(),
               TimeElapsedColumn(), TextColumn("{task.fields[text]}"))  # fmt: skip
    dataset, scene = out / "dataset", out / small_home.NAME
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:

        def step(title: str):
            task = bar.add_task(title, total=None, text="")
            return lambda text, done, total: bar.update(task, completed=done, total=total, text=text)

        report = step("building the source")
        count = first_home.build_source(dataset, jobs, lambda done, total: report("", done, total))
        console.print(f"[bold]source[/]     {dataset}: {count} models, scene '{small_home.NAME}'")

        outcome = first_home.convert(dataset, small_home.NAME, scene, jobs, step("converting"))
        failed = [check for check in outcome.checks if not check.passed]
        verdict = f"{len(outcome.checks) - len(failed)} of {len(outcome.checks)} checks passed"
        console.print(f"[bold]converted[/]  {scene / 'scene.xml'}: {outcome.objects} objects, {verdict}")
        for check in failed:
            console.print(f"           check {check.name}: {check.summary}")

        began = time.perf_counter()
        world, moved = first_home.load_and_run(scene)
        seconds = time.perf_counter() - began
        console.print(f"[bold]ran[/]        {world.time:.1f} s of physics in {seconds:.1f} s, loading included; "
                      f"nothing moved more than {moved * 1000:.1f} mm")  # fmt: skip

        step("asking the predicates")("what stands where (the first time compiles)", 0, None)
        places = first_home.what_stands_where(world)
        step("taking pictures")("", 0, None)
        pictures = first_home.take_pictures(world, out / "pictures")

    table = Table(title="what stands where", title_justify="left")
    for heading in ("object", "is", "what", "room"):
        table.add_column(heading)
    for place in places:
        table.add_row(place.object, place.relation, place.support, place.room)
    console.print(table)
    for file in pictures:
        console.print(f"[bold]picture[/]    {file}")
    console.print(f"[bold]report[/]     {scene / 'report.html'}")
    console.print(f"{time.perf_counter() - start:.0f} s. Look around in it: [bold]ig2mj view {scene}[/]")
    return 1 if failed else 0
