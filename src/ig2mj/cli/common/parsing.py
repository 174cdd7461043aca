"""A function's typed parameters as a command line, by tyro."""

from __future__ import annotations

import inspect
import typing
from collections.abc import Callable, Sequence
from typing import Annotated, Any

import tyro

from ig2mj.agents.registry import ROBOTS
from ig2mj.cli.common.deprecated import with_new_names
from ig2mj.cli.common.objects import HELP, with_changes
from ig2mj.errors import Ig2mjError


def parse_and_call(function: Callable[..., Any], prog: str, args: Sequence[str]) -> Any:
    """The function's result for the arguments of the command line. Raises SystemExit, as tyro does."""
    args = gathered(function, with_changes(function, with_new_names(function, prog, args)))
    _check_options(function, prog, args)
    return tyro.cli(_with_quiet_defaults(function), prog=prog, args=args, config=(tyro.conf.DisallowNone,))


def gathered(function: Callable[..., Any], args: Sequence[str]) -> list[str]:
    """The command line in which an option that takes several values, and is given several times, is given once, with
    all of them: tyro takes the values of the last one alone."""
    several = {name for name, hint in typing.get_type_hints(function, include_extras=True).items() if _is_tuple(hint)}
    groups, first = list[list[str]]([[]]), dict[str, list[str]]()
    for word in args:
        option, equals, value = word.partition("=")
        name = option.removeprefix("--").replace("-", "_")
        if not word.startswith("--"):
            groups[-1].append(word)
        elif name not in several:
            groups.append([word])
        else:
            known = first.setdefault(name, [option])
            groups = [group for group in groups if group is not known] + [known]
            known += [value] * bool(equals)
    return [word for group in groups for word in group]


def _is_tuple(hint: Any) -> bool:
    """Of any length, and all values follow one option."""
    bare, *about = typing.get_args(hint) if typing.get_origin(hint) is Annotated else (hint,)
    others = (tyro.conf.UseAppendAction, tyro.conf.Positional)
    return typing.get_origin(bare) is tuple and typing.get_args(bare)[-1] is ... and not any(a in others for a in about)


_MEANT = {"num_envs": "worlds", "n_envs": "worlds", "num_worlds": "worlds"}
"""Names that other libraries have for an option."""


def _check_options(function: Callable[..., Any], prog: str, args: Sequence[str]) -> None:
    """Raises Ig2mjError: an option of another name, or one for an argument that is given by its position."""
    hints = typing.get_type_hints(function, include_extras=True)
    for arg in args:
        option = arg.partition("=")[0]
        name = option.removeprefix("--").replace("-", "_")
        if not option.startswith("--"):
            continue
        if name not in hints and _MEANT.get(name) in hints:
            raise Ig2mjError(f"there is no option {option}; the option is --{_MEANT[name]}")
        if name in hints and tyro.conf.Positional in getattr(hints[name], "__metadata__", ()):
            raise Ig2mjError(f"{option} is no option: {name.upper()} is positional, as in `{prog} {name.upper()}`")


def _with_quiet_defaults(function: Callable[..., Any]) -> Callable[..., Any]:
    """The same function, whose help omits "(default: None)", "(default: )" and "(default: False)".

    This is no plain wrapper, since tyro looks through `functools.wraps`.
    """
    hints = typing.get_type_hints(function, include_extras=True)
    signature = inspect.signature(function)
    for name, parameter in signature.parameters.items():
        if name in hints and (parameter.default in (None, ()) or parameter.default is False):
            hints[name] = Annotated[hints[name], tyro.conf.arg(help_behavior_hint="")]

    # (A def would be wrapped where types are checked.)
    call = lambda *args, **given: function(*args, **_with_a_usable_seed(given))  # noqa: E731
    call.__name__, call.__doc__, call.__annotations__ = (
        function.__name__,
        _unfolded(_with_robots(function.__doc__ or "")),
        hints,
    )
    parameters = [p.replace(annotation=hints.get(n, p.annotation)) for n, p in signature.parameters.items()]
    call.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    return call


def _with_a_usable_seed(given: dict[str, Any]) -> dict[str, Any]:
    """The arguments. Raises Ig2mjError where there is a `seed` below 0, which NumPy's generators refuse."""
    if isinstance(seed := given.get("seed"), int) and seed < 0:
        raise Ig2mjError(f"--seed {seed}: a seed is at least 0")
    return given


def _with_robots(doc: str) -> str:
    """A docstring in which `{robots}` stands for the names of robots, and `{object}` for what `--object` takes."""
    *names, last = ROBOTS
    return doc.replace("{robots}", f"{', '.join(names)} or {last}").replace("{object}", HELP)


def _unfolded(doc: str) -> str:
    """A docstring whose paragraphs and arguments are one line each: tyro keeps a line break before a digit, and some
    others, which then stands in the middle of a line of the help."""
    lines = list[str]()
    margin = 0
    for line in inspect.cleandoc(doc).splitlines():
        indent = len(line) - len(line.lstrip())
        new = not line.strip() or not lines or not lines[-1].strip() or lines[-1] == "Args:"
        if new or (indent <= margin and ": " in line and margin > 0):
            lines.append(line)
            margin = indent
        else:
            lines[-1] += f" {line.strip()}"
    return "\n".join(lines)
