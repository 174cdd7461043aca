"""`ig2mj demos`: record demonstrations of experts; replay, export, measure and convert recordings."""

from __future__ import annotations

import pathlib
import sys
from typing import Annotated, Literal

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
    worlds: int = 0,
    noise: float | None = None,
    disturbed: float | None = None,
    seed: int = 0,
    split: str = "train",
    pool_size: int = 0,
    doors: Literal["open", "shut"] = "shut",
    horizon: int = 0,
    object: AddedObjects = (),
    jobs: int = 1,
    cluster: Cluster = None,
    resume: Resume = False,
) -> int:
    """Play an expert and record its successful episodes, with its labels and observations.

    The expert is scripted for the paper's activities, and the planner for activities of BEHAVIOR and for goals in a
    home. Ctrl-C keeps the episodes that are done; --resume continues.

    `ig2mj train --demos` learns from the recording; `ig2mj demos replay`, `metrics`, `export` and `ig2mj web` read it.

    Args:
      env: environment, e.g. CookingMeat or ig2mj/CookingMeat-v0 (`ig2mj list-envs` names them), activity/NAME, a goal
        ("goal/small_home (open fridge_0)"), or a task of a file of yours: my_tasks.py:MugToTable.
      out: output file.
      episodes: number of successful episodes to collect.
      robot: {robots}, or a folder that `ig2mj convert robot` wrote; default: the task's first robot.
      grasping: mitten, assisted, sticky or physical; default: the task's.
      obs: observations to record: state, or rgbd for images as well. Others can be computed by a replay.
      engine: native, warp or jax.
      worlds: number of worlds stepped at once; default: 8, of the planner 1.
      noise: standard deviation of the noise added to the expert's actions; the labels stay noise-free. Default: 0.1, of
        the planner 0.05.
      disturbed: probability per step that five random steps begin, from which the expert recovers. Default: 0.02, of
        the planner 0.
      seed: random seed of start states and noise.
      split: which start states: train or held_out.
      pool_size: number of start states; 0: all of the split, or as many as episodes where they neither ship nor were
        sampled before.
      doors: whether doors between rooms that the task does not name stand open at the start of episodes.
      horizon: agent steps of an episode; 0: the task's, of the planner as many as its plan may take.
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
    from ig2mj.demos.collection import EPISODES_PER_JOB, collection_jobs, join_recordings
    from ig2mj.demos.solving import horizon_for
    from ig2mj.envs.experts import expert_of
    from ig2mj.envs.planned_expert import PlannedExpert
    from ig2mj.envs.registry import VECTORS, make
    from ig2mj.envs.shared_starts import shared_pool
    from ig2mj.errors import Ig2mjError, UnknownNameError
    from ig2mj.install_hint import require_module
    from ig2mj.learn.perception import MODES

    if obs not in MODES:
        raise UnknownNameError("kind of observation", obs, MODES)
    if episodes < 1 or worlds < 0:
        raise Ig2mjError(f"--episodes {episodes}, --worlds {worlds}: at least one of each is needed")
    if horizon < 0:
        raise Ig2mjError(f"--horizon {horizon}: at least 1, or 0 for the task's")
    if not 0 <= (noise or 0.0) < float("inf") or not 0 <= (disturbed or 0.0) <= 1:
        raise Ig2mjError(f"--noise {noise}, --disturbed {disturbed}: 0 or more, and between 0 and 1")
    if jobs < 0:
        raise Ig2mjError(f"--jobs {jobs}: 0 takes one process per processor, else at least one is needed")
    require_module("h5py")
    check_output(out)
    robot = choose_robot(robot, own)
    where = where_of(jobs, cluster, resume)
    pool_size = pool_size or few_rows(env, split, max(episodes, worlds), object, grasping)
    names = VECTORS if obs == "state" else (*VECTORS, "rgb", "depth")
    count = pool_size or None
    common = {"observations": VECTORS, "split": split, "pool_size": count, "objects": object, "doors": doors}
    first = make(env, robot, 1, "native", grasping, **common)
    note_changes(first.scene, object)
    expert = expert_of(first)  # errors before any work
    planned = isinstance(expert, PlannedExpert)
    if planned:
        expert(first.reset(seed))  # a goal that cannot become true is refused here
        horizon = horizon or max(first.task.horizon, horizon_for(expert.planned, first.period))
    first.close()
    usual = (1, 0.05, 0.0) if planned else (8, 0.1, 0.02)
    settings = {
        "env": env,
        "robot": robot,
        "grasping": grasping,
        "engine": engine,
        "worlds": worlds or usual[0],
        "observations": list(names),
        "split": split,
        "pool_size": pool_size or None,
        "noise": usual[1] if noise is None else noise,
        "disturbed": usual[2] if disturbed is None else disturbed,
        **({"objects": list(object)} if object else {}),
        **({"doors": doors} if doors != "shut" else {}),
        **({"horizon": horizon} if horizon else {}),
    }
    title = f"demonstrations of {env}"
    starts = {"task": env, "split": split, "count": count, **({"objects": list(object)} if object else {})}
    work = JobSet(
        "ig2mj.demos.collection:collect_job",
        title,
        collection_jobs(settings, episodes, seed, 1 if planned else EPISODES_PER_JOB),
        shared_pool(**starts) if cluster is not None else {},
        ("ig2mj.envs.shared_starts:start_states", starts),
        gpu=engine != "native",
    )
    request = {"command": "demos collect", "episodes": episodes, "seed": seed, **settings}
    with opened(out, request, where) as journal, follow(title) as report:
        try:
            store, failed = map_jobs(work, where, journal, report)
        except KeyboardInterrupt:
            done = [job.name for job in work.jobs if job.name in journal.names()]
            kept = join_recordings((journal.get(name) for name in done), out)[0] if done else 0
            words = f"{out} holds the {kept} episodes that are done" if kept else "no episode is done"
            print(f"{words}; the same command with --resume continues", file=sys.stderr)
            raise
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
