"""`ig2mj warm-up WHAT`: compiles ahead of time what a batch of worlds needs, for this or another machine."""

from __future__ import annotations

import dataclasses
import pathlib
from typing import TYPE_CHECKING, Annotated, Any, cast

import tyro

from ig2mj.cli.common.objects import AddedObjects
from ig2mj.cli.common.own_robot import NONE, Own, choose_robot

if TYPE_CHECKING:
    from ig2mj.engine.warp.engine import WarpEngine
    from ig2mj.envs.environment import Environment
    from ig2mj.envs.several_homes import HomesEnvironment
    from ig2mj.worlds import Worlds


def run(
    what: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="HOME|ENV")],
    worlds: int = 1024,
    robot: str | None = None,
    own: Own = NONE,
    grasping: str | None = None,
    observations: tuple[str, ...] = (),
    engine: str | None = None,
    homes: str = "",
    randomize: str = "",
    looks: str | None = None,
    object: AddedObjects = (),
    arch: int | None = None,
    out: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FOLDER")] = None,
    json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> int:
    """Compile ahead of time what a batch of worlds needs.

    Creates the worlds, resets them and steps them once, so that all kernels and programs are in the cache. With --out
    they go to a separate folder for other machines with the same GPU, driver and versions: set IG2MJ_CACHE_DIR to it
    there.

    Args:
      what: a home or the folder of a scene, or an environment (`ig2mj list-envs`, or FILE.py:NAME of yours).
      worlds: number of worlds; programs are compiled for this number.
      robot: for an environment: its robot, or a folder that `ig2mj convert robot` wrote; default: the task's first.
      grasping: for an environment: mitten, assisted, sticky or physical.
      observations: for an environment: additional observations, e.g. rgb depth.
      engine: native, warp or jax; default: warp on a GPU, else native.
      homes: for an environment: train, held_out, or names of homes with commas; worlds are shared out over them.
      randomize: for an environment: axes of `ig2mj.Randomize` with commas, or all.
      looks: for an environment: how cameras see the home: day, night or plain.
      object: {object}.
      arch: compile the kernels of physics and images for GPUs of this architecture (compute capability times ten: 90
        is an H100 or H200); this machine needs none. JAX's programs are compiled where the GPU is.
      out: folder of the cache; default: IG2MJ_CACHE_DIR, or the user's own.
      json: print one JSON object.
    """
    import sys
    import time

    began = time.perf_counter()
    from ig2mj.process.compilation import cache_folder
    from ig2mj.process.settings import keep_compiled_in

    if out is not None:
        keep_compiled_in(out)
    options = {"homes": homes, "randomize": randomize, "looks": looks}
    batch = WarmUpBatch(what, worlds, choose_robot(robot, own), grasping, observations, engine, object, **options)
    seconds = _timed(batch) if arch is None else _ahead(batch, arch)
    seconds["all"] = time.perf_counter() - began
    folder = cache_folder()
    size = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    row = {"what": what, "worlds": worlds, "seconds": {k: round(v, 2) for k, v in seconds.items()}}
    if json:
        import json as form

        print(form.dumps({**row, "folder": str(folder), "megabytes": round(size / 1e6, 1)}))
        return 0
    parts = ", ".join(f"{name} {value:.1f}" for name, value in seconds.items())
    print(f"{what}, {worlds:,} worlds: seconds of {parts}")
    print(f"{folder}: {size / 1e6:.0f} MB; elsewhere: IG2MJ_CACHE_DIR={folder.name}", file=sys.stderr)
    return 0


@dataclasses.dataclass(frozen=True)
class WarmUpBatch:
    """The worlds of a home, or an environment; see `run`."""

    what: str
    worlds: int
    robot: str | None
    grasping: str | None
    observations: tuple[str, ...]
    engine: str | None
    objects: tuple[str, ...] = ()
    homes: str = ""
    randomize: str = ""
    looks: str | None = None

    def make(self, pool_size: int | None = None) -> Worlds | Environment | HomesEnvironment:
        """Raises Ig2mjError: a home with options of environments."""
        import ig2mj
        from ig2mj.envs.names import NAMESPACE
        from ig2mj.envs.registry import VECTORS, is_environment, list_envs
        from ig2mj.errors import Ig2mjError, UnknownNameError
        from ig2mj.learn.run_config import RunSettings
        from ig2mj.scene.paths import SHIPPED_HOMES, shipped_homes

        if is_environment(self.what):
            seen = (*VECTORS, *self.observations)
            options: dict[str, Any] = {"observations": seen, "pool_size": pool_size, "objects": self.objects}
            options |= {"looks": self.looks, **RunSettings(homes=self.homes, randomize=self.randomize).varied}
            return ig2mj.make(self.what, self.robot, self.worlds, self.engine, self.grasping, **options)
        if not (pathlib.Path(self.what).exists() or (SHIPPED_HOMES / self.what).is_dir()):
            short = self.what.removeprefix(f"{NAMESPACE}/")
            raise UnknownNameError("home or environment", short, (*shipped_homes(), *list_envs()))
        if any((self.robot, self.grasping, self.observations, self.homes, self.randomize, self.looks)):
            names = "--robot, --grasping, --observations, --homes, --randomize and --looks"
            raise Ig2mjError(f"{names} belong to environments; a home is stepped without")
        return ig2mj.Worlds(self.what, self.worlds, self.engine, objects=self.objects)


MOST_WORLDS = 64
"""Worlds that are created to find kernels, which do not depend on the number."""


def _ahead(batch: WarmUpBatch, architecture: int) -> dict[str, float]:
    """Seconds of tracing and of compiling the kernels for a GPU architecture; needs no GPU."""
    import time

    from ig2mj.engine.warp import ahead
    from ig2mj.envs.several_homes import HomesEnvironment
    from ig2mj.errors import Ig2mjError
    from ig2mj.worlds import Worlds

    if batch.engine not in (None, "warp"):
        raise Ig2mjError(f"--arch compiles kernels of the Warp engine; engine {batch.engine!r} has none")
    ahead.check(architecture)
    began = time.perf_counter()
    made = dataclasses.replace(batch, worlds=min(batch.worlds, MOST_WORLDS), engine="warp").make(pool_size=1)
    parts = made.envs if isinstance(made, HomesEnvironment) else (made,)
    engines = [part.engine if isinstance(part, Worlds) else part.core.engine for part in parts]
    launches = [launch for engine in engines for launch in ahead.launches_on_gpu(cast("WarpEngine", engine))]
    launches = list(dict.fromkeys(launches))
    found = time.perf_counter()
    ahead.compile_for(launches, architecture)
    return {"making": found - began, "kernels": time.perf_counter() - found}


def _timed(batch: WarmUpBatch) -> dict[str, float]:
    """Seconds of creating the worlds, of the reset and of the first step."""
    import time

    import jax
    import numpy as np

    from ig2mj.worlds import Worlds

    times, parts = [time.perf_counter()], ["making", "start", "first step"]

    def tick() -> None:
        times.append(time.perf_counter())

    made = batch.make()
    tick()
    if isinstance(made, Worlds):
        started = jax.block_until_ready(made.start(0))
        tick()
        jax.block_until_ready(made.step(started))
    else:
        state = jax.block_until_ready(made.reset(0))
        tick()
        action = np.zeros((batch.worlds, *made.action_space.shape), np.float32)
        jax.block_until_ready(made.step_autoreset(state, action))
    tick()
    return dict(zip(parts, np.diff(times).tolist(), strict=True))
