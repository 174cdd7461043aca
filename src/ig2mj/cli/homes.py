"""`ig2mj homes`: builds our own dataset of household objects, lists it, and draws it."""

from __future__ import annotations

import pathlib
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any

import tyro

if TYPE_CHECKING:
    from ig2mj_homes.catalogue import Entry


def build(
    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="DATASET")],
    seed: int = 0,
    only: tuple[str, ...] = (),
    jobs: int | None = None,
    home: tuple[str, ...] = (),
    json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> None:
    """Write a dataset root in iGibson's layout: VERSION, metadata, objects and scenes.

    Args:
      out: dataset root; categories and scenes already there are replaced.
      seed: of all variation; the same seed gives the same bytes.
      only: build just these categories, and no homes unless --home names some.
      home: build just these homes, and of the objects just the categories they need.
      jobs: processes; default one per core.
      json: print what was built as JSON.
    """
    from ig2mj_homes.dataset import build_dataset
    from ig2mj_homes.shipped_homes import build_homes, categories_of, furnished
    from rich.console import Console
    from rich.progress import Progress

    if home and not only:
        only = tuple(sorted({c for name in home for c in categories_of(furnished(name, seed))}))
    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("building household objects", total=None)
        built = build_dataset(
            out,
            seed=seed,
            only=only or None,
            jobs=jobs,
            progress=lambda done, total: bar.update(task, completed=done, total=total),
        )
        homes: dict[str, int] = {}
        if home or not only:
            task = bar.add_task("furnishing homes", total=None)
            homes = build_homes(
                out, home or None, seed, lambda name, done, total: bar.update(task, completed=done, total=total)
            )
    if json:
        _print_json({"dataset": str(out), "seed": seed, "categories": built, "homes": homes})
        return
    print(f"{out}: {sum(built.values())} models of {len(built)} categories, {len(homes)} homes")
    if homes:
        print(f"convert one: ig2mj convert scene --dataset {out} --scene {next(iter(homes))} --out OUT")


def convert(
    dataset: pathlib.Path,
    out: pathlib.Path,
    home: tuple[str, ...] = (),
    jobs: int = 2,
) -> int:
    """Convert the homes of a dataset into one folder with shared meshes, as scenes_mjcf/ has them.

    Each home's checks are kept as OUT/HOME/checks.json. Exit status 1 when a check failed.

    Args:
      dataset: root that `ig2mj homes build` wrote.
      out: folder for the homes; meshes that no home uses any more are removed from it.
      home: just these homes.
      jobs: processes.
    """
    import dataclasses

    from ig2mj_converters.convert_scene import convert_scene
    from ig2mj_converters.options import ConvertOptions
    from ig2mj_homes.ship import remove_unused, strip_report, total_bytes
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    scenes = dataset / "scenes"
    names = list(home) or sorted(p.name for p in scenes.iterdir() if (p / "urdf").is_dir())
    failed: list[str] = []
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        whole = bar.add_task("homes", total=len(names))
        for name in names:
            part = bar.add_task(name, total=None)
            options = ConvertOptions(jobs=jobs, assets="..")
            options = dataclasses.replace(
                options, progress=lambda _, done, total, part=part: bar.update(part, completed=done, total=total)
            )
            convert_scene(dataset, name, out / name, options=options)
            failed += strip_report(out / name)
            bar.remove_task(part)
            bar.advance(whole)
    remove_unused(out)
    print(f"{out}: {len(names)} homes, {total_bytes(out) / 1e6:.1f} MB, {len(failed)} checks failed")
    for line in failed:
        print(f"  {line}")
    return 1 if failed else 0


def list_(
    only: tuple[str, ...] = (),
    json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> None:
    """List the homes that ship with ig2mj, and the categories that can be built: synset, size, mass, models.

    Args:
      only: just these categories, and no homes.
      json: print the categories as JSON instead of tables.
    """
    from ig2mj.knowledge import synset

    entries = _entries(only)
    if not only and not json:
        _print_homes()
    if json:
        _print_json(
            [
                {
                    "category": e.category,
                    "synset": synset(e.category),
                    "size": e.size,
                    "mass": e.mass,
                    "fixed": e.fixed,
                    "models": e.count,
                }
                for e in entries
            ]
        )
        return
    from rich.console import Console
    from rich.table import Table

    table = Table(title=f"{sum(e.count for e in entries)} models of {len(entries)} categories")
    for name in ("category", "synset", "size x y z (m)", "mass (kg)", "fixed", "models"):
        table.add_column(name, justify="left" if name in ("category", "synset") else "right")
    for e in entries:
        size = " ".join(f"{v:g}" for v in e.size)
        table.add_row(
            e.category, synset(e.category) or "-", size, f"{e.mass:g}", "yes" if e.fixed else "", str(e.count)
        )
    Console().print(table)


def sheet(
    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="PNG")],
    only: tuple[str, ...] = (),
    models: int = 1,
    seed: int = 0,
    opened: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    collision: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> None:
    """Draw a contact sheet of models; needs OpenGL (see `ig2mj doctor`).

    Args:
      out: the picture.
      only: just these categories; default all.
      models: how many models of each category.
      seed: of all variation.
      opened: with doors, drawers and lids open.
      collision: draw the collision hulls instead of the visual meshes.
    """
    from ig2mj_homes.catalogue import build_model
    from ig2mj_homes.sheet import contact_sheet

    chosen = [build_model(e, k, seed) for e in _entries(only) for k in range(min(models, e.count))]
    out.parent.mkdir(parents=True, exist_ok=True)
    contact_sheet(chosen, opened=opened, felt=collision).save(out)
    print(f"{out}: {len(chosen)} models")


def pictures(
    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="DIR")],
    home: tuple[str, ...] = (),
    rooms: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> None:
    """Draw contact sheets of the homes: DIR/homes.jpg, all from above, and DIR/rooms_HOME.jpg, their rooms from inside.

    Args:
      out: folder for the pictures.
      home: names or folders of homes; default all that ship with ig2mj.
      rooms: draw the rooms too, one sheet per home.
    """
    from ig2mj.scene.scene import load_scene
    from ig2mj.viewer.home_sheet import from_above, rooms_inside

    scenes = [load_scene(name) for name in home or [h["home"] for h in shipped_homes()]]
    scenes.sort(key=lambda scene: scene.tables.num_objects)
    out.mkdir(parents=True, exist_ok=True)
    sheets = {"homes.jpg": from_above(scenes)}
    if rooms:
        sheets |= {f"rooms_{scene.name}.jpg": rooms_inside([scene]) for scene in scenes}
    for name, sheet in sheets.items():
        sheet.save(out / name, quality=82)
        print(out / name)


def shipped_homes() -> list[dict[str, Any]]:
    """Name, rooms and number of objects (parked ones and the building not counted) of every home in scenes_mjcf/."""
    from ig2mj.scene.manifest import load_manifest
    from ig2mj.scene.scene import MANIFEST_FILE, SHIPPED_HOMES

    homes = []
    for file in sorted(SHIPPED_HOMES.glob(f"*/{MANIFEST_FILE}")):
        manifest = load_manifest(file)
        objects = [o for o in manifest.objects if not o.parked and o.category not in ("walls", "floors", "ceilings")]
        rooms = list(manifest.rooms.instances)
        loose = sum(not o.fixed for o in objects)
        homes.append({"home": file.parent.name, "rooms": rooms, "objects": len(objects), "loose": loose})
    return homes


def _print_homes() -> None:
    from rich.console import Console
    from rich.table import Table

    homes = shipped_homes()
    table = Table(title=f"{len(homes)} homes, {sum(len(h['rooms']) for h in homes)} rooms (ig2mj view HOME)")
    for name in ("home", "objects", "loose", "rooms"):
        table.add_column(name, justify="right" if name in ("objects", "loose") else "left")
    for h in sorted(homes, key=lambda h: h["objects"]):
        table.add_row(h["home"], str(h["objects"]), str(h["loose"]), ", ".join(h["rooms"]))
    Console().print(table)


def _entries(only: tuple[str, ...]) -> list[Entry]:
    from ig2mj_homes.catalogue import catalogue, find

    return [find(name) for name in only] if only else list(catalogue().values())


def _print_json(data: Any) -> None:
    import json

    print(json.dumps(data, indent=1))


SUBCOMMANDS: dict[str, Callable[..., int | None]] = {
    "build": build,
    "convert": convert,
    "list": list_,
    "pictures": pictures,
    "sheet": sheet,
}
