"""`ig2mj plugins`: what installed packages and files of one's own add, and whether it can be used."""

from __future__ import annotations

from typing import Annotated

import tyro


def run(json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False) -> int:
    """List what installed packages and files of your own add to ig2mj, and import it to see whether it works.

    Files are those of --plugin and of the variable IG2MJ_PLUGINS. `IG2MJ_PLUGINS=-NAME` switches an installed package
    off, and `IG2MJ_PLUGINS=none` all of them. Code of a plug-in runs with your rights.

    Args:
      json: print JSON instead of a table.
    """
    from ig2mj.cli.common.printing import make_table, print_json, stdout_console
    from ig2mj.errors import PluginError
    from ig2mj.plugins import GROUP, KINDS, registry_of
    from ig2mj.plugins.entry_points import installed

    rows: list[dict[str, str]] = []
    for kind in KINDS:
        registry = registry_of(kind)
        for name, source in registry.sources().items():
            try:
                registry[name]
                state = "works"
            except PluginError as e:
                state = str(e)
            rows.append({"kind": kind, "name": name, "from": source, "state": state})
    rows += [{"kind": p.kind, "name": p.name, "from": p.source, "state": "switched off"} for p in installed()[1]]
    if json:
        print_json(rows)
    elif rows:
        console = stdout_console()
        console.print(make_table("plug-ins", ["kind", "name", "from", "state"], [[*row.values()] for row in rows]))
    else:
        print(f"no plug-ins: no installed package has entry points of the group {GROUP}, and no file is named")
    return int(any(row["state"] not in ("works", "switched off") for row in rows))
