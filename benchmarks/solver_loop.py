"""How many iterations of the solver MuJoCo Warp's kernels should make, before one kernel makes each world's others.

    python benchmarks/solver_loop.py HOME [--worlds 8192] [--wide -1 0 1 2 3 4] [--rows FILE]

A disturbed batch is stepped as by `throughput.py`; its last states are the start of steps with each number (-1: MuJoCo
Warp's own loop makes all). A row says how often iterations are those of the first number in the list, how far
accelerations are from its, and on a GPU what a physics step takes as a CUDA graph.
"""

from __future__ import annotations

import argparse
import gc
import pathlib
import time
from typing import Any

import jax
import numpy as np
import results
import throughput
import warp as wp
from batch_case import Case
from mujoco.mjx.third_party import mujoco_warp

from ig2mj.engine.warp.engine import WarpEngine
from ig2mj.engine.warp.patches import awake_kernels, solver_loop
from ig2mj.worlds import Core, Rules

STEPS, TIMES = 24, 4
"""Physics steps that are timed, and how often; each time from the same states."""

STATE = ["qpos", "qvel", "act", "ctrl", "qacc_warmstart", "time", "eq_active", "mocap_pos", "mocap_quat"]
OF_WARP = ["tree_asleep", "tree_awake"]


def states(case: Case, num_worlds: int, calls: int) -> tuple[WarpEngine, dict[str, np.ndarray]]:
    """The engine of a batch that was disturbed for some calls of `throughput.STEPS` control steps, and its states."""
    initial = jax.tree.map(lambda a: a[0], case.pool.physics)
    engine = WarpEngine(case.scene, num_worlds, profile=case.profile.for_worlds(num_worlds), initial=initial)
    worlds = Core(engine, Rules(case.model, case.goal), case.pool)
    call, carry = throughput.program(case, worlds, throughput.Watch(engine), True, "physics")
    for _ in range(calls):
        carry, _ = jax.block_until_ready(call(carry))
    data = carry[0].world.physics.data
    found = {name: np.array(getattr(data, name)) for name in STATE}
    found |= {name: np.array(getattr(data._impl, name)) for name in OF_WARP}
    found["tree_awake"] = (found["tree_awake"] == 1).astype(np.int32)  # what rests is computed anew
    return engine, found


class Steps:
    """Physics steps from given states."""

    def __init__(self, engine: WarpEngine, start: dict[str, np.ndarray]):
        profile, worlds = engine.profile, engine.num_worlds
        self.model = mujoco_warp.put_model(engine.host_model)
        self.model.opt.warn_overflow = 0
        self.data: Any = mujoco_warp.make_data(
            engine.host_model,
            nworld=worlds,
            naconmax=worlds * profile.contacts,
            naccdmax=worlds * profile.convex_contacts,
            njmax=profile.constraints,
            nvmax=profile.awake_dofs,
        )
        self.start = {}
        for name, value in start.items():
            target = getattr(self.data, name)
            if value.size:
                target.assign(value.reshape(target.shape).astype(target.numpy().dtype))
                self.start[name] = wp.clone(target)

    def step(self) -> dict[str, np.ndarray]:
        """Iterations and accelerations of one step."""
        self._reset()
        with awake_kernels():
            mujoco_warp.step(self.model, self.data)
        return {name: getattr(self.data, name).numpy().copy() for name in ("solver_niter", "qacc")}

    def milliseconds(self) -> list[float]:
        """A step's time as a CUDA graph."""
        with awake_kernels(), wp.ScopedCapture() as capture:
            mujoco_warp.step(self.model, self.data)
        assert capture.graph is not None
        times = []
        for _ in range(TIMES):
            self._reset()
            wp.synchronize_device()
            began = time.perf_counter()
            for _ in range(STEPS):
                wp.capture_launch(capture.graph)
            wp.synchronize_device()
            times.append(round(1e3 * (time.perf_counter() - began) / STEPS, 3))
        return times

    def _reset(self) -> None:
        for name, value in self.start.items():
            wp.copy(getattr(self.data, name), value)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("home")
    parser.add_argument("--worlds", type=int, default=8192)
    parser.add_argument("--wide", type=int, nargs="+", default=[-1, 0, 1, 2, 3, 4, 6, 8, -1])
    parser.add_argument("--calls", type=int, default=4, help="of 30 control steps each, before states are taken")
    parser.add_argument("--rows", type=pathlib.Path, help="rows are added to this file, as JSON lines")
    args = parser.parse_args()
    case = Case(args.home, True)
    engine, start = states(case, args.worlds, args.calls)
    jax.clear_caches()
    gc.collect()
    steps, first, serves = Steps(engine, start), None, solver_loop._serves
    for wide in args.wide:
        solver_loop.WIDE, solver_loop._serves = wide, serves if wide >= 0 else lambda m, ctx: False
        steps.step()  # loads kernels
        found = steps.step()
        first = first or found
        far = np.abs(found["qacc"] - first["qacc"]).max(1) / (1.0 + np.abs(first["qacc"]).max(1))
        niter = found["solver_niter"]
        row: dict[str, Any] = {
            "scene": case.scene.name,
            "worlds": args.worlds,
            "wide": wide,
            "iterations_mean_50_90_99_100": [float(niter.mean()), *np.percentile(niter, [50, 90, 99, 100]).tolist()],
            "same_iterations": float((niter == first["solver_niter"]).mean()),
            "accelerations_off_50_99_999_100": np.percentile(far, [50, 99, 99.9, 100]).tolist(),
        }
        if wp.get_device().is_cuda:
            row["ms_per_physics_step"] = steps.milliseconds()
        results.keep_row({**row, **throughput.device()}, args.rows)


if __name__ == "__main__":
    main()
