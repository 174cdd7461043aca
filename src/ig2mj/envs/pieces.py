"""What pieces of work need of an environment on another machine: its start states, which take minutes to sample."""

from __future__ import annotations

from collections.abc import Mapping

from ig2mj.envs.registry import find_task
from ig2mj.tasks import pools
from ig2mj.tasks.pool_files import file_of_bytes
from ig2mj.tasks.task import Task
from ig2mj.tasks.variants import variant

POOL = "pool"
"""Name of the start states among the bytes that pieces share."""


def shared_pool(task: str, split: str, count: int | None) -> dict[str, bytes]:
    """The start states of an environment, to be shared by pieces; nothing where they ship or are made each time."""
    found = find_task(task)
    if not isinstance(found, Task):
        return {}
    pools.pool_of(found, split, count)
    file = pools.start_states(found, split).cached
    return {POOL: file.read_bytes()} if file.exists() else {}


def keep_pool(shared: Mapping[str, bytes], task: str, split: str, count: int | None) -> None:
    """Puts shared start states where `ig2mj.make` finds them, unless it finds as many already."""
    found = find_task(task)
    if POOL in shared and isinstance(found, Task):
        states = pools.start_states(found, split)
        if states.rows_at_hand < (count or 0) or not states.rows_at_hand:
            file_of_bytes(shared[POOL], states.cached)


def start_states(task: str, split: str, count: int | None) -> str:
    """What start states another machine would take: the same text where its homes and objects are the same."""
    found = find_task(task)
    return f"{pools.start_states(found, split).cached.name} {count}" if isinstance(found, Task) else task


def shipped_states(task: str, grasping: str, split: str) -> str | None:
    """Name of the file of start states that ships with the package; None: they are made on each machine."""
    found = find_task(task)
    if not isinstance(found, Task):
        return None
    file = pools.start_states(variant(found, 0, grasping), split).shipped
    return None if file is None else file.name
