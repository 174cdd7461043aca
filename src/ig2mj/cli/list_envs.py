"""`ig2mj list-envs`: the environments and their robots."""

from __future__ import annotations

from typing import Annotated

import tyro


def run(
    files: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="FILE.py")] = (),
    json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> int:
    """List the environments with their tasks, homes and robots.

    Activities of BEHAVIOR-100 are environments, too: activity/NAME (`ig2mj activity list`).

    Args:
      files: list the tasks of these files of yours instead; this imports them.
      json: print JSON instead of a table.
    """
    import json as form

    from ig2mj.cli.common.printing import make_table, stdout_console
    from ig2mj.envs.names import NAMESPACE, VERSION
    from ig2mj.envs.registry import find_task, list_envs
    from ig2mj.envs.setups import able_robots
    from ig2mj.tasks.custom.files import registered_of

    if files:
        found = [known.task for file in files for known in registered_of(file.removesuffix(":"))]
    else:
        found = [find_task(name) for name in list_envs()]

    if json:
        rows = [
            {
                "name": t.name,
                "id": f"{NAMESPACE}/{t.name}-v{VERSION}",
                "home": t.home,
                "robots": able_robots(t),
                "goal": getattr(t, "goal", ""),
                **({} if t.code is None else {"file": t.code.file}),
                "summary": t.summary,
            }
            for t in found
        ]
        print(form.dumps(rows))
        return 0
    rows = [(t.name, t.home, ", ".join(able_robots(t)), t.summary) for t in found]
    stdout_console().print(make_table("environments", ("name", "home", "robots", "task"), rows))
    if not files:
        print("\nactivity/NAME is each of BEHAVIOR-100's activities; `ig2mj activity list` names them.")
    return 0
