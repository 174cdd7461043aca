"""`ig2mj list-envs`: the environments and their robots."""

from __future__ import annotations

from typing import Annotated

import tyro


def run(
    files: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="FILE.py")] = (),
    json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> int:
    """List the environments with their tasks, homes and robots.

    Activities of BEHAVIOR-100 are environments, too: activity/NAME (`ig2mj activity list`). Exit status: 1 if a task of
    a file is not sound.

    Args:
      files: list the tasks of these files of yours instead; this imports them.
      json: print JSON instead of a table.
    """
    import json as form
    import sys

    from ig2mj.cli.common.printing import make_table, stdout_console
    from ig2mj.envs.names import NAMESPACE, VERSION
    from ig2mj.envs.registry import find_task, list_envs
    from ig2mj.envs.setups import able_robots
    from ig2mj.errors import Ig2mjError
    from ig2mj.tasks.custom.files import task_names

    names = [f"{file}:{name}" for file in (f.removesuffix(":") for f in files) for name in task_names(file)]
    found, faulty = [], False
    for name in names or list_envs():
        try:
            task = find_task(name)
            found.append((task, able_robots(task)))
        except Ig2mjError as e:
            print(f"error: {e}", file=sys.stderr)
            faulty = True
    if json:
        rows = [
            {
                "name": t.name,
                "id": f"{NAMESPACE}/{t.name}-v{VERSION}",
                "home": t.home,
                "robots": robots,
                "goal": getattr(t, "goal", ""),
                **({} if t.code is None else {"file": t.code.file}),
                "summary": t.summary,
            }
            for t, robots in found
        ]
        print(form.dumps(rows))
        return int(faulty)
    rows = [(t.name, t.home, ", ".join(robots), t.summary) for t, robots in found]
    stdout_console().print(make_table("environments", ("name", "home", "robots", "task"), rows))
    if not files:
        print("\nactivity/NAME is each of BEHAVIOR-100's activities; `ig2mj activity list` names them.")
    return int(faulty)
