"""One process of `benchmarks/speed/scaling.py`, with one GPU: makes a case ready, then measures whenever it is told to.

    python -m benchmarks.speed.scaling_worker CASE '{"worlds": 8192, ...}'

Says `READY {...}` on standard output; for each line `{"seconds": 8}` on standard input it answers `DONE {...}`; it ends
with its input. For `{"kernels": FILE}` a learner learns from one rollout ten times, and writes what ran on its GPU. A
learner of several processes finds the others by the variables of `ig2mj.cluster.process_topology`; what they measure
together they time together. It takes all GPUs that it sees.
"""

from __future__ import annotations

import json
import os
import pathlib
import sys
import tempfile
import time
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from benchmarks.harness.captures import Counts, Moves
from benchmarks.harness.kernel_times import profiled_to
from benchmarks.speed.batch import device, memory, program
from ig2mj.cluster.process_topology import find_topology
from ig2mj.cluster.team import Team
from ig2mj.process import keep_scratch_in_place

Measure = Callable[[float], dict[str, Any]]
Profile = Callable[[pathlib.Path], dict[str, Any]]

PROFILED = 10
"""How often a learner learns while its kernels are listed."""


def say(word: str, row: dict[str, Any]) -> None:
    """One line for the process that started this one."""
    print(f"{word} {json.dumps(row)}", flush=True)


def simulator(settings: dict[str, Any]) -> tuple[dict[str, Any], Measure]:
    """Worlds in which a hand pushes objects about, with all states and a goal; with `pictures` also 128x128 RGB-D."""
    from benchmarks.harness.batch_case import Case
    from benchmarks.harness.disturbance import Watch
    from ig2mj.engine.health import CAPACITY
    from ig2mj.engine.warp.engine import WarpEngine
    from ig2mj.worlds import Core, Rules

    profiles = settings.get("profiles")
    case = Case(settings["home"], True, 16, pathlib.Path(profiles) if profiles else None)
    worlds, steps = settings["worlds"], settings["steps"]
    engine = WarpEngine(
        case.scene,
        worlds,
        profile=case.profile.for_worlds(worlds),
        initial=jax.tree.map(lambda a: a[0], case.pool.physics),
    )
    core = Core(engine, Rules(case.model, case.goal), case.pool)
    call, carry = program(case, core, Watch(engine), True, "camera" if settings["pictures"] else "full", steps)
    compiled = call.lower(carry).compile()
    # The hand pushes things about, and what is awake costs: a second measurement that went on where the first had ended
    # would be one of other work, a fifth slower. So each begins with these worlds.
    begun = jax.device_get(jax.block_until_ready(compiled(carry))[0])
    held = [begun]

    def one() -> float:
        began = time.perf_counter()
        held[0], _ = jax.block_until_ready(compiled(held[0]))
        return time.perf_counter() - began

    def again() -> None:
        held[0] = jax.device_put(begun)
        one()  # Warp captures its graphs for where the arrays lie now

    again()
    each = min(one(), one())

    def measure(seconds: float) -> dict[str, Any]:
        again()
        calls = max(2, round(seconds / each))
        began = time.perf_counter()
        for _ in range(calls):
            one()
        took = time.perf_counter() - began
        batch = held[0][0]
        overflow = np.asarray(batch.world.physics.overflow)
        return {
            "seconds": took,
            "steps": worlds * steps * calls,
            "overflow": int(((overflow & int(CAPACITY)) != 0).sum()),
            "non_finite": int((~np.asarray(engine.health(batch.world.physics).finite)).sum()),
        }

    return {"objects": case.scene.tables.num_objects, **memory(worlds)}, measure


def learner(settings: dict[str, Any], team: Team) -> tuple[dict[str, Any], Measure, Profile]:
    """SAC from pixels on an environment, as `ig2mj train` runs it: on one GPU one program for all of an iteration.

    It learns for `learnt` iterations before anything is measured. Where the worlds are a program of their own, arrays
    come to lie elsewhere, most often in the first iterations, and Warp captures a CUDA graph for each place: 65 ms
    of a processor. `graphs_captured` says how often that still was so, `moves` which arrays did.

    With `apart` the worlds and the learning are two programs there, too. Only such a learner can list its kernels: the
    worlds are left out, since with them a process of two once ended under the profiler (a failed launch of a graph).
    """
    import ig2mj
    from ig2mj.envs.registry import VECTORS
    from ig2mj.learn.algorithms import make_algorithm
    from ig2mj.learn.checkpoints import Checkpoints
    from ig2mj.learn.iteration import OneDevice
    from ig2mj.learn.perception import Perception
    from ig2mj.learn.sac import SAC, SACConfig
    from ig2mj.learn.several_devices import AXIS, ManyDevices

    worlds, count, moves = settings["worlds"], jax.device_count(), Moves()
    apart = count > 1 or settings["apart"]
    names = VECTORS if settings["obs"] == "state" else (*VECTORS, "rgb", "depth")
    env: Any = ig2mj.make(
        settings["env"], worlds=worlds, engine=settings["engine"], observations=names, pool_size=settings["pool_size"]
    )
    config = SACConfig(batch_size=settings["batch"] * count, buffer_size=settings["capacity"] * count)
    perception = Perception(env.observation_spaces, settings["obs"])
    sac = make_algorithm(config, perception, env, None, AXIS if apart else None)
    assert isinstance(sac, SAC)
    step: Any = ManyDevices(env, sac, jax.devices(), team) if apart else OneDevice(env, sac)
    held, memory_, key = *step.place(sac.init(jax.random.PRNGKey(0)), step.buffer()), jax.random.PRNGKey(1)
    play = step.begin(0)
    parts = {name: sum(a.size for a in jax.tree.leaves(getattr(held, name))) for name in ("actor", "critic")}
    state = [held, memory_, play, key]

    def one(ready: bool) -> tuple[float, dict[str, float], dict[str, float], float | None]:
        began = time.perf_counter()
        state[3], now = jax.random.split(state[3])
        *state[:3], sums, losses, spent = step(state[0], state[1], state[2], now, 0.1, ready)
        return time.perf_counter() - began, sums, losses, spent

    for _ in range(sac.warm_up(False)):
        one(False)
    for _ in range(settings["learnt"]):
        one(True)
    each = team.barrier("an iteration", min(one(True)[0], one(True)[0]))
    rounds, counts = [0], Counts()

    def measure(seconds: float) -> dict[str, Any]:
        rounds[0] += 1
        team.barrier(f"round {rounds[0]}")
        iterations = max(3, round(seconds / each))
        moves.rows.clear()
        began, before = time.perf_counter(), counts.now()
        done = [one(True) for _ in range(iterations)]
        took = time.perf_counter() - began
        parts_of_play = state[2] if isinstance(state[2], list) else [state[2]]
        troubles = [env.metrics(p.state) for p in parts_of_play]
        return {
            "seconds": took,
            "steps": sum(sums["steps"] for _, sums, _, _ in done) / team.count,  # every process gives the sum of all
            "updates": sum(losses["updates"] for _, _, losses, _ in done),
            "finite": all(np.isfinite(list(losses.values())).all() for _, _, losses, _ in done),
            "graphs_captured": counts.now()[0] - before[0],
            "moves": moves.rows[:20],
            **({"worlds_each": [spent or 0.0 for *_, spent in done]} if apart else {}),
            "overflow": sum(t["overflow"] for t in troubles),
            "non_finite": sum(t["not_finite"] for t in troubles),
        }

    def profile(file: pathlib.Path) -> dict[str, Any]:
        rounds[0] += 1
        state[2], rollouts, sums, _ = step.play(state[0], state[2], state[3])

        def traced() -> None:
            team.barrier(f"traced {rounds[0]}")  # profilers do not begin at the same moment
            for k in range(PROFILED):
                key = np.asarray(jax.random.fold_in(state[3], k))
                state[0], state[1], *_ = step.learn(state[0], state[1], rollouts, sums, key, 0.1, True)

        profiled_to(file, traced, PROFILED * sac.updates)
        return {"updates": PROFILED * sac.updates}

    with tempfile.TemporaryDirectory() as folder:
        kept = Checkpoints(folder).save(1, {"learner": jax.device_get(state[0])}, {})
        size = sum(f.stat().st_size for f in kept.rglob("*") if f.is_file())
    about = {
        "parameters": parts,
        "checkpoint_bytes": size,
        "replay_bytes_per_step": _bytes(state[1]) // (config.buffer_size // count),
        "updates_of_the_critics_per_update_of_the_actor": config.policy_delay,
    }
    return {**about, **memory(worlds)}, measure, profile


def _bytes(tree: Any) -> int:
    """Of the arrays of a tree, on one device."""
    return sum(a.addressable_shards[0].data.nbytes for a in jax.tree.leaves(tree))


def main() -> None:
    began = time.time()
    case, settings = sys.argv[1], json.loads(sys.argv[2])
    if settings["several"]:
        keep_scratch_in_place()  # as `ig2mj train` does
    team = Team.join(find_topology(os.environ))
    with team.together():
        profile = None
        if case == "simulator":
            about, measure = simulator(settings)
        else:
            about, measure, profile = learner(settings, team)
        say("READY", {**about, **device(), "ready_s": round(time.time() - began, 1)})
        for line in sys.stdin:
            wish = json.loads(line)
            if "kernels" in wish:
                assert profile is not None
                say("DONE", profile(pathlib.Path(wish["kernels"])))
            else:
                say("DONE", measure(wish["seconds"]))


if __name__ == "__main__":
    main()
