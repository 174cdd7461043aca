"""`ig2mj sample-task TASK`: samples an environment's start states, and keeps them in the cache."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import tyro

if TYPE_CHECKING:
    from ig2mj.tasks.task import Task


def run(
    task: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="TASK")],
    split: str = "train",
    count: int = 0,
    jobs: int = 0,
    anew: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> int:
    """Sample the start states of an environment, and keep them where `ig2mj.make` finds them.

    The same rows for any number of processes and on any machine; the file's hash is printed. Exit status 1 where a pool
    of the usual size is not, byte for byte, the one whose hash comes with ig2mj.

    Args:
      task: CookingMeat, or ig2mj/CookingMeat-v0; all: of every activity, both splits.
      split: train, or held_out for evaluation: from other seeds.
      count: rows; 0: 512 for training, 1000 held out.
      jobs: processes; 0: one per processor.
      anew: sample them even if they are there.
    """
    from ig2mj.envs.registry import find_task
    from ig2mj.errors import Ig2mjError, UnknownNameError
    from ig2mj.tasks.activities import ACTIVITIES
    from ig2mj.tasks.pools import SEEDS
    from ig2mj.tasks.task import Task

    if count < 0 or jobs < 0:
        raise Ig2mjError(f"--count {count}, --jobs {jobs}: neither can be negative")
    if task == "all":
        return max(_keep(each, part, count, jobs, anew) for each in ACTIVITIES.values() for part in SEEDS)
    found = find_task(task)
    if not isinstance(found, Task):
        raise UnknownNameError("task with a pool of start states", task, ACTIVITIES)
    return _keep(found, split, count, jobs, anew)


def _keep(task: Task, split: str, count: int, jobs: int, anew: bool) -> int:
    """Samples one pool unless it is there; 1 where it is not the one of the known hash."""
    from ig2mj.cli.printing import add_bar, progress_bar
    from ig2mj.tasks.pools import bare_scene, known_hash, pool_file, pool_hash, pool_of

    file = pool_file(task, bare_scene(task), split, count or None)
    if anew:
        file.unlink(missing_ok=True)
    with progress_bar() as bar:
        report = add_bar(bar, f"start states of {task.name}")
        pool = pool_of(task, split, count or None, jobs=jobs, progress=lambda made, wanted: report("", made, wanted))
    digest, known = pool_hash(file), known_hash(file)
    note = "" if known is None else ", the known hash" if known == digest else f", NOT THE KNOWN HASH {known}"
    print(f"{file}: {pool.size} start states of {task.name} ({split}), sha256 {digest}{note}")
    return int(known is not None and known != digest)
