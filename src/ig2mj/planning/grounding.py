"""Ground primitives of a problem: all that a robot can be asked to do with the objects that the problem names."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from ig2mj.planning.domain import Domain
from ig2mj.planning.problem import Problem
from ig2mj.planning.steps import PRIMITIVES, SUBSTANCE, Step, make_step
from ig2mj.tasks.task import GROUND


def named_things(domain: Domain, problem: Problem) -> list[str]:
    """Objects that the problem names, and tools, knives, taps, sources of heat and cold, containers of substances."""
    rooms = domain.model.tables.room_names
    names = [n for n in problem.named if n not in rooms and _category(domain, n) not in GROUND]
    sources = [s.name for s in domain.sources]
    return list(
        dict.fromkeys(
            [*names, *domain.tools, *domain.knives, *domain.taps, *sources, *domain.pourable, *domain.stirrers]
        )
    )


def ground_steps(domain: Domain, problem: Problem) -> Iterator[Step]:
    """The primitives, each with the objects that it can be about."""
    things, tables = named_things(domain, problem), domain.model.tables
    loose = [n for n in things if not domain.fixed(n)]
    rooms = [n for n in tables.room_names if n in problem.named] or list(tables.room_names)
    shell = (*GROUND, "door", "window")  # parts of the house rather than things in it
    opens = [n for n in domain.openable if n in things or _category(domain, n) not in shell]
    able = {
        "navigate_to": things,
        "grasp": loose,
        "release": loose,
        "open": opens,
        "close": opens,
        "toggle_on": [n for n in things if domain.has(n, "toggleable")],
        "toggle_off": [n for n in things if domain.has(n, "toggleable")],
        "wipe": [n for n in things if domain.has(n, "dustyable")],
        "scrub": [n for n in things if domain.has(n, "stainable")],
        "soak": [n for n in loose if domain.has(n, "soakable")],
        "fill": [n for n in loose if n in domain.fillable],
        "attach": [n for n in loose if domain.attachable(n)],
        "pour": list(domain.pourable),
        "mix": [n for n in things if domain.contains(n)],
        "spray": [n for n in problem.named if n in things and n not in domain.sprays],
        "slice": [n for n in things if domain.has(n, "sliceable")],
        "cook": [n for n in loose if domain.has(n, "cookable")],
        "freeze": [n for n in loose if domain.has(n, "freezable")],
    }
    second = {
        "place_on_floor": rooms,
        "wipe": domain.tools,
        "scrub": [t for t in domain.tools if domain.has(t, "soakable")],
        "soak": domain.taps,
        "fill": domain.taps,
        "slice": domain.knives,
        "pour": [n for n in problem.named if n in things],
        "spray": domain.sprays,
        "mix": domain.stirrers,
    }
    substances = substances_to_move(domain, problem)
    for primitive, kind in PRIMITIVES.items():
        first = able.get(primitive, loose)
        if len(kind.arguments) == 1:
            yield from (make_step(primitive, (n,)) for n in first)
            continue
        for name in first:
            others = second.get(primitive, things)
            if primitive in ("cook", "freeze"):
                others = [s.name for s in (domain.heaters if primitive == "cook" else domain.coolers)(name)]
            if primitive == "attach":
                others = domain.attachable(name)
            moved = [s for s in substances if primitive != "mix" or domain.recipes(s)]
            last = [(s,) for s in moved] if SUBSTANCE in kind.arguments else [()]
            pairs = itertools.product(others, last)
            yield from (make_step(primitive, (name, other, *more)) for other, more in pairs if other != name)


def substances_to_move(domain: Domain, problem: Problem) -> list[str]:
    """Those that the goal names, or if it names none, all in use, as far as containers hold them."""
    found = domain.model.substances
    if found is None:
        return []
    able = [s for s, has in zip(found.names, found.has_volume, strict=True) if has]
    named = {a for atom in problem.goal.atoms for a in atom.arguments}
    return [s for s in able if s in named] or able


def _category(domain: Domain, name: str) -> str:
    return domain.model.tables.object_categories[domain.index(name)]
