"""`ig2mj sample-task TASK`: samples an environment's start states, and keeps them in the cache."""

from __future__ import annotations

from typing import Annotated

import tyro


def run(
    task: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="TASK")],
    split: str = "train",
    count: int = 0,
    jobs: int = 0,
    anew: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> int:
    """Sample the start states of an environment, and keep them where `ig2mj.make` finds them.

    The same rows for any number of processes and on any machine; the file's hash is printed.

    Args:
      task: CookingMeat, or ig2mj/CookingMeat-v0.
      split: train, or held_out for evaluation: from other seeds.
      count: rows; 0: 512 for training, 1000 held out.
      jobs: processes; 0: one per processor.
      anew: sample them even if they are there.
    """
    import hashlib

    from ig2mj.cli.printing import add_bar, progress_bar
    from ig2mj.envs.registry import find_task
    from ig2mj.errors import Ig2mjError
    from ig2mj.tasks.pools import bare_scene, pool_file, pool_of
    from ig2mj.tasks.task import Task

    if count < 0 or jobs < 0:
        raise Ig2mjError(f"--count {count}, --jobs {jobs}: neither can be negative")
    found = find_task(task)
    if not isinstance(found, Task):
        raise Ig2mjError(f"{found.name} makes its start states anew each time: there is nothing to keep")
    file = pool_file(found, bare_scene(found), split, count or None)
    if anew:
        file.unlink(missing_ok=True)
    with progress_bar() as bar:
        report = add_bar(bar, f"start states of {found.name}")
        pool = pool_of(found, split, count or None, jobs=jobs, progress=lambda made, wanted: report("", made, wanted))
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    print(f"{file}: {pool.size} start states of {found.name} ({split}), sha256 {digest}")
    return 0
