"""Output of commands: tables for narrow terminals and for files, JSON, progress bars."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from ig2mj.callbacks import ProgressCallback

#: Columns of text where stdout is not a terminal, wide enough that nothing is folded away.
PIPED_WIDTH = 180
#: Blanks between two columns of a table.
GAP = 2

Rows = Iterable[Sequence[object]]


def stdout_console() -> Console:
    """A console on stdout: the terminal's width, or PIPED_WIDTH where it is a file or a pipe."""
    console = Console(highlight=False)
    return console if console.is_terminal else Console(highlight=False, width=PIPED_WIDTH)


def make_table(title: str, columns: Sequence[str], rows: Rows, width: int = PIPED_WIDTH) -> Table:
    """A table of texts.

    A column whose name starts with '>' is right-aligned. One whose name starts with '?' (before a '>') is left out
    where the table does not fit into `width`, the last of them first.
    """
    texts = [[str(cell) for cell in row] for row in rows]
    shown = list(range(len(columns)))
    for optional in [i for i, name in enumerate(columns) if name.startswith("?")][::-1]:
        if least_width([columns[i] for i in shown], [[row[i] for i in shown] for row in texts]) <= width:
            break
        shown.remove(optional)
    lacking = [_name(name) for i, name in enumerate(columns) if i not in shown]
    caption = f"a wider terminal shows: {', '.join(lacking)}" if lacking else None
    table = Table(title=escape(title), title_justify="left", title_style="bold", box=None, pad_edge=False,
                  caption=caption, caption_justify="left")  # fmt: skip
    for i in shown:
        right = columns[i].lstrip("?").startswith(">")
        table.add_column(escape(_name(columns[i])), justify="right" if right else "left", overflow="fold")
    for row in texts:
        table.add_row(*[escape(row[i]) for i in shown])
    return table


def least_width(columns: Sequence[str], rows: Rows) -> int:
    """Columns of text that a table needs so that no word is broken."""
    widest = [_longest_word(_name(name)) for name in columns]
    for row in rows:
        widest = [max(w, _longest_word(str(cell))) for w, cell in zip(widest, row, strict=True)]
    return sum(widest) + GAP * (len(widest) - 1)


def counted(number: int, what: str) -> str:
    """E.g. "1 warning", "2 warnings"."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def print_json(data: Any) -> None:
    """Indented JSON on stdout; also of msgspec structures. NaN and infinities become null."""
    import msgspec

    print(msgspec.json.format(msgspec.json.encode(data), indent=1).decode())


def progress_bar() -> Progress:
    """Bars on stderr that vanish when they are done; nothing at all where stderr is not a terminal.

    A task has the extra field `text`, e.g. `bar.add_task("converting", total=None, text="")`.
    """
    console = Console(stderr=True)
    return Progress(
        TextColumn("[bold]{task.description}"),
        BarColumn(bar_width=24),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[text]}"),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )


def add_bar(bar: Progress, title: str) -> ProgressCallback:
    """Opens a progress bar; returns the callback that moves it."""
    task = bar.add_task(title, total=None, text="")
    return lambda done, total, text="", /: bar.update(task, completed=done, total=total, text=text)


def _name(column: str) -> str:
    return column.lstrip("?").lstrip(">")


def _longest_word(text: str) -> int:
    return max((len(word) for word in re.split(r"\s+", text)), default=0)
