"""`ig2mj train ENV`: trains a policy, with reports, checkpoints and a policy file in a folder of its own."""

from __future__ import annotations

import pathlib
from typing import Annotated, Any

import tyro

ALGORITHMS = ("sac", "ppo", "bc", "dagger")

WORLDS = {"native": 32}
"""So many worlds unless another number is asked for; `PURE_WORLDS` on the others."""

PURE_WORLDS = 2048

SIDE = 128
"""Pixels, height and width of a camera's pictures."""


def run(
    env: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ENV")],
    algo: str = "sac",
    robot: str | None = None,
    grasping: str | None = None,
    obs: str = "state",
    pixels: int = 32,
    rows: Annotated[str | None, tyro.conf.arg(metavar="TOP:BOTTOM")] = None,
    engine: str | None = None,
    worlds: int = 0,
    minutes: float = 10.0,
    seed: int = 0,
    out: pathlib.Path | None = None,
    resume: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    demos: pathlib.Path | None = None,
    expert: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    begin_with: str | None = None,
    save_buffer: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    until: float | None = None,
    programs: int = 1,
    devices: str = "1",
    paper_rl: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    pool_size: int = 0,
    mixed: int = 0,
    videos: float = 0.0,
    set: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME=VALUE")] = (),
) -> int:
    """Train a policy in an environment.

    Args:
      env: environment, e.g. CookingMeat or ig2mj/CookingMeat-v0 (`ig2mj list-envs` names them).
      algo: sac, ppo, bc (from --demos alone), or dagger (a scripted expert corrects the policy).
      robot: humanoid, fetch or turtlebot; default: the task's first robot.
      grasping: mitten, assisted, sticky or physical; default: mitten for activities.
      obs: state (proprioception and privileged state) or rgbd (proprioception and pictures, as in the paper).
      pixels: height and width to which the 128x128 pictures are averaged down for the networks.
      rows: of these the first that the networks see and the first below those; 80:128 of 128 is the table before a
        humanoid; default: all.
      engine: native, warp or jax; default: warp on a GPU, else native.
      worlds: number of worlds stepped at once; 0: 2048 (native: 32).
      minutes: minutes of training, not counting compilation.
      seed: random seed.
      out: folder of the run; default: runs/ENV-ROBOT-GRASPING-ALGO-OBS-SEED.
      resume: continue from the newest checkpoint in the folder.
      demos: file of `ig2mj demos collect`: bc learns from it alone; sac starts as its clone and keeps replaying it.
      expert: for sac: the task's scripted expert begins episodes and corrects the policy, less and less until 70 % of
        the run (--set guided=0.7).
      begin_with: for dagger: a policy's file, a run's folder or the name of a policy that ships, whose networks are
        trained further; give its settings with --set; recall=1 lets it remember what it did not before.
      save_buffer: also store the replay buffer in checkpoints; otherwise a resumed run first refills it.
      until: stop once this share of the last episodes succeeds, e.g. 0.98.
      programs: compiled programs per iteration: 1, or 2 to time simulation and learning separately.
      devices: number of GPUs, or all: of this machine, or of all processes started together (docs/guide/scale.md).
      paper_rl: use the success thresholds of the paper's experiments.
      pool_size: number of start states; 0: all of the split.
      mixed: train on this many start states made of those: every object lies where it does in one, turned as in
        another; 0: on those themselves.
      videos: minutes between two films of a held-out episode, written to the run's folder videos; 0: none. A low-
        priority process makes them; they need OpenGL and ffmpeg.
      set: settings of the algorithm, e.g. updates=16 actor=128,128.
    """
    import dataclasses
    import os
    import platform
    import shlex
    import sys

    import jax

    from ig2mj.cli.train_films import Films
    from ig2mj.cluster.process_topology import find_topology
    from ig2mj.cluster.team import Team
    from ig2mj.envs.registry import VECTORS, make
    from ig2mj.errors import Ig2mjError
    from ig2mj.learn.algorithms import config_of, made
    from ig2mj.learn.bc import begin_as_clone
    from ig2mj.learn.best import COUNTED, SUCCESS, Best
    from ig2mj.learn.checkpoints import Checkpoints
    from ig2mj.learn.demos import load_demos
    from ig2mj.learn.going_on import further
    from ig2mj.learn.iteration import AXIS
    from ig2mj.learn.looking import look
    from ig2mj.learn.memory import is_out_of_memory, too_large
    from ig2mj.learn.options import configured
    from ig2mj.learn.perception import Perception
    from ig2mj.learn.policies import Policy, depends_on, world_of
    from ig2mj.learn.projection import lens_of
    from ig2mj.learn.shipped import find_policy
    from ig2mj.learn.train import Run, train
    from ig2mj.process import keep_scratch_in_place
    from ig2mj.sensors.base import SensorOptions

    _check(algo, obs, minutes, videos, until, pixels, programs, devices, demos, expert, out)
    if begin_with is not None and algo != "dagger":
        raise Ig2mjError(f"--begin-with is for --algo dagger, not {algo}: a policy's file holds no critics")
    former = None if begin_with is None else find_policy(begin_with)
    kept_rows = rows_of(rows, pixels)
    if algo == "bc":
        from ig2mj.cli.clone import train_from_demos

        return train_from_demos(env, demos, robot, grasping, obs, pixels, kept_rows, minutes, seed, out, resume, set)
    place = find_topology(os.environ)
    if devices != "1" or (place and place.count > 1):
        keep_scratch_in_place()
    team = Team.join(place)
    with team.together():
        if engine is None:
            engine = "warp" if jax.default_backend() == "gpu" else "native"
        config = configured(config_of(algo, small=engine == "native"), set)
        names = VECTORS if obs == "state" else (*VECTORS, "rgb", "depth")
        count = worlds or WORLDS.get(engine, PURE_WORLDS)
        shared = _devices(devices, team.count)
        if count % max(len(shared), 1):
            raise Ig2mjError(
                f"--devices {devices} --worlds {count}: worlds are shared evenly over {len(shared)} devices"
            )
        with team.turns():  # the first one samples start states where there are none, the others read them
            world = make(
                env,
                robot,
                count // max(len(shared), 1),
                engine,
                grasping,
                observations=names,
                relaxed_thresholds=paper_rl,
                pool_size=pool_size or None,
                augment_starts=mixed,
                sensors=SensorOptions(rows=drawn_rows(kept_rows, pixels)),
            )
        lens = lens_of(world, pixels, kept_rows) if obs == "rgbd" else None
        names = world.privileged_names, lens, world.proprioception_names
        perception = Perception(world.observation_spaces, obs, pixels, kept_rows, *names)
        shown = load_demos(demos, perception, world_of(world)) if demos is not None else None
        algorithm = made(config, perception, world, shown, AXIS if shared else None, expert)
        if out is None:
            out = pathlib.Path("runs") / "-".join([world.task.name, world.robot, world.grasping, algo, obs, str(seed)])
        depends = {**depends_on(world, perception), "paper_rl": paper_rl, "expert": expert}
        settings = Run(minutes, None, seed, out, resume, save_buffer, until=until, programs=programs)
        learner = None
        if shown is not None:
            depends["demos"] = int(shown.reward.shape[0])
            learner = begin_as_clone(algorithm, shown, seed)
        goes_on = resume and Checkpoints(out).numbers()
        if former is not None:
            if getattr(config, "look", 0):
                raise Ig2mjError("--begin-with and --set look: a policy that training begins with has looked already")
            policy = Policy.load(former)
            policy.check(world, perception, former)
            depends["begin_with"] = policy.weights_digest
            learner = None if goes_on else further(algorithm, policy, seed, former)
        elif getattr(config, "look", 0) and not goes_on:
            learner = look(algorithm, seed)
        device = jax.devices()[0]
        card = {
            "command": shlex.join(["ig2mj", *sys.argv[1:]]),
            "algorithm": algo,
            "settings": dataclasses.asdict(config),
            "seed": seed,
            "worlds": count,
            "engine": engine,
            "devices": max(len(shared), 1),
            "device": f"{device.device_kind} ({platform.machine()})",
            "scene": world.scene.digest,
            "paper_rl": paper_rl,
            "expert": expert,
        }
        best, films = Best(out, resume), Films.of(world, out, 60 * videos, paper_rl)

        def kept(learner: Any, row: dict[str, Any]) -> None:
            made_in = {"minutes": round(row["seconds"] / 60, 2), "env_steps": row["env_steps"]}
            made_in |= {SUCCESS: row.get("success"), COUNTED: row["counted"], "compile_s": row.get("compile_s")}
            best.offer(Policy.of(algorithm, learner, depends_on(world, perception), {**card, **made_in}))
            films.offer(best.file, row["seconds"])

        try:
            result = train(world, algorithm, settings, depends, learner, shared, team, kept)
        except Exception as e:  # XLA's and Warp's errors have no type of their own
            if not is_out_of_memory(e):
                raise
            raise Ig2mjError(too_large(world, algorithm, count, max(len(shared), 1))) from e
        if not team.first:
            return 0
        films.offer(best.file, result.row["seconds"], last=True)
        print(best.file)
        print(f"to measure it on states it has not seen: ig2mj evaluate {best.file}", file=sys.stderr)
        return 0


def _check(
    algo: str,
    obs: str,
    minutes: float,
    videos: float,
    until: float | None,
    pixels: int,
    programs: int,
    devices: str,
    demos: pathlib.Path | None,
    expert: bool,
    out: pathlib.Path | None,
) -> None:
    """Refuses options that cannot be, before anything is made. Raises Ig2mjError."""
    from ig2mj.errors import Ig2mjError, InputError, UnknownNameError
    from ig2mj.learn.perception import MODES

    if algo not in ALGORITHMS:
        raise UnknownNameError("algorithm", algo, ALGORITHMS)
    if obs not in MODES:
        raise UnknownNameError("kind of observation", obs, MODES)
    if not 0 < minutes < float("inf") or not 0 <= videos < float("inf"):
        raise Ig2mjError(f"--minutes {minutes}, --videos {videos}: finite, more than 0, and 0 or more")
    if until is not None and not 0 < until <= 1:
        raise Ig2mjError(f"--until {until}: a share is more than 0 and at most 1")
    if pixels < 1 or SIDE % pixels:
        raise Ig2mjError(f"--pixels {pixels}: a divisor of {SIDE} is needed")
    if programs not in (1, 2):
        raise Ig2mjError(f"--programs {programs}: 1 or 2 are possible")
    if devices != "all" and not (devices.isdigit() and int(devices)):
        raise Ig2mjError(f"--devices {devices}: a number from 1 on, or all")
    if demos is not None and algo not in ("bc", "sac"):
        raise Ig2mjError(f"--demos: {algo} takes none (bc and sac do)")
    if expert and algo != "sac":
        others = {"dagger": "dagger always has one", "ppo": "ppo learns alone", "bc": "bc learns from --demos"}
        raise Ig2mjError(f"--expert is for sac: {others[algo]}")
    if out is not None and out.is_file():
        raise InputError(out, "is a file", fix="--out names the folder of a run")


def rows_of(words: str | None, pixels: int) -> tuple[int, int] | None:
    """The rows of `--rows TOP:BOTTOM`. Raises Ig2mjError."""
    from ig2mj.errors import Ig2mjError

    if words is None:
        return None
    top, _, bottom = words.partition(":")
    if not (top.isdigit() and bottom.isdigit() and int(top) < int(bottom) <= pixels):
        raise Ig2mjError(f"--rows {words}: two numbers such as 80:128, of at most {pixels} rows (--pixels)")
    return int(top), int(bottom)


def drawn_rows(rows: tuple[int, int] | None, pixels: int) -> tuple[int, int] | None:
    """The rows of a camera's picture that are averaged down to these `rows_of`."""
    if rows is None:
        return None
    side = SIDE // pixels
    return rows[0] * side, rows[1] * side


def _devices(wanted: str, processes: int) -> list[Any]:
    """Those of all processes that share the work, as many of each; none where there is only one.

    Raises:
      Ig2mjError: there are not so many.
    """
    import jax

    from ig2mj.errors import Ig2mjError

    if wanted == "1" and processes == 1:
        return []
    every = jax.devices()
    least = min(sum(d.process_index == p for d in every) for p in range(processes))
    each = least if wanted == "all" else int(wanted) // processes
    if not 0 < each <= least or (wanted != "all" and int(wanted) % processes):
        shares = f" in {processes} processes, and each takes as many" if processes > 1 else ""
        raise Ig2mjError(f"--devices {wanted}: this run can have {len(every)}{shares}")
    by_process = [[d for d in every if d.process_index == p][:each] for p in range(processes)]
    return [device for own in by_process for device in own]
