"""`ig2mj sample-task TASK`: samples an environment's start states into the cache."""

from __future__ import annotations

import pathlib
from typing import TYPE_CHECKING, Annotated

import tyro

from ig2mj.cli.common.deprecated import renamed_options
from ig2mj.cli.common.objects import AddedObjects

if TYPE_CHECKING:
    from ig2mj.tasks.task import Task


@renamed_options({"--anew": "--force"})
def run(
    task: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="TASK")],
    split: str = "train",
    count: int = 0,
    jobs: int = 0,
    force: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    variant: int = 0,
    grasping: str = "mitten",
    object: AddedObjects = (),
    out: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="DIR")] = None,
) -> int:
    """Sample the start states of an environment and store them where `ig2mj.make` finds them.

    Start states of the paper's activities ship with ig2mj, so that success rates are comparable between machines;
    nothing is sampled for them. With --out they are sampled into a folder and compared with those that ship; the exit
    status is 1 if rows differ. Rows do not depend on the number of processes, but they do on the kind of processor,
    which rounds contacts differently.

    Args:
      task: e.g. CookingMeat, ig2mj/CookingMeat-v0 or my_tasks.py:MugToTable; all: both splits of every activity.
      split: train, or held_out for evaluation (other seeds).
      count: number of rows; 0: 512 for train, 1000 for held_out. A smaller number gives the first rows of a larger one.
      jobs: number of processes; 0: one per processor.
      force: sample again even if the cache has the pool.
      variant: variant of the activity's objects: 1 and 2 use other models of the same categories.
      grasping: physical: with objects that fit between two fingers, for activities that have some (TASK all: both).
      object: {object}; the same as of `ig2mj train` and the others.
      out: folder for the pools, instead of the cache.
    """
    from ig2mj.agents.grasping import MODES
    from ig2mj.envs.registry import find_task
    from ig2mj.errors import Ig2mjError, UnknownNameError
    from ig2mj.tasks.activities import ACTIVITIES
    from ig2mj.tasks.added_objects import with_objects
    from ig2mj.tasks.pools import COUNT
    from ig2mj.tasks.task import Task
    from ig2mj.tasks.variants import variant as task_variant

    if count < 0 or jobs < 0:
        raise Ig2mjError(f"--count {count}, --jobs {jobs}: neither can be negative")
    if grasping not in MODES:
        raise UnknownNameError("grasping mode", grasping, MODES)
    if task == "all" and object:
        raise Ig2mjError("--object is of one task: name it in place of all")
    if task == "all":
        tasks = [task_variant(each, variant) for each in ACTIVITIES.values()]
        tasks += [task_variant(each, variant, "physical") for each in ACTIVITIES.values() if each.physical is not None]
        return _keep([(each, part) for part in COUNT for each in tasks], count, jobs, force, out)
    found = find_task(task)
    if not isinstance(found, Task):
        raise UnknownNameError("task with a pool of start states", task, ACTIVITIES)
    chosen = with_objects(task_variant(found, variant, grasping), object)
    assert isinstance(chosen, Task)
    return _keep([(chosen, split)], count, jobs, force, out)


def _keep(pools: list[tuple[Task, str]], count: int, jobs: int, force: bool, out: pathlib.Path | None) -> int:
    """Samples missing pools in parallel; 1 if rows of one differ from those that ship."""
    import concurrent.futures
    import contextlib

    from ig2mj.cli.common.printing import add_bar, progress_bar
    from ig2mj.errors import Ig2mjError
    from ig2mj.process.program_cache import REMEDY
    from ig2mj.tasks.pool_files import different_rows
    from ig2mj.tasks.pools import COUNT, make_pool, pool_of, sampling_processes, start_states
    from ig2mj.worlds.pool import load_pool

    with contextlib.ExitStack() as stack:
        workers = None if jobs == 1 else stack.enter_context(sampling_processes(jobs))
        bar = stack.enter_context(progress_bar())

        def make(task: Task, split: str) -> tuple[str, bool]:
            states, rows = start_states(task, split), count or COUNT[split]
            report = add_bar(bar, f"start states of {task.name} ({split})")
            options = {"progress": report, "workers": workers}
            about = f"{rows} start states of {task.name} ({split})"
            ships = None if states.shipped is None else load_pool(states.shipped, states.scene)
            if out is None:
                if force:
                    states.cached.unlink(missing_ok=True)
                pool_of(task, split, rows, **options)
                if ships is not None and ships.size >= rows:
                    return f"{states.shipped}: {about}, which ship", False
                if not states.cached.is_file():
                    raise Ig2mjError(f"{states.cached} cannot be written: {REMEDY}")
                return f"{states.cached}: {about}", False
            file = out / states.cached.name
            if force:
                file.unlink(missing_ok=True)
            pool = make_pool(task, split, rows, file=file, **options)
            if ships is None:
                return f"{file}: {about}; none ship", False
            different = different_rows(pool, ships)
            if not different:
                return f"{file}: {about}, those that ship", False
            return (
                f"{file}: {about}; {len(different)} of {min(pool.size, ships.size)} differ from those that ship, first "
                f"row {different[0]}: another kind of processor, or another sampler. `ig2mj.make` takes those that ship"
            ), True

        threads = stack.enter_context(concurrent.futures.ThreadPoolExecutor(1 if jobs == 1 else len(pools)))
        status = 0
        for text, differs in threads.map(lambda pair: make(*pair), pools):
            print(text, flush=True)
            status |= int(differs)
    return status
