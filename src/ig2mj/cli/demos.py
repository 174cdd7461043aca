"""`ig2mj demos`: demonstrations of the scripted experts to learn from, and recordings to replay."""

from __future__ import annotations

import pathlib
from typing import Annotated

import tyro

from ig2mj.cli.demos_folder import metrics
from ig2mj.cli.demos_replay import export, replay


def collect(
    env: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="ENV")],
    out: pathlib.Path,
    episodes: int = 256,
    robot: str | None = None,
    grasping: str | None = None,
    obs: str = "state",
    engine: str = "native",
    worlds: int = 8,
    noise: float = 0.1,
    disturbed: float = 0.02,
    seed: int = 0,
    split: str = "train",
    pool_size: int = 0,
) -> int:
    """Play a scripted expert, and write its successful episodes as HDF5, for `ig2mj train --demos`.

    Args:
      env: CookingMeat, or ig2mj/CookingMeat-v0 (`ig2mj list-envs`).
      out: the file.
      episodes: how many.
      robot: humanoid or fetch; default: the first that the task lists.
      grasping: mitten, assisted, sticky or physical; default: the task's own.
      obs: state, or rgbd with pictures as well (needs --engine warp).
      engine: native, warp or jax.
      worlds: how many play at once.
      noise: deviation of what is added to the expert's actions; the labels have none.
      disturbed: share of the steps at which five random steps begin, from which the expert finds its way back.
      seed: of start states and noise.
      split: start states: train or held_out.
      pool_size: start states; 0: as many as the split has.
    """
    import sys

    from ig2mj.envs.experts import expert_of
    from ig2mj.envs.registry import VECTORS, make
    from ig2mj.errors import Ig2mjError, UnknownNameError
    from ig2mj.learn.demos import DemoWriter, collect_demos
    from ig2mj.learn.perception import MODES

    if obs not in MODES:
        raise UnknownNameError("kind of observation", obs, MODES)
    if episodes < 1 or worlds < 1:
        raise Ig2mjError(f"--episodes {episodes}, --worlds {worlds}: at least one of each is needed")
    names = VECTORS if obs == "state" else (*VECTORS, "rgb", "depth")
    played = make(
        env, robot, worlds, engine, grasping, observations=names, split=split, pool_size=pool_size or None
    )  # fmt: skip

    def progress(kept: int, of: int) -> None:
        if kept % max(of // 10, 1) == 0 or kept == of:
            print(f"{kept} of {of} episodes", file=sys.stderr)

    with DemoWriter(out, played) as writer:
        found = collect_demos(
            played,
            expert_of(played),
            writer,
            episodes,
            seed=seed,
            noise=noise,
            disturbed=disturbed,
            progress=progress,
        )
    print(f"{out}: {found['kept']} episodes; {found['failed']} more failed and are left out")
    return 0


SUBCOMMANDS = {"collect": collect, "replay": replay, "export": export, "metrics": metrics}
