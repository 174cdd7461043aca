"""Names and definitions of activities: of BEHAVIOR-100, of BEHAVIOR-1K once fetched, or of any file."""

from __future__ import annotations

import os
import pathlib

from ig2mj.errors import UnknownNameError
from ig2mj.files.content import read_text
from ig2mj.files.limits import refuse_more
from ig2mj.knowledge import bddl_folder
from ig2mj.tasks.bddl import behavior1k
from ig2mj.tasks.bddl.problem import Problem, parse_problem
from ig2mj.tasks.bddl.vocabulary import Activity, lower

FILE = "problem0.bddl"


def activity_names(behavior_1k: bool = False) -> list[str]:
    """Names of all activities of BEHAVIOR-100, or of BEHAVIOR-1K, sorted.

    Raises:
      MissingDependencyError: the definitions are not there; the message names the command that fetches them.
    """
    return sorted(file.parent.name for file in _folder(behavior_1k).glob(f"*/{FILE}"))


def read_problem(name: str | os.PathLike, behavior_1k: bool = False) -> Problem:
    """The definition of an activity.

    Args:
      name: of an activity, or the path of a definition (it ends in .bddl).
      behavior_1k: of BEHAVIOR-1K instead of BEHAVIOR-100: some names occur in both.

    Raises:
      UnknownNameError: no such activity. BddlError: the file is not a definition, naming line and word. InputError: it
        cannot be read, or names more objects than `ig2mj.files.limits` allows.
    """
    if os.fspath(name).endswith(".bddl"):
        file, tolerant = pathlib.Path(name), False
    else:
        file, tolerant = _folder(behavior_1k) / name / FILE, True
        if pathlib.PurePath(name).name != os.fspath(name) or "\0" in os.fspath(name) or not file.is_file():
            raise UnknownNameError("activity", os.fspath(name), activity_names(behavior_1k))
    text = read_text(file, fix="name a BDDL definition")
    problem = parse_problem(text, str(file), tolerant=tolerant)
    refuse_more("BDDL_OBJECTS", sum(map(len, problem.objects.values())), "names", file, ":objects", " objects")
    return problem


def load_activity(name: str | os.PathLike, behavior_1k: bool = False) -> Activity:
    """An activity in ig2mj's predicates. Raises as `read_problem`, and VocabularyError where it needs others."""
    problem = read_problem(name, behavior_1k)
    file = pathlib.Path(problem.file)
    return lower(problem, file.parent.name if file.name == FILE else file.stem)


def _folder(behavior_1k: bool) -> pathlib.Path:
    return behavior1k.definitions() if behavior_1k else bddl_folder() / "activity_definitions"
