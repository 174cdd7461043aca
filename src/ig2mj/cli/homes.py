"""`ig2mj homes`: make homes of one's own; list, build, convert and render those that come with ig2mj."""

from __future__ import annotations

import pathlib
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any

import tyro

if TYPE_CHECKING:
    from ig2mj_homes.objects.entry import Entry

    from ig2mj.callbacks import ProgressCallback

Flag = Annotated[bool, tyro.conf.FlagCreatePairsOff]


MAX_HULLS = 16
"""Convex pieces per link, at most. With 16 the volume error of every link is below 6 %."""


def make(
    file: Annotated[pathlib.Path, tyro.conf.Positional, tyro.conf.arg(metavar="HOME.toml")],
    out: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="DIR")] = None,
    seed: int | None = None,
    image: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    jobs: int = 1,
    json: Flag = False,
) -> int:
    """Make a home from a TOML: rooms, doors, windows, furniture, and loose objects by predicate.

    The result loads everywhere a home does: `ig2mj view DIR`. The exit status is 1 if one of its checks failed.
    docs/guide/own_homes.md describes the file. A small one:

        [rooms]
        kitchen = [0, 0, 4, 3]

        [furniture]
        table = { model = "breakfast_table", room = "kitchen" }

        [objects]
        mug = "(on_top mug table)"

    Args:
      file: the home's TOML.
      out: output folder; an earlier result there is replaced. Default: the home's name, in the working directory.
      seed: random seed of models and places that the file leaves open, in place of the file's.
      image: render the rooms into this image file; needs OpenGL (see `ig2mj doctor`).
      jobs: number of processes of the conversion.
      json: print what was made as JSON.
    """
    from ig2mj.cli.common.files import check_image
    from ig2mj.cli.common.own_home import make_home
    from ig2mj.cli.common.printing import add_bar, print_json, progress_bar
    from ig2mj.errors import Ig2mjError

    if jobs < 1:
        raise Ig2mjError(f"--jobs {jobs}: at least one is needed")
    if image is not None:
        check_image(image)
    with progress_bar() as bar:
        made = make_home(file, out, seed=seed, jobs=jobs, progress=add_bar(bar, f"making {file.stem}"))
    if image is not None:
        from ig2mj.scene.scene import load_scene
        from ig2mj.viewer.home_sheet import rooms_inside

        rooms_inside([load_scene(made.folder)]).save(image)
    if json:
        checks = {check.name: check.passed for check in made.checks}
        print_json({"folder": str(made.folder), "rooms": made.rooms, "objects": made.objects, "checks": checks})
    else:
        passed = len(made.checks) - len(made.failed)
        rooms = f"{len(made.rooms)} room{'s' * (len(made.rooms) != 1)}"
        print(f"{made.folder}: {rooms}, {len(made.objects)} objects, "
              f"{passed} of {len(made.checks)} checks passed (look: ig2mj view {made.folder})")  # fmt: skip
        for line in made.failed:
            print(f"  {line}")
    return 1 if made.failed else 0


def model(
    name: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="CATEGORY[/MODEL]")],
    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="DIR")],
    seed: int = 0,
) -> None:
    """Write a model of the catalogue as a folder, as `ig2mj convert object` writes one.

    Furniture for `--replace` and `--object`, which the object library does not have: a sofa, a bed, a cabinet.

    Args:
      name: its category, for the first model, or one of its models: sofa/sofa_02.
      out: output folder; an earlier result there is replaced.
      seed: random seed of all variation; homes that ship have 0.
    """
    import tempfile

    from ig2mj_converters.base.options import ConvertOptions
    from ig2mj_converters.conversion import convert_object
    from ig2mj_homes.dataset.root import write_models
    from ig2mj_homes.objects.catalogue import build_model, catalogue, find, model_number

    from ig2mj.errors import UnknownNameError

    category, _, requested = name.partition("/")
    if category not in catalogue():
        raise UnknownNameError("category", category, catalogue())
    entry = find(category)
    index = model_number(entry, requested, seed) if requested else 0
    made = build_model(entry, index, seed).model
    with tempfile.TemporaryDirectory(prefix="ig2mj-model-") as root:
        write_models(pathlib.Path(root), {category: [index]}, seed)
        urdf = pathlib.Path(root) / "objects" / category / made / f"{made}.urdf"
        options = ConvertOptions(cache=False, max_hulls=MAX_HULLS, report=False)
        convert_object(urdf, category, out, model=made, fixed=entry.fixed, options=options)
    print(f"{out}: {category}/{made}, {'fixed' if entry.fixed else 'loose'} (look: ig2mj view {out})")


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
        print(f"convert one: ig2mj convert scene --dataset {out} --scene {next(iter(homes))} --out OUT")


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
        added = 0 if home else _convert_objects(dataset, out, not no_cache, add_bar(bar, "objects"), failed)
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
    cache: bool,
    progress: ProgressCallback,
    failed: list[str],
) -> int:
    """Converts the object library; adds lines of failed checks to `failed`. How many models."""
    import json

    from ig2mj_converters.base.options import ConvertOptions
    from ig2mj_converters.conversion import convert_object
    from ig2mj_homes.dataset.object_library import (
        ASSETS,
        FOLDER,
        PREFERRED_FILE,
        VARIANTS_FILE,
        is_fixed,
        library_models,
        preferred_models,
        split_models,
    )
    from ig2mj_homes.dataset.ship import strip_report

    models = library_models(dataset)
    for number, (category, model, urdf) in enumerate(models):
        progress(number, len(models), category)
        folder = out / FOLDER / category / model
        options = ConvertOptions(assets=ASSETS, cache=cache, max_hulls=MAX_HULLS)
        convert_object(urdf, category, folder, model=model, fixed=is_fixed(category), options=options)
        failed += strip_report(folder, keep_checks=False)
    for file, content in ((PREFERRED_FILE, preferred_models(models)), (VARIANTS_FILE, split_models(models))):
        if content:
            text = json.dumps(content, indent=1, sort_keys=True) + "\n"
            (out / FOLDER / file).write_text(text, encoding="utf-8", newline="\n")
    return len(models)


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


def list_(
    objects: Flag = False,
    only: tuple[str, ...] = (),
    json: Flag = False,
) -> None:
    """List the homes that ship with ig2mj, or the categories of objects that can be built.

    Args:
      objects: list object categories instead: synset, size, mass, number of models.
      only: list only these categories.
      json: print JSON instead of a table.
    """
    from ig2mj.cli.common.printing import make_table, print_json, stdout_console

    kind, data = ("categories", _categories(only)) if objects or only else ("homes", shipped_homes())
    if json:
        print_json(data)
        return
    if kind == "homes":
        title = f"{len(data)} homes, {sum(len(h['rooms']) for h in data)} rooms (ig2mj view HOME)"
        columns = ("home", ">objects", ">movable", "rooms")
        data.sort(key=lambda h: h["objects"])
        rows = [(h["home"], h["objects"], h["movable"], ", ".join(h["rooms"])) for h in data]
    else:
        title = f"{sum(c['models'] for c in data)} models of {len(data)} categories"
        columns = ("category", "?synset", ">size x y z (m)", ">kg", "fixed", ">models")
        rows = [
            (c["category"], c["synset"] or "-", " ".join(f"{v:g}" for v in c["size"]), f"{c['mass']:g}",
             "yes" if c["fixed"] else "", c["models"])
            for c in data
        ]  # fmt: skip
    console = stdout_console()
    console.print(make_table(title, columns, rows, console.width))


def _categories(only: tuple[str, ...]) -> list[dict[str, Any]]:
    from ig2mj.knowledge import synset

    return [
        {
            "category": e.category,
            "synset": synset(e.category),
            "size": e.size,
            "mass": e.mass,
            "fixed": e.fixed,
            "models": e.count,
        }
        for e in _entries(only)
    ]


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
    entries = _entries(only)
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


def shipped_homes() -> list[dict[str, Any]]:
    """Name, rooms and number of objects (see `ObjectEntry.in_household`) of every home in scenes_mjcf/."""
    from ig2mj.scene import paths
    from ig2mj.scene.manifest import load_manifest

    homes = []
    for name in paths.shipped_homes():
        manifest = load_manifest(paths.SHIPPED_HOMES / name)
        objects = [o for o in manifest.objects if o.in_household]
        rooms = list(manifest.rooms.instances)
        movable = sum(not o.fixed for o in objects)
        homes.append({"home": name, "rooms": rooms, "objects": len(objects), "movable": movable})
    return homes


def _entries(only: tuple[str, ...]) -> list[Entry]:
    from ig2mj_homes.objects.catalogue import catalogue, find

    return [find(name) for name in only] if only else list(catalogue().values())


SUBCOMMANDS: dict[str, Callable[..., int | None]] = {
    "make": make,
    "model": model,
    "build": build,
    "convert": convert,
    "list": list_,
    "images": images,
    "tour": tour,
    "sheet": sheet,
}

RENAMED = {"pictures": "images"}
