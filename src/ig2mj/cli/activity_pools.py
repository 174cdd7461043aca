"""`ig2mj activity sample` and `show --pool`: initial states of an activity, and what is false in one of them."""

from __future__ import annotations

import dataclasses
import pathlib
import shlex
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from ig2mj.cli.common.jobs import Cluster, Resume, follow, opened, tell_failures, where_of

if TYPE_CHECKING:
    from ig2mj.tasks.bddl.binding import Binding
    from ig2mj.tasks.bddl.start import SampledStart

Flag = Annotated[bool, tyro.conf.FlagCreatePairsOff]


def sample(
    name: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ACTIVITY")],
    scene: Annotated[str | None, tyro.conf.arg(metavar="HOME")] = None,
    count: int = 16,
    out: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="POOL.npz")] = None,
    goal: Flag = False,
    seed: int = 0,
    jobs: int = 0,
    cluster: Cluster = None,
    resume: Resume = False,
    behavior1k: Flag = False,
    json: Flag = False,
) -> int:
    """Sample initial states of an activity, or goal states, and write them as a pool for batched resets.

    The exit status is 0 only if every row was sampled; otherwise the reasons for failure are counted. Rows of initial
    states in which the goal already holds are listed.

    Args:
      name: the activity's name, or a BDDL file of your own.
      scene: the home; default: the shipped home that needs the fewest additional objects and where a start can be
        sampled.
      count: number of rows.
      out: output file; default: NAME.npz in the working directory, NAME-goal.npz for goal states.
      goal: sample states in which the goal holds, each from the initial state with the same seed and row.
      seed: the same seed gives the same pool.
      jobs: number of processes; 0: one per processor.
      cluster: run on a Ray cluster: its address, or auto.
      resume: continue an interrupted run.
      behavior1k: look the name up in BEHAVIOR-1K instead of BEHAVIOR-100.
      json: print the result as JSON.
    """
    from ig2mj.cli.common.bindings import binding_as_text, find_homes
    from ig2mj.cli.common.files import check_output
    from ig2mj.errors import Ig2mjError
    from ig2mj.tasks.bddl.definitions import load_activity
    from ig2mj.tasks.bddl.goal_states import sample_goals
    from ig2mj.tasks.bddl.start import SampledStart, first_that_works, fitting, sample_start
    from ig2mj.worlds.pool import save_pool

    if count < 1:
        raise Ig2mjError(f"--count {count}: a pool needs at least one row")
    if jobs < 0:
        raise Ig2mjError(f"--jobs {jobs}: 0 takes one process per processor, else at least one is needed")
    activity = load_activity(name, behavior1k)
    file = out or pathlib.Path(f"{activity.name}-goal.npz" if goal else f"{activity.name}.npz")
    check_output(file)
    where = where_of(jobs, cluster, resume)
    bound, errors = fitting(activity, find_homes(scene))
    if not bound:
        raise Ig2mjError(" ".join(line.strip() for line in binding_as_text(None, [], errors)))
    binding, loaded = first_that_works(bound, seed, scene)
    request = {"command": "activity sample", "activity": name, "scene": loaded.digest, "rows": count, "seed": seed}
    if goal:
        request["goal"] = True
    with opened(file, request, where) as journal, follow(f"sampling in {loaded.name}") as report:
        if goal:
            options = {"name": name, "where": where, "journal": journal, "progress": report}
            goals = sample_goals(binding, loaded, count, seed, **options)
            done = SampledStart(goals, tuple(range(len(goals.rows))))
        else:
            done = sample_start(binding, loaded, count, seed, where=where, journal=journal, progress=report)
        if done.sampled.pool is not None:
            note = {"activity": name, "behavior1k": behavior1k, "seed": seed, "rows": list(done.sampled.rows)}
            note |= {"goal": True} if goal else {}
            save_pool(done.sampled.pool, file, loaded, note)
        if not done.sampled.failed:
            journal.finish()
    tell_failures(done.sampled.failed, count)
    show = ["ig2mj activity show", shlex.quote(name), "--pool", shlex.quote(str(file))]
    show += [*(["--behavior1k"] if behavior1k else []), *(["--scene", shlex.quote(scene)] if scene else [])]
    _tell(done, binding, file, json, " ".join(show), goal)
    return 0 if done.sampled.complete else 1


def _tell(done: SampledStart, binding: Binding, file: pathlib.Path, as_json: bool, show: str, goal: bool) -> None:
    """`show`: the command that shows the pool's rows. `goal`: they are goal states."""
    import sys

    from ig2mj.cli.common.printing import make_table, print_json, stdout_console

    sampled = done.sampled
    if as_json:
        result: dict[str, Any] = {
            "activity": binding.activity.name,
            "home": binding.home,
            "added": binding.additions,
            "file": str(file) if sampled.pool is not None else None,
            "rows": len(sampled.rows),
            "requested": sampled.requested,
            "goal_holds_in": done.reached,
            "seconds": round(sampled.seconds, 3),
            "rejected": dict(sampled.rejected.most_common()),
            "failed": sampled.failed,
        }
        print_json(result)
        return
    if sampled.pool is not None:
        what = "goal states" if goal else "starts"
        print(
            f"{file}: {len(sampled.rows)} of {sampled.requested} {what} of {binding.activity.name} in {binding.home}, "
            f"{len(binding.additions)} objects added, {sampled.seconds:.1f} s\n"
            f"look: {show} --row 0 --image row.png"
        )
    if done.reached and not goal:
        print(f"the goal already holds in rows {', '.join(map(str, done.reached))}", file=sys.stderr)
    lacking = sampled.requested - len(sampled.rows) - len(sampled.failed)
    if lacking:
        print(f"{lacking} of {sampled.requested} rows could not be sampled in {binding.home}", file=sys.stderr)
        rows = [(reason, str(n)) for reason, n in sampled.rejected.most_common(12)]
        stdout_console().print(make_table("why candidates were turned down", ("reason", "times"), rows))


def show_row(
    binding: Binding, pool: pathlib.Path, row: int, image: pathlib.Path | None, scene: str | None, json: bool
) -> bool:
    """Prints which goal conditions are false in a row of a pool; whether the goal holds.

    Raises:
      InputError: the pool is of another scene, or of another activity's objects. Ig2mjError: it has no such row.
    """
    import sys

    from ig2mj.cli.common.printing import print_json
    from ig2mj.errors import Ig2mjError, InputError
    from ig2mj.tasks.bddl.start import row_status
    from ig2mj.viewer.pool_pages import PoolPages
    from ig2mj.worlds.pool import load_pool, load_pool_scene

    loaded = load_pool_scene(pool, scene)
    if [f"{a.category}/{a.model}" for a in loaded.additions] != list(binding.additions):
        raise InputError(pool, f"was made for another activity than {binding.activity.name}", fix="name that one")
    rows = load_pool(pool, loaded)
    if not 0 <= row < rows.size:
        raise Ig2mjError(f"--row {row}: {pool} has rows 0 to {rows.size - 1}")
    status = row_status(binding, loaded, rows, row)
    if json:
        print_json({"row": row, **dataclasses.asdict(status)})
    else:
        print(
            f"row {row} of {rows.size} in {loaded.name}: {100 * status.fraction:.0f} % of the goal holds; still false:"
        )
        print("\n".join(status.missing or ("nothing",)), status.explanation, sep="\n\n")
    if image is not None:
        PoolPages(loaded, rows, at=row).picture(image)
        print(f"wrote {image}", file=sys.stderr)
    return status.holds
