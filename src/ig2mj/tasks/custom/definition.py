"""`CustomTask` and `register_task`: a task as a class, or a function, in a file of the user's.

    import ig2mj

    @ig2mj.register_task
    class MugToTable(ig2mj.CustomTask):
        \"\"\"Bring the mug to the breakfast table.\"\"\"

        home = "birch"
        objects = ("mug",)
        start = ("(on_top mug_0 countertop_0)",)
        goal = "(on_top mug_0 breakfast_table_0)"
        robots = ("fetch",)

`ig2mj train my_tasks.py:MugToTable`, `ig2mj.make("my_tasks.py:MugToTable")`, and after an import of the file
`ig2mj.make("MugToTable")` take it by name.

Axes: W worlds, n numbers.
"""

from __future__ import annotations

import dataclasses
import difflib
import functools
import os
import pathlib
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, TypeVar

import numpy as np

from ig2mj.agents.registry import is_robot_folder, make_robot
from ig2mj.errors import InputError, UnknownNameError
from ig2mj.predicates import logic
from ig2mj.predicates.literals import names_of_objects
from ig2mj.predicates.parse import parse
from ig2mj.scene.paths import MANIFEST_FILE, scene_folder
from ig2mj.tasks.added_objects import with_objects
from ig2mj.tasks.bddl.task import PREFIX, BddlTask, bddl_task
from ig2mj.tasks.custom.code import NOTEBOOK, TaskCode, blamed, call, shown
from ig2mj.tasks.custom.digest import digest_in, digest_of_object
from ig2mj.tasks.homes import AnyTask
from ig2mj.tasks.navigation.task import NavigationTask
from ig2mj.tasks.points import Point
from ig2mj.tasks.registry import REGISTERED, TASKS, load_task
from ig2mj.tasks.task import HORIZON, RIGHT, Acts, Near, Task, Weights

T = TypeVar("T")

FUNCTIONS = ("measure", "reward", "success", "failure", "observe")
"""Methods of a task that compute on all worlds."""


class CustomTask:
    """A task of your own: derive a class, and state what differs from what is here. All methods are optional.

    `measure`, `reward`, `success`, `failure` and `observe` take a `TaskView` of all worlds, and are pure: compiled on
    every engine, they see arrays without values. Use jax.numpy, `jnp.where` instead of `if`, and no random numbers,
    files or globals that change. `start` and `expert` are described with them.

    Attributes:
      base: a task, or its name, of which this is a variation: "PointNavigation", "activity/cleaning_windows",
        "activity/mine.bddl", or a `Task`. What is not stated here is that task's. None: none.
      home: a home that ships, or a folder, relative to the file's own.
      objects: what is added to it, as `load_scene(objects=...)` takes it; folders are relative to the file's own.
      start: conditions of the start states, or a method `start(self, home, rng)` that makes one (`StartWorld`).
      near, flat, upright: restrictions of the start states, see `ig2mj.tasks.task.Task`.
      goal: expression; an episode ends with success when it holds. '' where `success` says it.
      objects_of_interest: names of what the task is about, the first is what mittens take hold of; (): the objects that
        the goal names, loose ones first.
      distances: pairs of points whose distances the reward is made of without a method `reward`. weights: its weights.
      robots: names of those that take part, the usual one first, or folders that `ig2mj convert robot` wrote; each
        starts on free floor near the objects, and faces them. Or by name where each starts: (x, y), (x, y, degrees) in
        m, or an `Acts`.
      hands: number of the hands that act. whole_actions: an action has every number of the robot's controller, its
        drive among them, instead of the hands alone.
      grasping: mode unless another is asked for. horizon: agent steps until an episode is truncated.

    Methods:
      measure(self, world): arrays [W, ...] by name, `world.now` of the others, and `world.before` in the next step.
      reward(self, world): of the step, [W], or its terms by name. Without it: the fraction of the goal that was gained,
        and `distances`.
      success(self, world): in which worlds the task is done, [W], in place of `goal`.
      failure(self, world): in which worlds the episode ends without success, [W].
      observe(self, world): the observation `privileged_state`, [W, n], or arrays [W, ...] by name.
      expert(self, see): see `ig2mj.tasks.task.Task`.
    """

    base: ClassVar[str | AnyTask | None] = None
    home: ClassVar[str | os.PathLike] = ""
    objects: ClassVar[Sequence[str]] = ()
    start: ClassVar[Sequence[str] | Callable[..., Any]] = ()
    near: ClassVar[Sequence[Near]] = ()
    flat: ClassVar[Sequence[str]] = ()
    upright: ClassVar[Sequence[str]] = ()
    goal: ClassVar[str] = ""
    objects_of_interest: ClassVar[Sequence[str]] = ()
    distances: ClassVar[Sequence[tuple[Point, Point]]] = ()
    weights: ClassVar[Weights] = Weights(share=True)
    robots: ClassVar[str | Sequence[str] | Mapping[str, Any]] = ("fetch",)
    hands: ClassVar[int] = 1
    whole_actions: ClassVar[bool] = False
    grasping: ClassVar[str] = "assisted"
    horizon: ClassVar[int] = HORIZON

    measure: ClassVar[Callable[..., Any] | None] = None
    reward: ClassVar[Callable[..., Any] | None] = None
    success: ClassVar[Callable[..., Any] | None] = None
    failure: ClassVar[Callable[..., Any] | None] = None
    observe: ClassVar[Callable[..., Any] | None] = None
    expert: ClassVar[Callable[..., Any] | None] = None


SETTINGS = tuple(name for name in vars(CustomTask) if not name.startswith("_"))
"""What a task may state."""

Definition = type[CustomTask] | CustomTask | Task | NavigationTask | BddlTask | Callable[[], Any]
"""What defines a task: a class, a task, or a function that gives one of them."""


class RegisteredTask:
    """A task by its definition; it is made when it is first used. Attributes: name, file: of the definition."""

    def __init__(self, definition: Any, name: str, file: str):
        self._definition, self.name, self.file = definition, name, file

    @property
    def reference(self) -> str:
        """The name by which other processes of this machine find it: with its file, where it has one."""
        return TaskCode(self.file, self.name).reference

    @functools.cached_property
    def task(self) -> AnyTask:
        """Raises InputError: the definition states something that cannot be."""
        return _task(self._definition, self.name, self.file, _digest(self._definition, self.name, self.file))


def register_task(definition: T) -> T:
    """Makes a task known to `ig2mj.make` and to Gymnasium by its name; a decorator.

    Args:
      definition: a class derived from `CustomTask`, or a function without arguments that gives a task.

    Raises:
      InputError: it is neither, states what no task has, or another task has its name.
    """
    register(definition, getattr(definition, "__name__", ""), _file_of(definition))
    return definition


def register(definition: Any, name: str, file: str) -> RegisteredTask:
    """Registers a definition of a file; one of the same name and file is replaced. Raises as `register_task`."""
    where = shown(file)
    task = isinstance(definition, AnyTask | CustomTask)
    if not name.isidentifier() or not (task or callable(definition)):
        kind = type(definition).__name__
        expected = "a class derived from ig2mj.CustomTask, or a function that gives a task"
        raise InputError(where, f"is of type {kind}: {expected} is expected", element=name or repr(definition)[:80])
    if isinstance(definition, type) and not issubclass(definition, CustomTask):
        raise InputError(where, "is a class of another kind", element=name, fix="derive it from ig2mj.CustomTask")
    if isinstance(definition, type):
        _check_names(definition, where)
    if name in TASKS:
        raise InputError(where, "a task of ig2mj has this name", element=name, fix="choose another name")
    known = REGISTERED.get(name)
    if known is not None and not _same_file(known.file, file):
        fix = "choose another name for one of them"
        raise InputError(where, f"{shown(known.file)} defines a task of this name, too", element=name, fix=fix)
    REGISTERED[name] = made = RegisteredTask(definition, name, file)
    _tell_gymnasium()
    return made


def task_of(definition: Any) -> AnyTask:
    """The task of a definition: of a class or function, or of a task itself. Raises InputError."""
    if isinstance(definition, AnyTask):
        return definition
    name = getattr(definition, "__name__", type(definition).__name__)
    known = REGISTERED.get(name)
    if known is not None and known._definition is definition:
        return known.task
    file = _file_of(definition)
    return _task(definition, name, file, _digest(definition, name, file))


def _tell_gymnasium() -> None:
    """Registers the names with Gymnasium, where it is imported."""
    hook = sys.modules.get("ig2mj.envs.gymnasium_hook")
    if hook is not None:
        hook.register_now_or_later()


def _same_file(one: str, other: str) -> bool:
    if NOTEBOOK in (one, other):
        return one == other
    return pathlib.Path(one).resolve() == pathlib.Path(other).resolve()


def _file_of(definition: Any) -> str:
    """The file that a definition stands in; `NOTEBOOK` where there is none."""
    code = getattr(definition, "__code__", None)
    kind = definition if isinstance(definition, type) else type(definition)
    module = sys.modules.get(getattr(kind, "__module__", ""))
    file = getattr(code, "co_filename", None) or getattr(module, "__file__", None)
    if file is None or not pathlib.Path(file).is_file():
        return NOTEBOOK
    named = getattr(definition, "__name__", "")
    return file if named in pathlib.Path(file).read_text(encoding="utf-8", errors="replace") else NOTEBOOK


def _digest(definition: Any, name: str, file: str) -> str:
    if isinstance(definition, BddlTask) and definition.code is not None:
        return definition.code.digest
    if file != NOTEBOOK and "<locals>" not in getattr(definition, "__qualname__", ""):
        module = sys.modules.get(getattr(definition, "__module__", ""))
        source = getattr(module, "__ig2mj_source__", None) or pathlib.Path(file).read_text(encoding="utf-8")
        found = digest_in(source, name, pathlib.Path(file).resolve().parent)
        if found is not None:
            return found
    return digest_of_object(definition if callable(definition) else type(definition))


def _check_names(kind: type, where: str) -> None:
    """Raises InputError for a setting that no task has and that is nearly the name of one."""
    own = {name for base in kind.__mro__ if base not in (CustomTask, object) for name in vars(base)}
    for name in sorted(own - {"distance"}):
        if name.startswith("_") or name in SETTINGS or callable(getattr(kind, name)):
            continue
        near = difflib.get_close_matches(name, SETTINGS, n=1, cutoff=0.85)
        if near:
            raise InputError(where, "is no setting of a task", element=f"{kind.__name__}.{name}", fix=f"'{near[0]}'?")


# From a definition to a task.


def _task(definition: Any, name: str, file: str, digest: str) -> AnyTask:
    code = TaskCode(file, name, digest)
    if callable(definition) and not isinstance(definition, type):
        definition = call(definition)
    if isinstance(definition, type):
        try:
            definition = definition()
        except TypeError as e:
            raise InputError(shown(file), f"cannot be made without arguments: {e}", element=name) from e
    if isinstance(definition, BddlTask) and definition.name == name:
        return definition
    if isinstance(definition, AnyTask):
        return dataclasses.replace(definition, name=name, code=code)  # pyright: ignore[reportArgumentType]
    if not isinstance(definition, CustomTask):
        kind = type(definition).__name__
        raise InputError(shown(file), f"gives {kind}: a task or a class of one is expected", element=name)
    code = code.with_functions(**{function: getattr(definition, function) for function in FUNCTIONS})
    if callable(definition.start):
        code = code.with_functions(start=definition.start)
    if definition.base is not None:
        return _variation(definition, code)
    return _new(definition, code)


def _new(own: CustomTask, code: TaskCode) -> Task:
    """The task of a class without a base."""
    where, folder = shown(code.file), _folder(code)
    if not own.home:
        raise InputError(where, "is missing: a home that ships, or a folder", element=f"{code.name}.home")
    if not own.goal and code.success is None:
        fix = 'goal = "(on_top mug_0 table_0)", or a method success(self, world)'
        raise InputError(where, "has neither a goal nor a method `success`", element=code.name, fix=fix)
    fields = {name: _checked(own, code, name, kind) for name, kind in _KINDS.items()}
    with blamed(code, "goal"):
        named = names_of_objects(logic.atoms(parse(own.goal))) if own.goal else []
    task = Task(
        name=code.name,
        summary=_summary(own),
        home=_relative(own.home, folder),
        objects=(),
        start=() if code.start is not None else _strings(own, code, "start"),
        near=tuple(own.near),
        goal=own.goal,
        objects_of_interest=_strings(own, code, "objects_of_interest") or tuple(named),
        distances=tuple(own.distances),
        robots=_robots(own, code),
        flat=_strings(own, code, "flat"),
        upright=_strings(own, code, "upright"),
        expert=own.expert,
        code=code,
        **fields,
    )
    objects = [_relative(requested, folder) for requested in _strings(own, code, "objects")]
    with blamed(code, "home"):
        scene_folder(task.home)
    with blamed(code, "objects"):
        made = with_objects(task, objects)
    assert isinstance(made, Task)
    return made


_KINDS: dict[str, type] = {"whole_actions": bool, "grasping": str, "horizon": int}

_REPLACED = ("objects", "goal", "near", "flat", "upright", "objects_of_interest", "distances")
"""Settings that `Task` has, too."""


def _variation(own: CustomTask, code: TaskCode) -> AnyTask:
    """The task of a class with a base: that task with what the class states."""
    where, folder, base = shown(code.file), _folder(code), own.base
    stated = {n for kind in type(own).__mro__ if kind not in (CustomTask, object) for n in vars(kind)}
    with blamed(code, "base"):
        found = _base(base, folder)
    fields: dict[str, Any] = {"name": code.name, "code": code}
    if type(own).__doc__:
        fields["summary"] = _summary(own)
    fields |= {name: _checked(own, code, name, _KINDS[name]) for name in ("grasping", "horizon") if name in stated}
    known = {field.name for field in dataclasses.fields(found)}
    for name in (*_REPLACED, "home", "robots", "start", "expert", "whole_actions"):
        if name not in stated or (name == "start" and code.start is not None and isinstance(found, Task)):
            continue
        if name not in known:
            kind = type(found).__name__
            raise InputError(where, f"a {kind} has no such setting to state", element=f"{code.name}.{name}")
        value = getattr(own, name)
        fields[name] = _relative(value, folder) if name == "home" else tuple(value) if name in _REPLACED else value
        if name == "goal":
            fields[name] = value
    if isinstance(found, Task) and "start" in stated:
        fields["start"] = () if code.start is not None else _strings(own, code, "start")
    if "robots" in stated:
        fields["robots"] = _robots(own, code) if isinstance(found, Task) else _names(own.robots)
    return dataclasses.replace(found, **fields)


def _base(base: Any, folder: pathlib.Path) -> AnyTask:
    if isinstance(base, AnyTask):
        return base
    if isinstance(base, str) and base.startswith(PREFIX):
        name = base.removeprefix(PREFIX)
        return bddl_task(str(folder / name) if name.endswith(".bddl") else name)
    if base in TASKS:
        return load_task(base)
    raise UnknownNameError("task", str(base), TASKS)


def _folder(code: TaskCode) -> pathlib.Path:
    """To which paths of a definition are relative."""
    return pathlib.Path() if code.file == NOTEBOOK else pathlib.Path(code.file).resolve().parent


def _relative(value: Any, folder: pathlib.Path) -> str:
    """A name as it is; a path, relative to the file's folder, as an absolute one."""
    text = os.fspath(value)
    for name in (text, text.rpartition("@")[0]):
        if name and (folder / name / MANIFEST_FILE).is_file():
            return f"{folder / name}{text[len(name) :]}"
    return text


def _strings(own: CustomTask, code: TaskCode, name: str) -> tuple[str, ...]:
    """A setting that is a list of texts; a single text stands for a list of one. Raises InputError."""
    value = getattr(own, name)
    value = (value,) if isinstance(value, str) else tuple(value) if isinstance(value, Sequence) else None
    if value is None or not all(isinstance(one, str | os.PathLike) for one in value):
        raise InputError(shown(code.file), "a list of texts is expected", element=f"{code.name}.{name}")
    return tuple(os.fspath(one) for one in value)


def _checked(own: CustomTask, code: TaskCode, name: str, kind: type) -> Any:
    value = getattr(own, name)
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        problem = f"is of type {type(value).__name__}: {kind.__name__} is expected"
        raise InputError(shown(code.file), problem, element=f"{code.name}.{name}")
    return value


def _summary(own: CustomTask) -> str:
    doc = (type(own).__doc__ or "").strip()
    return doc.splitlines()[0] if doc else ""


def _names(robots: Any) -> tuple[str, ...]:
    return (robots,) if isinstance(robots, str) else tuple(robots)


def _robots(own: CustomTask, code: TaskCode) -> dict[str, Acts]:
    """How each robot takes part. Raises InputError."""
    element, given = f"{code.name}.robots", own.robots
    places = given if isinstance(given, Mapping) else dict.fromkeys(_names(given))
    if not places:
        raise InputError(shown(code.file), "names no robot", element=element)
    found, folder = dict[str, Acts](), _folder(code)
    for given_name, place in places.items():
        name = str(folder / given_name) if is_robot_folder(str(folder / given_name)) else given_name
        if isinstance(place, Acts):
            found[name] = place
            continue
        with blamed(code, "robots"):
            body = make_robot(name)
        numbers = None if place is None else np.asarray(place, float)
        if numbers is not None and numbers.shape not in ((2,), (3,)):
            expected = "(x, y) or (x, y, degrees), in metres, or an Acts, is expected"
            raise InputError(shown(code.file), expected, element=f"{element}['{name}']")
        hands = tuple(range(own.hands))
        if name == "humanoid" and own.hands == 1:
            hands = RIGHT
        if own.whole_actions:
            hands = hands[: body.hand_count]
        found[name] = Acts(
            None if numbers is None else (float(numbers[0]), float(numbers[1])),
            float(numbers[2]) if numbers is not None and len(numbers) == 3 else 0.0,
            hands=hands,
            weights=own.weights,
        )
    return found
