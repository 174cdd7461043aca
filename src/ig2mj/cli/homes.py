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


def list_(
    only: tuple[str, ...] = (),
    json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> None:
    """List the categories that can be built: synset, size, mass, number of models.

    Args:
      only: just these categories.
      json: print JSON instead of a table.
    """
    from ig2mj.knowledge import synset

    entries = _entries(only)
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


def _entries(only: tuple[str, ...]) -> list[Entry]:
    from ig2mj_homes.catalogue import catalogue, find

    return [find(name) for name in only] if only else list(catalogue().values())


def _print_json(data: Any) -> None:
    import json

    print(json.dumps(data, indent=1))


SUBCOMMANDS: dict[str, Callable[..., int | None]] = {"build": build, "list": list_, "sheet": sheet}
