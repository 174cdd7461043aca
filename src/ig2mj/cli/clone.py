"""`ig2mj train ENV --algo bc --demos FILE`: no environment is made, the file says what it is of."""

from __future__ import annotations

import pathlib


def train_from_demos(
    env: str,
    demos: pathlib.Path | None,
    robot: str | None,
    grasping: str | None,
    obs: str,
    pixels: int,
    rows: tuple[int, int] | None,
    minutes: float,
    seed: int,
    out: pathlib.Path | None,
    resume: bool,
    changes: tuple[str, ...],
) -> int:
    """Clones demonstrations, and writes the policy. See `ig2mj.cli.train` for the arguments."""
    import dataclasses
    import shlex
    import sys

    import jax

    from ig2mj.envs.names import short_name
    from ig2mj.errors import Ig2mjError, InputError
    from ig2mj.learn.bc import BC, BCConfig, clone
    from ig2mj.learn.demos import about, load_demos
    from ig2mj.learn.options import configured
    from ig2mj.learn.perception import Perception
    from ig2mj.learn.policies import Policy, depends_of
    from ig2mj.learn.train import Run

    if demos is None:
        raise Ig2mjError("--algo bc needs --demos (`ig2mj demos collect` writes such files)")
    world, spaces = about(demos)
    for name, wanted in (("task", short_name(env) or env), ("robot", robot), ("grasping", grasping)):
        if wanted is not None and world[name] != wanted:
            raise InputError(demos, f"is of {name} {world[name]}, not {wanted}")
    if obs == "rgbd" and not {"rgb", "depth"} & set(spaces):
        raise InputError(demos, "holds no pictures", fix="`ig2mj demos collect --obs rgbd` records them")
    perception = Perception(spaces, obs, pixels, rows, world.get("privileged", ()))
    runs = load_demos(demos, perception)
    config = configured(BCConfig(), changes)
    algorithm = BC(perception, runs.action.shape[1], config)
    names = [world["task"], world["robot"], world["grasping"], "bc", obs, str(seed)]
    folder = out or pathlib.Path("runs") / "-".join(names)
    depends = depends_of(world, perception)
    learner, row = clone(algorithm, runs, Run(minutes, seed=seed, out=folder, resume=resume), depends)
    made = {
        "command": shlex.join(["ig2mj", *sys.argv[1:]]),
        "algorithm": "bc",
        "settings": dataclasses.asdict(config),
        "seed": seed,
        "device": jax.devices()[0].device_kind,
        "minutes": round(row["seconds"] / 60, 2),
        "demonstration_steps": int(runs.reward.shape[0]),
        "loss_apart": row["loss_apart"],
    }
    file = folder / "policy.npz"
    Policy.of(algorithm, learner, depends, made).save(file)
    print(file)
    print(f"to measure it on states it has not seen: ig2mj evaluate {file}", file=sys.stderr)
    return 0
