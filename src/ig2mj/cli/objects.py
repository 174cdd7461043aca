"""`ig2mj objects`: list and show the objects that can be added to a home, and libraries of your own."""

from __future__ import annotations

import pathlib
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from ig2mj.files.shell import command

if TYPE_CHECKING:
    from ig2mj.scene.library import LibraryModel

Flag = Annotated[bool, tyro.conf.FlagCreatePairsOff]


def list_objects(
    word: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="[WORD]")] = "",
    own: Flag = False,
    image: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    json: Flag = False,
) -> int:
    """List the objects of the library that ships, and of your own libraries.

    Args:
      word: only objects whose category, name or ability contains this word, e.g. mug or cookable.
      own: only objects of your own libraries.
      image: write a contact sheet of them (.png, .jpg); needs OpenGL.
      json: print JSON instead of a table.
    """
    from ig2mj.cli.common.files import check_image
    from ig2mj.cli.common.printing import make_table, print_json, stdout_console
    from ig2mj.scene.library import library, own_library

    if image is not None:
        check_image(image)
    shelves = [own_library()] if own else [own_library(), library()]
    models = [m for shelf in shelves for of_category in shelf.values() for m in of_category.values()]
    found = [m for m in models if _matches(m, word)]
    if json:
        print_json([_facts(m) for m in found])
    elif not found:
        which = f" with '{word}' in category, name or ability" if word else ""
        print(f"no objects{which} (`ig2mj objects add DIR` adds a library of your own)")
    else:
        rows = [[m.reference, _size(m), f"{m.entry.mass:.3g}", _does(m), _where(m)] for m in found]
        columns = ["name", "size (m)", "> kg", "abilities, [links]", "?where"]
        console = stdout_console()
        console.print(make_table("Objects for --object NAME", columns, rows, console.width))
    if image is not None and found:
        _write_sheet(found, image)
    return 0 if found or not word else 1


def show(
    what: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="NAME|DIR")],
    image: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    json: Flag = False,
) -> int:
    """Show an object: size, mass, joints, abilities with thresholds, functional parts, and an image of it.

    The image has the object's frame (x red, y green, z blue), its annotated links, and its collision geometry.

    Args:
      what: a name of the object library (`ig2mj objects list`), or a folder that `ig2mj convert object` wrote.
      image: file of the image (.png, .jpg); default: MODEL.png in the working directory. It needs OpenGL.
      json: print JSON, and write no image without --image.
    """
    import sys

    from ig2mj.cli.common.files import check_image
    from ig2mj.cli.common.printing import print_json
    from ig2mj.errors import EngineError, MissingDependencyError
    from ig2mj.scene.library import find_model

    if image is not None:
        check_image(image)
    model = find_model(what)
    if json:
        print_json(_facts(model))
    else:
        print("\n".join(_description(model)))
    if json and image is None:
        return 0
    file = image or pathlib.Path(f"{model.prefix}.png")
    try:
        _write_image(model, file)
    except (EngineError, MissingDependencyError) as e:
        if image is not None:
            raise
        print(f"note: no image: {e}", file=sys.stderr)
    return 0


def add(folder: Annotated[pathlib.Path, tyro.conf.Positional, tyro.conf.arg(metavar="DIR")]) -> int:
    """Add a library of your own: a folder that holds objects, at any depth down to three levels.

    Commands and Python then find its objects by their names. The environment variable IG2MJ_OBJECTS names libraries for
    single commands.

    Args:
      folder: folder that holds folders that `ig2mj convert object` wrote.
    """
    from ig2mj.scene.library import own_library
    from ig2mj.scene.own_libraries import add_library, registry_file, remove_library

    path, found = add_library(folder)
    try:
        shelves = own_library()
    except Exception:
        remove_library(path)
        raise
    models = [m for of_category in shelves.values() for m in of_category.values() if m.folder in found]
    names = [m.reference for m in models]
    count = f"{len(names)} object{'s' * (len(names) != 1)}"
    print(f"{path}: {count} ({', '.join(names[:8])}{', ...' * (len(names) > 8)}), kept in {registry_file()}")
    first = next((m for m in models if not m.entry.fixed), models[0])
    place = f"{first.reference}@{_place(first, 'breakfast_table_0')}"
    print(f"try: {command('view', 'small_home', '--object', place)}")
    return 0


def remove(folder: Annotated[pathlib.Path, tyro.conf.Positional, tyro.conf.arg(metavar="DIR")]) -> int:
    """Forget a library of your own. Its files stay.

    Args:
      folder: as it was added.
    """
    from ig2mj.scene.own_libraries import remove_library

    print(f"{remove_library(folder)}: forgotten; its files stay")
    return 0


SUBCOMMANDS = {"list": list_objects, "show": show, "add": add, "remove": remove}


def _matches(model: LibraryModel, word: str) -> bool:
    texts = (model.reference, *model.entry.abilities, *model.entry.links)
    return any(word.lower() in text.lower() for text in texts)


def _size(model: LibraryModel) -> str:
    return " x ".join(f"{v:.2f}" for v in model.entry.bounding_box)


def _where(model: LibraryModel) -> str:
    from ig2mj.scene.model_splits import part_of

    if not model.own:
        return "ships"
    part = part_of(model)
    return str(model.folder) if part is None else f"{model.folder} ({part})"


def _does(model: LibraryModel) -> str:
    return ", ".join([*model.entry.abilities, *(f"[{kind}]" for kind in model.entry.links)])


def _facts(model: LibraryModel) -> dict[str, Any]:
    from ig2mj.scene.model_splits import part_of

    entry = model.entry
    return {
        "name": model.reference,
        "category": model.category,
        "model": model.model,
        "synset": entry.synset,
        "folder": str(model.folder),
        "own": model.own,
        "split": part_of(model),
        "fixed": entry.fixed,
        "size": list(entry.bounding_box),
        "mass": entry.mass,
        "bottom": _bottom(model),
        "joints": [joint.name for joint in entry.joints],
        "abilities": entry.abilities,
        "links": list(entry.links),
        "halves": [part.object for part in entry.parts],
        "sha256": model.sha256,
    }


def _bottom(model: LibraryModel) -> float:
    """m: how far the object reaches below its frame."""
    entry = model.entry
    return round(entry.bounding_box[2] / 2 - entry.base_link_offset[2], 4)


def _place(model: LibraryModel, support: str) -> str:
    """How `--object` can place it: predicates cannot place what is fixed."""
    return "X,Y,Z,YAW" if model.entry.fixed else f"on_top:{support}"


def _description(model: LibraryModel) -> list[str]:
    from ig2mj.scene.model_splits import part_of

    entry = model.entry
    kind = "fixed where it is put" if entry.fixed else "can be moved"
    ways = "" if entry.assisted_grasp or entry.fixed else ", assisted grasping does not hold it"
    above = _bottom(model)
    lines = [
        f"{model.reference}: {model.category} ({entry.synset or 'not in the taxonomy'}), {kind}{ways}",
        f"  files      {model.folder}",
        f"  size       {_size(model)} m, {entry.mass:.3g} kg; upright, it reaches {above:.3f} m below its frame",
    ]
    if (part := part_of(model)) is not None:
        lines.append(f"  split      {part}")
    for joint in entry.joints:
        limits = "continuous" if joint.range is None else f"{joint.range[0]:.3g} to {joint.range[1]:.3g}"
        opens = ", opens it" if any(o.joint == joint.name for o in entry.openable) else ""
        lines.append(f"  joint      {joint.name}: {joint.type}, {limits}{opens}")
    for ability, parameters in entry.abilities.items():
        values = ", ".join(f"{name} {value:g}" for name, value in parameters.items())
        lines.append(f"  ability    {ability}{': ' * bool(values)}{values}")
    lines += [f"  link       {kind} ({'a point' if link.site else 'a box'})" for kind, link in entry.links.items()]
    if entry.parts:
        lines.append(f"  halves     {', '.join(part.object for part in entry.parts)}")
    return [
        *lines,
        f"  hash       {model.sha256[:12]}",
        f"  add it     --object {model.reference}@{_place(model, 'OBJECT')}",
    ]


def _write_image(model: LibraryModel, file: pathlib.Path) -> None:
    from ig2mj.scene.scene import load_scene
    from ig2mj.viewer.object_sheet import object_image

    title = f"{model.reference if not model.named else model.folder.name}  {_size(model)} m  {model.entry.mass:.3g} kg"
    object_image(load_scene(model.folder), title).save(file)
    print(f"wrote {file}")


def _write_sheet(models: list[LibraryModel], file: pathlib.Path) -> None:
    from ig2mj.cli.common.printing import add_bar, progress_bar
    from ig2mj.scene.scene import load_scene
    from ig2mj.viewer.object_sheet import library_image

    with progress_bar() as bar:
        report = add_bar(bar, "loading objects")
        scenes = []
        for k, model in enumerate(models):
            report(k, len(models), model.reference)
            scenes.append((f"{model.reference} {_size(model)}", load_scene(model.folder)))
        library_image(scenes).save(file)
    print(f"wrote {file} ({len(models)} object{'s' * (len(models) != 1)})")
