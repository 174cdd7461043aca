"""`ig2mj robots table LIST`: tries the robots of a list, and writes what they do as a table."""

from __future__ import annotations

import json
import os
import pathlib
import subprocess
import tomllib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import tyro

if TYPE_CHECKING:
    from ig2mj.agents.urdf import UrdfRobot

KEYS = (
    "name", "maker", "file", "package", "package_path", "mesh_root", "max_hulls", "layout", "grippers", "refused",
)  # fmt: skip

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
  higher after the lift; eight are needed. Its position and its angle differ between tries.
- *grasping*: *physical* is by friction alone. *assisted* (`--grasping assisted` of other commands)
  is tried where the gripper does not lift eight times by friction.
- *passes*: it stands, drives where it has wheels, and lifts where it has a gripper. Robots that
  ig2mj does not support are listed with the reason that `ig2mj convert robot` gives.

| robot | maker | base | grippers | stands | drives | lifts | grasping | passes | file |
|---|---|---|--:|---|--:|--:|---|---|---|
"""

NOTES = "\nWhat does not pass, and why some do not lift by friction:\n\n"

COMMIT = "IG2MJ_COMMIT"
"""Environment variable that names the commit of a copy of the files without git."""


def table(
    list: Annotated[pathlib.Path, tyro.conf.Positional, tyro.conf.arg(metavar="LIST.toml")],
    data: Annotated[pathlib.Path, tyro.conf.arg(metavar="DIR")],
    cache: Annotated[pathlib.Path, tyro.conf.arg(metavar="DIR")],
    out: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE.md")] = None,
    only: tuple[str, ...] = (),
    home: str = "small_home",
    tries: int = 10,
    jobs: int = 1,
) -> int:
    """Try the robots of a list in a home, and write a table of what they do.

    Robots that were converted or tried before, with results in the cache, are not converted or tried again. Exit
    status: 1 if a robot does not do what it is made for.

    Args:
      list: TOML file with a table [[robot]] for each: name, maker, package and file, and as far as it needs them
        package_path, mesh_root, max_hulls, layout, [[robot.grippers]] with file and on, and refused: a word of the
        reason for which it is refused.
      data: folder that the files of the list are relative to.
      cache: folder for converted robots and results.
      out: Markdown file for the table; default: standard output.
      only: names of those to try; the table has all that were tried.
      home: folder of a converted scene, or the name of a home that comes with ig2mj.
      tries: number of tries to lift the cube.
      jobs: processes that try robots at the same time; 0: one per processor.
    """
    import sys

    from ig2mj.calibration.robot_lifting import CUBES
    from ig2mj.cli.common.jobs import follow
    from ig2mj.cluster.job_runner import Where, map_jobs
    from ig2mj.cluster.jobs import Job, JobSet

    entries = {entry["name"]: entry for entry in _entries(list)}
    _check_names(only, entries)
    cache.mkdir(parents=True, exist_ok=True)
    shared = {"data": str(data), "cache": str(cache), "home": home, "tries": tries}
    todo = [e for e in entries.values() if (not only or e["name"] in only) and not _results(cache, e).is_file()]
    work = [Job(entry["name"], {"entry": entry, **shared}) for entry in todo]
    with follow("robots") as progress:
        job_set = JobSet("ig2mj.cli.robots_table:try_entry", "robots", work)
        _, broken = map_jobs(job_set, Where(jobs), progress=progress)
    for name, reason in broken.items():
        print(f"error: {name}: {reason}", file=sys.stderr)
    found = {}
    for name, entry in entries.items():
        if (file := _results(cache, entry)).is_file():
            found[name] = json.loads(file.read_text(encoding="utf-8"))
            print(f"{name}: {'passed' if found[name]['passed'] else 'failed'}", file=sys.stderr)
    cubes = f"{1000 * min(CUBES):.0f} to {1000 * max(CUBES):.0f} mm"
    rows = [_row(entries[name], one) for name, one in found.items()]
    text = HEAD.format(list=list.as_posix(), home=home, cubes=cubes) + "\n".join(rows) + "\n"
    if notes := [f"- {name.replace('_', ' ')}: {note}." for name, one in found.items() if (note := _note(one))]:
        text += NOTES + "\n".join(notes) + "\n"
    text += _origin(found)
    if out is None:
        print(text, end="")
    else:
        out.write_text(text, encoding="utf-8")
    return 1 if broken or not all(one["passed"] for one in found.values()) else 0


def _check_names(only: tuple[str, ...], entries: dict[str, Any]) -> None:
    """Raises UnknownNameError: the list has no such robot."""
    from ig2mj.errors import UnknownNameError

    for name in only:
        if name not in entries:
            raise UnknownNameError("robot of the list", name, entries)


def _results(cache: pathlib.Path, entry: dict[str, Any]) -> pathlib.Path:
    return cache / f"{entry['name']}.trial.json"


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
    from ig2mj_converters.reading.mjcf_grippers import Mounting

    from ig2mj.agents.urdf import UrdfRobot

    folder = cache / entry["name"]
    if not (folder / "robot.json").is_file():
        options = ConvertOptions(
            report=False,
            max_hulls=entry.get("max_hulls", ConvertOptions.max_hulls),
            mesh_root=data / entry["mesh_root"] if "mesh_root" in entry else None,
            package_path=tuple(data / place for place in entry.get("package_path", ())),
        )
        grippers = [Mounting(data / one["file"], one.get("on")) for one in entry.get("grippers", ())]
        convert_robot(data / entry["file"], folder, options=options, grippers=grippers)
    return UrdfRobot.load(folder, entry.get("layout", {}))


def try_entry(entry: dict[str, Any], data: str, cache: str, home: str, tries: int) -> bytes:
    """Tries a robot, and writes what it does into the cache; nothing is returned."""
    from ig2mj.cluster.versions import versions
    from ig2mj.errors import InputError

    try:
        found = _tried(entry, pathlib.Path(data), pathlib.Path(cache), home, tries)
    except InputError as e:
        if "refused" not in entry or entry["refused"] not in str(e):
            raise
        found = {"passed": True, "refused": str(e)}
    found |= {"commit": _commit(), "versions": versions(), "package": _version_in(pathlib.Path(data), entry["package"])}
    _results(pathlib.Path(cache), entry).write_text(json.dumps(found, indent=1), encoding="utf-8")
    return b""


def _tried(entry: dict[str, Any], data: pathlib.Path, cache: pathlib.Path, home: str, tries: int) -> dict[str, Any]:
    """What a robot does, with the first way of grasping by which it lifts, else with the last."""
    import dataclasses

    from ig2mj.agents.urdf.summary import BASE_WORDS
    from ig2mj.calibration.robot_trial import try_robot
    from ig2mj.cli.common.trial_props import make_prop

    robot = _loaded(entry, data, cache)
    result = physical = try_robot(robot, make_prop, home, tries, MODES[0])
    for mode in MODES[1:]:
        if result.stands and result.lifted and not result.passed:
            result = try_robot(robot, make_prop, home, tries, mode)
    friction = "" if result is physical else _counted(physical.reasons, len(physical.lifted))
    hands = len(robot.layout.grippers) + len(robot.layout.suction)
    found = {**dataclasses.asdict(result), "passed": result.passed and "refused" not in entry}
    return {**found, "base": BASE_WORDS[robot.layout.base], "hands": hands, "friction": friction}


def _commit() -> str:
    if named := os.environ.get(COMMIT):
        return named
    command = ["git", "rev-parse", "--short", "HEAD"]
    try:
        done = subprocess.run(
            command, cwd=pathlib.Path(__file__).parent, capture_output=True, text=True, check=True, timeout=10
        )
    except (OSError, subprocess.SubprocessError):
        return "unknown"
    return done.stdout.strip()


def _version_in(data: pathlib.Path, package: str) -> str:
    """The version of a package that is installed in a folder; "" where that does not say."""
    from importlib.metadata import distributions

    found = {d.metadata["Name"].replace("_", "-").lower(): d.version for d in distributions(path=[str(data)])}
    return found.get(package.replace("_", "-").lower(), "")


def _row(entry: dict[str, Any], found: dict[str, Any]) -> str:
    files = [entry["file"], *(one["file"] for one in entry.get("grippers", ()))]
    names = dict.fromkeys(f"`{pathlib.PurePosixPath(*pathlib.PurePosixPath(file).parts[-2:])}`" for file in files)
    source = f"{', '.join(names)} of {entry['package']} {found['package']}".strip()
    head = (entry["name"].replace("_", " "), entry["maker"])
    if "refused" in found:
        cells = (*head, "not supported", "", "", "", "", "", "refused", source)
    else:
        lifted = f"{sum(found['lifted'])} of {len(found['lifted'])}" if found["lifted"] else found["problem"] and "no"
        cells = (
            *head,
            found["base"].removesuffix(" drive").replace("bolted to the floor", "fixed"),
            str(found["hands"] or ""),
            "yes" if found["stands"] else "no",
            "" if found["drives"] is None else f"{found['drives']:.2f}",
            lifted or "",
            found["mode"] if found["lifted"] else "",
            "yes" if found["passed"] else "no",
            source,
        )
    return f"| {' | '.join(cells)} |"


def _note(found: dict[str, Any]) -> str:
    """Why a robot is refused, does not pass, or passes with assistance only; "" where it passes by friction."""
    if "refused" in found:
        return found["refused"].removeprefix("layout: base: ").partition(" (base = ")[0]
    if found["passed"]:
        return f"by friction {friction}" if (friction := found.get("friction")) else ""
    parts = [] if found["stands"] else ["it does not stand"]
    parts += [found["problem"]] if found["problem"] else []
    parts += [counted] if (counted := _counted(found["reasons"], len(found["lifted"]))) else []
    return "; ".join(parts)


def _counted(reasons: Sequence[str], tries: int) -> str:
    """Reasons of failures, each with the number of tries."""
    import collections

    counts = collections.Counter(filter(None, reasons))
    return "; ".join(f"{reason} ({count} of {tries})" for reason, count in counts.items())


def _origin(found: dict[str, dict[str, Any]]) -> str:
    """A line on commits and versions of the rows."""
    commits = ", ".join(sorted({one["commit"] for one in found.values()}))
    packages = ("mujoco", "jax", "numpy")
    used = {f"{name} {one['versions'][name]}" for one in found.values() for name in packages}
    return f"\nCommit {commits}; {', '.join(sorted(used))}.\n" if found else ""
