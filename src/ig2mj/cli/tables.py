"""Printing for the commands: rich tables that stay readable when piped into a file."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rich.console import Console
from rich.markup import escape
from rich.table import Table

#: Columns of text where stdout is no terminal, wide enough that nothing is folded away.
PIPED_WIDTH = 180


def stdout_console() -> Console:
    """A console on stdout: the terminal's width, or PIPED_WIDTH where it is a file or a pipe."""
    console = Console(highlight=False)
    return console if console.is_terminal else Console(highlight=False, width=PIPED_WIDTH)


def make_table(title: str, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> Table:
    """A table of texts. A column whose name starts with '>' is right-aligned."""
    table = Table(title=escape(title), title_justify="left", title_style="bold", box=None, pad_edge=False)
    for column in columns:
        table.add_column(
            escape(column.lstrip(">")), justify="right" if column.startswith(">") else "left", overflow="fold"
        )
    for row in rows:
        table.add_row(*[escape(str(cell)) for cell in row])
    return table
