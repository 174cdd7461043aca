"""`ig2mj homes`: make homes of one's own; list, build, convert and render those that come with ig2mj."""

from __future__ import annotations

import pathlib
from collections.abc import Callable
from typing import Annotated, Any

import tyro

from ig2mj.cli.common.homes import entries_of, shipped_homes
from ig2mj.cli.homes_content import MAX_HULLS, build, convert
from ig2mj.cli.homes_images import images, sheet, tour
from ig2mj.files.shell import command

Flag = Annotated[bool, tyro.conf.FlagCreatePairsOff]


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
              f"{passed} of {len(made.checks)} checks passed (look: {command('view', made.folder)})")  # fmt: skip
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
    print(f"{out}: {category}/{made}, {'fixed' if entry.fixed else 'loose'} (look: {command('view', out)})")


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
        for e in entries_of(only)
    ]


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
