"""`ig2mj episodes make|show`: fixed episodes on which policies are compared."""

from __future__ import annotations

import pathlib
from typing import Annotated

import tyro


def make(
    task: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="TASK")],
    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="FILE")],
    count: int = 200,
    grasping: str | None = None,
) -> int:
    """Write a file of episodes of a task, on its held-out start states.

    Args:
      task: name of a task.
      out: the file, which ends with .npz.
      count: number of episodes.
      grasping: how hands hold; default: the task's.
    """
    from ig2mj.cli.common.files import check_output
    from ig2mj.errors import Ig2mjError
    from ig2mj.learn.episodes import make_episodes

    if count < 1:
        raise Ig2mjError(f"--count {count}: at least one episode")
    check_output(out)
    found = make_episodes(task, count, grasping)
    found.save(out)
    print(f"{out}: {found.count} episodes of {found.header['task']}, hash {found.header['hash']}")
    return 0


def show(
    name: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="EPISODES")],
    episode: int | None = None,
    json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> int:
    """Print what a file of episodes holds.

    Args:
      name: a file, or the name of a task whose episodes ship.
      episode: also print where this episode's objects start, from 0, and what was drawn for it.
      json: print one JSON object.
    """
    import json as form

    from ig2mj.errors import Ig2mjError
    from ig2mj.learn.episode_starts import described
    from ig2mj.learn.episodes import Episodes, find_episodes

    found = Episodes.load(find_episodes(name))
    if episode is not None and not 0 <= episode < found.count:
        raise Ig2mjError(f"--episode {episode}: the file has episodes 0 to {found.count - 1}")
    header = dict(found.header)
    content = {**header, "episodes": found.count}
    if episode is not None:
        content["episode"] = described(found, episode)
    if json:
        print(form.dumps(content))
        return 0
    print(f"{header['task']} in {header['scene']}, grasping {header['grasping']}: {found.count} episodes")
    print(f"hash {header['hash']}, {len(header['objects'])} objects")
    for robot, about in header["robots"].items():
        print(f"robot {robot} at {about['base_pos']}, cameras {', '.join(about['cameras'])}")
    print(f"instruction: {header['instructions']['usual'][0]}")
    print(f"axes: {', '.join(header['axes'])}")
    if episode is not None:
        start = content["episode"]
        print(f"episode {episode}, seed {start['seed']}:")
        for name, pose in start["objects"].items():
            print(f"  {name}: {pose['pos']} m, {pose['quat']}")
        for name, value in start["states"].items():
            print(f"  {name}: {value}")
        if not start["draws"]:
            print("what is drawn follows from the seed (format 1)")
            return 0
        print("drawn, each for its axis and for all together:")
        for name, value in start["draws"].items():
            print(f"  {name}: {value}")
    return 0


SUBCOMMANDS = {"make": make, "show": show}
