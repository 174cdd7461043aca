"""Binding: which objects of a home play the objects of an activity, and what has to be added to it.

An object with an `inroom` condition is one that stands in a room of that kind. Objects of one kind of room are in one
room if that is possible, and whatever a condition of the start relates is in one room anyway (iGibson takes one room
for all of a kind). Every other object is one of the home's that no other has taken, else one of the object library; so
is one with `inroom` of which the room has too few, where it is not a furniture that is fixed. All choices are the first
possible in the home's order: the same home, the same binding. Furniture under which the goal has something on the floor
comes first where it does not stand on a carpet.

A goal that wants something cleaned or cut may be bound where nothing cleans or cuts, since definitions do not always
name the tool: one of the library is added, on the floor of a room with water.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence

from ig2mj.errors import Ig2mjError
from ig2mj.knowledge import synset
from ig2mj.predicates import find, logic
from ig2mj.predicates.logic import Atom
from ig2mj.scene.additions import name_additions
from ig2mj.scene.extras import ATTACHED, BROKEN, ON_FIRE, PREFIX, attached_as_text
from ig2mj.scene.library import LibraryModel, library, split_models
from ig2mj.scene.manifest import Manifest, ObjectEntry
from ig2mj.scene.substance_requests import substances_as_text
from ig2mj.tasks.bddl.bare_floor import on_carpets
from ig2mj.tasks.bddl.matching import clusters_of, match, search_rooms
from ig2mj.tasks.bddl.synsets import AGENT, Kinds, kinds
from ig2mj.tasks.bddl.vocabulary import Activity

TOOLS = (
    (frozenset(("dusty", "stained")), "cleaningTool", "rag/rag_00"),
    (frozenset(("sliced",)), "slicer", "carving_knife/carving_knife_00"),
)
"""Predicates of a goal, the ability of the tool that they take, and the model that is added where the home has none."""

PLACES = ("on_top", "inside", "next_to", "under", "in_contact_with")
"""Predicates of two objects that say where the first is."""


class BindingError(Ig2mjError):
    """A home lacks what an activity needs. `reasons`: a sentence for each thing that is missing."""

    def __init__(self, activity: str, home: str, reasons: Sequence[str]):
        self.activity, self.home, self.reasons = activity, home, tuple(reasons)
        super().__init__(f"activity '{activity}' cannot be bound in '{home}': {'; '.join(reasons)}")


@dataclasses.dataclass(frozen=True)
class Binding:
    """An activity in a home.

    Attributes:
      activity, home: of which this is.
      objects: object of the activity -> object of the scene; a floor's is the home's floor. Halves are among them.
      rooms: object of the activity -> the room it has to be in, where the activity says so.
      additions: what `load_scene(home, objects=...)` must add. added: the names that these get, in that order.
      agents: object of the activity -> agent of the scene.
      stand_ins: synset -> what stands in for it, where our taxonomy does not know it.
      tools: names of added tools that the activity does not name, and the room on whose floor each lies.
    """

    activity: Activity
    home: str
    objects: Mapping[str, str]
    rooms: Mapping[str, str]
    additions: tuple[str, ...]
    added: tuple[str, ...]
    agents: Mapping[str, str]
    stand_ins: Mapping[str, str]
    tools: Mapping[str, str] = dataclasses.field(default_factory=dict)

    @property
    def requested(self) -> tuple[str, ...]:
        """What `load_scene(home, objects=...)` must be given: the additions, substances in use, further states."""
        return (*self.additions, *substances_as_text(self.activity.substances), *self.extras)

    @property
    def extras(self) -> tuple[str, ...]:
        """Further states that the activity needs, as `load_scene(objects=...)` takes them."""
        every = (*self.activity.init, *self.activity.goal)
        grounded = logic.atoms(logic.ground(logic.And(every), self.activity.objects.__getitem__))
        found: dict[str, None] = {}
        for a in grounded:
            if a.predicate in (ON_FIRE, BROKEN):
                found[f"{PREFIX}{a.predicate}"] = None
            elif a.predicate == ATTACHED:
                found[attached_as_text(*(self.objects[name] for name in a.arguments))] = None
        return tuple(found)


def bind(activity: Activity, manifest: Manifest, agents: Sequence[str] = ()) -> Binding:
    """Binds an activity in a home.

    Args:
      manifest: of the home, without additions.
      agents: names of the agents that will be in the scene; an activity's agents are these, in order.

    Raises:
      BindingError: the home lacks something that the library cannot give; says all of it.
    """
    return _Binder(activity, manifest).bind(agents)


class _Binder:
    def __init__(self, activity: Activity, manifest: Manifest):
        self.activity, self.manifest = activity, manifest
        self.synset = {name: s for name, s in activity.synset_of().items() if s != AGENT}
        self.kinds = {s: kinds(s, activity.behavior_1k) for s in dict.fromkeys(self.synset.values())}
        self.needs = activity.needs
        #: Objects that the start puts on something. Fixed ones cannot be, but may stand on the floor of a room already.
        self.placed = {
            a.arguments[0] for a in self.activity.init if isinstance(a, Atom) and a.predicate in PLACES
        } - set(self.activity.rooms)
        every = logic.ground(logic.And((*self.activity.init, *self.activity.goal)), self.activity.objects.__getitem__)
        self.placed |= {a.arguments[0] for a in logic.atoms(every) if a.predicate == ATTACHED}
        self.floors = {
            a.arguments[0]: a.arguments[1]
            for a in self.activity.init
            if isinstance(a, Atom) and a.predicate == "on_floor" and a.arguments[0] not in self.activity.rooms
        }
        self.entries = {o.name: o for o in manifest.objects if o.part_of is None}
        of_category: dict[str, list[ObjectEntry]] = {}
        for o in self.entries.values():
            of_category.setdefault(o.category, []).append(o)
        #: Objects that rules make: the home has none, and one of the library waits outside until then.
        self.made = {
            a.part.arguments[0]
            for a in self.activity.init
            if isinstance(a, logic.Not) and isinstance(a.part, Atom) and a.part.predicate == "real"
        }
        #: What holds things at the start, and what is held: of BEHAVIOR-1K's, large ones and small ones are taken.
        pairs = (
            [a.arguments for a in self.activity.init if isinstance(a, Atom) and a.predicate == "inside"]
            if activity.behavior_1k
            else []
        )
        self.holders, self.held = {b for _, b in pairs}, {a for a, _ in pairs}
        #: For every object of the activity the objects of the home that may play it, categories that say it best first.
        self.players = {
            name: [o for c in self.kinds[s].categories for o in of_category.get(c, ()) if self.may_play(o, name)]
            if name not in self.made
            else []
            for name, s in self.synset.items()
        }
        for name in self.holders & set(self.players) - set(self.activity.rooms):
            self.players[name].sort(key=lambda o: -_room(o))
        for name in _over_the_floor(activity) & set(self.players):
            covered = on_carpets(manifest.name)
            self.players[name].sort(key=lambda o: o.name in covered)
        self.objects: dict[str, str] = {}
        self.rooms: dict[str, str] = {}
        self.added: dict[str, LibraryModel] = {}
        self.reasons: list[str] = []

    def may_play(self, o: ObjectEntry, name: str) -> bool:
        """Whether the activity can do with the object what it wants of `name`."""
        return able(o, self.needs.get(name, ())) and not (o.fixed and (name in self.placed or name in self.made))

    def may_stand(self, o: ObjectEntry, name: str) -> bool:
        """Whether the object is loose, or stands in the room on whose floor the activity wants `name`."""
        room = self.rooms.get(self.floors.get(name, ""))
        return not o.fixed or name not in self.floors or room is None or room in o.rooms

    def bind(self, agents: Sequence[str]) -> Binding:
        for kind in dict.fromkeys(self.activity.rooms.values()):
            self.bind_rooms(kind, [n for n, k in self.activity.rooms.items() if k == kind and n in self.synset])
        self.bind_rest()
        if self.reasons:
            raise BindingError(self.activity.name, self.manifest.name, self.reasons)
        tools = self.lacking_tools()
        requested = [*(f"{m.category}/{m.model}" for m in self.added.values()), *tools]
        named = name_additions((o.name for o in self.manifest.objects), requested)
        self.objects |= {name: new for name, (new, _) in zip(self.added, named, strict=False)}
        for half, (whole, number) in self.activity.halves.items():
            self.objects[half] = self.half_of(whole, number)
        order = [*self.synset, *self.activity.halves]
        mine = self.activity.objects.get(AGENT, ())
        return Binding(
            activity=self.activity,
            home=self.manifest.name,
            objects={name: self.objects[name] for name in order},
            rooms=self.rooms,
            additions=tuple(requested),
            added=tuple(new for new, _ in named),
            agents=dict(zip(mine, agents, strict=False)),
            stand_ins={s: k.instead for s, k in self.kinds.items() if k.instead is not None},
            tools={name: self.wet_room() for name, _ in named[len(self.added) :]},
        )

    def lacking_tools(self) -> list[str]:
        """Models of tools that the goal takes, and that neither the home nor what is added to it has."""
        goal = logic.ground(logic.And(self.activity.goal), self.activity.objects.__getitem__)
        asked = {a.predicate for a in logic.atoms(goal)}
        loose = [o for o in self.entries.values() if not o.fixed and not o.parked]
        there = {ability for o in [*loose, *(m.entry for m in self.added.values())] for ability in o.abilities}
        return [model for predicates, ability, model in TOOLS if asked & predicates and ability not in there]

    def wet_room(self) -> str:
        """A room with water, if there is one."""
        wet = [room for o in self.entries.values() if "water_source" in o.links for room in o.rooms]
        return next(iter([*wet, *self.rooms.values(), *self.manifest.rooms.instances]), "")

    def bind_rooms(self, kind: str, names: list[str]) -> None:
        """Binds the objects that have to be in rooms of one kind."""
        instances = [room for room, entry in self.manifest.rooms.instances.items() if entry.type == kind]
        if not instances:
            self.reasons.append(f"has no {kind}")
            return
        related = [
            a.arguments for a in self.activity.init if isinstance(a, Atom) and a.predicate in (*PLACES, "on_floor")
        ]
        clusters = clusters_of(names, [(a, b) for a, b in related])
        found = search_rooms(clusters, instances, self.cost)
        if found is None:
            self.reasons += self.lacking(kind, instances, names)
            return
        for room, inside in found.items():
            matched = match(self.candidates(room, inside))
            for name in inside:
                self.rooms[name] = room
                if name in matched:
                    self.objects[name] = matched[name]
                elif (model := self.from_library(name)) is not None:
                    self.added[name] = model

    def cost(self, given: Mapping[str, Sequence[str]]) -> int | None:
        """How many objects must be added so that these rooms hold these objects; None: one cannot be added."""
        added = 0
        for room, names in given.items():
            matched = match(self.candidates(room, names))
            missing = [n for n in names if n not in matched]
            if any(self.from_library(n) is None for n in missing):
                return None
            added += len(missing)
        return added

    def candidates(self, room: str, names: Sequence[str]) -> dict[str, list[str]]:
        """For each name the objects that stand in the room and may play it; the home's floor is in every room."""
        return {n: [o.name for o in self.players[n] if room in o.rooms or o.category == "floors"] for n in names}

    def from_library(self, name: str) -> LibraryModel | None:
        """The model to add for an object: categories of its synset in turn, so that three fruits are not all apples."""
        synset_name = self.synset[name]
        choose = max if name in self.holders else min if name in self.held else None
        models = _library_models(self.kinds[synset_name], synset_name, lambda entry: self.may_play(entry, name), choose)
        return models[self.activity.objects[synset_name].index(name) % len(models)] if models else None

    def bind_rest(self) -> None:
        """Binds the objects that may come from anywhere."""
        rest = [n for n in self.synset if n not in self.activity.rooms]
        taken = set(self.objects.values())
        free = {
            n: [o.name for o in self.players[n] if o.name not in taken and not o.parked and self.may_stand(o, n)]
            for n in rest
        }
        matched = match(free)
        self.objects |= matched
        lacking: dict[str, list[str]] = {}
        for name in rest:
            if name in matched:
                continue
            if (model := self.from_library(name)) is not None:
                self.added[name] = model
            else:
                lacking.setdefault(self.synset[name], []).append(name)
        for synset_name, names in lacking.items():
            self.reasons.append(self.lacks(synset_name, len(names), self.needs.get(names[0], ()), "the home"))

    def lacking(self, kind: str, instances: Sequence[str], names: Sequence[str]) -> list[str]:
        """What the room that comes nearest lacks, in words."""
        best: list[str] | None = None
        for room in instances:
            matched = match(self.candidates(room, names))
            missing: dict[str, list[str]] = {}
            for name in names:
                if name not in matched and self.from_library(name) is None:
                    missing.setdefault(self.synset[name], []).append(name)
            missing_lines = [
                self.lacks(s, len(found), self.needs.get(found[0], ()), room) for s, found in missing.items()
            ]
            if best is None or len(missing_lines) < len(best):
                best = missing_lines
        return best or [f"no one {kind} holds all that is related"]

    def lacks(self, synset_name: str, count: int, needs: Iterable[str], where: str) -> str:
        known = self.kinds[synset_name].categories
        if not known:
            return f"nothing stands for {synset_name}"
        able_to = "".join(f" that can be {find(p).name}" for p in sorted(needs))
        some = [c for c in known if c != synset_name.split(".")[0]]
        of = f" ({', '.join(some[:3])}{', ...' if len(some) > 3 else ''})" if some else ""
        return f"{where} lacks {count} {synset_name}{of}{able_to}"

    def half_of(self, whole: str, number: int) -> str:
        bound = self.objects[whole]
        if whole not in self.added:
            return self.entries[bound].parts[number].object
        model = self.added[whole]
        return f"{bound}{model.entry.parts[number].object.removeprefix(model.entry.name)}"


def able(o: ObjectEntry, predicates: Iterable[str]) -> bool:
    """Whether an object has what predicates need: the ability, joints to open, halves to be cut into."""
    for name in predicates:
        ability = find(name).ability
        if ability is not None and ability not in o.abilities:
            return False
        if (name == "open" and not o.openable) or (name == "sliced" and not o.parts):
            return False
        if name in ("filled", "contains") and o.inside is None:
            return False
        if name == "insource" and o.inside is None and "waterSource" not in o.abilities:
            return False
        if name == "saturated" and not {"soakable", "cleaningTool"} & set(o.abilities):
            return False
    return True


def _over_the_floor(activity: Activity) -> set[str]:
    """Objects of an activity under which its goal has something that is on the floor there."""
    goal = logic.atoms(logic.ground(logic.And(activity.goal), activity.objects.__getitem__))
    lying = {a.arguments[0] for a in goal if a.predicate == "on_floor"}
    return {a.arguments[1] for a in goal if a.predicate == "under" and a.arguments[0] in lying}


def _room(o: ObjectEntry) -> float:
    """How much an object holds or takes: litres of its inside, else of its box."""
    x, y, z = o.bounding_box
    return 1000 * x * y * z if o.inside is None else o.inside.litres


def _library_models(
    known: Kinds, synset_name: str, fits: Callable[[ObjectEntry], bool], choose: Callable[..., LibraryModel] | None
) -> list[LibraryModel]:
    """Models of the library for a synset, one of each category: of its own, else of all below it; halves last.

    What is fixed furniture a home has or has not.

    Args:
      choose: `max` takes the largest model of each category, `min` the smallest; None: the first.
    """
    others = split_models()
    found = [
        [model for name, model in models.items() if name not in others.get(c, ())]
        for c in known.categories
        if (models := library().get(c))
    ]
    first = [m[0] if choose is None else choose(m, key=lambda model: _room(model.entry)) for m in found]
    models = [m for m in first if not m.entry.fixed and fits(m.entry)]
    if choose is not None:
        models.sort(key=lambda model: _room(model.entry), reverse=choose is max)
    for choice in (
        [m for m in models if synset(m.category) == synset_name and not m.category.startswith("half_")],
        [m for m in models if not m.category.startswith("half_")],
    ):
        if choice:
            return choice
    return models
