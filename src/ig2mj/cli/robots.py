"""`ig2mj robots`: shows robots of one's own, and tries them in a home."""

from __future__ import annotations

import pathlib
from typing import Annotated

import tyro

from ig2mj.cli.common.own_robot import NONE, Own, own_robot
from ig2mj.cli.robots_table import table


def show(
    robot: Annotated[str | None, tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER")] = None,
    own: Own = NONE,
    picture: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
) -> None:
    """Show which joints and links of a robot are taken for base, wheels, arms, grippers, hands and sensors.

    Args:
      robot: folder that `ig2mj convert robot` wrote.
      picture: image file of the robot and its parts; default: robot.png in the folder.
    """
    from ig2mj.cli.common.robot_report import tell_robot
    from ig2mj.errors import Ig2mjError

    chosen = own_robot(robot, own)
    if chosen is None:
        raise Ig2mjError("name a robot: its FOLDER, --robot-urdf FILE or --robot-mjcf FILE")
    tell_robot(chosen.folder, picture=picture)


def try_(
    robot: Annotated[str | None, tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER")] = None,
    own: Own = NONE,
    home: str = "small_home",
    tries: int = 10,
    grasping: str = "physical",
    seed: int = 0,
    json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> int:
    """Try a robot in a home: does it stand for 5 s, drive 1 m, and lift a cube of 0.2 kg?

    Exit status: 0 it does what it is made for (8 of 10 tries count as lifting), 1 it does not.

    Args:
      robot: folder that `ig2mj convert robot` wrote.
      home: folder of a converted scene, or the name of a home that comes with ig2mj.
      tries: number of tries to lift the cube.
      grasping: physical (by friction), assisted or sticky.
      seed: random seed of the cube's positions.
      json: print one JSON object.
    """
    import collections
    import dataclasses

    from ig2mj.agents.grasping import MODES
    from ig2mj.calibration.robot_trial import try_robot
    from ig2mj.cli.common.printing import print_json
    from ig2mj.cli.common.trial_props import make_prop
    from ig2mj.errors import Ig2mjError, UnknownNameError

    if grasping not in MODES or grasping == "mitten":
        raise UnknownNameError("grasping mode of a trial", grasping, [m for m in MODES if m != "mitten"])
    if tries < 1:
        raise Ig2mjError(f"--tries {tries}: at least one is needed")
    chosen = own_robot(robot, own)
    if chosen is None:
        raise Ig2mjError("name a robot: its FOLDER, --robot-urdf FILE or --robot-mjcf FILE")
    result = try_robot(chosen, make_prop, home, tries, grasping, seed)
    if json:
        print_json({"robot": chosen.name, **dataclasses.asdict(result), "passed": result.passed})
        return 0 if result.passed else 1
    print(f"{chosen.name}: {'stands' if result.stands else 'does not stand'}")
    if result.drives is not None:
        print(f"  drives {result.drives:.2f} m")
    if result.lifted:
        times = f"{sum(result.lifted)} of {len(result.lifted)}"
        print(
            f"  lifts a cube of {1000 * result.cube:.0f} mm in {times} tries ({result.needed} are needed),"
            f" {result.approach}, {result.mode}"
        )
        for reason, count in collections.Counter(filter(None, result.reasons)).items():
            print(f"    {count} of {len(result.lifted)}: {reason}")
        if not result.passed and grasping == "physical" and sum(result.lifted) < result.needed:
            print("    --grasping assisted: the hand holds what its fingers touch on both sides")
    if result.problem:
        print(f"  {result.problem}")
    return 0 if result.passed else 1


SUBCOMMANDS = {"show": show, "try": try_, "table": table}
