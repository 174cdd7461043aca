"""`ig2mj convert`: convert iGibson scenes, and URDF objects and robots, to MJCF."""

from __future__ import annotations

import contextlib
import dataclasses
import pathlib
from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from ig2mj.cli.common.conversion import DEFAULTS, Common, Flag, check_kind, options_of
from ig2mj.cli.convert_dataset import convert_dataset
from ig2mj.process.processors import available

if TYPE_CHECKING:
    from ig2mj_converters.base.outcome import ConversionOutcome

#: Exit status of a conversion that left models out (`--skip-missing`).
SKIPPED = 3


def convert_scene(
    dataset: pathlib.Path,
    scene: str,
    out: pathlib.Path,
    urdf: pathlib.Path | None = None,
    skip_missing: Flag = False,
    fixed_furniture: Flag = False,
    only_rooms: tuple[str, ...] = (),
    only_categories: tuple[str, ...] = (),
    ceiling_collision: Flag = False,
    keep_hovering: Flag = False,
    assets: Annotated[str, tyro.conf.arg(metavar="DIR")] = ".",
    common: Annotated[Common, tyro.conf.OmitArgPrefixes] = DEFAULTS,
) -> int:
    """Convert a scene of a dataset in iGibson's layout: OUT/scene.xml, manifest.json, meshes/, rooms.npz, report.html.

    Exit status: 0 converted; 2 bad input, one line on stderr; 3 converted, but missing models were skipped.

    Args:
      dataset: root of the dataset (holds objects/, scenes/ and metadata/).
      scene: name of a folder in scenes/.
      out: output folder; an earlier result there is replaced once the conversion succeeds.
      urdf: scene file to use instead of the scene's default one.
      skip_missing: leave out models that the dataset lacks.
      fixed_furniture: fix cabinets, shelves, tables and desks to the floor, as BEHAVIOR does.
      only_rooms: keep objects of these rooms (kitchen_0) or kinds of room (kitchen); building parts are always kept.
      only_categories: keep objects of these categories; building parts are always kept.
      ceiling_collision: let ceilings collide.
      keep_hovering: start loose objects exactly where the source has them; by default those in mid-air are lowered
        onto their support.
      assets: folder for meshes/ and textures/, relative to OUT, that several scenes may share (e.g. "..").
    """
    from ig2mj_converters.conversion import convert_scene as convert

    check_kind(out, "home")
    options = options_of(
        common,
        fixed_furniture=fixed_furniture,
        only_rooms=only_rooms or None,
        only_categories=only_categories or None,
        skip_missing=skip_missing,
        ceiling_collision=ceiling_collision,
        keep_hovering=keep_hovering,
        assets=assets,
    )
    with _progress(f"converting {scene}") as options_with:
        outcome = convert(dataset, scene, out, urdf=urdf, options=options_with(options))
    return _tell(outcome, out, "scene.xml", common.json)


def convert_object(
    urdf: pathlib.Path,
    category: str,
    out: pathlib.Path,
    model: str | None = None,
    split: str | None = None,
    bbox: tuple[float, float, float] | None = None,
    fixed: Flag = False,
    annotations: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    mesh_root: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="DIR")] = None,
    package_path: Annotated[tuple[pathlib.Path, ...], tyro.conf.arg(metavar="DIR")] = (),
    common: Annotated[Common, tyro.conf.OmitArgPrefixes] = DEFAULTS,
) -> int:
    """Convert one URDF object, iGibson's or any other: OUT/object.xml, manifest.json, meshes/, report.html.

    `ig2mj view small_home --object OUT@on_top:breakfast_table_0` puts it into a home, `ig2mj objects show OUT` renders
    it. Exit status: 0 converted; 2 bad input, one line on stderr.

    Args:
      urdf: the object's URDF.
      category: its category in iGibson's taxonomy (apple, fridge, ...), which decides its abilities.
      out: output folder; an earlier result there is replaced once the conversion succeeds.
      model: name of the object; default: the file's name.
      split: the part of its category that it joins, train or held_out, once its folder is in a library of yours
        (`ig2mj objects add DIR`, docs/guide/randomization.md).
      fixed: it is furniture: in a home it stands where it is put for good, and nothing moves it.
      annotations: TOML file with its abilities, thresholds and functional parts, such as a button or a heat source
        (docs/guide/objects.md).
      bbox: requested size along the axes of the base link, metres; default: the size it has.
      mesh_root: additional folder from which meshes may be read (URDFs that use ../ or absolute paths).
      package_path: folders that hold the packages of `package://` names.
    """
    from ig2mj_converters.conversion import convert_object as convert

    from ig2mj.scene.model_splits import check_joins, join_split

    check_kind(out, "robot" if category == "agent" else "object")
    if split is not None:
        check_joins(split, category, model or urdf.stem, fixed)

    options = options_of(common, default_jobs=available(), mesh_root=mesh_root, package_path=package_path)
    with _progress(f"converting {urdf.name}") as options_with:
        outcome = convert(
            urdf,
            category,
            out,
            model=model,
            bounding_box=bbox,
            fixed=fixed,
            annotations=annotations,
            options=options_with(options),
        )
    if split is not None:
        join_split(out, split)
    return _tell(outcome, out, "object.xml", common.json)


def convert_robot(
    out: pathlib.Path,
    urdf: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    mjcf: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    gripper: Annotated[tuple[str, ...], tyro.conf.arg(metavar="FILE[@NAME]")] = (),
    name: str | None = None,
    layout: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    mesh_root: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="DIR")] = None,
    package_path: Annotated[tuple[pathlib.Path, ...], tyro.conf.arg(metavar="DIR")] = (),
    common: Annotated[Common, tyro.conf.OmitArgPrefixes] = DEFAULTS,
) -> int:
    """Convert a robot's URDF or MJCF: OUT/object.xml, robot.json, layout.toml, robot.png, meshes/.

    Prints which joints and links were taken for base, wheels, arms, grippers, hands, camera and laser. Edit
    OUT/layout.toml to change that. `--robot OUT` of other commands, and `ig2mj.make(..., robot="OUT")`, take the
    folder. Exit status: 0 converted; 2 bad input, a robot with legs among it.

    Args:
      out: output folder; an earlier result there is replaced once the conversion succeeds, except its layout.toml.
      urdf: the robot's URDF.
      mjcf: the robot's MJCF, e.g. of MuJoCo Menagerie, or a scene that includes it.
      gripper: MJCF of a gripper to mount on an arm of MJCF, and the name of the site or body of the arm that carries
        it; default: its site attachment_site, else its last body. Of several arms one for each.
      name: name of the robot; default: the one in the file.
      layout: TOML or JSON file that corrects the assignment (docs/guide/robots.md).
      mesh_root: additional folder from which meshes may be read (files that use ../ or absolute paths).
      package_path: folders that hold the packages of `package://` names.
    """
    from ig2mj_converters.base.output import replaced_folder
    from ig2mj_converters.convert_robot import convert_robot as convert
    from ig2mj_converters.reading.mjcf_grippers import Mounting

    from ig2mj.agents.urdf.robot import own_layout
    from ig2mj.cli.common.robot_report import tell_robot, write_layout
    from ig2mj.errors import Ig2mjError, InputError

    if (urdf is None) == (mjcf is None):
        raise Ig2mjError("name the robot's file: --urdf FILE or --mjcf FILE")
    file = urdf if urdf is not None else mjcf
    assert file is not None
    if (file.suffix.lower() in (".xml", ".mjcf")) != (mjcf is not None) and file.is_file():
        option, other = ("--urdf", "--mjcf") if mjcf is None else ("--mjcf", "--urdf")
        raise InputError(file, f"is not what {option} takes", fix=f"{other} FILE")
    if layout is not None and not layout.is_file():
        raise InputError(layout, "is not a file", element="--layout", fix="name a TOML or JSON file")
    check_kind(out, "robot")
    kept = own_layout(out)
    former = None if kept is None or layout is not None else (kept.name, kept.read_bytes())
    options = options_of(common, default_jobs=available(), mesh_root=mesh_root, package_path=package_path)
    mountings = [Mounting.of_words(words) for words in gripper]
    with replaced_folder(out) as folder:
        made = folder / ".converted"
        with _progress(f"converting {file.name}") as options_with:
            outcome = convert(file, made, name=name, options=options_with(options), grippers=mountings)
        said = write_layout(made, layout, former, out)
        for entry in made.iterdir():
            entry.rename(folder / entry.name)
        made.rmdir()
    status = _tell(outcome, out, "object.xml", common.json)
    if not common.json:
        tell_robot(out, said)
    return status


def upgrade(
    folder: Annotated[pathlib.Path, tyro.conf.Positional, tyro.conf.arg(metavar="DIR")], json: Flag = False
) -> None:
    """Bring converted scenes and objects to the present format: add the inside of their containers.

    Only manifests are changed. Physics stays the same, so that pools and recordings remain valid.

    Args:
      folder: a converted scene or object, or a folder that holds some.
      json: print JSON instead of a line.
    """
    from ig2mj_converters.upgrade import upgrade_folders

    from ig2mj.cli.common.printing import add_bar, print_json, progress_bar

    with progress_bar() as bar:
        done = upgrade_folders(folder, add_bar(bar, "finding insides"))
    if json:
        print_json({"folders": done.folders, "upgraded": done.upgraded, "containers": done.containers})
    else:
        print(f"{folder}: {done.upgraded} of {done.folders} manifests upgraded, {done.containers} containers in all")


SUBCOMMANDS = {
    "scene": convert_scene,
    "object": convert_object,
    "robot": convert_robot,
    "dataset": convert_dataset,
    "upgrade": upgrade,
}


@contextlib.contextmanager
def _progress(title: str) -> Iterator[Any]:
    """A progress bar on stderr; yields a function that makes options report to it."""
    from ig2mj.cli.common.printing import add_bar, progress_bar

    with progress_bar() as bar:
        report = add_bar(bar, title)
        yield lambda options: dataclasses.replace(options, progress=report)


def _tell(outcome: ConversionOutcome, out: pathlib.Path, main_file: str, as_json: bool) -> int:
    """Prints what was written and where; the exit status."""
    from ig2mj.cli.common.printing import counted, print_json

    failed = [check for check in outcome.checks if not check.passed]
    if as_json:
        summary = {
            "out": str(out),
            "objects": outcome.objects,
            "skipped": outcome.skipped,
            "warnings": outcome.warnings,
            "first_warnings": outcome.first_warnings,
            "checks": {check.name: {"passed": check.passed, "summary": check.summary} for check in outcome.checks},
            "cached": outcome.cached,
            "seconds": {stage: round(seconds, 3) for stage, seconds in outcome.timings.items()},
        }
        print_json(summary)
    else:
        seconds = sum(outcome.timings.values())
        from_cache = " (nothing has changed: taken from the cache)" if outcome.cached else ""
        what = counted(outcome.objects, "object")
        print(f"{out / main_file}: {what}, {counted(outcome.warnings, 'warning')}, {seconds:.1f} s{from_cache}")
        for line in outcome.skipped:
            print(f"  skipped, not in the dataset: {line}")
        for check in failed:
            print(f"  check {check.name}: {check.summary}")
        for line in outcome.first_warnings:
            print(f"  warning: {line}")
        if outcome.warnings > len(outcome.first_warnings):
            where = f"; {out / 'report.html'} has all" if outcome.checks else ""
            print(f"  ... {counted(outcome.warnings, 'warning')} in all{where}")
        if outcome.checks:
            print(f"  report: {out / 'report.html'}")
    return SKIPPED if outcome.skipped else 0
