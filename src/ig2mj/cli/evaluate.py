"""`ig2mj evaluate POLICY`: success rate of a policy on held-out start states."""

from __future__ import annotations

import pathlib
from typing import Annotated

import tyro

from ig2mj.cli.common.deprecated import renamed_options
from ig2mj.cli.common.jobs import Cluster, Resume, follow, opened, tell_failures, where_of
from ig2mj.cli.common.objects import AddedObjects
from ig2mj.cli.common.own_robot import NONE, Own, choose_robot
from ig2mj.cli.common.tasks import TaskOption, use_task

WORLDS = {"native": 8}
"""So many worlds unless another number is asked for; on the others as many as episodes, up to `PURE_WORLDS`."""

PURE_WORLDS = 1000


@renamed_options({"--drawn": "--stochastic"})
def run(
    target: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="POLICY")],
    episodes: int | None = None,
    split: str = "held_out",
    engine: str | None = None,
    worlds: int = 0,
    robot: str | None = None,
    own: Own = NONE,
    grasping: str | None = None,
    pool_size: int = 0,
    object: AddedObjects = (),
    stochastic: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    jobs: int = 1,
    cluster: Cluster = None,
    out: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    resume: Resume = False,
    task: TaskOption = None,
    axes: str | None = None,
    episode_file: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    page: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    policy: Annotated[str | None, tyro.conf.arg(metavar="ADDRESS")] = None,
    observations: str | None = None,
    image_size: int = 224,
    chunk: int = 0,
    timeout: float = 60.0,
    json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> int:
    """Measure how often a policy succeeds, on start states that it was not trained on.

    Each start state is played once; with more episodes than start states they are played again.

    Args:
      target: a file that `ig2mj train` wrote, or the name of a policy that ships; with --policy the name of a task.
      episodes: number of episodes; the start states of the split are played in order. Default: 1000; with --axes, of
        each axis, and with --policy 200.
      split: set of start states: held_out or train.
      engine: native, warp or jax; default: warp on a GPU, else native.
      worlds: number of worlds stepped at once; 0: one per episode, at most 1000 (native: 8).
      robot: refuse a policy of another robot (the policy's card says which it is for); for a policy of a robot of your
        own, the folder that `ig2mj convert robot` wrote.
      grasping: refuse a policy of another grasping mode.
      pool_size: number of start states; 0: all of the split, or as many as episodes where they neither ship nor were
        sampled before.
      object: {object}; default: those that it was trained with.
      stochastic: sample actions from the policy's distribution, as in training, instead of taking its mode.
      jobs: number of processes, each with its own worlds (the native engine uses all processors in any case).
      cluster: run on a Ray cluster: its address, or auto.
      out: file for the JSON result, with --axes of the axes that are finished; needed for --resume.
      resume: continue an interrupted evaluation.
      task: the policy's task, if it is defined in a file of yours; this imports the file.
      axes: play fixed episodes (`ig2mj episodes`) in which this varies, next to those in which nothing does: names of
        axes of `ig2mj.Randomize`, separated by commas, or all.
      episode_file: a file of `ig2mj episodes make` in place of the one that ships.
      page: with --axes, write a page with plots and images of failures.
      policy: a policy server that acts: ws://HOST:PORT (openpi's protocol), vla-eval://HOST:PORT or groot://HOST:PORT.
      observations: with --policy, names of observations that are sent; default: those that the server names, else
        proprioception,rgb, and rgb of the right hand's camera.
      image_size: with --policy, pixels of images in both directions, unless the server is of ig2mj.
      chunk: with --policy, steps of a chunk of actions that are carried out; 0: all.
      timeout: with --policy, seconds that an answer of the server may take.
      json: print one JSON object.
    """
    import contextlib
    import json as form
    import os
    import sys
    import time

    from ig2mj.process import leave_products_to_cublas
    from ig2mj.process.imports import find_gpu

    leave_products_to_cublas()
    if engine != "native" and jobs == 1 and cluster is None:
        find_gpu(os.environ)  # while the rest is imported

    import jax

    from ig2mj.cli.common.files import check_output
    from ig2mj.cli.common.tasks import few_rows
    from ig2mj.cluster.job_runner import map_jobs
    from ig2mj.cluster.jobs import JobSet
    from ig2mj.envs.shared_starts import shared_pool, shipped_states
    from ig2mj.errors import Ig2mjError
    from ig2mj.learn.evaluate import evaluation_jobs, summary
    from ig2mj.learn.policies import Policy, doors_in, horizon_on_card, looks_of, objects_of, robot_of
    from ig2mj.learn.shipped import find_policy
    from ig2mj.tasks.custom.files import refuse_unknown
    from ig2mj.tasks.pools import COUNT

    if policy is not None or axes is not None:
        from ig2mj.cli.common.fixed_episodes import Request, evaluate_policy, evaluate_server

        where = Request(axes, episodes, episode_file, page, out, json, engine, worlds, robot, grasping, resume)
        refused = {"--jobs": jobs != 1, "--cluster": cluster is not None, "--object": bool(object)}
        refused |= {"--pool-size": pool_size != 0, "--split": split != "held_out"}
        for option, given in refused.items():
            if given:
                raise Ig2mjError(f"{option} does not go with --axes or --policy: they play the episodes of a file")
        use_task(task)
        if policy is not None:
            return evaluate_server(target, policy, where, observations, image_size, chunk, timeout)
        return evaluate_policy(target, where, stochastic)
    for option, given in {"--episode-file": episode_file, "--page": page}.items():
        if given is not None:
            raise Ig2mjError(f"{option} goes with --axes")
    episodes = 1000 if episodes is None else episodes
    if episodes < 1 or min(jobs, worlds) < 0:
        raise Ig2mjError(
            f"--episodes {episodes}, --jobs {jobs}, --worlds {worlds}: at least one episode, and none below 0"
        )
    if resume and out is None:
        raise Ig2mjError("--resume needs --out FILE: finished jobs are stored next to it")
    if out is not None:
        check_output(out)
    use_task(task)
    file = find_policy(target)
    loaded = Policy.load(file)
    depends = loaded.card["depends"]
    refuse_unknown(depends["task"], depends.get("task_file"), file)
    if engine is None:
        engine = "warp" if jax.default_backend() == "gpu" else "native"
    count = worlds or min(episodes, WORLDS.get(engine, PURE_WORLDS))
    objects = object or objects_of(loaded, file)
    mode = grasping or depends["grasping"]
    rows = pool_size or few_rows(depends["task"], split, min(episodes, COUNT.get(split, episodes)), objects, mode)
    settings = {
        "file": str(file),
        "task": depends["task"],
        "robot": choose_robot(robot, own) or robot_of(loaded.card),
        "grasping": mode,
        "engine": engine,
        "worlds": count,
        "observations": list(loaded.observations),
        "paper_rl": loaded.card.get("paper_rl", False),
        "split": split,
        "pool_size": rows or None,
        "drawn": stochastic,
    }
    if loaded.card["depends"].get("looks"):
        settings["looks"] = looks_of(loaded)
    settings |= {**doors_in(loaded.card["depends"]), **horizon_on_card(loaded.card)}
    if objects:
        settings["objects"] = list(objects)
    states = pool_size or COUNT.get(split, episodes)
    if episodes > states:
        words = f"--episodes {episodes}: there are {states} start states, so some are played and counted again"
        print(f"warning: {words}", file=sys.stderr)
    where, title = where_of(jobs, cluster, resume), f"evaluating {target}"
    starts = {"task": depends["task"], "split": split, "count": rows or None}
    starts |= {"objects": list(objects)} if objects else {}
    shared = {"policy": file.read_bytes(), **(shared_pool(**starts) if cluster is not None or jobs != 1 else {})}
    work = JobSet(
        "ig2mj.learn.evaluate:evaluate_job",
        title,
        evaluation_jobs(settings, episodes),
        shared,
        ("ig2mj.envs.shared_starts:start_states", starts),
        gpu=engine != "native" and jax.default_backend() == "gpu",
    )
    began = time.monotonic()
    with contextlib.ExitStack() as stack:
        request = {"command": "evaluate", "episodes": episodes, "weights": loaded.weights_digest, **settings}
        journal = stack.enter_context(opened(out, request, where)) if out is not None else None
        store, failed = map_jobs(work, where, journal, stack.enter_context(follow(title)))
        done = [form.loads(store.get(job.name)) for job in work.jobs if job.name not in failed]
        seconds = time.monotonic() - began
        tell_failures(failed, len(work.jobs))
        if not done:
            return 1
        found = summary(done)
        result = {
            "env": depends["task"],
            "robot": depends["robot"],
            "grasping": settings["grasping"],
            "agent": str(target),
            "weights": loaded.weights_digest,
            "paper_rl": settings["paper_rl"],
            "variant": 0,  # of the objects: policies are trained with the task's own
            "split": split,
            "drawn": stochastic,
            "engine": engine,
            "worlds": count,
            "start_states": None if objects else shipped_states(depends["task"], settings["grasping"], split),
            **({"objects": list(objects)} if objects else {}),
            **found,
        }
        if out is not None:
            out.write_text(form.dumps(result) + "\n", encoding="utf-8")  # the same bytes wherever it was done
        if journal is not None and not failed:
            journal.finish()
    if not resume:  # jobs of an earlier call took time that is not in `seconds`
        start = max(d["start_seconds"] for d in done)  # making and compiling; next to nothing in jobs that follow
        result["start_seconds"] = round(start, 1)
        result["steps_per_second"] = round(sum(d["steps"] for d in done) / max(seconds - start, 1e-9), 1)
    if json:
        print(form.dumps(result))
    else:
        low, high = found["success_low"], found["success_high"]
        print(
            f"{result['env']}, {result['robot']}, {result['grasping']}: {found['success_rate']:.1%} of "
            f"{found['episodes']} episodes succeed ({low:.1%} to {high:.1%} with 95 % confidence), mean return "
            f"{found['mean_return']:.3f}"
        )
    return 1 if failed else 0
