"""Old names of options and of sub-commands, which keep working until version 0.3.

A function of the command line names the options that were renamed:

    @renamed_options({"--drawn": "--stochastic", "--mixed": "--set augment_starts="})
    def run(stochastic: bool = False, set: tuple[str, ...] = ()) -> int: ...

An option that took several values, and is now given several times, is written "--NEW *". An option that became a
setting is written "--set NAME=" if it has a value (`--mixed 4` is then `--set augment_starts=4`), and "--set NAME=true"
if it is a flag. A module names sub-commands that were renamed in
`RENAMED = {"pictures": "images"}`, next to its `SUBCOMMANDS`. Help lists the new names only; each old name
that is typed prints one line on stderr.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

from ig2mj.process.deprecation import rename_text

F = TypeVar("F", bound=Callable[..., Any])

_ATTRIBUTE = "renamed_options"
_SET = "--set "
_EACH = " *"


def renamed_options(names: Mapping[str, str]) -> Callable[[F], F]:
    """Marks a function of the command line: old option -> new option or setting. See the module's text."""

    def mark(function: F) -> F:
        setattr(function, _ATTRIBUTE, dict(names))
        return function

    return mark


def renamed_options_of(function: Callable[..., Any]) -> Mapping[str, str]:
    """Old options of a function, and what replaces them."""
    return getattr(function, _ATTRIBUTE, {})


def with_new_names(function: Callable[..., Any], prog: str, args: Sequence[str]) -> list[str]:
    """The command line with current names. Prints one line on stderr for each old one."""
    renamed = renamed_options_of(function)
    out, settings = list[str](), list[str]()
    waiting = list(args)
    while waiting:
        word = waiting.pop(0)
        option, equals, value = word.partition("=")
        new = renamed.get(option.replace("_", "-")) if word.startswith("--") else None
        if new is None:
            out.append(word)
            continue
        _warn(prog, option, new.removesuffix(_EACH))
        if new.endswith(_EACH):
            values = [value] if equals else []
            while not equals and waiting and not waiting[0].startswith("--"):
                values.append(waiting.pop(0))
            out += [word for each in values for word in (new.removesuffix(_EACH), each)]
            continue
        if not new.startswith(_SET):
            out.append(new + equals + value)
            continue
        if new.endswith("=") and not equals and waiting:
            value = waiting.pop(0)
        settings.append(new.removeprefix(_SET) + value)
    if settings:
        word = _SET.strip()
        at = len(out) - 1 - out[::-1].index(word) if word in out else len(out)
        out[at : at + 1] = [word, *settings]
    return out


def new_subcommand(command: str, name: str, renamed: Mapping[str, str]) -> str:
    """The current name of a sub-command. Prints one line on stderr where the old one was typed."""
    if name not in renamed:
        return name
    _warn(f"ig2mj {command}", name, renamed[name])
    return renamed[name]


def _warn(prog: str, old: str, new: str) -> None:
    new += "VALUE" * new.endswith("=")
    print(f"{prog}: {rename_text(old, new)}", file=sys.stderr)
