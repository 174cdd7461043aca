"""Control steps per second of the batched engine: worlds x scenes, idle and disturbed, with states and a goal.

    python benchmarks/throughput.py HOME [HOME ...] --worlds 1024 4096 16384 [--idle] [--what full] [--out DIR]

A control step is four physics steps of 1/120 s, the view, all extended states, guards and a goal of up to ten literals,
in one jitted function under `lax.scan`; a floating hand pushes objects about unless `--idle`. Every row says what the
hand really did (`benchmarks/disturbance.py`) and how many worlds overflowed or lost their numbers: a row with any, or a
disturbed one whose hand touches nothing, does not count (`counts` is false).
"""

from __future__ import annotations

import argparse
import functools
import json
import pathlib
import time

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from disturbance import LEAST, Watch, join, summary

import ig2mj
from ig2mj.agents.floating_hand import add_floating_hand
from ig2mj.agents.pushing import push, start_pushing
from ig2mj.agents.reach import find_reach
from ig2mj.calibration import calibrate
from ig2mj.engine.health import CAPACITY, Overflow
from ig2mj.engine.profile import PROFILE_FILE, EngineProfile, load_profile
from ig2mj.engine.warp import WarpEngine
from ig2mj.predicates.compile import compile_expression
from ig2mj.sampling.perturbation import loose_objects
from ig2mj.sampling.settled import make_pool
from ig2mj.scene.manifest import AgentEntry
from ig2mj.sensors.batch_camera import BatchCamera
from ig2mj.states.model import StateModel
from ig2mj.worlds.batch import Worlds
from ig2mj.worlds.pool import Pool

STEPS = 30
"""Control steps of one timed call."""

HAND_DOFS = 16

Place = tuple[float, float, float]


def add_eye(spec: mujoco.MjSpec, pos: Place) -> AgentEntry:
    """A camera that hangs in the room, where there is no hand to carry it."""
    eye = spec.worldbody.add_body(name="eye", pos=list(pos))
    eye.add_camera(name="eye/eye", fovy=60.0)
    return AgentEntry(name="eye", body="eye", camera="eye/eye")


def ten_literals(model: StateModel) -> str:
    """A goal of ten literals over the first loose objects: where they are, and what they have become."""
    tables = model.tables
    loose = [tables.object_names[i] for i in loose_objects(tables)]
    fixed = [
        n
        for n, f, c in zip(tables.object_names, tables.object_fixed, tables.object_categories, strict=True)
        if f and c not in ("walls", "floors", "ceilings")
    ]
    pairs = [(loose[i % len(loose)], fixed[(3 * i) % len(fixed)]) for i in range(7)]
    words = ["on_top", "inside", "next_to", "under", "on_top", "inside", "touching"]
    atoms = [f"({w} {a} {b})" for w, (a, b) in zip(words, pairs, strict=True)]
    atoms.append(f"(in_contact_with {loose[0]} {loose[-1]})")
    able = model.parameters
    for word, has in (("frozen", np.isfinite(able.freeze_temperature)), ("burnt", np.isfinite(able.burn_temperature))):
        atoms += [f"(not ({word} {tables.object_names[int(i)]}))" for i in np.flatnonzero(has)[:1]]
    return "(and " + " ".join(atoms) + ")"


class Case:
    """One scene, made ready: profile, pool, goal."""

    def __init__(self, home: str, hand: bool, pool_rows: int, profile: EngineProfile | None):
        start = time.time()
        self.reach = find_reach(ig2mj.load_scene(home))
        self.reach_seconds = time.time() - start
        add = functools.partial(add_floating_hand if hand else add_eye, pos=tuple(self.reach.start))
        self.eye = "hand/eye" if hand else "eye/eye"
        self.scene = ig2mj.load_scene(home, [add])
        self.model = StateModel.of_manifest(self.scene.tables, self.scene.manifest)
        start = time.time()
        self.pool: Pool = make_pool(self.scene, self.model, pool_rows, share=0.2)
        self.pool_seconds = time.time() - start
        start = time.time()
        if profile is None and (self.scene.folder / PROFILE_FILE).exists():
            profile = load_profile(self.scene.folder, self.scene.model)
        self.profile = profile or calibrate(self.scene, self.reach if hand else None, rounds=4)
        self.calibration_seconds = time.time() - start
        self.goal = compile_expression(self.model, ten_literals(self.model))


def run(case: Case, num_worlds: int, disturbed: bool, what: str, calls: int = 4, **solver: int) -> dict:
    """Times one batch. The first call compiles and is not counted."""
    scene, model = case.scene, case.model
    engine = WarpEngine(
        scene, num_worlds, profile=case.profile, initial=jax.tree.map(lambda a: a[0], case.pool.physics), **solver
    )
    worlds = Worlds(engine, model, case.pool, case.goal)
    seconds = engine.substeps * engine.timestep

    watch = Watch(engine)

    def control(batch, pusher, com, palm):
        if not disturbed:
            return pusher
        return push(case.reach, pusher, com, palm, batch.world.key, batch.world.step, seconds)

    camera = BatchCamera(engine, model, [case.eye], width=128, height=128, depth=True) if what == "camera" else None

    def full(carry, _):
        batch, pusher, com, palm = carry
        pusher = control(batch, pusher, com, palm)
        batch, verdict = worlds.step(batch, pusher.ctrl)
        seen = verdict.fraction.mean()
        view, physics = batch.world.view, batch.world.physics
        if camera is not None:
            images = camera(physics, view, batch.world.states)
            seen += images.rgb.astype(jnp.float32).mean() + images.depth.mean()
        return (batch, pusher, view.object_com, view.agent_pos[:, 0]), (seen, watch.step(physics))

    def physics(carry, _):
        """Of the view only what the hand needs, unless the whole of it is asked for."""
        batch, pusher, com, palm = carry
        pusher = control(batch, pusher, com, palm)
        state, view = engine.step(batch.world.physics, pusher.ctrl)
        world = batch.world.replace(physics=state, step=batch.world.step + 1)
        if what == "view":
            world = world.replace(view=view)
        seen = view.object_com[:, 0, 2].mean()
        return (batch.replace(world=world), pusher, view.object_com, view.agent_pos[:, 0]), (seen, watch.step(state))

    body = physics if what in ("physics", "view") else full
    call = jax.jit(lambda carry: jax.lax.scan(body, carry, None, STEPS), donate_argnums=0)
    start = time.time()
    batch = jax.block_until_ready(jax.jit(worlds.start)(0))
    before = np.asarray(batch.world.view.object_com)
    pusher = start_pushing(case.reach, num_worlds, scene.model.nu)
    # Copies: what is donated must not be in the batch as well.
    carry = (batch, pusher, batch.world.view.object_com + 0.0, batch.world.view.agent_pos[:, 0] + 0.0)
    carry, _ = jax.block_until_ready(call(carry))
    compile_seconds = time.time() - start
    times, activity = [], []
    for _ in range(calls):
        start = time.time()
        carry, (seen, acts) = jax.block_until_ready(call(carry))
        times.append(time.time() - start)
        activity.append(acts)
    batch = carry[0]
    overflow = np.asarray(batch.world.physics.overflow)
    memory = (jax.devices()[0].memory_stats() or {}).get("peak_bytes_in_use", 0)
    did = summary(join(activity), HAND_DOFS if disturbed else 0)
    row = {
        "scene": scene.name,
        "objects": scene.tables.num_objects,
        "worlds": num_worlds,
        "case": "disturbed" if disturbed else "idle",
        "what": what,
        **solver,
        "control_steps_per_s": round(num_worlds * STEPS / float(np.median(times))),
        "ms_per_control_step": round(1e3 * float(np.median(times)) / STEPS, 3),
        "compile_s": round(compile_seconds, 1),
        "simulated_s": round((calls + 1) * STEPS * seconds, 2),
        **did,
        "moved_objects_per_world": round(watch.moved(before, carry[2]), 2),
        "capacity_overflows": int(((overflow & int(CAPACITY)) != 0).sum()),
        "overflow_bits": _bits(overflow),
        "iteration_limits": int(((overflow & int(Overflow.ITERATIONS | Overflow.LS_ITERATIONS)) != 0).sum()),
        "non_finite": int((~np.asarray(engine.health(batch.world.physics).finite)).sum()),
        "peak_device_MB_per_world": round(memory / num_worlds / 1e6, 3),
        "mean_seen": float(np.asarray(seen).mean()),
        "troubles": worlds.metrics(batch) if what in ("full", "camera") else {},
    }
    row["counts"] = (
        row["capacity_overflows"] == 0
        and row["non_finite"] == 0
        and (not disturbed or row["hand_contact_share"] >= LEAST)
    )
    print(json.dumps(row), flush=True)
    return row


def _bits(overflow: np.ndarray) -> dict[str, int]:
    """Worlds by flag of capacity."""
    counts = {f.name: int(((overflow & int(f)) != 0).sum()) for f in Overflow if f & CAPACITY and f.name}
    return {name: count for name, count in counts.items() if count}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("homes", nargs="+")
    parser.add_argument("--worlds", type=int, nargs="+", default=[4096])
    parser.add_argument("--idle", action="store_true", help="no hand, nothing moves")
    parser.add_argument(
        "--what",
        nargs="+",
        default=["full"],
        choices=["physics", "view", "full", "camera"],
        help="full: with states, guards and goal; the others for comparison",
    )
    parser.add_argument("--iterations", type=int, nargs="+", default=[0], help="solver limits to try; 0: the engine's")
    parser.add_argument("--pool", type=int, default=16)
    parser.add_argument("--out", type=pathlib.Path)
    args = parser.parse_args()
    device = jax.devices()[0]
    rows = []
    for home in args.homes:
        case = Case(home, not args.idle, args.pool, None)
        model = case.scene.model
        print(
            json.dumps(
                {
                    "scene": case.scene.name,
                    "objects": case.scene.tables.num_objects,
                    "nv": int(model.nv),
                    "ngeom": int(model.ngeom),
                    "nbody": int(model.nbody),
                    "profile": str(case.profile),
                    "reachable": len(case.reach.objects),
                    "reach_s": round(case.reach_seconds, 1),
                    "pool_s": round(case.pool_seconds, 1),
                    "calibration_s": round(case.calibration_seconds, 1),
                }
            ),
            flush=True,
        )
        for worlds in args.worlds:
            for what in args.what:
                for limit in args.iterations:
                    solver = {"iterations": limit, "ls_iterations": limit} if limit else {}
                    rows.append(run(case, worlds, not args.idle, what, **solver))
    if args.out:
        args.out.mkdir(parents=True, exist_ok=True)
        report = {"device": str(device.device_kind), "jax": jax.__version__, "rows": rows}
        (args.out / "throughput.json").write_text(json.dumps(report, indent=1))


if __name__ == "__main__":
    main()
