"""`ig2mj demos`: record demonstrations of scripted experts; replay, export, measure and convert recordings."""

from __future__ import annotations

import pathlib
from typing import Annotated

import tyro

from ig2mj.cli.common.jobs import Cluster, Resume, follow, opened, tell_failures, where_of
from ig2mj.cli.common.objects import AddedObjects
from ig2mj.cli.common.own_robot import NONE, Own, choose_robot
from ig2mj.cli.demos_folder import metrics
from ig2mj.cli.demos_replay import export, replay
from ig2mj.cli.demos_video import gallery, video


def collect(
    env: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ENV")],
    out: pathlib.Path,
    episodes: int = 256,
    robot: str | None = None,
    own: Own = NONE,
    grasping: str | None = None,
    obs: str = "state",
    engine: str = "native",
    worlds: int = 8,
    noise: float = 0.1,
    disturbed: float = 0.02,
    seed: int = 0,
    split: str = "train",
    pool_size: int = 0,
    object: AddedObjects = (),
    jobs: int = 1,
    cluster: Cluster = None,
    resume: Resume = False,
) -> int:
    """Play a scripted expert and record its successful episodes, with its labels and observations.

    `ig2mj train --demos` learns from the recording; `ig2mj demos replay`, `metrics`, `export` and `ig2mj web` read it.

    Args:
      env: environment, e.g. CookingMeat or ig2mj/CookingMeat-v0 (`ig2mj list-envs` names them), or a task of a file of
        yours: my_tasks.py:MugToTable.
      out: output file.
      episodes: number of successful episodes to collect.
      robot: {robots}, or a folder that `ig2mj convert robot` wrote; default: the task's first robot.
      grasping: mitten, assisted, sticky or physical; default: the task's.
      obs: observations to record: state, or rgbd for images as well. Others can be computed by a replay.
      engine: native, warp or jax.
      worlds: number of worlds stepped at once.
      noise: standard deviation of the noise added to the expert's actions; the labels stay noise-free.
      disturbed: probability per step that five random steps begin, from which the expert recovers.
      seed: random seed of start states and noise.
      split: which start states: train or held_out.
      pool_size: number of start states; 0: all of the split, or as many as episodes where they neither ship nor were
        sampled before.
      object: {object}.
      jobs: number of processes, each with its own worlds.
      cluster: run on a Ray cluster: its address, or auto.
      resume: continue an interrupted collection.
    """
    from ig2mj.cli.common.files import check_output
    from ig2mj.cli.common.objects import note_changes
    from ig2mj.cli.common.tasks import few_rows
    from ig2mj.cluster.job_runner import map_jobs
    from ig2mj.cluster.jobs import JobSet
    from ig2mj.demos.collection import collection_jobs, join_recordings
    from ig2mj.envs.experts import expert_of
    from ig2mj.envs.registry import VECTORS, make
    from ig2mj.envs.shared_starts import shared_pool
    from ig2mj.errors import Ig2mjError, UnknownNameError
    from ig2mj.install_hint import require_module
    from ig2mj.learn.perception import MODES

    if obs not in MODES:
        raise UnknownNameError("kind of observation", obs, MODES)
    if episodes < 1 or worlds < 1:
        raise Ig2mjError(f"--episodes {episodes}, --worlds {worlds}: at least one of each is needed")
    if not 0 <= noise < float("inf") or not 0 <= disturbed <= 1:
        raise Ig2mjError(f"--noise {noise}, --disturbed {disturbed}: 0 or more, and between 0 and 1")
    if jobs < 0:
        raise Ig2mjError(f"--jobs {jobs}: 0 takes one process per processor, else at least one is needed")
    require_module("h5py")
    check_output(out)
    robot = choose_robot(robot, own)
    where = where_of(jobs, cluster, resume)
    pool_size = pool_size or few_rows(env, split, max(episodes, worlds), object, grasping)
    names = VECTORS if obs == "state" else (*VECTORS, "rgb", "depth")
    settings = {
        "env": env,
        "robot": robot,
        "grasping": grasping,
        "engine": engine,
        "worlds": worlds,
        "observations": list(names),
        "split": split,
        "pool_size": pool_size or None,
        "noise": noise,
        "disturbed": disturbed,
        **({"objects": list(object)} if object else {}),
    }
    count = pool_size or None
    common = {"observations": VECTORS, "split": split, "pool_size": count, "objects": object}
    first = make(env, robot, 1, "native", grasping, **common)
    note_changes(first.scene, object)
    expert_of(first)  # errors before any work
    first.close()
    title = f"demonstrations of {env}"
    starts = {"task": env, "split": split, "count": count, **({"objects": list(object)} if object else {})}
    work = JobSet(
        "ig2mj.demos.collection:collect_job",
        title,
        collection_jobs(settings, episodes, seed),
        shared_pool(**starts) if cluster is not None else {},
        ("ig2mj.envs.shared_starts:start_states", starts),
        gpu=engine != "native",
    )
    request = {"command": "demos collect", "episodes": episodes, "seed": seed, **settings}
    with opened(out, request, where) as journal, follow(title) as report:
        store, failed = map_jobs(work, where, journal, report)
        parts = (store.get(job.name) for job in work.jobs if job.name not in failed)
        kept, lost = join_recordings(parts, out) if len(failed) < len(work.jobs) else (0, 0)
        if not failed:
            journal.finish()
    tell_failures(failed, len(work.jobs))
    if kept:
        print(f"{out}: {kept} episodes; {lost} more failed and are left out")
    return 1 if failed else 0


def convert(
    old: Annotated[pathlib.Path, tyro.conf.Positional, tyro.conf.arg(metavar="OLD")],
    new: Annotated[pathlib.Path, tyro.conf.Positional, tyro.conf.arg(metavar="NEW")],
) -> int:
    """Convert a demonstrations file of ig2mj 0.1.0 to a recording.

    The old file holds no states of the world. `ig2mj train --demos` learns from the result; it cannot be replayed,
    measured or exported. Recordings of 0.1.0 need no conversion.

    Args:
      old: file that `ig2mj demos collect` of ig2mj 0.1.0 wrote.
      new: output file.
    """
    from ig2mj.cli.common.files import check_output
    from ig2mj.demos.convert import convert as convert_file

    check_output(new)
    runs = convert_file(old, new)
    print(f"{new}: {runs} runs to learn from (`ig2mj train --demos`); without states of the world, not for replays")
    return 0


SUBCOMMANDS = {
    "collect": collect,
    "replay": replay,
    "export": export,
    "metrics": metrics,
    "video": video,
    "gallery": gallery,
    "convert": convert,
}
