"""`Domain`: constants of a scene for task planners: which objects open, clean, wet, cut, heat, cool and support."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Iterable

import numpy as np

from ig2mj.agents.task_robot import TaskRobot
from ig2mj.knowledge.substances import DUST, WATER
from ig2mj.knowledge.transitions import STIRRERS, Transition
from ig2mj.planning.steps import PRIMITIVES, Step
from ig2mj.planning.tool_areas import is_hidden
from ig2mj.predicates.literals import object_index
from ig2mj.predicates.logic import Atom
from ig2mj.predicates.registry import find
from ig2mj.predicates.substances import substance_index
from ig2mj.sampling.conditions import Condition
from ig2mj.sampling.rules import PLACEMENTS
from ig2mj.scene.extras import attached_as_text
from ig2mj.states.model import StateModel
from ig2mj.states.substances.applying import sprays
from ig2mj.states.substances.model import ALWAYS

SUPPORT_HEIGHT, SUPPORT_EDGE = (0.25, 1.3), 0.3
"""m: heights of the upper sides, and least horizontal edge, of furniture on which an object can be put out of the
way."""

COLD = 0.0
"""Celsius below which a source freezes."""


@dataclasses.dataclass(frozen=True)
class HeatSource:
    """A source that heats or cools (`StateParameters.heat_*`), by its object's name."""

    name: str
    temperature: float
    needs_switch: bool
    needs_closed: bool
    acts_inside: bool


@dataclasses.dataclass(frozen=True, eq=False)
class Domain:
    """Constants of one scene and robot.

    Attributes:
      model: of the scene's states. hands: of the robot. lifts: kg that one of them lifts.
    """

    model: StateModel
    hands: int = 2
    lifts: float = math.inf

    @classmethod
    def of_robot(cls, model: StateModel, robot: TaskRobot) -> Domain:
        """With the hands that a robot has."""
        return cls(model, robot.hand_count, robot.hand_lifts)

    def hands_for(self, name: str) -> int:
        """Hands that it takes to lift an object: two where one does not lift its mass, and there are two."""
        if self.hands < 2 or not self.graspable(name):
            return 1
        return 1 + bool(self.model.tables.object_mass[self.index(name)] > self.lifts)

    def hands_taken(self, held: Iterable[str]) -> int:
        """Hands that hold objects of these names."""
        return sum(self.hands_for(name) for name in set(held))

    def index(self, name: str) -> int:
        """Position of an object. Raises UnknownNameError."""
        return object_index(self.model, name)

    def check(self, step: Step) -> None:
        """Raises UnknownNameError: the scene has no such object or room, or does not use the substance."""
        for name in step.arguments:
            if name not in step.things:
                substance_index(self.model, name)
            elif name not in self.model.tables.room_names:
                self.index(name)

    def has(self, name: str, ability: str) -> bool:
        """Whether an object has an ability."""
        return ability in self.model.parameters.abilities[self.index(name)]

    def fixed(self, name: str) -> bool:
        """Whether an object is a part of the house."""
        return bool(self.model.tables.object_fixed[self.index(name)])

    def graspable(self, name: str) -> bool:
        """Whether hands take hold of an object itself, not only of its doors."""
        tables = self.model.tables
        return bool(((tables.graspable_object == self.index(name)) & (tables.graspable_joint < 0)).any())

    def volume(self, name: str) -> float:
        """Cubic metres of an object's box as it is modelled; of a room, 0."""
        tables = self.model.tables
        return float(np.prod(tables.object_bbox[self.index(name)])) if name in tables.object_names else 0.0

    def length(self, name: str) -> float:
        """Metres from corner to corner of an object's box as it is modelled."""
        return float(np.linalg.norm(self.model.tables.object_bbox[self.index(name)]))

    def thickness(self, name: str) -> float:
        """Metres of the shortest edge of an object's box as it is modelled: its height where it lies flat."""
        return float(np.min(self.model.tables.object_bbox[self.index(name)]))

    def opens(self, name: str) -> bool:
        """Whether an object has joints that count for `open`."""
        return name in self._openable

    def is_door(self, name: str) -> bool:
        """Whether an object is a door between rooms."""
        return self.model.tables.object_categories[self.index(name)] == "door"

    def halves(self, name: str) -> tuple[str, ...]:
        """Names of what an object is cut into."""
        names = self.model.tables.object_names
        return tuple(names[h] for h in self.model.parameters.halves_of(self.index(name)))

    @functools.cached_property
    def _openable(self) -> frozenset[str]:
        names = self.model.tables.object_names
        return frozenset(n for j in np.unique(self.model.tables.openable_object) if self.has(n := names[j], "openable"))

    @functools.cached_property
    def openable(self) -> tuple[str, ...]:
        """All objects that open, in the scene's order."""
        return tuple(n for n in self.model.tables.object_names if n in self._openable)

    def _loose(self, ability: str) -> tuple[str, ...]:
        tables, found = self.model.tables, self.model.parameters.has(ability)
        usable = found & ~tables.object_fixed & ~tables.object_parked
        return tuple(tables.object_names[o] for o in np.flatnonzero(usable))

    @functools.cached_property
    def loose(self) -> tuple[str, ...]:
        """Objects that can be moved and are in use."""
        tables = self.model.tables
        return tuple(tables.object_names[o] for o in np.flatnonzero(~tables.object_fixed & ~tables.object_parked))

    @functools.cached_property
    def tools(self) -> tuple[str, ...]:
        """Cleaning tools that can be carried; of these, if there are any, those that clean with what touches a face."""
        tools = tuple(t for t in self._loose("cleaningTool") if self.graspable(t))
        links = dict(zip(self.model.parameters.tool_object, self.model.parameters.tool_link, strict=True))
        return tuple(t for t in tools if not is_hidden(self.model.tables, int(links[self.index(t)]))) or tools

    @functools.cached_property
    def knives(self) -> tuple[str, ...]:
        """Objects that cut and can be carried."""
        return tuple(k for k in self._loose("slicer") if self.graspable(k))

    @functools.cached_property
    def taps(self) -> tuple[str, ...]:
        """Objects from which water comes."""
        names = self.model.tables.object_names
        return tuple(dict.fromkeys(names[o] for o in self.model.parameters.water_object))

    def contains(self, name: str) -> bool:
        """Whether an object is a container of substances; False where the scene has none in use."""
        found = self.model.substances
        return found is not None and found.containers.row_of(self.index(name)) is not None

    @functools.cached_property
    def fillable(self) -> tuple[str, ...]:
        """Containers that can be carried, where water is in use and comes from somewhere."""
        found = self.model.substances
        if found is None or found.water < 0 or not self.taps:
            return ()
        return self.pourable

    @functools.cached_property
    def pourable(self) -> tuple[str, ...]:
        """Containers that can be carried, and turned over."""
        return tuple(n for n in self.loose if self.contains(n) and self.graspable(n))

    @functools.cached_property
    def sprays(self) -> tuple[str, ...]:
        """Containers that spray what they hold, and can be carried; one hand holds them, another one switches them."""
        found = self.model.substances
        if found is None or self.hands < 2:
            return ()
        names = {self.model.tables.object_names[found.containers.object[row]] for row in sprays(self.model)}
        return tuple(n for n in self.pourable if n in names)

    @functools.cached_property
    def stirrers(self) -> tuple[str, ...]:
        """Objects that stir, and can be carried."""
        categories = self.model.tables.object_categories
        return tuple(n for n in self.loose if categories[self.index(n)] in STIRRERS and self.graspable(n))

    def recipes(self, substance: str) -> tuple[Transition, ...]:
        """Rules by which stirring makes a substance of others, at any temperature."""
        rules = () if self.model.substances is None else self.model.substances.rules
        plain = [r for r in rules if r.stir and r.inputs and not r.objects and not r.count]
        return tuple(r for r in plain if r.output == substance and np.isneginf(r.temperature) and np.isinf(r.cold))

    @functools.cached_property
    def mixable(self) -> tuple[str, ...]:
        """Substances that stirring makes of others in use."""
        return () if self.model.substances is None else tuple(s for s in self.model.substances.names if self.recipes(s))

    def litres(self, name: str) -> float:
        """Litres that a container holds; of anything else, 0."""
        found = self.model.substances
        row = None if found is None else found.containers.row_of(self.index(name))
        return 0.0 if found is None or row is None else float(found.containers.litres[row])

    def absorbs(self, name: str) -> bool:
        """Whether an object absorbs what is poured or sprayed onto it."""
        return bool(np.isfinite(self.model.parameters.wetness_soaked[self.index(name)]))

    def meant(self, step: Step) -> Step:
        """A step that says what it is to make true: of a primitive with `one_of`, if it does not yet, what the target
        can be."""
        templates = PRIMITIVES[step.primitive].one_of
        if not templates or step.also:
            return step
        target = self.receiver(step)
        able = {"contains": self.contains(target), "saturated": self.absorbs(target), "covered": True}
        template = next(t for predicate, can in able.items() for t in templates if can and t[0] == predicate)
        return dataclasses.replace(step, also=(step.condition(template),))

    def receiver(self, step: Step) -> str:
        """What gets the substance of a step of a primitive with `one_of`."""
        return step.condition(PRIMITIVES[step.primitive].one_of[0]).arguments[0]

    @functools.cached_property
    def sources(self) -> tuple[HeatSource, ...]:
        """Sources of heat and cold."""
        p, names = self.model.parameters, self.model.tables.object_names
        return tuple(
            HeatSource(
                names[o],
                float(p.heat_temperature[s]),
                bool(p.heat_requires_toggled_on[s]),
                bool(p.heat_requires_closed[s]),
                bool(p.heat_requires_inside[s]),
            )
            for s, o in enumerate(p.heat_object)
            if p.heat_requires_inside[s] or p.heat_link[s] >= 0
        )

    def heaters(self, name: str) -> tuple[HeatSource, ...]:
        """Sources hot enough to cook an object, those that need no door first."""
        limit = float(self.model.parameters.cook_temperature[self.index(name)])
        hot = [s for s in self.sources if s.temperature >= limit]
        return tuple(sorted(hot, key=lambda s: s.acts_inside))

    def coolers(self, name: str) -> tuple[HeatSource, ...]:
        """Sources cold enough to freeze an object."""
        limit = float(self.model.parameters.freeze_temperature[self.index(name)])
        return tuple(s for s in self.sources if s.temperature <= min(limit, COLD))

    def impossible(self, condition: Condition) -> str:
        """Why no primitive can make a condition true, in words; "" where one can.

        Raises:
          UnknownNameError, ArityError: it names something that the scene lacks.
        """
        predicate, value = find(condition.predicate), condition.value
        name = condition.arguments[0]
        if condition.predicate not in (*PLACEMENTS, *_CHANGES):
            return f"no primitive makes '{predicate.name}' true or false"
        if condition.predicate in PLACEMENTS:
            self.index(name)
            if self._mover(condition) is None:
                return f"'{name}' is fixed"
            if value and len(condition.arguments) > 1 and condition.arguments[0] == condition.arguments[1]:
                return f"'{name}' cannot be placed relative to itself"
            return ""
        if predicate.ability is not None and not self.has(name, predicate.ability):
            return f"'{name}' is not {predicate.ability}" if value else ""
        if condition.predicate == "attached":
            return self._cannot_be_attached(name, condition.arguments[1], value)
        if condition.predicate in ("filled", "contains", "saturated", "covered"):
            return self._cannot_receive(condition.predicate, name, condition.arguments[1], value)
        return self._unchangeable(condition.predicate, name, value)

    def _cannot_receive(self, predicate: str, name: str, substance: str, value: bool) -> str:
        """Why no primitive brings a substance into or onto an object, or takes it from there."""
        found = self.model.substances
        if substance in ALWAYS:
            dirty = "dusty" if substance == DUST else "stained"
            return f"primitives only take {substance} off objects: (not ({dirty} {name}))"
        if not value:
            return (
                f"no primitive takes {substance} {'out of' if predicate in ('filled', 'contains') else 'off'} '{name}'"
            )
        if found is None or substance not in found.names:
            return f"the scene has no {substance} in use (--substances {substance})"
        if not found.has_volume[found.names.index(substance)]:
            return f"no primitive brings {substance} anywhere: no container holds it"
        if predicate in ("filled", "contains"):
            if not self.contains(name):
                return f"'{name}' is no container"
            if substance == WATER and name in self.fillable:
                return ""
        elif predicate == "saturated" and not self.absorbs(name):
            return f"'{name}' does not absorb what is poured or sprayed onto it"
        elif predicate == "covered" and (self.absorbs(name) or found.row[self.index(name)] == len(found.covered)):
            return f"'{name}' {'absorbs what covers others' if self.absorbs(name) else 'has no surface'}"
        if substance == WATER and predicate == "saturated" and self.taps and not self.fixed(name):
            return ""
        others = [n for n in self.pourable if n != name]
        if predicate in ("filled", "contains") and self.recipes(substance) and any(n != name for n in self.stirrers):
            return ""
        return "" if others else f"no container can be carried to '{name}' to pour {substance} out of it"

    def attachable(self, name: str) -> tuple[str, ...]:
        """Objects that an object can be attached to."""
        joints, names = self.model.joints, self.model.tables.object_names
        return () if joints is None else tuple(names[p] for p in joints.parent[joints.child == self.index(name)])

    def _cannot_be_attached(self, name: str, other: str, value: bool) -> str:
        """Why no primitive attaches an object to another, or takes it off."""
        if not value:
            return f"no primitive takes '{name}' off '{other}'"
        if other not in self.attachable(name):
            return f"'{name}' cannot be attached to '{other}' (add '{attached_as_text(name, other)}')"
        return "" if self.graspable(name) else f"no hand takes hold of '{name}'"

    def _mover(self, condition: Condition) -> str | None:
        """The object to be moved so that a placement becomes true: the first argument, or where that is fixed and the
        relation holds both ways, the second."""
        name = condition.arguments[0]
        if not self.fixed(name):
            return name
        if condition.predicate in SYMMETRIC and not self.fixed(condition.arguments[1]):
            return condition.arguments[1]
        return None

    def mover(self, condition: Condition) -> str:
        """The object that a placement moves."""
        found = self._mover(condition)
        assert found is not None, condition
        return found

    def _unchangeable(self, predicate: str, name: str, value: bool) -> str:
        if predicate == "open":
            return "" if self.opens(name) else f"'{name}' has no joints that open"
        if predicate == "toggled_on":
            return ""
        if value != _CHANGES[predicate]:
            return f"no primitive makes '{name}' {'' if value else 'not '}{predicate}"
        if predicate in ("dusty", "stained"):
            tools = [t for t in self.tools if t != name]
            if not tools:
                return "the scene has no cleaning tool that can be carried"
            if predicate == "stained" and not (self.taps and any(self.has(t, "soakable") for t in tools)):
                return "the scene has no water, or no cleaning tool that can be soaked"
            return ""
        if predicate == "soaked":
            if not self.taps:
                return "the scene has no water"
            return f"'{name}' is fixed" if self.fixed(name) else ""
        if predicate == "sliced":
            return "" if self.knives else "the scene has no knife"
        if predicate == "cooked":
            return "" if self.heaters(name) else f"nothing in the scene is hot enough for '{name}'"
        return "" if self.coolers(name) else f"nothing in the scene is cold enough for '{name}'"

    @functools.cached_property
    def supports(self) -> tuple[str, ...]:
        """Fixed furniture with a large upper side at the height of a table, largest first."""
        tables = self.model.tables
        size, top = tables.object_bbox, tables.object_bbox[:, 2]
        good = tables.object_fixed & ~tables.object_is_floor
        good &= (top >= SUPPORT_HEIGHT[0]) & (top <= SUPPORT_HEIGHT[1]) & (size[:, :2].min(1) >= SUPPORT_EDGE)
        order = np.flatnonzero(good)[np.argsort(-(size[good, 0] * size[good, 1]), kind="stable")]
        names = [tables.object_names[o] for o in order]
        return tuple(n for n in names if n not in self._openable) or tuple(names)


_CHANGES = {
    "open": True,
    "toggled_on": True,
    "soaked": True,
    "dusty": False,
    "stained": False,
    "sliced": True,
    "cooked": True,
    "frozen": True,
    "filled": True,
    "contains": True,
    "saturated": True,
    "covered": True,
    "attached": True,
}
"""Predicates of one object, or of an object and a substance, that primitives change, and to what (open and toggled_on
both ways)."""

SYMMETRIC = ("next_to", "in_contact_with")
"""Relations that hold both ways, so that either object may be moved."""


def condition_of(atom: Atom, value: bool = True) -> Condition:
    """An atom, or its negation, as a condition."""
    return Condition(find(atom.predicate).name, atom.arguments, value)
