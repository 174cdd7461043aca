"""Tasks in files of the user's: the option `--task` of commands that read a recording or a policy.

It takes FILE.py:NAME, or activity/FILE.bddl.
"""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from typing import Annotated

import tyro

TaskOption = Annotated[str | None, tyro.conf.arg(metavar="FILE.py:NAME")]


def use_task(reference: str | None) -> None:
    """Imports the file of a task, so that recordings and policies of the task find it; None: nothing is asked for.

    Raises:
      Ig2mjError: it is neither of these. InputError: the file cannot be imported. UnknownNameError: no such task in it.
    """
    if reference is not None:
        from ig2mj.tasks.custom.files import use_task as use

        use(reference)


def task_option(name: str) -> str:
    """What a command that reads a file of a task needs besides: " --task FILE.py:NAME", or '' for one that ships.

    Args:
      name: of the task, as it was given.
    """
    from ig2mj.tasks.registry import split_reference

    own = split_reference(name) is not None or name.endswith(".bddl")
    return f" --task {shlex.quote(name)}" if own else ""


ROWS = 8
"""Start states that are sampled for a person, or for a page."""


def few_rows(
    name: str, split: str, rows: int, objects: Sequence[str] = (), grasping: str | None = None, variant: int = 0
) -> int:
    """Number of start states that a few episodes of a task need: `rows` where its pool neither ships nor exists yet,
    so that sampling does not keep the user waiting; 0: all of the split.

    Args:
      rows: at least so many. The others: of `make`.

    Raises:
      As `make`.
    """
    from ig2mj.envs.registry import find_task
    from ig2mj.tasks.activities import ACTIVITIES
    from ig2mj.tasks.added_objects import with_objects
    from ig2mj.tasks.pools import COUNT, start_states
    from ig2mj.tasks.task import Task
    from ig2mj.tasks.variants import variant as task_variant

    task = find_task(name)
    if not isinstance(task, Task) or (task.name in ACTIVITIES and not objects and not variant):
        return 0
    whole = with_objects(task_variant(task, variant, grasping or task.grasping), tuple(objects))
    assert isinstance(whole, Task)
    there = start_states(whole, split).rows_at_hand
    return max(there, rows) if there < COUNT[split] else 0
