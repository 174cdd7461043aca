"""`ig2mj list-envs`: the environments and their robots."""

from __future__ import annotations

from typing import Annotated

import tyro


def run(json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False) -> int:
    """List the environments with their tasks, homes and robots.

    Activities of BEHAVIOR-100 are environments, too: activity/NAME (`ig2mj activity list`).

    Args:
      json: print JSON instead of a table.
    """
    import json as form

    from ig2mj.cli.common.printing import make_table, stdout_console
    from ig2mj.envs.names import NAMESPACE, VERSION
    from ig2mj.envs.registry import TASKS
    from ig2mj.envs.setups import able_robots

    if json:
        rows = [
            {
                "name": t.name,
                "id": f"{NAMESPACE}/{t.name}-v{VERSION}",
                "home": t.home,
                "robots": able_robots(t),
                "goal": t.goal,
                "summary": t.summary,
            }
            for t in TASKS.values()
        ]
        print(form.dumps(rows))
        return 0
    rows = [(t.name, t.home, ", ".join(able_robots(t)), t.summary) for t in TASKS.values()]
    stdout_console().print(make_table("environments", ("name", "home", "robots", "task"), rows))
    print("\nactivity/NAME is each of BEHAVIOR-100's activities; `ig2mj activity list` names them.")
    return 0
