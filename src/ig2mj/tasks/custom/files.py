"""Tasks by file: `my_tasks.py:MugToTable`. The file is imported, which runs its code with the rights of the process."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import pathlib
import sys
from types import ModuleType
from typing import Any

from ig2mj.errors import Ig2mjError, InputError, UnknownNameError
from ig2mj.install_hint import pip_install_module
from ig2mj.plugins.named_files import import_named
from ig2mj.process.settings import name_for_processes
from ig2mj.tasks.bddl.task import DEFINITION, PREFIX, bddl_task
from ig2mj.tasks.custom.code import line_in, shown
from ig2mj.tasks.custom.definition import CustomTask, RegisteredTask, register
from ig2mj.tasks.homes import AnyTask
from ig2mj.tasks.registry import REGISTERED, TASKS, load_task, split_reference

SOURCE = "__ig2mj_source__"
"""Attribute of an imported file: the text that was run."""

VARIABLE = "IG2MJ_TASKS"
"""Environment variable with files whose tasks are known by their bare names, separated as those of PATH are."""


def import_files() -> None:
    """Registers the tasks of the files of `VARIABLE`: of Python, or BDDL definitions. Raises as `task_of_file`.

    Files of plug-ins may register tasks, too (`ig2mj.plugins`).
    """
    import_named()
    for file in filter(None, os.environ.get(VARIABLE, "").split(os.pathsep)):
        if file.endswith(DEFINITION):
            _register_definition(file)
        else:
            registered_of(file)


def use_task(reference: str) -> AnyTask:
    """The task of a reference, known by its bare name in this process and in those that it starts.

    Raises:
      Ig2mjError: it is neither FILE.py:NAME nor activity/FILE.bddl. Others as `task_of_file` and `bddl_task`.
    """
    definition = reference.removeprefix(PREFIX)
    if definition.endswith(DEFINITION):
        file, task = definition, _register_definition(definition)
    else:
        task, file = task_of_file(reference), reference.rpartition(":")[0]
    name_for_processes(VARIABLE, str(pathlib.Path(file).resolve()), os.pathsep)
    return task


def _register_definition(file: str) -> AnyTask:
    """Makes the task of a BDDL definition known by its name. Raises as `bddl_task`."""
    task = bddl_task(file)
    REGISTERED[task.name] = RegisteredTask(task, task.name, file)
    return task


def refuse_unknown(name: str, file_name: object, file: object) -> None:
    """Checks that the task that a file, such as a recording, names is known.

    Args:
      file_name: of the code in which it is defined, as the file says; None: it is none of the user's.

    Raises:
      InputError: it is in a file that was not named.
    """
    import_files()
    if file_name is None or name in REGISTERED:
        return
    problem = f"its task {name} is defined in {file_name}, which is read only where you name it"
    bddl = str(file_name).endswith(DEFINITION)
    reference = f"{PREFIX}PATH/{file_name}" if bddl else f"PATH/{file_name}:{name}"
    fix = f"--task {reference}; in Python, import the file in which @ig2mj.register_task registers it"
    fix = f"--task {reference}" if bddl else fix
    raise InputError(file, problem, fix=fix)


def task_of_file(reference: str) -> AnyTask:
    """The task of a reference such as "my_tasks.py:MugToTable".

    Raises:
      InputError: there is no such file, or it cannot be imported. UnknownNameError: it defines no such task.
    """
    split = split_reference(reference)
    if split is None:
        raise Ig2mjError(f"'{reference}' is not FILE.py:NAME")
    return registered_in(*split).task


def registered_in(file: str, name: str) -> RegisteredTask:
    """A task of a file, imported where it is not. Raises as `task_of_file`."""
    module = import_file(file)
    if not name:
        there = [f"{file}:{one}" for one in names_in(module)]
        raise InputError(shown(file), "is a file of tasks", fix=f"name one: {', '.join(there) or f'{file}:NAME'}")
    definition = getattr(module, name, None)
    if not _defines(definition, module):
        raise UnknownNameError(f"task of {shown(file)}", name, names_in(module), also=f"write {file}:NAME")
    known = REGISTERED.get(name)
    if known is not None and known._definition is definition:
        return known
    return register(definition, name, str(module.__file__))


def registered_of(file: str) -> list[RegisteredTask]:
    """All tasks of a file. Raises as `task_of_file`; InputError: it defines none."""
    return [registered_in(file, name) for name in task_names(file)]


def task_names(file: str) -> list[str]:
    """Names of the tasks of a file. Raises as `import_file`; InputError: it defines none."""
    names = names_in(import_file(file))
    if not names:
        fix = "a class derived from ig2mj.CustomTask is one"
        raise InputError(shown(file), "defines no task", fix=fix)
    return names


def names_in(module: ModuleType) -> list[str]:
    """Names of the tasks that a file defines: its classes, its tasks, and the functions that it registered."""
    return [name for name, value in vars(module).items() if not name.startswith("_") and _is_task(value, module, name)]


def _defines(value: Any, module: ModuleType) -> bool:
    """Whether it can define a task: any function of the file may."""
    own = getattr(value, "__module__", "") == module.__name__
    return isinstance(value, AnyTask | CustomTask) or (own and callable(value))


def _is_task(value: Any, module: ModuleType, name: str) -> bool:
    if isinstance(value, AnyTask | CustomTask):
        return not (value.name in TASKS and value is load_task(value.name)) if isinstance(value, AnyTask) else True
    if getattr(value, "__module__", "") != module.__name__:
        return False
    if isinstance(value, type):
        return issubclass(value, CustomTask)
    known = REGISTERED.get(name)
    return known is not None and known._definition is value


def import_file(file: str | os.PathLike) -> ModuleType:
    """A file as a module; the same while its text stays the same. Its folder can be imported from, as a script's can.

    Raises:
      InputError: there is no such file, it is no Python, or what it runs raises; the error's cause has the traceback.
    """
    path = pathlib.Path(file)
    try:
        source = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as e:
        why = "there is no such file" if isinstance(e, FileNotFoundError) else f"cannot be read: {e}"
        raise InputError(file, why, fix="FILE.py:NAME names a task of a Python file") from e
    full = str(path.resolve())
    for module in list(sys.modules.values()):  # imported already, by this function or by the user
        if getattr(module, SOURCE, None) == source and getattr(module, "__file__", None) == full:
            return module
    name = f"{path.stem}_{hashlib.blake2b(full.encode(), digest_size=4).hexdigest()}"
    spec = importlib.util.spec_from_loader(name, loader=None, origin=full)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    module.__file__ = full
    setattr(module, SOURCE, source)
    folder = str(path.resolve().parent)
    if folder not in sys.path:
        sys.path.append(folder)
    before = sys.modules.get(name)
    sys.modules[name] = module
    try:
        exec(compile(source, full, "exec"), vars(module))
    except BaseException as e:
        if before is None:
            del sys.modules[name]
        else:
            sys.modules[name] = before
        if isinstance(e, Ig2mjError) or not isinstance(e, Exception | SystemExit):
            raise
        raise InputError(shown(file), _why(e), element=_where(e, shown(full)), fix="--debug shows it") from e
    return module


def _why(error: BaseException) -> str:
    if isinstance(error, SyntaxError):
        return f"is not Python: {error.msg}"
    if isinstance(error, ModuleNotFoundError) and error.name:
        return f"imports '{error.name}', which is not installed ({pip_install_module(error.name)})"
    return f"cannot be imported: {type(error).__name__}: {next(iter(str(error).splitlines()), '')[:200]}"


def _where(error: BaseException, file: str) -> str:
    if isinstance(error, SyntaxError):
        return f"line {error.lineno}"
    return line_in(error, file).lstrip(", ") if isinstance(error, Exception) else ""
