"""`TaskCode`: what a task says in functions of its author's, and a hash of what determines the task.

Axis: W worlds.
"""

from __future__ import annotations

import contextlib
import dataclasses
import os
import pathlib
import pkgutil
import traceback
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from ig2mj.errors import Ig2mjError, InputError

NOTEBOOK = "<python>"
"""File of a task that was not read from one, such as that of a notebook."""

IN_FILES = ("task_file", "task_code")
"""What recordings and policies have of a task in a user's code: the file's name, and the digest."""

Function = Callable[..., Any]


@dataclasses.dataclass(frozen=True, eq=False)
class TaskCode:
    """See the module's text. The functions take a `TaskView` and are pure.

    Attributes:
      file: where the task is defined. name: its name in the file. digest: of what determines it.
      measure: what the next step must know, arrays [W, ...] by name.
      reward: of the step, [W], or its terms by name. success, failure: in which worlds the episode ends so.
      terminated: in which worlds the episode ends, in place of the task's own ends.
      observe: [W, n], or arrays [W, ...] by name: `privileged_state`.
      start: makes one start state (`ig2mj.tasks.custom.start.StartWorld`).
      observations: further vectors [W, n] by name.
    """

    file: str = NOTEBOOK
    name: str = ""
    digest: str = ""
    measure: Function | None = None
    reward: Function | None = None
    success: Function | None = None
    failure: Function | None = None
    terminated: Function | None = None
    observe: Function | None = None
    start: Function | None = None
    observations: Mapping[str, Function] = dataclasses.field(default_factory=dict)

    @property
    def has_functions(self) -> bool:
        """Whether it says anything of measures, rewards, ends or observations."""
        functions = (self.measure, self.reward, self.success, self.failure, self.terminated, self.observe)
        return any(f is not None for f in functions) or bool(self.observations)

    @property
    def reference(self) -> str:
        """The name by which `ig2mj.make` finds the task from any folder of this machine."""
        if self.file.endswith(".bddl"):
            return f"activity/{pathlib.Path(self.file).resolve()}"
        return f"{pathlib.Path(self.file).resolve()}:{self.name}" if self.file != NOTEBOOK else self.name

    @property
    def in_files(self) -> dict[str, str]:
        """By the names of `IN_FILES`; the file without its folder."""
        return dict(zip(IN_FILES, (pathlib.PurePath(self.file).name, self.digest), strict=True))

    def with_functions(self, **functions: Any) -> TaskCode:
        """With other functions in place of some; None keeps what there is."""
        return dataclasses.replace(self, **{name: f for name, f in functions.items() if f is not None})

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickles have the task's name: another process reads the file itself."""
        if self.file == NOTEBOOK:
            raise Ig2mjError(f"{self.name}: other processes cannot read a task of a notebook (write it to a file)")
        return _read_again, (self.reference, self.digest)


def _read_again(reference: str, digest: str) -> TaskCode:
    code = pkgutil.resolve_name("ig2mj.tasks.custom.files:task_of_file")(reference).code
    if code is None or code.digest != digest:
        raise InputError(reference.rpartition(":")[0], "has changed since this command began", fix="start it again")
    return code


def shown(file: str | os.PathLike) -> str:
    """A file as its user writes it: relative to the working folder where it is below that."""
    path = pathlib.Path(file)
    with contextlib.suppress(ValueError, OSError):
        return str(path.resolve().relative_to(pathlib.Path.cwd()))
    return str(path)


def place_of(function: Function) -> str:
    """The file in which a function is defined."""
    code = getattr(getattr(function, "__func__", function), "__code__", None)
    file = getattr(code, "co_filename", NOTEBOOK)
    return shown(file) if pathlib.Path(file).is_file() else NOTEBOOK


def label_of(function: Function) -> str:
    """A function as errors name it: MugToTable.reward."""
    return str(getattr(function, "__qualname__", repr(function))).rpartition("<locals>.")[2]


def call(function: Function, *arguments: Any) -> Any:
    """Calls a function of the user's.

    Raises:
      InputError: it raised; the message names its file, the line and what was raised, and the traceback is the error's
        cause.
    """
    try:
        return function(*arguments)
    except Exception as e:
        where = line_in(e, place_of(function))
        raise InputError(place_of(function), _said(e), element=f"{label_of(function)}{where}") from e


def line_in(error: Exception, file: str) -> str:
    """', line 12' where an error passed through a file last; '' where it did not."""
    frames = [f for f in traceback.extract_tb(error.__traceback__) if shown(f.filename) == file]
    return f", line {frames[-1].lineno}" if frames else ""


PURE = "compute with jax.numpy instead of numpy, and with jnp.where instead of if"
"""What a function of arrays does."""


def _said(error: Exception) -> str:
    """The first sentence of an error of the user's code."""
    if isinstance(error, Ig2mjError):
        return str(error)
    kind = type(error).__name__
    if kind in ("TracerArrayConversionError", "TracerBoolConversionError", "ConcretizationTypeError"):
        return f"cannot be compiled ({kind}): it must be pure: {PURE}"
    if isinstance(error, ValueError) and "truth value of an array" in str(error):
        return f"an array has a value for each world, and no single truth value: {PURE}"
    text = next(iter(str(error).splitlines()), "")[:200]
    return f"{kind}: {text}" if text else kind


@contextlib.contextmanager
def blamed(code: TaskCode | None, part: str) -> Iterator[None]:
    """Within the block, errors about what a task names name the task's file, where it has one.

    Args:
      part: of the task's definition, such as "goal".
    """
    try:
        yield
    except Ig2mjError as e:
        if code is None or (isinstance(e, InputError) and e.file == shown(code.file)):
            raise
        raise InputError(shown(code.file), str(e), element=f"{code.name}.{part}") from e
