"""How fast the native engine steps a settled home, with and without the view.

    python -m benchmarks.speed.native_step [--objects 60] [--scene FOLDER] [--seconds 3] [--json FILE]

Six cases: everything asleep; a hand, or the humanoid, that stands still (always awake); a hand, or the humanoid's right
one, that pushes objects about, back to the start every three seconds; a batch of worlds on threads. "physics" is MuJoCo
alone, taking the same four physics steps; "engine" adds touching, forces, boxes and poses; "awake" is the mean
number of objects awake.
"""

from __future__ import annotations

import dataclasses
import pathlib
import platform
import tempfile
import time
from collections.abc import Callable, Sequence

import msgspec
import mujoco
import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

import ig2mj
from benchmarks.harness.made_home import write_home
from ig2mj.agents.floating_hand import FloatingHand, hand_ctrl
from ig2mj.agents.humanoid import Humanoid
from ig2mj.engine.native.engine import NativeEngine, NativePhysics
from ig2mj.errors import EngineError

EPISODE_STEPS = 90
"""Control steps until the pushing hand starts again: later there is little left to push."""

SETTLE_STEPS = 150
"""Control steps (5 s) given to the home to come to rest."""

Control = Callable[[int], np.ndarray]
"""Controls [nu] at each control step of an episode."""


@dataclasses.dataclass
class Args:
    """What to measure."""

    objects: int = 60
    """Number of objects of the home made for the benchmark."""
    scene: pathlib.Path | None = None
    """A converted home to measure instead."""
    worlds: int = 16
    """Number of worlds in the batched case."""
    seconds: float = 3.0
    """Time spent on each figure."""
    json: pathlib.Path | None = None
    """Where to write the figures as JSON."""


@dataclasses.dataclass
class Row:
    """One case: control steps (of four physics steps) of one world per second, and microseconds per control step."""

    case: str
    awake: float
    physics_per_s: float
    engine_per_s: float
    physics_us: float
    engine_us: float
    own_us: float
    own_share: float


def rates(actions: Sequence[Callable[[], object]], seconds: float, period: int = 1) -> list[float]:
    """Calls per second of each action, taken in turn: the shortest time of each step of a period.

    Other work on the machine only ever makes a step longer. Actions begin at the start of a period.
    """
    calls = 8 if period == 1 else 1  # where all steps are alike, the clock is read once for eight
    best = np.full((len(actions), period), np.inf)
    end = time.perf_counter() + seconds * len(actions)
    while time.perf_counter() < end:
        for k, action in enumerate(actions):
            for step in range(period):
                start = time.perf_counter()
                for _ in range(calls):
                    action()
                best[k, step] = min(best[k, step], (time.perf_counter() - start) / calls)
    return [1 / float(np.mean(steps)) for steps in best]


def row(case: str, awake: float, physics: float, engine: float) -> Row:
    physics_us, engine_us = 1e6 / physics, 1e6 / engine
    own = engine_us - physics_us
    return Row(case, awake, physics, engine, physics_us, engine_us, own, own / engine_us)


def settled(scene: ig2mj.Scene, worlds: int = 1) -> tuple[NativeEngine, NativePhysics]:
    """An engine and its worlds at rest."""
    engine = NativeEngine(scene, worlds)
    physics = engine.reset()
    for _ in range(SETTLE_STEPS):
        physics, view = engine.step(physics)
    if view.awake.any():
        names = [scene.object_names[o] for o in np.flatnonzero(view.awake[0])]
        print(f"not at rest after {SETTLE_STEPS} control steps: {', '.join(names)}")
    return engine, physics


def bare_physics(engine: NativeEngine, physics: NativePhysics, ctrl: Control | None) -> Callable[[], None]:
    """MuJoCo's part of a control step alone, on a copy of world 0."""
    model, data = engine.to_mujoco(physics, 0)
    start, own = mujoco.MjData(model), mujoco.MjData(model)
    mujoco.mj_copyData(start, model, data)
    mujoco.mj_copyData(own, model, data)
    count = 0

    def step() -> None:
        nonlocal count
        if ctrl is not None:
            if count % EPISODE_STEPS == 0:
                mujoco.mj_copyData(own, model, start)
            own.ctrl[:] = ctrl(count % EPISODE_STEPS)
            count += 1
        mujoco.mj_step2(model, own)
        mujoco.mj_step(model, own, nstep=3)
        mujoco.mj_step1(model, own)

    return step


def full_engine(
    engine: NativeEngine, physics: NativePhysics, ctrl: Control | None, awake: list[int]
) -> Callable[[], None]:
    """The engine's whole control step; notes the number of objects awake at every sixteenth."""
    start = engine.export(physics, 0)
    count = 0

    def step() -> None:
        nonlocal count, physics
        if ctrl is not None and count % EPISODE_STEPS == 0:
            physics = engine.load(physics, start)
        physics, view = engine.step(physics, None if ctrl is None else ctrl(count % EPISODE_STEPS)[None])
        if count % 16 == 0:
            awake.append(int(view.awake.sum()))
        count += 1

    return step


def sweep(step: int) -> np.ndarray:
    """A hand that comes down and sweeps to and fro over the top of the first piece of furniture."""
    return hand_ctrl((0.45 * np.sin(step / 25), 0.2 * np.sin(step / 9), -min(0.16, 0.01 * step)))


RIGHT_HAND = 22
"""Place of the right hand's position (x, y, z, world frame) among the humanoid's controls."""


def held(scene: ig2mj.Scene) -> np.ndarray:
    """Controls with which the humanoid stays where it starts."""
    return np.array(scene.model.key_ctrl[0])


def swept(scene: ig2mj.Scene, step: int) -> np.ndarray:
    """The same, with the right hand on `sweep`'s way."""
    ctrl = held(scene)
    ctrl[RIGHT_HAND : RIGHT_HAND + 3] = np.array([0.0, 0.0, 1.02]) + sweep(step)[:3]
    return ctrl


def main(args: Args) -> None:
    console = Console(width=100)
    with tempfile.TemporaryDirectory() as temporary:
        folder = args.scene or write_home(pathlib.Path(temporary) / "home", args.objects)
        plain = ig2mj.load_scene(folder)
        high = ig2mj.load_scene(folder, agents=[FloatingHand(pos=(0, 0, 5))])
        low = ig2mj.load_scene(folder, agents=[FloatingHand(pos=(0, 0, 1.1))])
        far = ig2mj.load_scene(folder, agents=[Humanoid(pos=(0.0, 0.0, 5.0))])
        near = ig2mj.load_scene(folder, agents=[Humanoid(pos=(0.0, 0.75, 0.7))])
    rows = []
    for case, scene, ctrl in (
        ("asleep", plain, None),
        ("hand hovers", high, lambda _: np.zeros(high.model.nu)),
        ("hand pushes", low, sweep),
        ("humanoid stands", far, lambda _: held(far)),
        ("humanoid pushes", near, lambda step: swept(near, step)),
    ):
        engine, physics = settled(scene)
        awake: list[int] = []
        with console.status(f"measuring: {case}"):
            actions = [bare_physics(engine, physics, ctrl), full_engine(engine, physics, ctrl, awake)]
            bare, whole = rates(actions, args.seconds, EPISODE_STEPS if "pushes" in case else 1)
        rows.append(row(case, float(np.mean(awake)), bare, whole))
    engine, physics = settled(plain, args.worlds)
    with console.status("measuring: batch"):
        batch = args.worlds * rates([full_engine(engine, physics, None, [])], args.seconds)[0]
    rows.append(row(f"asleep, {args.worlds} worlds, {engine.threads} threads", 0.0, rows[0].physics_per_s, batch))

    names = f"{len(plain.object_names)} objects, {plain.model.nv} dofs, {plain.model.ngeom} geoms"
    table = Table(title=f"Native engine, {plain.name}: {names}")
    table.add_column("case", no_wrap=True)
    for column in ("awake", "physics /s", "engine /s", "physics us", "engine us", "ours us", "ours"):
        table.add_column(column, justify="right")
    for r in rows:
        table.add_row(
            r.case,
            f"{r.awake:.1f}",
            f"{r.physics_per_s:,.0f}",
            f"{r.engine_per_s:,.0f}",
            f"{r.physics_us:.1f}",
            f"{r.engine_us:.1f}",
            f"{r.own_us:.1f}",
            f"{r.own_share:.0%}",
        )
    console.print(table)
    console.print("A control step is four physics steps of 1/120 s. The batch row divides by the number of worlds.")
    if args.json:
        result = {
            "scene": plain.name,
            "objects": len(plain.object_names),
            "dofs": plain.model.nv,
            "mujoco": mujoco.mj_versionString(),
            "python": platform.python_version(),
            "processor": platform.processor() or platform.machine(),
            "rows": [dataclasses.asdict(r) for r in rows],
        }
        args.json.parent.mkdir(parents=True, exist_ok=True)
        args.json.write_bytes(msgspec.json.format(msgspec.json.encode(result), indent=1) + b"\n")


if __name__ == "__main__":
    try:
        main(tyro.cli(Args, description=__doc__))
    except EngineError as e:
        raise SystemExit(str(e)) from None
