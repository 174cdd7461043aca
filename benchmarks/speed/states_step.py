"""What extended states and a goal of ten literals cost, without physics.

    python -m benchmarks.speed.states_step [--objects 60] [--worlds 64 512] [--json FILE]

One world without the native engine (microseconds per control step, on one core): everything asleep; one object that
moves, which the goal is about or not; without a goal; physics without states. Many worlds (microseconds per world
and step of the one jitted function that also runs on a GPU).
"""

from __future__ import annotations

import dataclasses
import pathlib
import platform
import tempfile
import time
from collections.abc import Callable

import jax
import jax.numpy as jnp
import msgspec
import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

import ig2mj
from benchmarks.harness.stateful_home import GOAL, write_stateful_home
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.view import PhysicsView
from ig2mj.predicates import compile_expression
from ig2mj.process import run_programs_inline
from ig2mj.states import StateModel, initial_states
from ig2mj.worlds.incremental import IncrementalRules
from ig2mj.worlds.rules import Rules

SETTLE_STEPS = 200
"""Control steps given to the home to come to rest."""

PLACES = 16
"""Places between which the object that moves goes about."""

TURN = 0.05
"""Seconds of one turn of a measurement; the best of many turns counts, for other work only ever slows one."""


@dataclasses.dataclass
class Args:
    """What to measure."""

    objects: int = 60
    """Number of objects of the home made for the benchmark."""
    worlds: tuple[int, ...] = (64, 512)
    """Numbers of worlds of the batched cases."""
    seconds: float = 3.0
    """Time spent on each figure."""
    json: pathlib.Path | None = None
    """Where to write the figures as JSON."""


@dataclasses.dataclass
class Row:
    """One figure: microseconds per control step and world."""

    case: str
    microseconds: float


def best(actions: dict[str, Callable[[], object]], seconds: float) -> list[Row]:
    """Microseconds per call of each action, in turns."""
    found = dict.fromkeys(actions, float("inf"))
    for action in actions.values():
        action()
    for _ in range(max(3, round(seconds / TURN))):
        for name, action in actions.items():
            count, start = 0, time.perf_counter()
            while (passed := time.perf_counter() - start) < TURN:
                action()
                count += 1
            found[name] = min(found[name], 1e6 * passed / count)
    return [Row(name, value) for name, value in found.items()]


def one_world(scene: ig2mj.Scene, rules: Rules, seconds: float) -> list[Row]:
    """Beside the native engine."""
    engine = NativeEngine(scene)
    physics = engine.reset()
    for _ in range(SETTLE_STEPS):
        physics, view = engine.step(physics)
    loose = np.flatnonzero(~scene.tables.object_fixed)
    named = scene.object_index("thing_3")  # the goal asks what it is on
    assert loose[0] != named

    def pushed(obj: int) -> list[PhysicsView]:
        """Views between which one object moves on by a millimetre each, never to where it lay at first."""
        body, views = scene.tables.object_root[obj], []
        for k in range(1, PLACES + 1):
            there = jax.tree.map(np.copy, view)
            for name, row in (("object_com", obj), ("object_pos", obj), ("aabb_low", obj), ("aabb_high", obj)):
                getattr(there, name)[0, row] += 1e-3 * k
            there.body_pos[0, body] += 1e-3 * k
            views.append(there)
        return views

    moved, moved_named = pushed(int(loose[0])), pushed(named)
    still, cooling, moving, moving_named, beside = (Stepped(rules) for _ in range(5))
    aimless = Stepped(Rules(rules.model, initial=rules.initial))
    # Not a number never equals the one before: this world never settles, as one in which something cools.
    cooling.states = cooling.states.replace(temperature=cooling.states.temperature.at[0, loose[0]].set(jnp.nan))

    def with_physics() -> None:
        nonlocal physics
        physics, now = engine.step(physics)
        beside.step(now)

    def physics_alone() -> None:
        nonlocal physics
        physics, _ = engine.step(physics)

    return best(
        {
            "native engine with view, asleep": physics_alone,
            "the same with states and goal": with_physics,
            "states and goal, nothing moves": lambda: still.step(view),
            "states and goal, an object cools": lambda: cooling.step(view),
            "states and goal, one object moves": lambda: moving.step(moved[moving.count % PLACES]),
            "the same, the goal is about it": lambda: moving_named.step(moved_named[moving_named.count % PLACES]),
            "states without a goal, one object moves": lambda: aimless.step(moved[aimless.count % PLACES]),
        },
        seconds,
    )


class Stepped:
    """States that go on from step to step; every step waits for its status."""

    def __init__(self, rules: Rules):
        self.stepper, self.states, self.count = IncrementalRules(rules, 1), rules.initial, 0

    def step(self, view: PhysicsView) -> bool:
        self.states, _, status = self.stepper.step(self.states, view)
        self.count += 1
        return bool(np.asarray(status.holds)[0])


def many_worlds(scene: ig2mj.Scene, rules: Rules, worlds: int, seconds: float) -> Row:
    """The one function of a batch: relations, states, goal."""
    engine = NativeEngine(scene)
    view = jax.tree.map(lambda leaf: jnp.repeat(jnp.asarray(leaf), worlds, axis=0), engine.view(engine.reset()))
    step, states = jax.jit(rules.step), initial_states(rules.model, worlds)
    (row,) = best({f"{worlds} worlds in one function": lambda: jax.block_until_ready(step(states, view))}, seconds)
    return Row(row.case, row.microseconds / worlds)


def main(args: Args) -> None:
    run_programs_inline()
    with tempfile.TemporaryDirectory() as folder:
        scene = ig2mj.load_scene(write_stateful_home(pathlib.Path(folder) / "home", args.objects))
    model = StateModel.of_manifest(scene.tables, scene.manifest)
    rules = Rules(model, compile_expression(model, GOAL))
    rows = one_world(scene, rules, args.seconds)
    rows += [many_worlds(scene, rules, count, args.seconds) for count in args.worlds]
    table = Table(title=f"{args.objects} objects, goal of 10 literals, {jax.devices()[0].device_kind}")
    table.add_column("case")
    table.add_column("us per world and step", justify="right")
    for row in rows:
        table.add_row(row.case, f"{row.microseconds:.1f}")
    Console().print(table)
    if args.json is not None:
        machine = {
            "machine": platform.processor() or platform.machine(),
            "jax": jax.__version__,
            "objects": args.objects,
        }
        args.json.write_bytes(msgspec.json.encode({**machine, "rows": [dataclasses.asdict(r) for r in rows]}))


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
