"""What substances cost, and whether they are conserved.

    python -m benchmarks.speed.substances native [--seconds 3]
    python -m benchmarks.speed.substances batch [--worlds 4096] [--engine warp]
    python -m benchmarks.speed.substances pour [--worlds 10000] [--engine warp]
    python -m benchmarks.speed.substances trace --folder FOLDER [--case substances] [--worlds 4096] [--engine warp]

`native`: microseconds of the states of one control step of birch on the native engine: without substances, with 16
containers and 6 substances where nothing flows, and where a quarter of the containers overflow; while nothing moves,
while one loose object moves elsewhere, and while all objects move. `batch`: seconds of
rollouts of birch without substances, with them, and with 64 transition rules besides; a quarter of the containers of
each world overflow. `pour`: worlds in which a litre is poured from a jug into a glass of 0.3 litres; the largest
relative change of the sum over jug, glass and what was lost, and how far the engine is from the native one. `trace`:
JAX's profile of one rollout of a case of `batch`, written into a folder.
"""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
import json
import pathlib
import tempfile
import time

import jax
import jax.numpy as jnp
import numpy as np
import tyro

import ig2mj
from benchmarks.harness.pouring import write_pouring
from benchmarks.harness.results import keep_row, machine, provenance
from ig2mj.engine import make_engine
from ig2mj.engine.view import PhysicsView, replace_fields
from ig2mj.knowledge.transitions import load_transitions
from ig2mj.process import run_programs_inline
from ig2mj.scene.scene import Scene
from ig2mj.states.world import ExtendedStates
from ig2mj.worlds import Core, Rules
from ig2mj.worlds.incremental import IncrementalRules

SUBSTANCES = ("water", "olive_oil", "milk", "salt", "flour", "vinegar")
OBJECTS = ("mug", "bowl", "glass", "saucepan", "carafe", "casserole", "bucket")
"""With the nine containers of birch, 16."""

STEPS, CALLS = 30, 8
"""Control steps of a timed rollout, and rollouts; the best counts."""

POURED, GLASS = 1.0, 0.3
"""Litres in the jug, and what the glass holds."""

POUR_STEPS = 120
"""Control steps after which nothing flows any more."""


def _overflowing(rules: Rules, states: ExtendedStates) -> ExtendedStates:
    """The states with a quarter of the containers overfull with two substances."""
    assert rules.model.substances is not None
    litres = rules.model.substances.containers.litres
    volume = np.zeros(np.shape(states.volume), np.float32)
    drains = rules.model.substances.containers.drains
    few = np.flatnonzero(~drains)[:: max(1, (~drains).sum() // max(1, len(litres) // 4))][: len(litres) // 4]
    volume[:, few, 0], volume[:, few, 1] = 3.0 * litres[few], 1.0 * litres[few]
    return states.replace(volume=jnp.asarray(volume))


def _scene(substances: tuple[str, ...]) -> Scene:
    return ig2mj.load_scene("birch", objects=OBJECTS, substances=substances)


def native(seconds: float = 3.0) -> None:
    """Cost on the native engine.

    Args:
      seconds: for each figure.
    """
    run_programs_inline()
    for name, substances, flows, moves in (
        ("without", (), False, ""),
        ("without, one moves", (), False, "one"),
        ("without, all move", (), False, "all"),
        ("at rest", SUBSTANCES, False, ""),
        ("at rest, one moves", SUBSTANCES, False, "one"),
        ("at rest, all move", SUBSTANCES, False, "all"),
        ("flows", SUBSTANCES, True, ""),
        ("flows, one moves", SUBSTANCES, True, "one"),
        ("flows, all move", SUBSTANCES, True, "all"),
    ):
        scene = _scene(substances)
        engine, rules = make_engine("native", scene, 1), Rules.of_scene(scene)
        physics = engine.reset()
        views = []
        for _ in range(100):
            physics, view = engine.step(physics)
            views.append(view)
        seen = views[1:3] if moves == "all" else views[-1:]  # in the first steps objects settle
        if moves == "one":
            seen = [views[-1], _with_moved(scene, views[-1])]
        steps = IncrementalRules.of(rules, engine)
        start = _overflowing(rules, rules.initial) if flows else rules.initial
        row = {"case": name, "microseconds": round(_best_rollout(steps, start, seen, seconds), 2)}
        keep_row({**row, **provenance(), **machine(-1)}, None)


def _with_moved(scene: Scene, view: PhysicsView) -> PhysicsView:
    """The view with a loose object that holds nothing and cleans nothing a millimetre higher."""
    entries = scene.manifest.objects
    loose = [o for o, e in enumerate(entries) if not e.fixed and e.inside is None and "cleaningTool" not in e.abilities]
    own = np.zeros(len(entries), bool)
    own[loose[0]] = True
    shift = np.array([0.0, 0.0, 0.001], np.float32)
    of_objects = ("object_pos", "object_com", "aabb_low", "aabb_high")
    fields = {name: np.asarray(getattr(view, name)) + own[:, None] * shift for name in of_objects}
    fields["body_pos"] = np.asarray(view.body_pos) + (scene.tables.body_object == loose[0])[:, None] * shift
    return replace_fields(view, fields)


def _best_rollout(steps: IncrementalRules, start: ExtendedStates, views: list[PhysicsView], seconds: float) -> float:
    """Microseconds of a step after the first of a rollout: mean over steps of the best of many rollouts."""
    found, end = np.full(STEPS, np.inf), 0.0
    for rollout in itertools.count():
        if rollout == 1:  # all is compiled
            end = time.perf_counter() + seconds
        if rollout > 2 and time.perf_counter() > end:
            return 1e6 * float(found.mean())
        states = steps.step(start, views[0]).states
        for k in range(STEPS):
            begun = time.perf_counter()
            states = steps.step(states, views[(k + 1) % len(views)]).states
            found[k] = min(found[k], time.perf_counter() - begun)
    raise AssertionError


def _rules_file(folder: pathlib.Path) -> pathlib.Path:
    """64 rules among the substances that never apply, since they take 10,000 degrees."""
    pairs = [(a, b, c) for a in SUBSTANCES for b in SUBSTANCES for c in SUBSTANCES if len({a, b, c}) == 3][:64]
    rules = [
        {"name": f"rule {n}", "from": [a, b], "makes": c, "temperature": 10000} for n, (a, b, c) in enumerate(pairs)
    ]
    file = folder / "rules.json"
    file.write_text(json.dumps(rules))
    return file


def batch(worlds: int = 4096, engine: str = "warp", only: tuple[str, ...] = ()) -> None:
    """Cost in a batch.

    Args:
      only: names of cases; default: all. The percentage needs "without".
    """
    plain = 0.0
    with tempfile.TemporaryDirectory() as folder:
        for name, substances in (("without", ()), ("substances", SUBSTANCES), ("64 rules", SUBSTANCES)):
            if only and name not in only:
                continue
            if name == "64 rules":
                load_transitions(_rules_file(pathlib.Path(folder)))
            scene = _scene(substances)
            rules = Rules.of_scene(scene)
            core = Core(make_engine(engine, scene, worlds), rules)
            start = core.start(0)
            times = []
            for _ in range(CALLS):
                if substances:
                    world = dataclasses.replace(start.world, states=_overflowing(rules, start.world.states))
                    start = dataclasses.replace(start, world=world)
                begun = time.perf_counter()
                start, _ = core.rollout(start, jnp.zeros(()), _nothing, STEPS)
                jax.block_until_ready(start.world.states.temperature)
                times.append(time.perf_counter() - begun)
            plain = plain or min(times)
            row = {
                "case": name,
                "worlds": worlds,
                "engine": engine,
                "rules": 0 if rules.model.substances is None else len(rules.model.substances.rules),
                "containers": 0 if rules.model.substances is None else len(rules.model.substances.containers.object),
                "steps_per_s": round(worlds * STEPS / min(times)),
                "percent": round(100 * (min(times) / plain - 1), 2),
            }
            keep_row({**row, **provenance(), **machine(-1)}, None)


def trace(folder: pathlib.Path, case: str = "substances", worlds: int = 4096, engine: str = "warp") -> None:
    """A profile of one rollout, for TensorBoard or Perfetto.

    Args:
      case: "without", "substances" or "64 rules".
    """
    with tempfile.TemporaryDirectory() as rules_folder:
        if case == "64 rules":
            load_transitions(_rules_file(pathlib.Path(rules_folder)))
        scene = _scene(() if case == "without" else SUBSTANCES)
    rules = Rules.of_scene(scene)
    core = Core(make_engine(engine, scene, worlds), rules)
    batch = core.start(0)
    for call in range(3):
        if case != "without":
            world = dataclasses.replace(batch.world, states=_overflowing(rules, batch.world.states))
            batch = dataclasses.replace(batch, world=world)
        with jax.profiler.trace(folder) if call == 2 else contextlib.nullcontext():
            batch, _ = core.rollout(batch, jnp.zeros(()), _nothing, STEPS)
            jax.block_until_ready(batch.world.states.temperature)


def _nothing(batch, carry):
    return None, carry


def pour(worlds: int = 10000, engine: str = "warp") -> None:
    """Conservation, and agreement with the native engine."""
    with tempfile.TemporaryDirectory() as folder:
        scene = ig2mj.load_scene(write_pouring(pathlib.Path(folder) / "pouring", POURED))
    one = Core(make_engine("native", scene, 1), Rules.of_scene(scene))
    first = one.start(0)
    for _ in range(POUR_STEPS):
        first, _ = one.step(first)
    core = Core(make_engine(engine, scene, worlds), Rules.of_scene(scene))
    many, _ = core.rollout(core.start(0), jnp.zeros(()), _nothing, POUR_STEPS)
    states = many.world.states
    volume, lost = np.asarray(states.volume, float)[..., 0], np.asarray(states.lost, float)[..., 0]
    total = volume.sum(1) + lost - np.asarray(states.drawn, float)[..., 0]
    apart = np.abs(volume - np.asarray(first.world.states.volume)[..., 0]).max()
    row = {
        "worlds": worlds,
        "engine": engine,
        "glass": float(volume[:, 1].mean()),
        "lost": float(lost.mean()),
        "largest_relative_change": float(np.abs(total / POURED - 1).max()),
        "litres_from_native": float(apart),
    }
    row["passes"] = row["largest_relative_change"] < 1e-5 and row["litres_from_native"] < 1e-3
    keep_row({**row, **provenance(), **machine(-1)}, None)


if __name__ == "__main__":
    tyro.extras.subcommand_cli_from_dict({"native": native, "batch": batch, "pour": pour, "trace": trace})
