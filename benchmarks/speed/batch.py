"""Control steps per second of the batched engine: worlds x scenes, idle and disturbed, with states and a goal.

    python -m benchmarks.speed.batch HOME [HOME ...] --worlds 1024 4096 16384 [--idle] [--what full] [--rows FILE]

A control step is four physics steps of 1/120 s, the view, all extended states, guards and a goal of up to ten literals,
in one jitted function under `lax.scan`; a floating hand pushes objects about unless `--idle`, or with `--robot` the
humanoid or Fetch acts at random without grasping, a new action every half second (`ACTS`).
Every row says what hand or robot really did (`harness/disturbance.py`), how many worlds overflowed or lost their
numbers, and in how many an object left the house. A row with any of the first two or more than one in a thousand of the
last does not count (`counts` is false), nor does one whose hand touches nothing.

Several of these may run at once (`suite.py`): what is timed runs under a lock, everything else at the same time.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import functools
import pathlib
import time
from collections.abc import Callable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import warp as wp

from benchmarks.harness import results
from benchmarks.harness.batch_case import ROBOTS, Case
from benchmarks.harness.disturbance import LEAST, MOST_LOST, Watch, join, summary
from benchmarks.harness.kernel_times import profiled
from benchmarks.harness.turns import exclusive, preparing
from ig2mj.calibration.acting import ACTION_STEPS, act_at_random, robot_of, start_acting
from ig2mj.calibration.pushing import push, start_pushing
from ig2mj.engine.health import CAPACITY, Overflow
from ig2mj.engine.warp import patches
from ig2mj.engine.warp.engine import WarpEngine
from ig2mj.scene.scene import PLAIN
from ig2mj.sensors.batch_camera import BatchCamera
from ig2mj.worlds import Core, Rules

STEPS = 30
"""Control steps of one timed call."""

CALLS, LEAST_CALLS, CALL_SECONDS = 6, 5, 15.0
"""Timed calls of a program; fewer, down to `LEAST_CALLS`, where they would take longer than this together."""

SIZE = 128
"""Pixels a side of the pictures."""

AGENT_STEP = 3
"""Control steps of an agent step, of which `--what agent` takes one picture."""

ACTS = {"Humanoid": (1, 0.5 / ACTION_STEPS)}
"""By robot: control steps of an action (else `ACTION_STEPS`), and share of the range of actions that is drawn from. The
humanoid goes at up to 1.5 m/s along each axis: at twice that boxes fly over walls, at the 0.5 m/s of the paper's
activities it touches hardly anything. It acts in every control step: hands that are sent 0.15 m on ten times a second
jump there at 5 m/s."""

CAMERAS = {"camera": PLAIN, "camera_day": "day", "camera_night": "night", "agent": PLAIN}
"""By `--what`: how images show the home."""

ENGINES = {"ig2mj": contextlib.nullcontext, "mujoco_warp": patches.upstream_kernels}
"""Whose functions run on the device: with ours in place of some of MuJoCo Warp's, or MuJoCo Warp's alone."""


@dataclasses.dataclass
class Prepared:
    """A compiled program, its carry, and what was timed of it.

    Attributes:
      times: seconds of each timed call. activity: of each call, what hand or robot did (`Watch.step`).
      before: `[W, O, 3]`, m: where objects were before the first call.
    """

    what: str
    worlds: Core
    watch: Watch
    call: Callable[[Any], Any]
    carry: Any
    compile_seconds: float
    times: list[float] = dataclasses.field(default_factory=list)
    activity: list[Any] = dataclasses.field(default_factory=list)
    seen: Any = None
    first: float = 0.0

    def __post_init__(self) -> None:
        self.before = np.array(self.carry[0].world.view.object_com)

    def warm_up(self) -> None:
        """Two calls that do not count: buffers change places after the first, so graphs are captured in both."""
        start = time.time()
        self._run()
        self.first = time.time() - start
        self._run()

    def measure(self) -> float:
        """One timed call. Returns its seconds."""
        start = time.time()
        self._run()
        self.times.append(time.time() - start)
        return self.times[-1]

    def _run(self) -> None:
        self.carry, (self.seen, acts) = jax.block_until_ready(self.call(self.carry))
        self.activity.append(acts)


def run(
    case: Case,
    num_worlds: int,
    disturbed: bool,
    whats: Sequence[str],
    lock: pathlib.Path | None,
    kernels: int = 0,
    patience: float = 0.0,
    timeline: pathlib.Path | None = None,
    **solver: Any,
) -> list[dict[str, Any]]:
    """Times batches of one home side by side: the k-th calls of all programs follow one another, and each goes through
    the same motion from the same start, so that their ratio is free of what the hand happens to do.

    Args:
      whats: what each batch computes, as `--what`.
      lock, patience: see `turns.exclusive`.
      kernels: so many of the longest of each are printed afterwards. timeline: see `kernel_times.profiled`.
      solver: limits of iterations.

    Returns:
      A row for each of `whats`.
    """
    with preparing(lock, patience):
        programs = [prepare(case, num_worlds, disturbed, what, solver) for what in whats]
    with exclusive(lock, patience):
        for each in programs:
            each.warm_up()
        spent = last = 0.0
        for number in range(CALLS):
            if number >= LEAST_CALLS and spent + last > CALL_SECONDS * len(programs):
                break
            last = sum(each.measure() for each in programs)
            spent += last
        profiles: list[dict] = [{} for _ in programs]
        if kernels:
            for k, each in enumerate(programs):
                call = functools.partial(each.call, each.carry)
                (each.carry, _), profiles[k] = profiled(call, STEPS, kernels, "control step", timeline)
    rows = [_row(case, each, disturbed) | solver for each in programs]
    for row, each, profile in zip(rows, programs, profiles, strict=True):
        ratios = np.array(each.times) / np.array(programs[0].times)
        if each is not programs[0]:
            row["time_by_call_over"] = {"what": whats[0], "median": _round(np.median(ratios)),
                                        "range": [_round(ratios.min()), _round(ratios.max())]}  # fmt: skip
        if profile:
            row["kernels"] = profile
    return rows


def prepare(case: Case, num_worlds: int, disturbed: bool, what: str, solver: dict[str, Any]) -> Prepared:
    """A batch at its start, and its compiled program."""
    start = time.time()
    profile = case.profile.for_worlds(num_worlds)
    initial = jax.tree.map(lambda a: a[0], case.pool.physics)
    engine = WarpEngine(case.scene, num_worlds, profile=profile, initial=initial, **solver)
    worlds = Core(engine, Rules(case.model, case.goal), case.pool)
    watch = Watch(engine)
    call, carry = program(case, worlds, watch, disturbed, what)
    return Prepared(what, worlds, watch, call.lower(carry).compile(), carry, time.time() - start)


def _row(case: Case, each: Prepared, disturbed: bool) -> dict[str, Any]:
    engine, batch, times = each.watch.engine, each.carry[0], each.times
    num_worlds, seconds = engine.num_worlds, engine.substeps * engine.timestep
    profile = case.profile.for_worlds(num_worlds)
    overflow = np.asarray(batch.world.physics.overflow)
    calls = len(each.activity)

    def speed(t: float) -> int:
        return round(num_worlds * STEPS / t)

    row: dict[str, Any] = {
        "scene": case.scene.name,
        "objects": case.scene.tables.num_objects,
        "worlds": num_worlds,
        "case": (case.robot.__name__.lower() if case.robot else "disturbed") if disturbed else "idle",
        "what": each.what,
        "control_steps_per_s": speed(float(np.median(times))),
        "range_of_calls": [speed(max(times)), speed(min(times))],
        "ms_per_control_step": round(1e3 * float(np.median(times)) / STEPS, 3),
        "spread": round((max(times) - min(times)) / float(np.median(times)), 3),
        "ms_of_calls": [round(1e3 * t / STEPS, 2) for t in times],
        "compile_s": round(each.compile_seconds, 1),
        "first_call_s": round(each.first, 1),
        "simulated_s": round(calls * STEPS * seconds, 2),
        **summary(join(each.activity[1:]), own_dofs(case)),
        "moved_objects_per_world": round(each.watch.moved(each.before, each.carry[2]), 2),
        "capacity_overflows": int(((overflow & int(CAPACITY)) != 0).sum()),
        "overflow_bits": _bits(overflow),
        "iteration_limits": int(((overflow & int(Overflow.ITERATIONS | Overflow.LS_ITERATIONS)) != 0).sum()),
        "non_finite": int((~np.asarray(engine.health(batch.world.physics).finite)).sum()),
        "lost_object_worlds": each.watch.lost(each.carry[2]),
        **memory(num_worlds),
        "profile": [profile.awake_dofs, profile.constraints, profile.contacts, profile.convex_contacts],
        "mean_seen": float(np.asarray(each.seen).mean()),
        "troubles": each.worlds.metrics(batch) if each.what in ("full", *CAMERAS) else {},
    }
    if each.what == "agent":
        row["agent_steps_per_s"] = round(row["control_steps_per_s"] / AGENT_STEP)
    sound = row["capacity_overflows"] == 0 and row["non_finite"] == 0
    sound = sound and row["lost_object_worlds"] <= MOST_LOST * num_worlds
    # A robot that acts at random is the load itself, whatever it happens to touch.
    row["counts"] = sound and (not disturbed or case.robot is not None or row["hand_contact_share"] >= LEAST)
    return row


def _round(ratio: Any) -> float:
    return round(float(ratio), 3)


def own_dofs(case: Case) -> int:
    """Degrees of freedom of the agents."""
    return int((case.scene.tables.body_agent[case.scene.model.dof_bodyid] >= 0).sum())


def program(case: Case, worlds: Core, watch: Watch, disturbed: bool, what: str, steps: int = STEPS):
    """The jitted function of so many control steps, and the carry to begin with."""
    engine = watch.engine
    seconds = engine.substeps * engine.timestep
    camera = None
    if what in CAMERAS:
        camera = BatchCamera(engine, case.model, [case.eye], width=SIZE, height=SIZE, depth=True, looks=CAMERAS[what])

    every, share = ACTS.get(case.robot.__name__ if case.robot else "", (ACTION_STEPS, 1.0))
    robot = robot_of(case.scene, every * seconds) if disturbed and case.robot is not None else None

    def control(batch, pusher, com, palm):
        if not disturbed:
            return pusher
        if robot is not None:
            world = batch.world
            return act_at_random(robot, pusher, world.view, world.key, world.step, share, every)
        return push(case.reach, pusher, com, palm, batch.world.key, batch.world.step, seconds)

    def full(carry, _):
        batch, pusher, com, palm = carry
        pusher = control(batch, pusher, com, palm)
        batch, status = worlds.step_fn(batch, pusher.ctrl)
        seen = status.fraction.mean()
        view, physics = batch.world.view, batch.world.physics
        if what in CAMERAS and what != "agent":
            seen += picture(batch)
        return (batch, pusher, view.object_com, view.agent.base_pos[:, 0]), (seen, watch.step(physics))

    def picture(batch):
        assert camera is not None
        images = camera(batch.world.physics, batch.world.view, batch.world.states)
        return jnp.asarray(images.rgb, jnp.float32).mean() + jnp.asarray(images.depth).mean()

    def agent(carry, _):
        carry, (seen, acts) = jax.lax.scan(full, carry, None, AGENT_STEP)
        return carry, (seen + picture(carry[0]), acts)

    def physics(carry, _):
        """Of the view only what the hand needs, unless the whole of it is asked for."""
        batch, pusher, com, palm = carry
        pusher = control(batch, pusher, com, palm)
        state, view = engine.step(batch.world.physics, pusher.ctrl)
        world = batch.world.replace(physics=state, step=batch.world.step + 1)
        if what == "view":
            world = world.replace(view=view)
        elif robot is not None:  # what its controller reads
            world = world.replace(view=world.view.replace(agent=view.agent, held=view.held))
        seen = view.object_com[:, 0, 2].mean()
        return (batch.replace(world=world), pusher, view.object_com, view.agent.base_pos[:, 0]), (
            seen,
            watch.step(state),
        )

    def several(carry):
        if what != "agent":
            return jax.lax.scan(physics if what in ("physics", "view") else full, carry, None, steps)
        carry, out = jax.lax.scan(agent, carry, None, steps // AGENT_STEP)
        return carry, jax.tree.map(lambda a: a.reshape(-1, *a.shape[2:]), out)  # [agent steps, 3, ...] in a row

    call = jax.jit(several, donate_argnums=0)
    batch = jax.block_until_ready(worlds.start(0))
    if robot is not None:
        pusher = start_acting(robot, engine.num_worlds, case.scene.model.nu)
    else:
        pusher = start_pushing(case.reach, engine.num_worlds, case.scene.model.nu)
    # Copies: what is donated must not be in the batch as well.
    view = batch.world.view
    return call, (batch, pusher, view.object_com + 0.0, view.agent.base_pos[:, 0] + 0.0)


def memory(num_worlds: int) -> dict[str, float]:
    """Most device memory of this process so far, JAX's and Warp's own, MB per world. 0 on a CPU."""
    of_jax = (jax.local_devices()[0].memory_stats() or {}).get("peak_bytes_in_use", 0)
    of_warp = wp.get_mempool_used_mem_high(wp.get_device("cuda:0")) if wp.is_cuda_available() else 0
    return {
        "peak_device_MB_per_world": round((of_jax + of_warp) / num_worlds / 1e6, 3),
        "of_that_warps_MB_per_world": round(of_warp / num_worlds / 1e6, 3),
    }


def _bits(overflow: np.ndarray) -> dict[str, int]:
    """Worlds by flag of capacity."""
    counts = {f.name: int(((overflow & int(f)) != 0).sum()) for f in Overflow if f & CAPACITY and f.name}
    return {name: count for name, count in counts.items() if count}


def device() -> dict[str, str]:
    """What this ran on, and what ran."""
    return {
        **results.provenance(),
        "device": str(jax.devices()[0].device_kind),
        "jax": jax.__version__,
        "warp": wp.__version__,
        "mujoco": mujoco.__version__,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("homes", nargs="+")
    parser.add_argument("--worlds", type=int, nargs="+", default=[4096])
    parser.add_argument("--idle", action="store_true", help="no hand, nothing moves")
    parser.add_argument("--robot", default="hand", choices=["hand", *ROBOTS], help="which acts at random, no hand then")
    parser.add_argument(
        "--what",
        nargs="+",
        default=["full"],
        choices=["physics", "view", "full", *CAMERAS],
        help="several are timed in turns. full: with states, guards and goal; camera: and an image a control step, of "
        "the home by day or by night with camera_day and camera_night; agent: and one in three",
    )
    parser.add_argument("--engine", default="ig2mj", choices=ENGINES, help="mujoco_warp: without our kernels")
    parser.add_argument("--iterations", type=int, nargs="+", default=[0], help="solver limits to try; 0: the engine's")
    parser.add_argument("--pool", type=int, default=16, help="rows of initial states")
    parser.add_argument("--profiles", type=pathlib.Path, help="folder with <home>/engine_profile.json")
    parser.add_argument("--kernels", type=int, default=0, metavar="N", help="print the N longest kernels")
    parser.add_argument("--timeline", type=pathlib.Path, help="with --kernels: file for the last steps' launches, CSV")
    parser.add_argument("--label", default="", help="a remark for the rows")
    parser.add_argument("--lock", type=pathlib.Path, help="file to lock while timing")
    parser.add_argument(
        "--patience", type=float, default=0.0, help="seconds to wait for others with this lock that are being compiled"
    )
    parser.add_argument("--rows", type=pathlib.Path, help="rows are added to this file, as JSON lines")
    args = parser.parse_args()
    for home in args.homes:
        alone = None if args.patience else exclusive(args.lock)
        with preparing(args.lock, args.patience):
            case = Case(home, not args.idle, args.pool, args.profiles, alone, args.robot)
        for worlds in args.worlds:
            for limit in args.iterations:
                solver = {"iterations": limit, "ls_iterations": limit} if limit else {}
                with ENGINES[args.engine]():
                    ways = args.lock, args.kernels, args.patience, args.timeline
                    rows = run(case, worlds, not args.idle, args.what, *ways, **solver)
                for row in rows:
                    row = {"engine": args.engine} | row | {"ready_s": case.seconds, "label": args.label, **device()}
                    results.keep_row(row, args.rows)


if __name__ == "__main__":
    main()
