"""The command `ig2mj`: finds the sub-command, imports only that one, and turns errors into one line.

A sub-command is one file of this package, named after it, and one line of `COMMANDS` below. Its file holds either
`run`, a function whose typed parameters are the command line (tyro reads them, and the docstring gives the help):

    def run(
        scene: Annotated[pathlib.Path, tyro.conf.Positional],
        json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    ) -> int | None:
        \"\"\"What `ig2mj inspect` does.

        Args:
          scene: folder of a converted scene.
          json: print JSON instead of tables.
        \"\"\"

or, where it has sub-commands itself (`ig2mj convert scene`), a table of such functions:

    SUBCOMMANDS = {"scene": convert_scene, "object": convert_object}

Rules for such a file:
  - Heavy imports (jax, mujoco, coacd) stand inside the functions, so that `--help` stays fast.
  - A function returns its exit status; None means 0.
  - Errors of the user are raised as `ig2mj.errors.Ig2mjError` and printed as one line on stderr, with status 2. So are
    missing packages (ModuleNotFoundError) and OSErrors.
  - Results go to stdout, progress and remarks to stderr, so that `--json` can be piped.
  - The name of a parameter that is a Python keyword: `Annotated[Vec3, tyro.conf.arg(name="from")]`.
  - Old names of options and sub-commands keep working until version 0.3: see `ig2mj.cli.common.deprecated`.
  - What several commands share is in `ig2mj.cli.common`.

Exit statuses: 0 done, 1 something failed (a check, or an error of ig2mj itself), 2 bad input or bad usage, 3 converted
with models skipped (`convert`), 130 interrupted.
"""

from __future__ import annotations

import difflib
import errno
import importlib
import multiprocessing.util
import os
import pathlib
import sys
import textwrap
import traceback
from collections.abc import Callable, Mapping, Sequence
from inspect import getdoc
from typing import Any

from ig2mj.cli.common.deprecated import new_subcommand
from ig2mj.errors import Ig2mjError
from ig2mj.install_hint import pip_install_module
from ig2mj.plugins import Registry
from ig2mj.plugins.named_files import name_file
from ig2mj.process.gc_pause import collect_seldom
from ig2mj.process.out_of_memory import is_out_of_memory, out_of_memory_text
from ig2mj.process.settings import default_variables
from ig2mj.process.spawning import allow_spawning
from ig2mj.process.variables import error_of_variable

#: Sub-command -> what it does, in the order of `ig2mj --help`. The module is `ig2mj.cli.<sub-command>`, a
#: hyphen in it an underscore.
COMMANDS: dict[str, str] = {
    "demo": "convert a small home, simulate it, cook a fish in it; let a robot cook",
    "convert": "convert iGibson scenes, URDF objects, and robots of URDF or MJCF",
    "view": "open a scene in MuJoCo's viewer, or write an image of it",
    "web": "show a scene, an environment or a recording in the browser",
    "inspect": "list a scene's objects, joints, abilities and rooms",
    "states": "list the extended states of a scene's objects",
    "predicates": "show which predicates are true in a scene, or why an expression is false",
    "calibrate": "measure the batched engine's buffers for a scene",
    "warm-up": "compile ahead of time what a batch of worlds needs, for this or other machines",
    "sample": "sample initial states in which conditions hold, as a pool for batched resets",
    "activity": "list BEHAVIOR's activities, show what each requires, sample its start states",
    "plan": "print the steps with which a robot reaches a goal, or does an activity",
    "solve": "plan and carry out the steps to a goal or an activity, and report how often it is reached",
    "list-envs": "list the environments and the robots that can do them",
    "play": "drive a robot in an environment by keyboard and mouse",
    "rollout": "play episodes of an environment and report how they ended",
    "train": "train a policy in an environment",
    "evaluate": "measure how often a policy succeeds from held-out start states",
    "episodes": "write and show fixed episodes on which policies are compared",
    "policies": "list the trained policies that ship, show their model cards, serve or add one",
    "vr": "do a task yourself, in a headset or with mouse and keyboard",
    "demos": "record demonstrations of scripted experts; replay, export, measure and convert recordings",
    "sample-task": "sample an environment's start states and store them in the cache",
    "objects": "list and show the objects that can be added to a home, add libraries of your own",
    "homes": "make a home of your own; list, build, convert and render those that come with ig2mj",
    "plugins": "list the states, commands and the like that installed packages and files of your own add",
    "robots": "show which parts of a robot of your own do what; try it in a home",
    "doctor": "show what this machine can run, and how to fix what it cannot",
}

#: Commands of plug-ins: functions as `run` is, or mappings as `SUBCOMMANDS` is.
ADDED: Registry[Any] = Registry(
    "command",
    "a function, or a mapping of functions by name,",
    lambda thing: callable(thing) or isinstance(thing, Mapping),
    COMMANDS,
    pattern="[a-z][a-z0-9-]*",
)

INTERRUPTED = 130
"""Exit status after Ctrl-C, as of shells."""

_USAGE = "usage: ig2mj [--debug] [--plugin FILE.py] [--version] COMMAND ..."


def main(argv: Sequence[str] | None = None) -> None:
    """Console script: runs the sub-command named in `argv` (default: the process's arguments) and exits."""
    for stream in ("stdout", "stderr"):
        if getattr(sys, stream) is None:  # the shell closed it: `>&-`
            setattr(sys, stream, pathlib.Path(os.devnull).open("w"))  # noqa: SIM115  as long as the process
    allow_spawning()
    collect_seldom()
    # XLA's C++ warnings, such as of its emitter of LLVM code, say nothing to a user. Read when JAX is imported.
    default_variables({"TF_CPP_MIN_LOG_LEVEL": "2"})
    status = call(sys.argv[1:] if argv is None else argv)
    if status == INTERRUPTED:
        # Files are closed by now. Libraries are not unloaded: XLA crashes if it was compiling.
        for process in multiprocessing.active_children():
            process.terminate()
        # Releases semaphores, which Python would otherwise report as leaked.
        multiprocessing.util._run_finalizers(0)  # pyright: ignore[reportAttributeAccessIssue]
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    sys.exit(status)


def call(argv: Sequence[str]) -> int:
    """Runs one command line and returns its exit status.

    Anywhere in it, `--debug` lets tracebacks through, and `--plugin FILE.py` imports a file first.
    """
    args = [a for a in argv if a != "--debug"]
    debug = len(args) < len(argv)
    try:
        status = _dispatch(_without_plugins(args))
        sys.stdout.flush()
        return status
    except SystemExit as e:  # tyro's own exits: 0 after --help, 2 on bad usage
        return _exit_status(e.code)
    except KeyboardInterrupt:
        if debug:
            raise
        print("interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # `ig2mj inspect | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 141
    except Exception as e:
        if debug:
            raise
        line, status = describe_error(e)
        print(f"error: {line}", file=sys.stderr)
        return status


def describe_error(error: Exception) -> tuple[str, int]:
    """One line for an error, and its exit status."""
    if isinstance(error, Ig2mjError):
        return " ".join(str(error).split()), 2
    if isinstance(error, ModuleNotFoundError) and error.name and not error.name.startswith("ig2mj"):
        return f"the Python package '{error.name}' is not installed ({pip_install_module(error.name)})", 2
    if isinstance(error, OSError) and not is_out_of_memory(error):
        name = error.filename or _written(error)
        where = f"{name}: " if name else ""
        return f"{where}{error.strerror or error}", 2
    if (known := error_of_variable(error)) is not None:
        return str(known), 2
    if is_out_of_memory(error):
        return out_of_memory_text(error), 2
    text = " ".join(str(error).split())
    return f"ig2mj failed with {type(error).__name__}: {text} (run it again with --debug for the traceback)", 1


def _written(error: OSError) -> pathlib.Path | None:
    """The file that could not be written: the OSError of a full disk has no file name, but a caller's frame does."""
    if error.errno not in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO):
        return None
    frames = [frame for frame, _ in traceback.walk_tb(error.__traceback__)]
    for frame in reversed(frames):
        if frame.f_globals.get("__name__", "").startswith(("rich.", "ig2mj.cli.common.printing")):
            return None  # the terminal, or where standard output goes
        found = [value for value in frame.f_locals.values() if isinstance(value, pathlib.Path)]
        if found:
            return found[-1]
    return None


def _without_plugins(args: list[str]) -> list[str]:
    """The arguments without `--plugin FILE`; the files are imported. Raises Ig2mjError: one is missing or fails."""
    rest: list[str] = []
    words = iter(args)
    for word in words:
        option, equals, file = word.partition("=")
        if option != "--plugin":
            rest.append(word)
            continue
        file = file if equals else next(words, "")
        if not file:
            raise Ig2mjError("--plugin needs a Python file, or the name of a module, that calls ig2mj.register")
        name_file(file)
    return rest


def _dispatch(args: list[str]) -> int:
    if not args or args[0] in ("-h", "--help", "help"):
        print(_help())
        return 0 if args else 2
    if args[0] == "--version":
        from ig2mj.process.own_version import own_version

        print(f"ig2mj {own_version()}")
        return 0
    name, rest = args[0], args[1:]
    if name not in COMMANDS:
        if name not in ADDED:
            return _unknown("command", name, ADDED, "ig2mj --help")
        added = ADDED[name]
        return _nested(name, rest, None, added) if isinstance(added, Mapping) else _run(added, f"ig2mj {name}", rest)
    module = importlib.import_module(f"ig2mj.cli.{name.replace('-', '_')}")
    subcommands: Mapping[str, Callable[..., Any]] | None = getattr(module, "SUBCOMMANDS", None)
    if subcommands is None:
        return _run(module.run, f"ig2mj {name}", rest)
    return _nested(name, rest, module.__doc__, subcommands, getattr(module, "RENAMED", {}))


def _nested(
    name: str,
    rest: list[str],
    doc: str | None,
    subcommands: Mapping[str, Callable[..., Any]],
    renamed: Mapping[str, str] | None = None,
) -> int:
    if not rest or rest[0] in ("-h", "--help"):
        print(_nested_help(name, doc, subcommands))
        return 0 if rest else 2
    sub = new_subcommand(name, rest[0], renamed or {})
    if sub not in subcommands and any(arg.lower().endswith(".urdf") for arg in rest):
        words = [
            f"`ig2mj {name} {known} --urdf FILE`" for known in ("object", "robot", "scene") if known in subcommands
        ]
        if words:
            print(f"error: '{sub}' is not a command of 'ig2mj {name}' (a URDF: {', '.join(words)})", file=sys.stderr)
            return 2
    if sub not in subcommands:
        return _unknown(f"command of 'ig2mj {name}'", sub, subcommands, f"ig2mj {name} --help")
    return _run(subcommands[sub], f"ig2mj {name} {sub}", rest[1:])


def _run(function: Callable[..., Any], prog: str, args: list[str]) -> int:
    from ig2mj.cli.common.parsing import parse_and_call

    return _exit_status(parse_and_call(function, prog, args))


def _exit_status(value: object) -> int:
    """A command's return value, or a SystemExit's code, as exit status. None is 0; a text is printed, and is 1."""
    if value is None:
        return 0
    if isinstance(value, int):
        return int(value)
    print(value, file=sys.stderr)
    return 1


def _help() -> str:
    lines = [
        _USAGE,
        "",
        "iGibson 2.0's household scenes, object states and predicates on MuJoCo and JAX.",
        "",
        "commands:",
    ]
    lines += [_entry(name, text) for name, text in COMMANDS.items()]
    lines += _help_of_plugins()
    lines += ["", "options:"]
    lines += [_entry("--debug", "show the traceback of an error"), _entry("--version", "print the version")]
    lines += [_entry("--plugin F", "import a Python file that calls ig2mj.register first")]
    lines += [
        "",
        "`ig2mj COMMAND --help` lists a command's options;",
        "`ig2mj doctor` shows what this machine can run.",
    ]
    return "\n".join(lines)


def _help_of_plugins() -> list[str]:
    """Lines of the commands of plug-ins; code of installed packages is not imported for them."""
    try:
        sources, plugins = ADDED.sources(), ADDED.plugins()
        texts = {name: f"{plugins[name].summary} ({source})" for name, source in sources.items() if name in plugins}
        for name in sources.keys() - texts.keys():
            doc = "" if isinstance(ADDED[name], Mapping) else (getdoc(ADDED[name]) or "").split("\n", 1)[0]
            texts[name] = f"{doc} ({sources[name]})"
    except Ig2mjError as e:
        return ["", f"commands of plug-ins cannot be listed: {e}"]
    return ["", "commands of plug-ins:", *(_entry(name, texts[name].strip()) for name in sources)] if sources else []


def _entry(name: str, text: str) -> str:
    """A line of help, folded to a terminal of 80 columns."""
    return textwrap.fill(text, 79, initial_indent=f"  {name:<12} ", subsequent_indent=" " * 15)


def _nested_help(name: str, doc: str | None, subcommands: Mapping[str, Callable[..., Any]]) -> str:
    summary = [COMMANDS.get(name, ""), ""] if not doc else [doc.strip().splitlines()[0], ""]
    lines = [f"usage: ig2mj {name} COMMAND ...", "", *summary, "commands:"]
    for sub, function in subcommands.items():
        text = (getdoc(function) or "").split("\n", 1)[0]
        lines.append(_entry(sub, text))
    return "\n".join([*lines, "", f"`ig2mj {name} COMMAND --help` lists a command's options."])


def _unknown(kind: str, name: str, known: Mapping[str, Any], help_command: str) -> int:
    near = difflib.get_close_matches(name, list(known), n=3, cutoff=0.5)
    hint = f"did you mean {' or '.join(near)}?" if near else f"`{help_command}` lists them"
    print(f"error: '{name}' is not a {kind} ({hint})", file=sys.stderr)
    return 2
