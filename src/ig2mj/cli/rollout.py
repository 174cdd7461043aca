"""`ig2mj rollout ENV`: plays episodes of an environment, and reports how they ended."""

from __future__ import annotations

import pathlib
from typing import TYPE_CHECKING, Annotated

import tyro

from ig2mj.cli.common.deprecated import renamed_options
from ig2mj.cli.common.objects import AddedObjects
from ig2mj.cli.common.own_robot import NONE, Own, choose_robot

if TYPE_CHECKING:
    from ig2mj.envs.environment import Environment
    from ig2mj.envs.rollout import Act
    from ig2mj.learn.policies import Policy

AGENTS = ("zero", "random", "expert")

FORMATS = ("ig2mj", "igibson")


@renamed_options({"--paper-rl": "--relaxed-thresholds"})
def run(
    env: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ENV")],
    agent: str = "random",
    robot: str | None = None,
    own: Own = NONE,
    grasping: str | None = None,
    engine: str | None = None,
    worlds: int = 1,
    episodes: int = 1,
    seed: int = 0,
    split: str = "train",
    held_out: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    pool_size: int = 0,
    variant: int = 0,
    object: AddedObjects = (),
    video: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    record: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    format: str = "ig2mj",
    relaxed_thresholds: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> int:
    """Play episodes of an environment and report how they ended.

    Args:
      env: environment, e.g. CookingMeat or ig2mj/CookingMeat-v0 (`ig2mj list-envs` names them), or a task of a file of
        yours: my_tasks.py:MugToTable.
      agent: zero (no motion), random, expert (scripted for the six activities, the planner for those of BEHAVIOR), or
        a policy: a file written by `ig2mj train`, or the name of one that ships.
      robot: {robots}, or a folder that `ig2mj convert robot` wrote; default: the task's first robot.
      grasping: mitten (a hand holds the task's first object from the first touch on), assisted, sticky or physical
        (docs/guide/environments.md); default: the task's.
      engine: native, warp or jax; default: warp on a GPU, else native.
      worlds: number of worlds stepped at once.
      episodes: number of episodes, over all worlds.
      seed: random seed of start states and actions.
      split: set of start states: train or held_out.
      held_out: play the first EPISODES held-out start states, each once.
      pool_size: number of start states; 0: all of the split, or as many as episodes where they neither ship nor were
        sampled before.
      variant: variant of the activity's objects: 1 and 2 use other models of the same categories.
      object: {object}. Default: those that the policy was trained with.
      video: video of the first episode of the first world (.mp4, .gif), or five of its frames in a row (.png,
        .jpg); needs OpenGL. With it the default engine is native on a GPU, too.
      record: HDF5 file to record all worlds to, for `ig2mj demos replay`.
      format: format of --record: ig2mj; or igibson, which also writes one iGibson log per run to a folder named after
        FILE.
      relaxed_thresholds: use the success thresholds of the paper's experiments.
      json: print one JSON object as the last line.
    """
    import json as form

    import numpy as np

    from ig2mj.cli.common.files import check_output, check_video
    from ig2mj.cli.common.objects import note_changes
    from ig2mj.cli.common.tasks import few_rows
    from ig2mj.envs.registry import VECTORS, make
    from ig2mj.envs.rollout import play
    from ig2mj.errors import Ig2mjError, UnknownNameError
    from ig2mj.install_hint import require_module
    from ig2mj.learn.policies import looks_of, objects_of
    from ig2mj.process.progress import progress

    if format not in FORMATS:
        raise UnknownNameError("format", format, FORMATS)
    if record is None and format != FORMATS[0]:
        raise Ig2mjError(f"--format {format} needs --record FILE")
    robot = choose_robot(robot, own)
    policy = None if agent in AGENTS else policy_named(agent)
    if episodes < 1 or worlds < 1:
        raise Ig2mjError(f"--episodes {episodes}, --worlds {worlds}: at least one of each is needed")
    if video is not None:
        from ig2mj.showcase.film_strip import ENDINGS

        check_video(video, ENDINGS)
        engine = engine or "native"
    if record is not None:
        require_module("h5py")
        check_output(record)
    split = "held_out" if held_out else split
    objects = object or (() if policy is None else objects_of(policy, agent))
    played = make(
        env,
        robot,
        worlds,
        engine,
        grasping,
        observations=VECTORS if policy is None else policy.observations,
        relaxed_thresholds=relaxed_thresholds,
        split=split,
        pool_size=pool_size or few_rows(env, split, max(episodes, worlds), objects, grasping, variant) or None,
        variant=variant,
        objects=objects,
        looks=None if policy is None else looks_of(policy),
    )
    note_changes(played.scene, objects)
    if record is not None:
        from ig2mj.demos import record as recorded

        played = recorded(played, record)
    film = None
    if video is not None:
        from ig2mj.showcase.episode_video import EpisodeVideo

        film = EpisodeVideo(video, played)
    try:
        act = who_acts(agent, policy, played, seed)
        with progress(f"playing {played.task.name}") as report:
            watch = film.see if film is not None else None
            outcome = play(played, act, episodes, seed, held_out, watch, report=report)
    finally:
        played.close()
        if film is not None:
            film.close()
    if record is not None and format == "igibson":
        _write_igibson(record)
    successes = sum(outcome.success)
    result = {
        "env": played.task.name,
        "robot": played.robot,
        "grasping": played.grasping,
        "agent": agent,
        "paper_rl": relaxed_thresholds,
        "variant": variant,
        "engine": played.core.engine.name,
        "worlds": worlds,
        "episodes": episodes,
        "success_rate": successes / episodes,
        **{f"{name}_rate": sum(found) / episodes for name, found in outcome.outcomes.items()},
        "mean_return": float(np.mean(outcome.total)),
        "steps_per_second": round(outcome.steps_per_second, 1),
        "overflow": outcome.metrics["overflow"],
        "non_finite": outcome.metrics["not_finite"],
    }
    if film is not None and not json:
        print(f"video: {video}")
    if json:
        print(form.dumps(result))
    else:
        print(
            f"{played.task.name}, {played.robot}, {agent}: {successes} of {episodes} episodes succeed, mean return "
            f"{result['mean_return']:.3f}, {result['steps_per_second']} agent steps/s"
        )
    played.close()
    return 0


def _write_igibson(recorded: pathlib.Path) -> None:
    from ig2mj.demos import Recording, Replayer
    from ig2mj.demos.igibson import export_igibson

    with Recording(recorded) as recording:
        export_igibson(Replayer(recording, "state"), recorded.with_suffix(""))


def policy_named(name: str) -> Policy:
    """A file that `ig2mj train` wrote, or one that ships.

    Raises:
      UnknownNameError: neither an agent nor a policy. InputError: it cannot be read.
    """
    from ig2mj.errors import UnknownNameError
    from ig2mj.learn.policies import Policy
    from ig2mj.learn.shipped import find_policy, shipped

    try:
        return Policy.load(find_policy(name))
    except UnknownNameError:
        raise UnknownNameError("agent", name, (*AGENTS, *shipped())) from None


def who_acts(agent: str, policy: Policy | None, env: Environment, seed: int) -> Act:
    """The agent as a function. Raises UnknownNameError: the task has no expert. InputError: the policy does not fit."""
    import numpy as np

    if policy is not None:
        from ig2mj.learn.evaluate import acting

        return acting(policy, env, agent)

    if agent == "expert":
        from ig2mj.envs.experts import expert_of

        return expert_of(env)
    rng, shape = np.random.default_rng(seed), (env.num_worlds, *env.action_space.shape)
    if agent == "random":
        return lambda state: rng.uniform(-1, 1, shape).astype(np.float32)
    return lambda state: np.zeros(shape, np.float32)
