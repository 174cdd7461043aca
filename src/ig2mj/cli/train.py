"""`ig2mj train ENV`: trains a policy, with reports, checkpoints and a policy file in a folder of its own."""

from __future__ import annotations

import pathlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from ig2mj.cli.common.deprecated import renamed_options
from ig2mj.cli.common.objects import AddedObjects
from ig2mj.cli.common.own_robot import NONE, Own, choose_robot
from ig2mj.cli.common.tasks import task_option
from ig2mj.files.shell import command

if TYPE_CHECKING:
    from ig2mj.learn.run_config import RunOptions, RunSettings

WORLDS = {"native": 32}
"""So many worlds unless another number is asked for; `PURE_WORLDS` on the others."""

PURE_WORLDS = 2048

SIDE = 128
"""Pixels, height and width of a camera's images."""


@renamed_options(
    {
        "--begin-with": "--init-from",
        "--until": "--stop-at-success",
        "--pixels": "--set image_size=",
        "--rows": "--set image_rows=",
        "--engine": "--set engine=",
        "--expert": "--set expert=true",
        "--save-buffer": "--set save_buffer=true",
        "--programs": "--set programs=",
        "--paper-rl": "--set relaxed_thresholds=true",
        "--pool-size": "--set pool_size=",
        "--mixed": "--set augment_starts=",
    }
)
def run(
    env: Annotated[str | None, tyro.conf.Positional, tyro.conf.arg(metavar="ENV")] = None,
    config: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None,
    set: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME=VALUE")] = (),
    algo: str | None = None,
    robot: str | None = None,
    own: Own = NONE,
    grasping: str | None = None,
    obs: str | None = None,
    worlds: int | None = None,
    minutes: float | None = None,
    seed: int | None = None,
    out: pathlib.Path | None = None,
    resume: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    devices: str | None = None,
    demos: pathlib.Path | None = None,
    init_from: str | None = None,
    stop_at_success: float | None = None,
    videos: float | None = None,
    object: AddedObjects = (),
) -> int:
    """Train a policy in an environment.

    Args:
      env: environment, e.g. CookingMeat or ig2mj/CookingMeat-v0 (`ig2mj list-envs` names them), or a task of a file of
        yours: my_tasks.py:MugToTable.
      config: TOML file of a run, or the name of a policy that ships, which is trained again; other options override
        what the file says.
      set: settings of the algorithm and of the run, e.g. utd_ratio=16 actor_layers=128,128 engine=native
        image_size=64; docs/guide/learning.md lists them.
      algo: sac (the default), ppo, bc (from --demos alone), or dagger (the task's expert, or the planner, labels what
        the policy does).
      robot: {robots}, or a folder that `ig2mj convert robot` wrote; default: the task's first robot.
      grasping: mitten (a hand holds what it touches first), assisted, sticky or physical; default: the task's.
      obs: state (the default: proprioception and privileged state) or rgbd (proprioception and images, as in the
        paper).
      worlds: number of worlds stepped at once; default: 2048 (native: 32).
      minutes: minutes of training, not counting compilation; default: 10.
      seed: random seed; default: 0.
      out: folder of the run; default: runs/ENV-ROBOT-GRASPING-ALGO-OBS-SEED.
      resume: continue from the newest checkpoint in the folder.
      devices: number of GPUs, or all: of this machine, or of all processes started together (docs/guide/scale.md).
      demos: file of `ig2mj demos collect`: bc learns from it alone; sac and dagger start as its clone and keep
        replaying it.
      init_from: for dagger and sac: a policy's file, a run's folder or the name of a policy that ships, whose networks
        are trained further; with dagger, --set object_memory=poses adds a memory that it did not have.
      stop_at_success: stop once this share of the last episodes succeeds, e.g. 0.98.
      videos: minutes between two videos of a held-out episode, written to the run's folder videos; default: none. A
        process of low priority makes them; they need OpenGL and ffmpeg.
      object: {object}.
    """
    import os

    from ig2mj.learn.run_files import run_table
    from ig2mj.process import keep_scratch_in_place, leave_products_to_cublas
    from ig2mj.process.imports import find_gpu

    leave_products_to_cublas()
    table = {} if config is None else run_table(config)
    if _on_one_device(table, set, devices, os.environ):
        if _has_several_programs(table, set):
            keep_scratch_in_place()
        find_gpu(os.environ)  # while the rest is imported

    from ig2mj.learn.algorithms import check_settings
    from ig2mj.learn.run_config import RunOptions, read_run_file, settings_of

    options, settings = read_run_file(config) if config is not None else ({}, ())
    robot = choose_robot(robot, own)
    given: dict[str, Any] = {"env": env, "algo": algo, "robot": robot, "grasping": grasping, "obs": obs}
    given |= {"worlds": worlds, "minutes": minutes, "seed": seed, "devices": devices, "init_from": init_from}
    given |= {"demos": demos and str(demos), "stop_at_success": stop_at_success, "videos": videos}
    given |= {"objects": object or None}
    chosen = RunOptions(**{**options, **{name: value for name, value in given.items() if value is not None}})
    changes = (*settings, *set)
    found, config_of_algorithm, occlusion = settings_of(chosen.algo, changes)
    _check(chosen, found, out)
    if chosen.algo == "bc":
        from ig2mj.cli.clone import train_from_demos

        return train_from_demos(chosen, out, resume, found, config_of_algorithm)
    check_settings(config_of_algorithm, occlusion)
    return _train(chosen, out, resume, changes)


def _on_one_device(
    table: Mapping[str, Any], changes: tuple[str, ...], devices: str | None, environ: Mapping[str, str]
) -> bool:
    """Whether a run is on one device of this process, as its file and the command say; both are checked later."""
    from ig2mj.cluster.process_topology import find_topology

    several = str(devices or table.get("devices", "1")) != "1" or find_topology(environ) is not None
    return not several and _said(table, changes).get("engine") != "native"


def _has_several_programs(table: Mapping[str, Any], changes: tuple[str, ...]) -> bool:
    """Whether an iteration of a run is several programs, as far as its file and the command say."""
    said = _said(table, changes)
    return "homes" in said or said.get("programs") != "1"


def _said(table: Mapping[str, Any], changes: tuple[str, ...]) -> dict[str, str]:
    """Settings of a run's file and of the command, by name."""
    said = {str(name): str(value) for name, value in table.get("settings", {}).items()}
    return said | {name: value for name, _, value in (change.partition("=") for change in changes)}


def _train(chosen: RunOptions, out: pathlib.Path | None, resume: bool, changes: tuple[str, ...]) -> int:
    """Trains in an environment. `changes`: settings as "name=value". Returns the exit status."""
    import dataclasses
    import os
    import platform
    import shlex
    import sys

    import jax

    from ig2mj.cli.common.objects import note_changes
    from ig2mj.cli.train_videos import TrainingVideos
    from ig2mj.cluster.process_per_gpu import run_on_each_gpu, visible_gpus
    from ig2mj.cluster.process_topology import find_topology
    from ig2mj.cluster.team import Team
    from ig2mj.envs.registry import VECTORS, make
    from ig2mj.envs.several_homes import HomesEnvironment
    from ig2mj.errors import Ig2mjError
    from ig2mj.learn.algorithms import make_algorithm
    from ig2mj.learn.bc import begin_as_clone
    from ig2mj.learn.best import COUNTED, SUCCESS, Best
    from ig2mj.learn.checkpoints import Checkpoints
    from ig2mj.learn.demos import horizon_of_demos, load_demos
    from ig2mj.learn.device_memory import too_large
    from ig2mj.learn.occlusion.encoder_pretraining import pretrain
    from ig2mj.learn.perception import Perception, depth_range_of
    from ig2mj.learn.policies import Policy, depends_on, horizon_on_card, objects_on_card, robot_folder, world_of
    from ig2mj.learn.run_config import initial_policy, settings_of
    from ig2mj.learn.several_devices import AXIS
    from ig2mj.learn.train import Run, train
    from ig2mj.learn.warm_start import init_from_policy
    from ig2mj.process import keep_scratch_in_place
    from ig2mj.process.out_of_memory import is_out_of_memory
    from ig2mj.sensors.base import SensorOptions

    algo, obs, seed, devices = chosen.algo, chosen.obs, chosen.seed, chosen.devices
    former = None if chosen.init_from is None else initial_policy(chosen.init_from)
    topology = find_topology(os.environ)
    if topology is None and devices != "1" and sys.argv[1:2] == ["train"]:
        gpus = visible_gpus(os.environ)
        gpus = gpus if devices == "all" else gpus[: int(devices)]
        if len(gpus) > 1 and devices in ("all", str(len(gpus))):
            return run_on_each_gpu(gpus, [sys.executable, "-m", "ig2mj", *sys.argv[1:]], os.environ)
    settings = settings_of(algo, changes, quiet=True)[0]
    spread = devices != "1" or (topology and topology.count > 1)
    if spread or settings.homes or settings.programs > 1:  # an iteration is several programs
        keep_scratch_in_place()
    team = Team.join(topology)
    with team.together():
        # JAX's backend must not be asked for before the processes have joined
        settings, config, occlusion = settings_of(algo, changes, jax.default_backend() == "gpu", quiet=True)
        engine = settings.engine
        count = chosen.worlds or WORLDS.get(engine, PURE_WORLDS)
        shared = _devices(devices, team.count)
        if count % max(len(shared), 1):
            raise Ig2mjError(
                f"--devices {devices} --worlds {count}: worlds must divide evenly over {len(shared)} devices"
            )
        if shared and engine == "native":
            raise Ig2mjError(f"--devices {devices} needs an engine that runs on devices: --set engine=warp, or jax")
        with team.turns():  # the first one samples start states where there are none, the others read them
            world = make(
                chosen.env,
                chosen.robot,
                count // max(len(shared), 1),
                engine,
                chosen.grasping,
                observations=VECTORS if obs == "state" else (*VECTORS, "rgb", "depth"),
                relaxed_thresholds=settings.relaxed_thresholds,
                pool_size=settings.pool_size or None,
                augment_starts=settings.augment_starts,
                sensors=SensorOptions(rows=rendered_rows(settings.rows, settings.image_size)),
                objects=chosen.objects,
                looks=settings.looks,
                doors=settings.doors,
                horizon=settings.horizon or (horizon_of_demos(chosen.demos) if chosen.demos is not None else None),
                **settings.varied,
            )
            note_changes(world.scene, chosen.objects)
        depth_range = settings.depth_range or depth_range_of(world)
        images = settings.image_size, settings.rows, world.privileged_names, depth_range
        perception = Perception(world.observation_spaces, obs, *images)
        shown = load_demos(chosen.demos, perception, world_of(world)) if chosen.demos is not None else None
        parts = world, shown, AXIS if shared else None, settings.expert, occlusion
        algorithm = make_algorithm(config, perception, *parts, begun=former is not None)
        folder = out or pathlib.Path("runs") / "-".join(
            [world.task.name, world.robot, world.grasping, algo, obs, str(seed)]
        )
        extra = {"paper_rl": settings.relaxed_thresholds, "expert": settings.expert}
        depends = {**depends_on(world, perception), **extra, "occlusion": dataclasses.asdict(occlusion)}
        keep: dict[str, Any] = {"save_buffer": settings.save_buffer, "programs": settings.programs}
        keep |= {"homes_in_turn": settings.homes_in_turn}
        run = Run(chosen.minutes, None, seed, folder, resume, stop_at_success=chosen.stop_at_success, **keep)
        learner = None
        if shown is not None:
            depends["demos"] = int(shown.reward.shape[0])
            learner = begin_as_clone(algorithm, shown, seed)
        resumes = resume and Checkpoints(folder).numbers()
        if former is not None:
            policy = Policy.load(former)
            policy.check(world, perception, former)
            depends["init_from"] = policy.weights_digest
            learner = None if resumes else init_from_policy(algorithm, policy, seed, former)
        elif occlusion.pretrain_updates and not resumes:
            learner = pretrain(algorithm, occlusion.pretrain_updates, seed)
        device = jax.devices()[0]
        card = {
            "command": shlex.join(["ig2mj", *sys.argv[1:]]),
            "algorithm": algo,
            "settings": {**dataclasses.asdict(config), **dataclasses.asdict(occlusion)},
            "run_settings": dataclasses.asdict(settings),
            "seed": seed,
            "worlds": count,
            "engine": engine,
            "devices": max(len(shared), 1),
            "device": f"{device.device_kind} ({platform.machine()})",
            "scene": world.scene.digest,
            **({"homes": list(world.homes)} if isinstance(world, HomesEnvironment) else {}),
            **robot_folder(world.made_with.get("robot")),
            **horizon_on_card({"horizon": world.task.horizon}),
            **objects_on_card(world),
            **extra,
        }
        best = Best(folder, resume)
        videos = TrainingVideos.of(world, folder, 60 * chosen.videos, settings.relaxed_thresholds)

        def kept(learner: Any, row: dict[str, Any]) -> None:
            made_in = {"minutes": round(row["seconds"] / 60, 2), "env_steps": row["env_steps"]}
            made_in |= {SUCCESS: row.get("success"), COUNTED: row["counted"], "compile_s": row.get("compile_s")}
            best.offer(Policy.of(algorithm, learner, depends_on(world, perception), {**card, **made_in}))
            videos.offer(best.file, row["seconds"])

        try:
            result = train(world, algorithm, run, depends, learner, shared, team, kept)
        except Exception as e:  # XLA's and Warp's errors have no type of their own
            if not is_out_of_memory(e):
                raise
            raise Ig2mjError(too_large(world, algorithm, count, max(len(shared), 1))) from e
        if not team.first:
            return 0
        videos.offer(best.file, result.row["seconds"], last=True)
        print(best.file)
        option = task_option(chosen.env)
        print(f"to evaluate it on held-out start states: {command('evaluate', best.file)}{option}", file=sys.stderr)
        return 0


def _check(chosen: RunOptions, settings: RunSettings, out: pathlib.Path | None) -> None:
    """Refuses options that cannot be, before anything is made. Raises Ig2mjError."""
    from ig2mj.errors import Ig2mjError, InputError, UnknownNameError
    from ig2mj.learn.perception import MODES

    algo, obs, devices, stop = chosen.algo, chosen.obs, chosen.devices, chosen.stop_at_success
    if not chosen.env:
        raise Ig2mjError("no environment: `ig2mj train CookingMeat`, or --config FILE that names one")
    if obs not in MODES:
        raise UnknownNameError("kind of observation", obs, MODES)
    if not 0 < chosen.minutes < float("inf") or not 0 <= chosen.videos < float("inf"):
        words = "the first must be above 0, the second 0 or more, both finite"
        raise Ig2mjError(f"--minutes {chosen.minutes}, --videos {chosen.videos}: {words}")
    if stop is not None and not 0 < stop <= 1:
        raise Ig2mjError(f"--stop-at-success {stop}: a share is more than 0 and at most 1")
    if SIDE % settings.image_size:
        raise Ig2mjError(f"image_size={settings.image_size}: a divisor of {SIDE} is needed")
    if settings.rows is not None and obs != "rgbd":
        raise Ig2mjError("image_rows: only images have rows (--obs rgbd)")
    if devices != "all" and not (devices.isdigit() and int(devices)):
        raise Ig2mjError(f"--devices {devices}: a number from 1 on, or all")
    if chosen.demos is not None and algo == "ppo":
        raise Ig2mjError(f"--demos: {algo} takes none (bc, dagger and sac do)")
    if chosen.demos is not None and chosen.init_from is not None:
        raise Ig2mjError("--demos, --init-from: a run begins with one of them")
    if chosen.init_from is not None and algo not in ("dagger", "sac"):
        raise Ig2mjError(f"--init-from is for --algo dagger and sac, not {algo}")
    if settings.expert and algo != "sac":
        others = {"dagger": "dagger always has one", "ppo": "ppo learns alone", "bc": "bc learns from --demos"}
        raise Ig2mjError(f"expert=true is for sac: {others[algo]}")
    if out is not None and out.is_file():
        raise InputError(out, "is a file", fix="--out names the folder of a run")


def rendered_rows(rows: tuple[int, int] | None, size: int) -> tuple[int, int] | None:
    """The rows of a camera's image that are averaged down to these rows of `size`."""
    if rows is None:
        return None
    cell = SIDE // size
    return rows[0] * cell, rows[1] * cell


def _devices(requested: str, processes: int) -> list[Any]:
    """Those of all processes that share the work, as many of each; none where there is only one.

    Raises:
      Ig2mjError: there are not so many.
    """
    import jax

    from ig2mj.errors import Ig2mjError

    every = jax.devices() if requested != "1" or processes > 1 else []
    if processes == 1 and (requested == "1" or (requested == "all" and len(every) == 1)):
        return []
    least = min(sum(d.process_index == p for d in every) for p in range(processes))
    each = least if requested == "all" else int(requested) // processes
    if not 0 < each <= least or (requested != "all" and int(requested) % processes):
        shares = f" in {processes} processes, and each takes as many" if processes > 1 else ""
        raise Ig2mjError(f"--devices {requested}: this run can have {len(every)}{shares}")
    by_process = [[d for d in every if d.process_index == p][:each] for p in range(processes)]
    return [device for own in by_process for device in own]
