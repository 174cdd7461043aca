"""`ig2mj sample-task TASK`: samples an environment's start states, and keeps them in the cache."""

from __future__ import annotations

import json
import pathlib
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
    variant: int = 0,
    grasping: str = "mitten",
    hashes: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
) -> int:
    """Sample the start states of an environment and store them where `ig2mj.make` finds them.

    The rows do not depend on the number of processes or the machine; the file's hash is printed. The exit status is 1
    if a pool of the default size differs from the one whose hash comes with ig2mj.

    Args:
      task: e.g. CookingMeat or ig2mj/CookingMeat-v0; all: both splits of every activity.
      split: train, or held_out for evaluation (other seeds).
      count: number of rows; 0: 512 for training, 1000 held out.
      jobs: number of processes; 0: one per processor.
      anew: sample again even if the pool exists.
      variant: variant of the activity's objects: 1 and 2 use other models of the same categories.
      grasping: physical: objects that fit between two fingers, for activities that have them (TASK all: both).
      hashes: JSON file to which the pools' hashes are added, keyed by file name, in the form of
        src/ig2mj/tasks/pool_hashes.json.
    """
    from ig2mj.agents.grasping import MODES
    from ig2mj.envs.registry import find_task
    from ig2mj.errors import Ig2mjError, UnknownNameError
    from ig2mj.tasks.activities import ACTIVITIES
    from ig2mj.tasks.pools import COUNT
    from ig2mj.tasks.task import Task
    from ig2mj.tasks.variants import variant as task_variant

    if count < 0 or jobs < 0:
        raise Ig2mjError(f"--count {count}, --jobs {jobs}: neither can be negative")
    if grasping not in MODES:
        raise UnknownNameError("grasping mode", grasping, MODES)
    if task == "all":
        tasks = [task_variant(each, variant) for each in ACTIVITIES.values()]
        tasks += [task_variant(each, variant, "physical") for each in ACTIVITIES.values() if each.physical is not None]
        return _keep([(each, part) for part in COUNT for each in tasks], count, jobs, anew, hashes)
    found = find_task(task)
    if not isinstance(found, Task):
        raise UnknownNameError("task with a pool of start states", task, ACTIVITIES)
    return _keep([(task_variant(found, variant, grasping), split)], count, jobs, anew, hashes)


def _keep(wanted: list[tuple[Task, str]], count: int, jobs: int, anew: bool, hashes: pathlib.Path | None) -> int:
    """Samples the pools that are not there, side by side; 1 where one is not that of the known hash."""
    import concurrent.futures
    import contextlib

    from ig2mj.cli.printing import add_bar, progress_bar
    from ig2mj.tasks.pools import bare_scene, known_hash, pool_file, pool_hash, pool_of, sampling_processes

    status = 0
    with contextlib.ExitStack() as stack:
        workers = None if jobs == 1 else stack.enter_context(sampling_processes(jobs))
        bar = stack.enter_context(progress_bar())

        def make(task: Task, split: str) -> tuple[pathlib.Path, int]:
            file = pool_file(task, bare_scene(task), split, count or None)
            if anew:
                file.unlink(missing_ok=True)
            report = add_bar(bar, f"start states of {task.name} ({split})")
            pool = pool_of(
                task,
                split,
                count or None,
                progress=lambda made, wanted: report("", made, wanted),
                workers=workers,
            )
            return file, pool.size

        threads = stack.enter_context(concurrent.futures.ThreadPoolExecutor(1 if jobs == 1 else len(wanted)))
        for (task, split), (file, size) in zip(wanted, threads.map(lambda pair: make(*pair), wanted), strict=True):
            digest, known = pool_hash(file), known_hash(file)
            note = "" if known is None else ", the known hash" if known == digest else f", NOT THE KNOWN HASH {known}"
            print(f"{file}: {size} start states of {task.name} ({split}), sha256 {digest}{note}", flush=True)
            if hashes is not None:
                note_hash(hashes, file.name, digest)
            status |= int(known is not None and known != digest)
    return status


def note_hash(hashes: pathlib.Path, name: str, digest: str) -> None:
    """Adds a pool's hash to a JSON file of such hashes, or replaces the one of the same name."""
    known = json.loads(hashes.read_text()) if hashes.exists() else {}
    hashes.parent.mkdir(parents=True, exist_ok=True)
    hashes.write_text(json.dumps(dict(sorted({**known, name: digest}.items())), indent=1) + "\n")
