"""Start states of an environment for jobs on other machines, since sampling them takes minutes.

`objects` of the functions: what is added to the home (`ig2mj.tasks.added_objects`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ig2mj.envs.registry import find_task
from ig2mj.tasks import pools
from ig2mj.tasks.added_objects import with_objects
from ig2mj.tasks.pool_files import file_of_bytes
from ig2mj.tasks.task import Task
from ig2mj.tasks.variants import variant

POOL = "pool"
"""Name of the start states in `JobSet.shared`."""


def shared_pool(task: str, split: str, count: int | None, objects: Sequence[str] = ()) -> dict[str, bytes]:
    """The start states of an environment for `JobSet.shared`; empty if they ship, or if none are stored."""
    found = with_objects(find_task(task), objects)
    if not isinstance(found, Task):
        return {}
    pools.pool_of(found, split, count)
    file = pools.start_states(found, split).cached
    return {POOL: file.read_bytes()} if file.exists() else {}


def keep_pool(
    shared: Mapping[str, bytes], task: str, split: str, count: int | None, objects: Sequence[str] = ()
) -> None:
    """Stores shared start states where `ig2mj.make` finds them, unless as many are there already."""
    found = with_objects(find_task(task), objects)
    if POOL in shared and isinstance(found, Task):
        states = pools.start_states(found, split)
        if states.rows_at_hand < (count or 0) or not states.rows_at_hand:
            file_of_bytes(shared[POOL], states.cached)


def start_states(task: str, split: str, count: int | None, objects: Sequence[str] = ()) -> str:
    """Digest of the start states that this machine would use; equal where homes and objects are equal."""
    found = with_objects(find_task(task), objects)
    own = "" if found.code is None else f" {found.code.digest}"
    return (f"{pools.start_states(found, split).cached.name} {count}" if isinstance(found, Task) else task) + own


def shipped_states(task: str, grasping: str, split: str) -> str | None:
    """Name of the file of start states that ships with the package; None: each machine samples them."""
    found = find_task(task)
    if not isinstance(found, Task):
        return None
    file = pools.start_states(variant(found, 0, grasping), split).shipped
    return None if file is None else file.name
