"""`ig2mj homes build` and `convert`: the content that ships with ig2mj, as a dataset and as MJCF."""

from __future__ import annotations

import pathlib
from typing import TYPE_CHECKING, Annotated

import tyro

from ig2mj.files.shell import command

if TYPE_CHECKING:
    from ig2mj.callbacks import ProgressCallback

Flag = Annotated[bool, tyro.conf.FlagCreatePairsOff]

MAX_HULLS = 16
"""Convex pieces per link, at most. With 16 the volume error of every link is below 6 %."""


def build(
    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="DATASET")],
    seed: int = 0,
    only: tuple[str, ...] = (),
    jobs: int | None = None,
    home: tuple[str, ...] = (),
    json: Flag = False,
) -> None:
    """Write a dataset root in iGibson's layout: VERSION, metadata, objects and scenes.

    Args:
      out: root of the dataset; categories and scenes already there are replaced.
      seed: random seed of all variation; the same seed gives the same bytes.
      only: build only these categories, and no homes unless --home names some.
      home: build only these homes, and only the object categories they need.
      jobs: number of processes; default: one per core.
      json: print what was built as JSON.
    """
    from ig2mj_homes.dataset.root import build_dataset
    from ig2mj_homes.dataset.shipped_homes import build_homes, categories_of, furnished

    from ig2mj.cli.common.printing import add_bar, print_json, progress_bar

    if home and not only:
        only = tuple(sorted({c for name in home for c in categories_of(furnished(name, seed))}))
    with progress_bar() as bar:
        report = add_bar(bar, "building household objects")
        built = build_dataset(
            out,
            seed=seed,
            only=only or None,
            jobs=jobs,
            progress=report,
        )
        homes: dict[str, int] = {}
        if home or not only:
            homes = build_homes(out, home or None, seed, add_bar(bar, "furnishing homes"))
    if json:
        print_json({"dataset": str(out), "seed": seed, "categories": built, "homes": homes})
        return
    print(f"{out}: {sum(built.values())} models of {len(built)} categories, {len(homes)} homes")
    if homes:
        one = command("convert", "scene", "--dataset", out, "--scene", next(iter(homes)), "--out", "OUT")
        print(f"convert one: {one}")


def convert(
    dataset: pathlib.Path,
    out: pathlib.Path,
    home: tuple[str, ...] = (),
    jobs: int = 2,
    no_cache: Flag = False,
) -> int:
    """Convert a dataset's homes and the object library into one folder with shared meshes, as scenes_mjcf/ has them.

    Each home's checks are kept in OUT/HOME/checks.json, the library goes to OUT/objects/CATEGORY/MODEL. The exit
    status is 1 if a check failed.

    Args:
      dataset: dataset root written by `ig2mj homes build`.
      out: output folder; unused meshes there are removed.
      home: convert only these homes, and no objects.
      jobs: number of processes.
      no_cache: convert again what has not changed, and write nothing to the cache.
    """
    from ig2mj_converters.base.options import ConvertOptions
    from ig2mj_converters.conversion import convert_scene
    from ig2mj_homes.dataset.ship import remove_unused, strip_report, total_bytes

    from ig2mj.cli.common.printing import add_bar, progress_bar

    names = _scenes_of(dataset, home)
    failed: list[str] = []
    cached = 0
    with progress_bar() as bar:
        whole = add_bar(bar, "homes")
        for number, name in enumerate(names):
            whole(number, len(names), name)
            part = add_bar(bar, name)
            options = ConvertOptions(jobs=jobs, assets="..", cache=not no_cache, progress=part, max_hulls=MAX_HULLS)
            cached += convert_scene(dataset, name, out / name, options=options).cached
            failed += strip_report(out / name)
            bar.remove_task(bar.task_ids[-1])
        added = 0 if home else _convert_objects(dataset, out, jobs, not no_cache, add_bar(bar, "objects"), failed)
    remove_unused(out)
    kept = f" ({cached} unchanged, taken from the cache)" if cached else ""
    megabytes = total_bytes(out) / 1e6
    print(f"{out}: {len(names)} homes, {added} objects, {megabytes:.1f} MB, {len(failed)} checks failed{kept}")
    for line in failed:
        print(f"  {line}")
    return 1 if failed else 0


def _convert_objects(
    dataset: pathlib.Path,
    out: pathlib.Path,
    jobs: int,
    cache: bool,
    progress: ProgressCallback,
    failed: list[str],
) -> int:
    """Converts the object library, a model per process; adds lines of failed checks to `failed`. How many models."""
    import functools
    import json

    from ig2mj_converters.base.process_pool import TaskPool
    from ig2mj_homes.dataset.object_library import (
        FOLDER,
        PREFERRED_FILE,
        VARIANTS_FILE,
        library_models,
        preferred_models,
        split_models,
    )

    models = library_models(dataset)
    with TaskPool(jobs) as pool:
        found = pool.map(
            functools.partial(_convert_object, out / FOLDER, cache), models, [model[0] for model in models], progress
        )
    failed += [line for lines in found for line in lines]
    for file, content in ((PREFERRED_FILE, preferred_models(models)), (VARIANTS_FILE, split_models(models))):
        if content:
            text = json.dumps(content, indent=1, sort_keys=True) + "\n"
            (out / FOLDER / file).write_text(text, encoding="utf-8", newline="\n")
    return len(models)


def _convert_object(library: pathlib.Path, cache: bool, entry: tuple[str, str, pathlib.Path]) -> list[str]:
    """Converts a model of the object library: (category, model, URDF). Lines of failed checks."""
    from ig2mj_converters.base.options import ConvertOptions
    from ig2mj_converters.conversion import convert_object
    from ig2mj_homes.dataset.object_library import ASSETS, is_fixed
    from ig2mj_homes.dataset.ship import strip_report

    category, model, urdf = entry
    folder = library / category / model
    options = ConvertOptions(assets=ASSETS, cache=cache, max_hulls=MAX_HULLS)
    convert_object(urdf, category, folder, model=model, fixed=is_fixed(category), options=options)
    return strip_report(folder, keep_checks=False)


def _scenes_of(dataset: pathlib.Path, requested: tuple[str, ...]) -> list[str]:
    """Scenes of a dataset, all or the requested ones. Raises InputError, UnknownNameError."""
    from ig2mj.errors import InputError, UnknownNameError

    found = sorted(folder.parent.name for folder in (dataset / "scenes").glob("*/urdf"))
    if not found:
        raise InputError(dataset, "holds no scenes/*/urdf", fix="give the folder that `ig2mj homes build` wrote")
    for name in requested:
        if name not in found:
            raise UnknownNameError(f"home of {dataset}", name, found)
    return list(requested) or found
