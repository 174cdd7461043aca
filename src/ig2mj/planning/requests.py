"""Requests to primitives, drawn at random in a home, to measure how often each primitive succeeds.

A request is a primitive with objects of the right kind: what opens, what can be soaked, two objects for a placement.
Whether the robot can carry it out is not looked at: the object may be out of reach, the container too small. What must
hold before (a closed door, dust, an object in a hand) is part of the request, so that only the primitive is measured.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Sequence

import numpy as np

from ig2mj.knowledge.substances import WATER
from ig2mj.knowledge.taxonomy import is_a
from ig2mj.planning.domain import Domain
from ig2mj.planning.steps import PRIMITIVES, SUBSTANCE, Step
from ig2mj.sampling.conditions import Condition
from ig2mj.scene.extras import attached_as_text
from ig2mj.scene.substance_requests import substances_as_text

KIT = (
    "rag/rag_00", "carving_knife/carving_knife_00", "apple/apple_00", "steak/steak_00", "atomizer/atomizer_00",
    "spoon/spoon_00", "light_bulb/light_bulb_00", "table_lamp/table_lamp_00",
)  # fmt: skip
"""Of the object library, added to every home: most lack something that cleans, cuts, is cut, is cooked, sprays or
stirs, and two things of which one can be attached to the other."""


STIRRED = ("salt", "seawater")
"""Substances: what water is stirred with, and what it becomes."""


def added_to(own: Collection[str]) -> tuple[str, ...]:
    """What a home is loaded with: the objects of `KIT`, of which the last but one can be attached to the last, water
    that containers can hold, and what is stirred.

    Args:
      own: names of the home's own objects.
    """
    bulb, lamp = (_next_of(added.partition("/")[0], own) for added in KIT[-2:])
    return (*KIT, attached_as_text(bulb, lamp), *substances_as_text([WATER, *STIRRED]))


def _next_of(category: str, own: Collection[str]) -> str:
    """The name of the first object of a category that is added to a home."""
    numbers = [n.removeprefix(f"{category}_") for n in own if n.startswith(f"{category}_")]
    return f"{category}_{1 + max((int(n) for n in numbers if n.isdecimal()), default=-1)}"


MEASURED = tuple(PRIMITIVES)
"""Primitives that requests are drawn for."""

_STRUCTURE = ("walls", "floors", "ceilings", "door", "window")
_CONTAINER = "container.n.01"


@dataclasses.dataclass(frozen=True)
class Request:
    """What is asked.

    Attributes:
      step: the primitive and its arguments. before: conditions that are sampled and set first.
      taken: objects that the robot takes into its hands first.
    """

    step: Step
    before: tuple[Condition, ...] = ()
    taken: tuple[str, ...] = ()


class RequestSource:
    """Draws requests in one home with the objects of `KIT`."""

    def __init__(self, domain: Domain, kit: Sequence[str]):
        """`kit`: names of the added objects, in the order of `KIT`; they stand outside the house."""
        self._domain, self._kit = domain, tuple(kit)
        self._rag, self._knife, self._fruit, self._meat, self._spray, self._spoon, self._bulb, self._lamp = kit
        tables = domain.model.tables
        names, categories = tables.object_names, tables.object_categories
        inside = [n for n, c in zip(names, categories, strict=True) if c not in ("walls", "floors", "ceilings")]
        loose = {n for n, fixed in zip(names, tables.object_fixed, strict=True) if not fixed}
        parked = {n for n, away in zip(names, tables.object_parked, strict=True) if away}
        self._things = [n for n in inside if n not in parked and n not in kit]
        self._loose = [n for n in self._things if n in loose]
        category = dict(zip(names, categories, strict=True))
        furniture = [n for n in self._things if n not in loose and category[n] not in _STRUCTURE]
        self._furniture = furniture
        self._containers = [n for n in furniture if domain.opens(n)]
        self._containers += [n for n in self._things if is_a(category[n], _CONTAINER)]
        self._open_above = [n for n in self._things if category[n] not in _STRUCTURE]
        self._rooms = list(tables.room_names) or [n for n, c in category.items() if c == "floors"]

    def draw(self, primitive: str, rng: np.random.Generator) -> Request | None:
        """A request; None: the home has nothing that it could be asked of."""
        arguments = self._arguments(primitive, rng)
        if arguments is None or len(set(arguments)) < len(arguments):
            return None
        before, taken = self._before(primitive, arguments)
        kit = [n for n in (*arguments, *taken) if n in self._kit]
        placed = {c.arguments[0] for c in before if c.is_placement}
        for name in dict.fromkeys(kit):
            if name not in placed:
                before.insert(
                    0, Condition("on_top", (name, _one([s for s in self._domain.supports if s not in self._kit], rng)))
                )
        return Request(Step(primitive, arguments), tuple(before), taken)

    def _arguments(self, primitive: str, rng: np.random.Generator) -> tuple[str, ...] | None:
        domain = self._domain
        able = {"open": domain.openable, "close": domain.openable}
        able |= dict.fromkeys(("toggle_on", "toggle_off"), self._with("toggleable"))
        able |= {"wipe": self._with("dustyable"), "scrub": self._with("stainable")}
        able |= dict.fromkeys(("navigate_to", "spray"), self._things)
        first = {
            "soak": [n for n in self._loose if domain.has(n, "soakable")] + [self._rag],
            "fill": [n for n in self._loose if n in domain.fillable],
            "pour": [n for n in self._loose if n in domain.pourable],
            "attach": [n for n in (*self._loose, self._bulb) if domain.attachable(n)],
            "mix": [n for n in self._loose if domain.contains(n)],
            "slice": [n for n in self._loose if domain.has(n, "sliceable")] + [self._fruit],
            "cook": [n for n in self._loose if domain.has(n, "cookable")] + [self._meat],
            "freeze": [n for n in self._loose if domain.has(n, "freezable")] + [self._fruit],
            **able,
        }
        name = _one(first.get(primitive, self._loose), rng)
        second: dict[str, Sequence[str]] = {
            "place_on_top": self._furniture,
            "place_under": self._furniture,
            "place_inside": self._containers,
            "place_next_to": self._things,
            "push": self._things,
            "place_on_floor": self._rooms,
            "wipe": [self._rag],
            "scrub": [self._rag],
            "slice": [self._knife],
            "soak": domain.taps,
            "fill": domain.taps,
            "pour": self._open_above,
            "spray": domain.sprays,
            "mix": [self._spoon],
            "attach": domain.attachable(name) if name else (),
        }
        if primitive in ("cook", "freeze"):
            sources = domain.heaters(name) if primitive == "cook" else domain.coolers(name)
            second[primitive] = [s.name for s in sources]
        if primitive not in second:
            return (name,) if name else None
        other = _one(second[primitive], rng)
        substance = _one(domain.mixable, rng) if primitive == "mix" else WATER
        last = (substance,) if SUBSTANCE in PRIMITIVES[primitive].arguments else ()
        return (name, other, *last) if name and other else None

    def _with(self, ability: str) -> list[str]:
        return [n for n in self._things if self._domain.has(n, ability)]

    def _before(self, primitive: str, arguments: tuple[str, ...]) -> tuple[list[Condition], tuple[str, ...]]:
        """What must hold first, and what must be in the hands."""
        name, second = arguments[0], arguments[-1]

        def true(predicate: str, *about: str) -> Condition:
            return Condition(predicate, about)

        def false(predicate: str, *about: str) -> Condition:
            return Condition(predicate, about, False)

        if primitive in ("open", "toggle_on"):
            return [false("open" if primitive == "open" else "toggled_on", name)], ()
        if primitive in ("close", "toggle_off"):
            return [true("open" if primitive == "close" else "toggled_on", name)], ()
        if primitive == "place_inside":
            return [true("open", second)] if self._domain.opens(second) else [], (name,)
        if primitive.startswith("place_") or primitive in ("release", "attach"):
            return [], (name,)
        if primitive == "wipe":
            return [true("dusty", name)], (second,)
        if primitive == "scrub":
            return [true("stained", name), true("soaked", second)], (second,)
        if primitive == "slice":
            return [], (second,)
        if primitive in ("soak", "fill"):
            return self._running(second), (name,)
        if primitive in ("pour", "spray"):
            container = name if primitive == "pour" else arguments[1]
            return [true("filled", container, WATER)], (container,)
        if primitive == "mix":
            recipe = self._domain.recipes(second)[0]
            return [true("contains", name, part) for part in recipe.inputs], (arguments[1],)
        if primitive in ("cook", "freeze"):
            source = next(s for s in self._domain.sources if s.name == second)
            before = self._running(second) if source.needs_switch else []
            if not source.acts_inside:
                return before, (name,)
            shut = [false("open", second)] if source.needs_closed and self._domain.opens(second) else []
            return [true("inside", name, second), *before, *shut], ()
        return [], ()

    def _running(self, source: str) -> list[Condition]:
        return [Condition("toggled_on", (source,))] if self._domain.has(source, "toggleable") else []


def _one(names: Sequence[str], rng: np.random.Generator) -> str:
    return names[int(rng.integers(len(names)))] if names else ""
