"""What pieces of work need of an environment on another machine: its start states, which take minutes to sample."""

from __future__ import annotations

from collections.abc import Mapping

from ig2mj.envs.registry import find_task
from ig2mj.files.unfinished import unfinished
from ig2mj.tasks.pools import bare_scene, pool_file, pool_of
from ig2mj.tasks.task import Task

POOL = "pool"
"""Name of the start states among the bytes that pieces share."""


def shared_pool(task: str, split: str, count: int | None) -> dict[str, bytes]:
    """The start states of an environment, to be shared by pieces; nothing where it makes its own each time."""
    found = find_task(task)
    if not isinstance(found, Task):
        return {}
    pool_of(found, split, count)
    return {POOL: pool_file(found, bare_scene(found), split, count).read_bytes()}


def keep_pool(shared: Mapping[str, bytes], task: str, split: str, count: int | None) -> None:
    """Puts shared start states where `ig2mj.make` finds them, unless they are there."""
    found = find_task(task)
    if POOL not in shared or not isinstance(found, Task):
        return
    file = pool_file(found, bare_scene(found), split, count)
    if file.exists():
        return
    file.parent.mkdir(parents=True, exist_ok=True)
    beside = unfinished(file)
    beside.write_bytes(shared[POOL])
    beside.replace(file)


def start_states(task: str, split: str, count: int | None) -> str:
    """What start states another machine would take: the same text where its homes and objects are the same."""
    found = find_task(task)
    return pool_file(found, bare_scene(found), split, count).name if isinstance(found, Task) else task
