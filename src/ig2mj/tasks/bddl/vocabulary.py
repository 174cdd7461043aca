"""Lowering: a definition in either vocabulary of BDDL to the predicates of `ig2mj.predicates`.

bddl 1.0.1 (BEHAVIOR-100) has iGibson's predicates under other names: `nextto` is `next_to`. bddl 3.6 (BEHAVIOR-1K) says
some things in another way:

    ontop X floor.n.01_1                     on_floor X floor.n.01_1
    covered X stain.n.01_1, ... dust.n.01_1  stained X, dusty X
    saturated X water.n.06_1                 soaked X
    covered, saturated, filled, contains, insource X mud.n.03_1     the same of X and mud
    future mud.n.03_1, real mud.n.03_1       not present mud, present mud
    real half__apple.n.01_1                  sliced apple.n.01_1, likewise (not (real apple.n.01_1))
    future half__apple.n.01_1                not sliced apple.n.01_1
    future bagel.n.01_1, real bagel.n.01_1   not real bagel.n.01_1, real bagel.n.01_1

Halves that an activity waits for are the parts of their whole. What else an activity waits for, a substance or an
object, must be something that transition rules make of what the activity has (`ig2mj.knowledge.transitions`); what is
made on the way is in use, too. What needs cloth (folded, draped, ...) has no state here.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Mapping, Sequence

from ig2mj.errors import Ig2mjError, UnknownNameError
from ig2mj.knowledge.substances import substance
from ig2mj.knowledge.transitions import DRYERS, HALF, WASHERS, intermediates, makes_objects
from ig2mj.predicates import find, logic
from ig2mj.predicates.logic import Atom, Expression, Not
from ig2mj.tasks.bddl.problem import Problem
from ig2mj.tasks.bddl.synsets import FLOOR, ROOM_STAND_INS

BEHAVIOR_1K = "omnigibson"
OF_SUBSTANCES = ("covered", "saturated", "filled", "contains", "insource")
"""Predicates of an object and a substance, under the same names here."""
SAME = (
    "ontop", "inside", "nextto", "under", "touching", "cooked", "frozen",
    "open", "toggled_on", "hot", "attached", "broken", "on_fire",
)  # fmt: skip
"""Other predicates that `ig2mj.predicates` has, perhaps under another name."""
DIRT = {"stain.n.01": "stained", "dust.n.01": "dusty"}
WATER, WATER_NAME = "water.n.06", "water"
HALF_OF = "half__"


class VocabularyError(Ig2mjError):
    """An activity uses predicates that no state expresses; they are in `predicates`."""

    def __init__(self, name: str, predicates: tuple[str, ...]):
        self.name, self.predicates = name, predicates
        super().__init__(f"activity '{name}' uses {', '.join(predicates)}, which ig2mj has no state for")


@dataclasses.dataclass(frozen=True)
class Activity:
    """What an activity asks for, in predicates of `ig2mj.predicates`, over the definition's own names of objects.

    Attributes:
      name: of the activity. behavior_1k: its synsets are of BEHAVIOR-1K's taxonomy.
      objects: synset -> objects that must be found or added; halves and substances are not among them.
      halves: half -> (whole, number), for halves that come to be when the whole is cut.
      rooms: object -> the kind of room it has to be in.
      init: conditions of the start. goal: all must hold. Groups of quantifiers are synsets of `objects`.
      remarks: oddities of the definition. substances: names of those in use (`ig2mj.knowledge.substances`).
    """

    name: str
    behavior_1k: bool
    objects: Mapping[str, tuple[str, ...]]
    halves: Mapping[str, tuple[str, int]]
    rooms: Mapping[str, str]
    init: tuple[Expression, ...]
    goal: tuple[Expression, ...]
    remarks: tuple[str, ...] = ()
    substances: tuple[str, ...] = ()

    def synset_of(self) -> dict[str, str]:
        """Object -> its synset."""
        return {name: synset for synset, names in self.objects.items() for name in names}

    @functools.cached_property
    def needs(self) -> Mapping[str, frozenset[str]]:
        """Object -> predicates of it alone that hold at the start or that the goal wants true: it must be able to."""
        found: dict[str, set[str]] = {}
        every = logic.ground(logic.And((*self.init, *self.goal)), self.objects.__getitem__)
        _note_wanted(every, True, found)
        for whole, _ in self.halves.values():
            found.setdefault(whole, set()).add("sliced")
        return {name: frozenset(predicates) for name, predicates in found.items()}


def lower(problem: Problem, name: str) -> Activity:
    """The activity that a definition describes.

    Args:
      name: of the activity; the definition's own carries a number.

    Raises:
      VocabularyError: it uses predicates that no state expresses.
    """
    lowering = _Lowering(problem)
    init, goal = lowering.all(problem.init), lowering.all(problem.goal)
    if lowering.unknown:
        raise VocabularyError(name, tuple(sorted(lowering.unknown)))
    kept = {s: names for s, names in problem.objects.items() if s not in lowering.substances}
    kept = {s: tuple(n for n in names if n not in lowering.halves) for s, names in kept.items()}
    return Activity(
        name=name,
        behavior_1k=problem.domain == BEHAVIOR_1K,
        objects={s: names for s, names in kept.items() if names},
        halves=lowering.halves,
        rooms=problem.rooms if lowering.old else {n: ROOM_STAND_INS.get(k, k) for n, k in problem.rooms.items()},
        init=tuple(dict.fromkeys(init)),
        goal=tuple(dict.fromkeys(goal)),
        remarks=problem.remarks,
        substances=lowering.in_use((*init, *goal)),
    )


def _note_wanted(e: Expression, positive: bool, found: dict[str, set[str]]) -> None:
    match e:
        case Atom(predicate, (name, *others)):
            if positive and (not others or predicate in OF_SUBSTANCES):
                found.setdefault(name, set()).add(predicate)
        case Not(part):
            _note_wanted(part, not positive, found)
        case logic.And(parts) | logic.Or(parts) | logic.Exactly(_, parts):
            for p in parts:
                _note_wanted(p, positive, found)
        case logic.Pairing(_, rows):
            for p in (p for row in rows for p in row if p is not None):
                _note_wanted(p, positive, found)


class _Lowering:
    def __init__(self, problem: Problem):
        self.problem, self.old = problem, problem.domain != BEHAVIOR_1K
        self.synset = problem.synset_of()
        self.unknown: set[str] = set()
        self.substances: set[str] = set()
        self.future: set[str] = set()
        self.halves: dict[str, tuple[str, int]] = {}
        #: Substances that are made on the way to what the activity waits for.
        self.on_the_way: dict[str, None] = {}
        if not self.old:
            every = logic.atoms(logic.ground(logic.And((*problem.init, *problem.goal)), self.members))
            self.substances = {self.synset[a.arguments[1]] for a in every if a.predicate in OF_SUBSTANCES}
            waiting = [self.synset[a.arguments[0]] for a in every if a.predicate in ("real", "future")]
            self.substances |= {s for s in waiting if is_substance(s) and not makes_objects(stem_of(s))}
            self.future = {a.arguments[0] for a in every if a.predicate == "future"}
            self.halves = self.find_halves(self.future)

    def members(self, group: str) -> tuple[str, ...]:
        return self.problem.objects[group]

    def find_halves(self, future: set[str]) -> dict[str, tuple[str, int]]:
        """Future halves -> (whole, number), in the order of the definition, shared out among wholes of that name."""
        found = {}
        for synset, names in self.problem.objects.items():
            stem = synset.split(".")[0]
            waiting = [n for n in names if n in future]
            if not stem.startswith(HALF_OF) or not waiting:
                continue
            same = [n for s, n in self.problem.objects.items() if s.split(".")[0] == stem.removeprefix(HALF_OF)]
            wholes = [name for group in same for name in group if name not in future]
            for i, half in enumerate(waiting if wholes else ()):
                whole = i * len(wholes) // len(waiting)
                first = -(-whole * len(waiting) // len(wholes))
                found[half] = (wholes[whole], i - first)
        return found

    def all(self, parts: tuple[Expression, ...]) -> tuple[Expression, ...]:
        lowered = []
        for part in parts:
            groups = groups_of(part)
            special = {s for s in groups if s in self.substances or any(h in self.halves for h in self.members(s))}
            source = logic.ground(part, self.members) if special or FLOOR in groups else part
            lowered.append(rewrite(source, self.atom))
        return tuple(lowered)

    def atom(self, a: Atom, bound: Mapping[str, str]) -> Expression:
        synsets = [bound.get(x) or self.synset.get(x, "") for x in a.arguments]
        if self.old:
            return Atom(find(a.predicate).name, a.arguments)
        match a.predicate:
            case "ontop" if synsets[1] == FLOOR:
                return Atom("on_floor", a.arguments)
            case "covered" if synsets[1] in DIRT:
                return Atom(DIRT[synsets[1]], a.arguments[:1])
            case "saturated" if synsets[1] == WATER:
                return Atom("soaked", a.arguments[:1])
            case "covered" | "saturated" | "filled" | "contains" | "insource":
                return Atom(a.predicate, (a.arguments[0], self.substance(synsets[1])))
            case "real" | "future" if synsets[0] in self.substances:
                name = self.substance(synsets[0])
                if a.predicate == "future":
                    self.note_made(name)
                present = Atom("present", (name,))
                return present if a.predicate == "real" else Not(present)
            case "real" | "future" if a.arguments[0] in self.halves:
                sliced = Atom("sliced", (self.halves[a.arguments[0]][0],))
                return sliced if a.predicate == "real" else Not(sliced)
            case "real" if self.is_cut(a.arguments[0], synsets[0]):
                return Not(Atom("sliced", a.arguments))
            case "real" | "future" if self.is_thing(synsets[0]):
                if a.predicate == "future":
                    self.note_made(stem_of(synsets[0]))
                real = Atom("real", a.arguments)
                return real if a.predicate == "real" else Not(real)
        name = a.predicate
        if name not in SAME:
            self.unknown.add(name)
            return a
        return Atom(find(name).name, a.arguments)

    def note_made(self, name: str) -> None:
        """Notes what is made on the way to something that the activity waits for, or that no rule makes it."""
        waiting = {stem_of(s) for s, names in self.problem.objects.items() if self.waits_for(names)}
        given = {stem_of(s).replace(HALF_OF, HALF) for s in self.problem.objects} - waiting
        if name == WATER_NAME and given & {*WASHERS, *DRYERS}:
            return
        found = intermediates(name, given)
        if found is None:
            self.unknown.add(f"a rule that makes {name}")
        else:
            self.on_the_way |= {n: None for n in found if not makes_objects(n)}

    def waits_for(self, names: Sequence[str]) -> bool:
        """Whether all of some names are not there at the start."""
        return set(names) <= self.future

    def is_thing(self, synset: str) -> bool:
        """Whether a synset names objects, and not what comes to be by cutting."""
        return bool(synset) and synset not in self.substances and not synset.startswith(HALF_OF)

    def substance(self, synset: str) -> str:
        """The substance of a synset; one that is not known is noted."""
        name = stem_of(synset)
        if not is_substance(synset):
            self.unknown.add(f"the substance {name}")
        return name

    def in_use(self, parts: Sequence[Expression]) -> tuple[str, ...]:
        """Names of the substances in lowered conditions, and of those from which they are made."""
        found: dict[str, None] = {}
        for part in parts:
            for a in logic.atoms(logic.ground(part, self.problem.objects.__getitem__)):
                if a.predicate in OF_SUBSTANCES:
                    found[a.arguments[1]] = None
                elif a.predicate == "present":
                    found[a.arguments[0]] = None
        return tuple(dict.fromkeys((*found, *self.on_the_way)))

    def is_cut(self, name: str, synset: str) -> bool:
        """Whether an object, or every object of a variable's synset, is a whole that halves wait for."""
        wholes = {whole for whole, _ in self.halves.values()}
        return name in wholes if name in self.synset else set(self.members(synset)) <= wholes


AtomRule = Callable[[Atom, Mapping[str, str]], Expression]
"""What an atom becomes, given the variables bound around it with their groups."""


def stem_of(synset: str) -> str:
    """The name in a synset: "water.n.06" -> "water"."""
    return synset.split(".")[0]


def is_substance(synset: str) -> bool:
    """Whether a synset names a substance."""
    try:
        substance(stem_of(synset))
    except UnknownNameError:
        return False
    return True


def rewrite(e: Expression, rule: AtomRule, bound: Mapping[str, str] | None = None) -> Expression:
    """The expression with every atom replaced; double negations vanish."""
    bound = bound or {}
    match e:
        case Atom():
            return rule(e, bound)
        case Not(part):
            inner = rewrite(part, rule, bound)
            return inner.part if isinstance(inner, Not) else Not(inner)
        case logic.And(parts):
            return logic.And(tuple(rewrite(p, rule, bound) for p in parts))
        case logic.Or(parts):
            return logic.Or(tuple(rewrite(p, rule, bound) for p in parts))
        case logic.ForAll(variable, group, body) | logic.Exists(variable, group, body):
            return type(e)(variable, group, rewrite(body, rule, {**bound, variable: group}))
        case logic.ForN(count, variable, group, body):
            return logic.ForN(count, variable, group, rewrite(body, rule, {**bound, variable: group}))
        case logic.ForPairs(first, second, body):
            return logic.ForPairs(first, second, rewrite(body, rule, {**bound, **dict([first, second])}))
        case logic.ForNPairs(count, first, second, body):
            return logic.ForNPairs(count, first, second, rewrite(body, rule, {**bound, **dict([first, second])}))
        case logic.Exactly(count, parts):
            return logic.Exactly(count, tuple(rewrite(p, rule, bound) for p in parts))
        case logic.Pairing(count, rows):
            return logic.Pairing(
                count, tuple(tuple(None if p is None else rewrite(p, rule, bound) for p in row) for row in rows)
            )
    raise TypeError(f"{e!r} is not an expression")


def groups_of(e: Expression) -> set[str]:
    """Groups of all quantifiers of an expression that have an atom in them."""
    found: set[str] = set()
    rewrite(e, functools.partial(_note_groups, found))
    return found


def names_in(e: Expression) -> set[str]:
    """Names (and variables) that the atoms of an expression have as arguments."""
    found: set[str] = set()
    rewrite(e, functools.partial(_note_names, found))
    return found


def _note_names(found: set[str], a: Atom, bound: Mapping[str, str]) -> Atom:
    found.update(a.arguments)
    return a


def _note_groups(found: set[str], a: Atom, bound: Mapping[str, str]) -> Atom:
    found.update(bound.values())
    return a
