"""`ig2mj robots table LIST`: tries the robots of a list, and writes what they do as a table."""

from __future__ import annotations

import json
import pathlib
import tomllib
from typing import TYPE_CHECKING, Annotated, Any

import tyro

if TYPE_CHECKING:
    from ig2mj.agents.urdf import UrdfRobot

KEYS = ("name", "maker", "file", "package", "package_path", "mesh_root", "max_hulls", "layout")

MODES = ("physical", "assisted")
"""Ways of grasping that are tried in turn, until the robot lifts."""

HEAD = """\
# Robots of different makers

`ig2mj robots table` converts the robots of a list, `{list}`, and tries them in
`{home}`. The files are those of the packages of the last column, which belong to their authors;
nothing of them is part of ig2mj.

- *stands*: for 5 s without a command no joint of an arm sags by 0.05 rad, and no base tilts by
  5 degrees or drifts by 3 cm.
- *drives*: metres ahead, of robots with wheels; the trial ends at 1 m.
- *lifts*: tries of ten in which a cube of 0.2 kg, {cubes} wide as the gripper allows, is 8 cm
  higher after the lift. Its position and its angle differ between tries.
- *grasping*: *physical* is by friction alone. *assisted* (`--grasping assisted` of other commands)
  is tried where the gripper does not lift eight times by friction.

| robot | maker | base | grippers | stands | drives | lifts | grasping | file |
|---|---|---|--:|---|--:|--:|---|---|
"""


def table(
    list: Annotated[pathlib.Path, tyro.conf.Positional, tyro.conf.arg(metavar="LIST.toml")],
    data: Annotated[pathlib.Path, tyro.conf.arg(metavar="DIR")],
    cache: Annotated[pathlib.Path, tyro.conf.arg(metavar="DIR")],
    out: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE.md")] = None,
    only: tuple[str, ...] = (),
    home: str = "small_home",
    tries: int = 10,
) -> int:
    """Try the robots of a list in a home, and write a table of what they do.

    Robots that were converted or tried before, with results in the cache, are not converted or tried again. Exit
    status: 1 if a robot does not do what it is made for.

    Args:
      list: TOML file with a table [[robot]] for each: name, maker, package and file, and as far as it needs them
        package_path, mesh_root, max_hulls and layout.
      data: folder that the files of the list are relative to.
      cache: folder for converted robots and results.
      out: Markdown file for the table; default: standard output.
      only: names of those to try; the table has all that were tried.
      home: folder of a converted scene, or the name of a home that comes with ig2mj.
      tries: number of tries to lift the cube.
    """
    import sys

    from ig2mj.calibration.robot_trial import CUBES
    from ig2mj.errors import Ig2mjError

    entries, rows, failed = _entries(list), [], 0
    for entry in entries:
        results = cache / f"{entry['name']}.trial.json"
        if not results.is_file() and (not only or entry["name"] in only):
            try:
                results.write_text(json.dumps(_tried(entry, data, cache, home, tries)), encoding="utf-8")
            except Ig2mjError as e:
                print(f"error: {entry['name']}: {e}", file=sys.stderr)
                failed += 1
                continue
        if results.is_file():
            found = json.loads(results.read_text(encoding="utf-8"))
            failed += not found["passed"]
            print(f"{entry['name']}: {'passed' if found['passed'] else 'failed'}", file=sys.stderr)
            rows.append(_row(entry, found))
    cubes = f"{1000 * min(CUBES):.0f} to {1000 * max(CUBES):.0f} mm"
    text = HEAD.format(list=list.as_posix(), home=home, cubes=cubes) + "\n".join(rows) + "\n"
    if out is None:
        print(text, end="")
    else:
        out.write_text(text, encoding="utf-8")
    return 1 if failed else 0


def _entries(file: pathlib.Path) -> list[dict[str, Any]]:
    """Raises InputError: the list cannot be read, or an entry lacks something."""
    from ig2mj.errors import InputError, UnknownNameError
    from ig2mj.files.content import read_text

    try:
        found = tomllib.loads(read_text(file, fix="name a TOML file")).get("robot", [])
    except ValueError as e:
        raise InputError(file, f"is not TOML: {e}") from e
    for entry in found:
        for name in entry:
            if name not in KEYS:
                raise UnknownNameError(f"entry of a robot of {file}", name, KEYS)
        if missing := [name for name in KEYS[:4] if name not in entry]:
            raise InputError(file, f"a robot has no {missing[0]}", element=str(entry.get("name", "robot")))
    return found


def _loaded(entry: dict[str, Any], data: pathlib.Path, cache: pathlib.Path) -> UrdfRobot:
    """The robot of an entry, converted on first use."""
    from ig2mj_converters.base.options import ConvertOptions
    from ig2mj_converters.convert_robot import convert_robot

    from ig2mj.agents.urdf import UrdfRobot

    folder = cache / entry["name"]
    if not (folder / "robot.json").is_file():
        options = ConvertOptions(
            report=False,
            max_hulls=entry.get("max_hulls", ConvertOptions.max_hulls),
            mesh_root=data / entry["mesh_root"] if "mesh_root" in entry else None,
            package_path=tuple(data / place for place in entry.get("package_path", ())),
        )
        convert_robot(data / entry["file"], folder, options=options)
    return UrdfRobot.load(folder, entry.get("layout", {}))


def _tried(entry: dict[str, Any], data: pathlib.Path, cache: pathlib.Path, home: str, tries: int) -> dict[str, Any]:
    """What a robot does, with the first way of grasping by which it lifts, else with the last."""
    import dataclasses

    from ig2mj.agents.urdf.summary import BASE_WORDS
    from ig2mj.calibration.robot_trial import try_robot
    from ig2mj.cli.common.trial_props import make_prop

    robot = _loaded(entry, data, cache)
    result = try_robot(robot, make_prop, home, tries, MODES[0])
    for mode in MODES[1:]:
        if result.stands and result.lifted and not result.passed:
            result = try_robot(robot, make_prop, home, tries, mode)
    hands = len(robot.layout.grippers) + len(robot.layout.suction)
    found = {**dataclasses.asdict(result), "passed": result.passed and not result.problem}
    return {**found, "base": BASE_WORDS[robot.layout.base], "hands": hands}


def _row(entry: dict[str, Any], found: dict[str, Any]) -> str:
    lifted = f"{sum(found['lifted'])} of {len(found['lifted'])}" if found["lifted"] else found["problem"] and "no"
    cells = (
        entry["name"].replace("_", " "),
        entry["maker"],
        found["base"].removesuffix(" drive").replace("bolted to the floor", "fixed"),
        str(found["hands"] or ""),
        "yes" if found["stands"] else "no",
        "" if found["drives"] is None else f"{found['drives']:.2f}",
        lifted or "",
        found["mode"] if found["lifted"] else "",
        f"`{pathlib.PurePosixPath(entry['file']).name}` of {entry['package']}",
    )
    return f"| {' | '.join(cells)} |"
