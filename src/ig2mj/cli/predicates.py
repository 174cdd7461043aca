"""`ig2mj predicates SCENE [EXPRESSION]`: predicates that are true in a scene, or why an expression is false."""

from __future__ import annotations

import pathlib
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from ig2mj.cli.common.objects import AddedObjects

if TYPE_CHECKING:
    from ig2mj.predicates.logic import Atom
    from ig2mj.simulation import Simulation


def run(
    scene: Annotated[pathlib.Path, tyro.conf.Positional, tyro.conf.arg(metavar="SCENE")],
    expression: Annotated[str | None, tyro.conf.Positional, tyro.conf.arg(metavar="[EXPRESSION]")] = None,
    set: Annotated[tuple[str, ...], tyro.conf.arg(metavar="STATE=OBJECT[=VALUE] ...")] = (),
    seconds: Annotated[float, tyro.conf.arg(metavar="S")] = 0.0,
    compat: Literal["paper", "igibson"] = "paper",
    strict: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
    object: AddedObjects = (),
    json: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False,
) -> int:
    """Show which predicates are true in a scene, or whether an expression holds and why not.

    Without EXPRESSION: every unary predicate, and on_top, inside and on_floor of objects that touch or contain each
    other. With one, the exit status is 0 if it holds and 1 if it does not. Example: '(and (cooked fish_0)
    (on_top plate_0 breakfast_table_0))'.

    Args:
      scene: folder of a converted scene, its scene.xml, or the name of a home that comes with ig2mj.
      expression: predicates joined by and, or, not, imply, forall, exists, forn, forpairs, fornpairs.
      set: set states first, e.g. toggled_on=stove_0 or temperature=fish_0=80.
      seconds: simulate this many seconds first.
      compat: follow the paper, or iGibson's code where the two differ.
      strict: report an error, instead of false, for an object that lacks the predicate's ability.
      object: {object}.
      json: print JSON instead of text.
    """
    from ig2mj.cli.common.worlds import started
    from ig2mj.predicates import parse

    parsed = None if expression is None else parse(expression, "EXPRESSION")
    world = started(scene, compat, seconds, set, lambda world: parsed is None or world.compiled(parsed, strict), object)
    if parsed is None:
        _print_holding(world, json)
        return 0
    goal = world.compiled(parsed, strict)
    now = world.world
    true, share = bool(goal(now)[0]), float(goal.fraction(now)[0])
    if json:
        _print_json(world, {"holds": true, "fraction": share, "explanation": goal.explain(now)})
    else:
        print(goal.explain(now))
        if not true:
            print(f"Fulfilled: {share:.0%}")
    return 0 if true else 1


def _print_holding(world: Simulation, json: bool) -> None:
    holding = _holding(world)
    if json:
        _print_json(world, {"holding": [[a.predicate, *a.arguments] for a in holding]})
        return
    from ig2mj.cli.common.printing import make_table, stdout_console
    from ig2mj.predicates import PREDICATES

    console = stdout_console()
    found: dict[str, list[str]] = {}
    for a in holding:
        found.setdefault(a.predicate, []).append(", ".join(a.arguments))
    rows = [[name, "; ".join(texts)] for name, texts in found.items()]
    console.print(make_table(f"{world.scene.name}, {world.time:.2f} s: what holds", ["predicate", "of"], rows))
    known = [[p.name, ", ".join(p.arguments), p.ability or "any object"] for p in PREDICATES.values()]
    console.print()
    console.print(make_table("all predicates", ["name", "arguments", "for"], known, console.width))


def _print_json(world: Simulation, found: dict) -> None:
    from ig2mj.cli.common.printing import print_json

    print_json({"name": world.scene.name, "time": round(world.time, 6), **found})


def _holding(world: Simulation) -> list[Atom]:
    """Atoms that are true, among the candidates."""
    import numpy as np

    from ig2mj.predicates import And, atom

    asked = _candidates(world)
    if not asked:
        return []
    values = world.compiled(And(tuple(asked)), False).literals_of(world.world)
    return [atom(a.predicate, *a.arguments) for a, true in zip(asked, np.asarray(values)[0], strict=True) if true]


def _candidates(world: Simulation) -> list[Atom]:
    """Predicates of one object that has the ability; of two that touch, or one of which is in the other's box."""
    import numpy as np

    from ig2mj.geometry.boxes import point_in_box
    from ig2mj.predicates import PREDICATES, atom
    from ig2mj.predicates.registry import OF_SUBSTANCES
    from ig2mj.scene.manifest import BUILDING

    tables, view, names = world.scene.tables, world.view, world.scene.object_names
    asked = []
    for p in PREDICATES.values():
        if p.arguments == ("object",) and (p.ability or (len(tables.agent_names) and p.name not in OF_SUBSTANCES)):
            having = world.state_model.parameters.has(p.ability) if p.ability else ~tables.object_parked
            asked += [atom(p.name, names[o]) for o in np.flatnonzero(having & (tables.object_part_of < 0))]
    touching = np.asarray(view.touching)[0]
    asked += [atom("on_top", names[a], names[b]) for a, b in np.argwhere(touching) if not tables.object_fixed[a]]
    com = np.asarray(view.object_com)[0][:, None]
    within = np.asarray(point_in_box(com, np.asarray(view.aabb_low)[0], np.asarray(view.aabb_high)[0]))
    pairs = np.argwhere(within & ~np.eye(len(names), dtype=bool))
    building = np.isin(tables.object_categories, sorted(BUILDING))  # everything is inside the walls
    loose = ~tables.object_fixed
    asked += [atom("inside", names[a], names[b]) for a, b in pairs if loose[a] and not building[b]]
    near_floor = np.any(touching[:, tables.object_is_floor], axis=1) | (tables.object_fixed & ~building)
    on_floor = np.flatnonzero(near_floor & ~tables.object_is_floor)
    if tables.room_map.size:
        asked += [atom("on_floor", names[o], room) for o in on_floor for room in tables.room_names]
    return asked
