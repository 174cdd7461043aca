"""`ig2mj doctor`: what this machine can run, and a command that fixes each missing part."""

from __future__ import annotations

from typing import Annotated

import tyro


def run(json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False) -> int:
    """Show what this machine can run, and how to fix what it cannot.

    The exit status is 0 if everything required is present, even if optional parts are missing; otherwise 1.

    Args:
      json: print JSON instead of a table.
    """
    from ig2mj.diagnosis.checks import diagnose, healthy
    from ig2mj.process.waiting import WAITING

    now = ["looking at this machine"]
    with WAITING.during(lambda: now[0]):  # on a terminal one line that changes, elsewhere a line now and then
        checks = diagnose(lambda text: now.__setitem__(0, text))
    ok = healthy(checks)
    if json:
        _print_json(checks, ok)
    else:
        _print_table(checks, ok)
    return 0 if ok else 1


def _print_json(checks, ok: bool) -> None:
    import dataclasses

    from ig2mj.cli.common.printing import print_json
    from ig2mj.process.own_version import own_version

    print_json({"ig2mj": own_version(), "ok": ok, "checks": [dataclasses.asdict(c) for c in checks]})


def _print_table(checks, ok: bool) -> None:
    from rich.markup import escape
    from rich.table import Table

    from ig2mj.cli.common.printing import stdout_console

    table = Table(box=None, pad_edge=False, show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    group = ""
    for check in checks:
        if check.group != group:
            group = check.group
            table.add_row("", f"[bold]{group}[/bold]", "")
        mark = "[green]ok[/green]" if check.ok else ("[red]BAD[/red]" if check.required else "[yellow]--[/yellow]")
        table.add_row(mark, f"  {escape(check.name)}", escape(check.found))
        if check.fix:
            table.add_row("", "", f"[cyan]-> {escape(check.fix)}[/cyan]")
    console = stdout_console()
    console.print(table)
    if ok:
        console.print("\nEverything that ig2mj needs is here. [yellow]--[/yellow] marks optional things.")
    else:
        console.print("\n[red]Something that ig2mj needs is missing[/red]: fix the lines marked BAD.")
