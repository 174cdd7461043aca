"""`ig2mj train ENV --algo bc --demos FILE`: no environment is made, the file says what it is of."""

from __future__ import annotations

import pathlib
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ig2mj.cli.common.tasks import task_option
from ig2mj.files.shell import command

if TYPE_CHECKING:
    from ig2mj.learn.bc import BCConfig
    from ig2mj.learn.run_config import RunOptions, RunSettings


def train_from_demos(
    chosen: RunOptions, out: pathlib.Path | None, resume: bool, settings: RunSettings, config: BCConfig
) -> int:
    """Clones demonstrations, and writes the policy.

    Args:
      out, resume: see `ig2mj.cli.train`.
    """
    import dataclasses
    import shlex
    import sys

    import jax

    from ig2mj.agents.registry import robot_name
    from ig2mj.errors import Ig2mjError, InputError
    from ig2mj.learn.bc import BC, clone
    from ig2mj.learn.demos import about, horizon_of_demos, load_demos
    from ig2mj.learn.perception import DEPTH_RANGE, Perception
    from ig2mj.learn.policies import Policy, depends_of, horizon_on_card
    from ig2mj.learn.train import Run

    demos, obs, seed = chosen.demos, chosen.obs, chosen.seed
    if demos is None:
        raise Ig2mjError("--algo bc needs --demos (`ig2mj demos collect` writes such files)")
    world, spaces = about(demos)
    for name, requested in (
        ("task", _task_name(chosen.env, world, demos)),
        ("robot", None if chosen.robot is None else robot_name(chosen.robot)),
        ("grasping", chosen.grasping),
    ):
        if requested is not None and world[name] != requested:
            raise InputError(demos, f"is of {name} {world[name]}, not {requested}")
    if obs == "rgbd" and not {"rgb", "depth"} & set(spaces):
        raise InputError(demos, "holds no images", fix="`ig2mj demos collect --obs rgbd` records them")
    images = settings.image_size, settings.rows, world.get("privileged", ()), settings.depth_range or DEPTH_RANGE
    perception = Perception(spaces, obs, *images)
    runs = load_demos(demos, perception)
    algorithm = BC(perception, runs.action.shape[1], config)
    names = [world["task"], world["robot"], world["grasping"], "bc", obs, str(seed)]
    folder = out or pathlib.Path("runs") / "-".join(names)
    depends = depends_of(world, perception)
    learner, row = clone(algorithm, runs, Run(chosen.minutes, seed=seed, out=folder, resume=resume), depends)
    made = {
        "command": shlex.join(["ig2mj", *sys.argv[1:]]),
        "algorithm": "bc",
        "settings": dataclasses.asdict(config),
        "run_settings": dataclasses.asdict(settings),
        "seed": seed,
        "device": jax.devices()[0].device_kind,
        "minutes": round(row["seconds"] / 60, 2),
        "demonstration_steps": int(runs.reward.shape[0]),
        "held_out_loss": row["held_out_loss"],
        **horizon_on_card({"horizon": settings.horizon or horizon_of_demos(demos)}),
    }
    file = folder / "policy.npz"
    Policy.of(algorithm, learner, depends, made).save(file)
    print(file)
    option = task_option(chosen.env)
    print(f"to evaluate it on held-out start states: {command('evaluate', file)}{option}", file=sys.stderr)
    return 0


def _task_name(env: str, world: Mapping[str, Any], demos: str) -> str:
    """The name of an environment's task, as recordings have it. Raises InputError: theirs is another version of it."""
    from ig2mj.envs.names import short_name
    from ig2mj.errors import InputError
    from ig2mj.tasks.registry import split_reference

    if split_reference(env) is None:
        return short_name(env) or env
    from ig2mj.tasks.custom.files import task_of_file

    task = task_of_file(env)
    if task.code is not None and world.get("task_code") not in (None, task.code.digest):
        raise InputError(demos, f"what determines {task.name} in {world.get('task_file')} has changed since")
    return task.name
