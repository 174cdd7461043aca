"""What questions cost: the first of each predicate, every further pair, `ig2mj predicates`, and goals of 60 literals.

    python benchmarks/questions.py [--homes small_home spruce] [--goals spruce birch] [--out benchmarks/results]

Each figure comes from a process of its own, with empty caches unless the row says "warm". The figures are processor
seconds (all threads of the process together), which other work on the machine hardly changes; where a person waits,
the wall's seconds stand beside them.

- first question: `Simulation.predicate`, once for each predicate, in the order in which they are registered; so later
  predicates find what earlier ones compiled.
- further pair: other random arguments of the same predicates, each asked once.
- goal: `compile_expression` and one jitted status of all worlds, compiled; then its fastest call. "native": as one
  world beside the native engine compiles it (`ig2mj.worlds.lazy.program`), with the states' other programs; no call.
"""

from __future__ import annotations

import dataclasses
import os
import pathlib
import resource
import subprocess
import sys
import tempfile
import time
from typing import Any

import msgspec
import numpy as np
import results
import tyro
from rich.table import Table

FURTHER = 40
"""Further questions of each predicate."""

SHARES = {"on_top": 10, "inside": 12, "under": 6, "next_to": 8, "in_contact_with": 6}
"""Literals of two objects in the goal; the rest are predicates of one object."""

LITERALS = 60

WORLDS = 64
"""Of the goals."""


@dataclasses.dataclass
class Args:
    """What to measure."""

    homes: tuple[str, ...] = ("small_home", "spruce")
    """Homes that are asked one question after the other."""
    goals: tuple[str, ...] = ("birch", "spruce")
    """Homes with a goal of 60 literals."""
    part: str | None = None
    """For the processes that this one starts."""
    out: pathlib.Path = results.RESULTS
    """Where to write."""


def clock() -> tuple[float, float]:
    """Wall and processor seconds so far."""
    return time.perf_counter(), time.process_time()


def since(start: tuple[float, float]) -> tuple[float, float]:
    """Wall and processor seconds since `start`."""
    now = clock()
    return now[0] - start[0], now[1] - start[1]


def questions(home: str) -> list[dict[str, Any]]:
    """First and further questions of every predicate."""
    from ig2mj import Simulation
    from ig2mj.predicates import PREDICATES

    world = Simulation(home)
    world.step(count=5)
    rng = np.random.default_rng(0)
    names, rooms = world.scene.tables.object_names, world.scene.tables.room_names
    having = {p.name: world.state_model.parameters.has(p.ability) for p in PREDICATES.values() if p.ability}

    def arguments(name: str) -> list[str]:
        """Random ones; the first object has the ability, where one in the home does."""
        able = np.flatnonzero(having.get(name, np.ones(len(names), bool)))
        chosen = [names[rng.choice(able)]] if len(able) else []
        for role in PREDICATES[name].arguments[1:]:
            chosen.append(str(rng.choice(rooms if role == "room" else [n for n in names if n not in chosen])))
        return chosen

    rows = []
    for name in PREDICATES:
        chosen = [arguments(name) for _ in range(FURTHER + 1)]
        if not all(chosen):
            continue
        start = clock()
        world.predicate(name, *chosen[0])
        wall, cpu = since(start)
        further = []
        for one in chosen[1:]:
            start = clock()
            world.predicate(name, *one)
            further.append(since(start)[1])
        rows.append(
            {
                "home": home,
                "predicate": name,
                "first_cpu_s": cpu,
                "first_wall_s": wall,
                "further_cpu_ms_median": 1e3 * float(np.median(further)),
                "further_cpu_ms_most": 1e3 * max(further),
            }
        )
    return rows


def random_goal(model: Any) -> str:
    """60 literals of random objects of a home; every container is a real one."""
    rng = np.random.default_rng(1)
    tables = model.tables
    names = np.array(tables.object_names)
    pieces = np.bincount(tables.piece_object[tables.piece_object >= 0], minlength=len(names))
    loose = np.flatnonzero(~tables.object_fixed & ~tables.object_parked)
    furniture = np.flatnonzero(tables.object_fixed & (pieces >= 4) & ~tables.object_is_floor)
    literals = []
    for name, count in SHARES.items():
        for _ in range(count):
            a = rng.choice(loose)
            b = rng.choice(furniture if rng.random() < 0.7 else loose[loose != a])
            literals.append(f"({name} {names[a]} {names[b]})")
    of_one = ["cooked", "frozen", "soaked", "dusty", "stained", "toggled_on", "open", "burnt"]
    ability = ["cookable", "freezable", "soakable", "dustyable", "stainable", "toggleable", "openable", "burnable"]
    while len(literals) < LITERALS:
        k = rng.integers(len(of_one))
        able = np.flatnonzero(model.parameters.has(ability[k]))
        if len(able):
            literals.append(f"({of_one[k]} {names[rng.choice(able)]})")
    return "(and " + " ".join(literals) + ")"


def goal(home: str) -> list[dict[str, Any]]:
    """A goal of 60 literals compiled for many worlds, and its step."""
    import jax
    import jax.numpy as jnp

    from ig2mj import Simulation
    from ig2mj.predicates import compile_expression
    from ig2mj.worlds.lazy.stepper import StateStepper
    from ig2mj.worlds.rules import Rules

    world = Simulation(home)
    world.step(count=5)
    states, view = world.states, world.view
    text = random_goal(world.state_model)
    start = clock()
    rules = Rules(world.state_model, compile_expression(world.state_model, text))
    literals = len(rules.goal.atoms) if rules.goal is not None else 0
    StateStepper.of(rules, 1).step(states, view)
    wall, cpu = since(start)
    rows: list[dict[str, Any]] = [
        {"home": home, "worlds": "native", "literals": literals, "compile_cpu_s": cpu, "compile_wall_s": wall}
    ]
    for worlds in (1, WORLDS):
        many_states, many_view = jax.tree.map(lambda leaf: jnp.repeat(jnp.asarray(leaf), worlds, 0), (states, view))  # noqa: B023
        start = clock()
        made = compile_expression(world.state_model, text)
        compiled = jax.jit(lambda s, v: made.status(s, v)).lower(many_states, many_view).compile()  # noqa: B023
        wall, cpu = since(start)
        spent = []
        for _ in range(30):
            start = clock()
            jax.block_until_ready(compiled(many_states, many_view))
            spent.append(since(start)[1])
        memory = compiled.memory_analysis()
        assert memory is not None
        rows.append(
            {
                "home": home,
                "worlds": str(worlds),
                "literals": len(made.atoms),
                "compile_cpu_s": cpu,
                "compile_wall_s": wall,
                "step_cpu_us_per_world": 1e6 * min(spent) / worlds,
                "code_mib": memory.generated_code_size_in_bytes / 2**20,
                "temporary_kib_per_world": memory.temp_size_in_bytes / 2**10 / worlds,
            }
        )
    return rows


def command_line(caches: str) -> list[dict[str, Any]]:
    """`ig2mj predicates small_home`, with empty caches and again."""
    rows = []
    for cache in ("empty", "warm", "warm"):
        before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
        subprocess.run(
            [sys.executable, "-m", "ig2mj", "predicates", "small_home"],
            env={**os.environ, "IG2MJ_CACHE_DIR": caches},
            stdout=subprocess.DEVNULL,
            check=True,
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        rows.append({"cache": cache, "cpu_s": cpu, "wall_s": time.perf_counter() - start})
    return rows


PARTS = {"questions": questions, "goal": goal, "command": command_line}


def in_a_process(part: str, of: str) -> list[dict[str, Any]]:
    """Rows of one part, measured in a process of its own with empty caches."""
    with tempfile.TemporaryDirectory() as caches:
        if part == "command":
            return command_line(caches)
        made = subprocess.run(
            [sys.executable, __file__, "--part", f"{part}:{of}"],
            env={**os.environ, "IG2MJ_CACHE_DIR": caches},
            stdout=subprocess.PIPE,
            check=True,
        )
    return msgspec.json.decode(made.stdout.splitlines()[-1])


def table(title: str, rows: list[dict[str, Any]]) -> Table:
    """Rows as a table to read."""
    made = Table(title=title)
    columns = list(dict.fromkeys(key for row in rows for key in row))
    for key in columns:
        made.add_column(key.replace("_", " "), justify="left" if isinstance(rows[0].get(key), str) else "right")
    for row in rows:
        values = (row.get(key, "") for key in columns)
        made.add_row(*(f"{v:.3g}" if isinstance(v, float) else str(v) for v in values))
    return made


def main(args: Args) -> None:
    if args.part:
        part, of = args.part.split(":")
        print(msgspec.json.encode(PARTS[part](of)).decode())
        return
    tables, rows = [], []
    for part, names, title in (
        ("questions", args.homes, "Questions one after the other: processor time"),
        ("goal", args.goals, f"Goals of {LITERALS} literals"),
        ("command", ("small_home",), "ig2mj predicates small_home"),
    ):
        found = [row for name in names for row in in_a_process(part, name)]
        if found:
            tables.append(table(title, found))
            rows += [{"part": part, **row} for row in found]
    results.save("questions", -1, {"further": FURTHER, "worlds": WORLDS}, rows, tables, args.out)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
