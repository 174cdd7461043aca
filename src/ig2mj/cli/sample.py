"""`ig2mj sample SCENE CONDITION ...`: samples initial states in which conditions hold, or disturbed ones."""

from __future__ import annotations

import pathlib
from typing import TYPE_CHECKING, Annotated

import tyro

from ig2mj.cli.common.deprecated import renamed_options
from ig2mj.cli.common.jobs import Cluster, Resume, where_of
from ig2mj.cli.common.objects import AddedObjects
from ig2mj.files.shell import command

if TYPE_CHECKING:
    from ig2mj.cluster.job_runner import Where


@renamed_options({"--add": "--object *"})
def run(
    scene: Annotated[pathlib.Path, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")],
    conditions: Annotated[tuple[str, ...], tyro.conf.Positional, tyro.conf.arg(metavar="CONDITION")] = (),
    count: int = 64,
    out: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    seed: int = 0,
    jobs: int = 0,
    cluster: Cluster = None,
    resume: Resume = False,
    object: AddedObjects = (),
    disturb: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    share: float = 0.3,
    json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> int:
    """Sample initial states in which conditions hold, and write them as a pool for batched resets.

    A condition is a predicate, its negation, or a conjunction: "(on_top book_0 table_0)", "(not (open fridge_0))". A
    category in place of a name means any one object of it; plate and plate#2 are two different ones. The exit status
    is 0 only if every row was sampled; otherwise the reasons for failure are counted.

    Args:
      scene: folder of a converted scene, or the name of a home that comes with ig2mj.
      conditions: conditions that must hold together.
      count: number of rows.
      out: output file; default: pool.npz in the working directory.
      seed: the same seed gives the same pool.
      jobs: number of processes; 0: one per processor.
      cluster: run on a Ray cluster: its address, or auto.
      resume: continue an interrupted run.
      object: {object}.
      disturb: instead of conditions: shift, turn and drop loose objects at random.
      share: with --disturb: probability that a loose object is moved.
      json: print the result as JSON.
    """
    from ig2mj.cli.common.files import check_output
    from ig2mj.errors import Ig2mjError
    from ig2mj.scene.scene import load_scene

    if count < 1:
        raise Ig2mjError(f"--count {count}: a pool needs at least one row")
    if jobs < 0:
        raise Ig2mjError(f"--jobs {jobs}: 0 takes one process per processor, else at least one is needed")
    if not 0 <= share <= 1:
        raise Ig2mjError(f"--share {share}: a probability is between 0 and 1")
    if disturb == bool(conditions):
        raise Ig2mjError('give conditions, such as "(on_top apple_0 breakfast_table_0)", or --disturb')
    file = out or pathlib.Path("pool.npz")
    check_output(file)
    where = where_of(jobs, cluster, resume)
    loaded = load_scene(scene, objects=object)
    if disturb:
        return _disturb(loaded, count, file, seed, share, where)
    look = command("view", scene, "--pool", file)
    return _sample(loaded, conditions, count, file, seed, where, look="" if json else look)


def _disturb(loaded, count: int, file: pathlib.Path, seed: int, share: float, where: Where) -> int:
    from ig2mj.cli.common.jobs import follow, opened, tell_failures
    from ig2mj.sampling.settled_jobs import sample_settled
    from ig2mj.worlds.pool import save_pool

    request = {"command": "sample --disturb", "scene": loaded.digest, "rows": count, "seed": seed, "share": share}
    with opened(file, request, where) as journal, follow(f"settling {loaded.name}") as report:
        pool, failed = sample_settled(loaded, count, seed, share, where=where, journal=journal, progress=report)
        if pool is not None:
            save_pool(pool, file, loaded, {"seed": seed, "share": share})
            journal.finish()
    tell_failures(failed, len(failed))
    if pool is None:
        return 1
    print(f"{file}: {pool.size} settled states of {loaded.name}")
    return 0


def _sample(loaded, conditions, count: int, file: pathlib.Path, seed: int, where: Where, look: str) -> int:
    """`look`: the command that shows the pool; '': the result is printed as JSON."""
    import json
    import sys

    from ig2mj.cli.common.jobs import follow, opened, tell_failures
    from ig2mj.cli.common.printing import make_table, stdout_console
    from ig2mj.sampling.many import sample
    from ig2mj.worlds.pool import save_pool

    request = {"command": "sample", "scene": loaded.digest, "conditions": list(conditions), "rows": count, "seed": seed}
    with opened(file, request, where) as journal, follow(f"sampling in {loaded.name}") as report:
        done = sample(loaded, conditions, count, seed, where=where, journal=journal, progress=report)
        if done.pool is not None:
            save_pool(done.pool, file, loaded, {"seed": seed, "conditions": list(conditions), "rows": list(done.rows)})
        if not done.failed:
            journal.finish()
    lacking = count - len(done.rows) - len(done.failed)
    if not look:
        reasons = dict(done.rejected.most_common())
        print(json.dumps({"file": str(file) if done.pool else None, "rows": len(done.rows), "requested": count,
                          "seconds": round(done.seconds, 3), "rejected": reasons, "failed": done.failed}))  # fmt: skip
    elif done.pool is not None:
        print(f"{file}: {done.pool.size} of {count} states of {loaded.name} in {done.seconds:.1f} s "
              f"(look: {look})")  # fmt: skip
    tell_failures(done.failed, count)
    if lacking and look:
        print(f"{lacking} of {count} rows could not be sampled", file=sys.stderr)
        rows = [(reason, str(n)) for reason, n in done.rejected.most_common(12)]
        stdout_console().print(make_table("why candidates were turned down", ("reason", "times"), rows))
    return 0 if done.complete else 1
