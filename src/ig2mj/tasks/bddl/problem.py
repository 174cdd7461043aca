"""`Problem`: one activity's definition, read and checked (BDDL as in bddl 1.0.1 and 3.6.0).

    (define (problem NAME) (:domain igibson)
      (:objects plate.n.04_1 plate.n.04_2 - plate.n.04   sink.n.01_1 - sink.n.01 ...)
      (:init (inside plate.n.04_1 sink.n.01_1) (stained plate.n.04_1) (inroom sink.n.01_1 kitchen) ...)
      (:goal (and (forall (?plate.n.04 - plate.n.04) (not (stained ?plate.n.04))) ...)))

Conditions become the expressions of `ig2mj.predicates.logic`, still over the definition's own names and predicates.
Groups of quantifiers are the synsets of `:objects`. A name with a question mark that no quantifier binds is the object.
"""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Collection, Iterable, Mapping

from ig2mj.predicates import logic
from ig2mj.predicates.logic import Atom, Expression, Not
from ig2mj.tasks.bddl.syntax import BddlError, SyntaxGroup, Tree, Word, error, read_tree

IN_ROOM = "inroom"

PREDICATES: Mapping[str, Mapping[str, int]] = {
    "igibson": {
        **dict.fromkeys(("inside", "nextto", "ontop", "under", "touching", "onfloor", IN_ROOM), 2),
        **dict.fromkeys(("cooked", "burnt", "soaked", "open", "dusty", "stained", "sliced", "toggled_on", "frozen"), 1),
    },
    "omnigibson": {
        **dict.fromkeys(("inside", "nextto", "ontop", "under", "touching", IN_ROOM), 2),
        **dict.fromkeys(("covered", "saturated", "filled", "contains", "overlaid", "attached", "draped"), 2),
        **dict.fromkeys(("insource", "grasped"), 2),
        **dict.fromkeys(("cooked", "frozen", "open", "folded", "unfolded", "toggled_on", "hot", "on_fire"), 1),
        **dict.fromkeys(("future", "real", "broken", "assembled"), 1),
    },
}
"""Domain -> predicate -> number of its arguments."""


@dataclasses.dataclass(frozen=True)
class Problem:
    """An activity's definition.

    Attributes:
      name: as the definition gives it. domain: "igibson" (BEHAVIOR-100) or "omnigibson" (BEHAVIOR-1K).
      objects: synset -> names of its objects, in the order of the definition.
      rooms: object -> the kind of room it has to be in (`inroom`).
      init: initial conditions without `inroom`: atoms, negated atoms, and rarely quantified ones.
      goal: the parts that must all hold.
      file: where it was read from.
      remarks: what a tolerant reading passed over, each with its line.
    """

    name: str
    domain: str
    objects: Mapping[str, tuple[str, ...]]
    rooms: Mapping[str, str]
    init: tuple[Expression, ...]
    goal: tuple[Expression, ...]
    file: str = "definition"
    remarks: tuple[str, ...] = ()

    def synset_of(self) -> dict[str, str]:
        """Object -> its synset."""
        return {name: synset for synset, names in self.objects.items() for name in names}


def parse_problem(text: str, file: str = "definition", *, tolerant: bool = False) -> Problem:
    """Reads a definition.

    Args:
      tolerant: pass over what bddl's own parser does not notice and three definitions of 3.6.0 contain: a word between
        sections, an object that is declared twice, a second condition in the goal (the first counts).

    Raises:
      BddlError: brackets that do not match; an unknown section, predicate, object, synset or quantifier; a wrong number
        of parts. Each names line and word.
    """
    return _Reader(file, tolerant).problem(read_tree(text, file))


class _Reader:
    def __init__(self, file: str, tolerant: bool):
        self.file, self.tolerant = file, tolerant
        self.remarks: list[str] = []
        self.objects: dict[str, tuple[str, ...]] = {}
        self.names: set[str] = set()
        self.predicates: Mapping[str, int] = {}
        self.domain = ""

    def problem(self, tree: SyntaxGroup) -> Problem:
        if not tree.parts or not _is(tree.parts[0], "define"):
            raise self.error(tree, "a definition begins with (define")
        sections: dict[str, SyntaxGroup] = {}
        for part in tree.parts[1:]:
            if isinstance(part, Word) and self.tolerates(part, "stands between the sections: ignored"):
                continue
            if isinstance(part, Word) or not part.parts or not isinstance(head := part.parts[0], Word):
                raise self.error(
                    part, "is not a section", "sections are (problem ...), (:domain ...), (:objects ...) ..."
                )
            if head.text not in ("problem", ":domain", ":requirements", ":objects", ":init", ":goal"):
                raise self.error(head, "is not a section" + _near(head.text, [":domain", ":objects", ":init", ":goal"]))
            if head.text in sections:
                raise self.error(head, "occurs twice")
            sections[head.text] = part
        for name in ("problem", ":domain", ":objects", ":init", ":goal"):
            if name not in sections:
                raise self.error(tree, f"has no section ({name} ...)")
        self.domain = self.only_word(sections[":domain"])
        if self.domain not in PREDICATES:
            raise self.error(sections[":domain"], f"is not a known domain ({', '.join(PREDICATES)})")
        self.predicates = PREDICATES[self.domain]
        self.read_objects(sections[":objects"])
        init, rooms = [], {}
        for part in sections[":init"].parts[1:]:
            condition = self.condition(part, {}, top=True)
            if isinstance(condition, Atom) and condition.predicate == IN_ROOM:
                rooms[condition.arguments[0]] = condition.arguments[1]
            else:
                init.append(condition)
        goal = sections[":goal"]
        several = len(goal.parts) > 2 and self.tolerates(goal, "has several conditions: the first counts")
        if len(goal.parts) != 2 and not several:
            raise self.error(goal, "takes one condition", "join several with (and ...)")
        whole = self.condition(next(iter(goal.parts[1:])), {})
        parts = whole.parts if isinstance(whole, logic.And) else (whole,)
        name = self.only_word(sections["problem"])
        return Problem(name, self.domain, self.objects, rooms, tuple(init), parts, self.file, tuple(self.remarks))

    def read_objects(self, section: SyntaxGroup) -> None:
        waiting: list[Word] = []
        words = iter(section.parts[1:])
        for part in words:
            if not isinstance(part, Word):
                raise self.error(part, "is not an object", "objects are a list: NAME NAME - SYNSET")
            if part.text != "-":
                if part.text in self.names:
                    if self.tolerates(part, "is declared twice: counts once"):
                        continue
                    raise self.error(part, "is declared twice")
                self.names.add(part.text)
                waiting.append(part)
                continue
            synset = next(words, None)
            if not isinstance(synset, Word) or synset.text == "-":
                raise self.error(part, "is not followed by a synset")
            if not waiting:
                raise self.error(synset, "has no objects before its hyphen")
            self.objects[synset.text] = (*self.objects.get(synset.text, ()), *(w.text for w in waiting))
            waiting = []
        if waiting:
            raise self.error(waiting[0], "has no synset", "write NAME - SYNSET")

    def condition(self, tree: Tree, bound: Mapping[str, str], top: bool = False) -> Expression:
        """A condition; `bound`: variable -> its synset. `top`: `inroom` may stand here."""
        if isinstance(tree, Word) or not tree.parts or not isinstance(head := tree.parts[0], Word):
            raise self.error(
                tree, "is not a condition", "a condition is (PREDICATE OBJECT ...) or (and ...), (not ...) ..."
            )
        word, parts = head.text, tree.parts[1:]

        match word:
            case "and" | "or":
                made = tuple(self.condition(p, bound) for p in parts)
                return logic.And(made) if word == "and" else logic.Or(made)
            case "not":
                self.wants(tree, 1, "(not X)")
                return Not(self.condition(parts[0], bound))
            case "imply":
                self.wants(tree, 2, "(imply X Y)")
                return logic.implies(self.condition(parts[0], bound), self.condition(parts[1], bound))
            case "forall" | "exists":
                self.wants(tree, 2, f"({word} (?x - SYNSET) X)")
                variable, group = self.binding(parts[0])
                kind = logic.ForAll if word == "forall" else logic.Exists
                return kind(variable, group, self.condition(parts[1], {**bound, variable: group}))
            case "forn":
                self.wants(tree, 3, "(forn (N) (?x - SYNSET) X)")
                count, (variable, group) = self.count(parts[0]), self.binding(parts[1])
                return logic.ForN(count, variable, group, self.condition(parts[2], {**bound, variable: group}))
            case "forpairs":
                self.wants(tree, 3, "(forpairs (?x - SYNSET) (?y - SYNSET) X)")
                first, second = self.binding(parts[0]), self.binding(parts[1])
                return logic.ForPairs(first, second, self.condition(parts[2], {**bound, **dict([first, second])}))
            case "fornpairs":
                self.wants(tree, 4, "(fornpairs (N) (?x - SYNSET) (?y - SYNSET) X)")
                count, first, second = self.count(parts[0]), self.binding(parts[1]), self.binding(parts[2])
                body = self.condition(parts[3], {**bound, **dict([first, second])})
                return logic.ForNPairs(count, first, second, body)
        return self.atom(tree, head, parts, bound, top)

    def wants(self, tree: SyntaxGroup, count: int, form: str) -> None:
        """Checks how many parts follow the first word."""
        if len(tree.parts) - 1 != count:
            raise self.error(tree, f"expects {form}, has {len(tree.parts) - 1} parts")

    def atom(self, tree: SyntaxGroup, head: Word, parts: tuple[Tree, ...], bound: Collection[str], top: bool) -> Atom:
        if head.text not in self.predicates:
            raise self.error(head, f"is not a predicate of domain {self.domain}{_near(head.text, self.predicates)}")
        if len(parts) != (requested := self.predicates[head.text]):
            raise self.error(tree, f"takes {requested} arguments, has {len(parts)}")
        if head.text == IN_ROOM and not top:
            raise self.error(head, "is allowed in :init only")
        arguments = []
        for number, part in enumerate(parts):
            if not isinstance(part, Word):
                raise self.error(part, "is not an object")
            arguments.append(self.argument(part, bound, is_room=head.text == IN_ROOM and number == 1))
        return Atom(head.text, tuple(arguments))

    def argument(self, word: Word, bound: Collection[str], is_room: bool) -> str:
        if is_room or word.text in bound:
            return word.text
        name = word.text.removeprefix("?")
        if name not in self.names:
            kind = "a variable of a quantifier around it, or an object" if word.text.startswith("?") else "an object"
            raise self.error(word, f"is not {kind} of :objects{_near(name, self.names)}")
        return name

    def binding(self, tree: Tree) -> tuple[str, str]:
        match tree:
            case SyntaxGroup((Word(variable), Word("-"), Word(group) as synset)) if variable.startswith("?"):
                if group not in self.objects:
                    raise self.error(synset, f"is not a synset of :objects{_near(group, self.objects)}")
                return variable, group
        raise self.error(tree, "is not a variable with its synset", "write (?x - SYNSET)")

    def count(self, tree: Tree) -> int:
        word = tree.parts[0] if isinstance(tree, SyntaxGroup) and len(tree.parts) == 1 else tree
        if not isinstance(word, Word) or not word.text.isdecimal():
            raise self.error(tree, "is not a whole number")
        return int(word.text)

    def only_word(self, section: SyntaxGroup) -> str:
        match section.parts:
            case (_, Word(text)):
                return text
        raise self.error(section, "takes one name")

    def tolerates(self, at: Tree, what: str) -> bool:
        """Notes an oddity where these are passed over."""
        if self.tolerant:
            self.remarks.append(str(self.error(at, what)))
        return self.tolerant

    def error(self, at: Tree, problem: str, fix: str = "") -> BddlError:
        return error(self.file, at, problem, fix)


def _is(tree: Tree, word: str) -> bool:
    return isinstance(tree, Word) and tree.text == word


def _near(name: str, known: Iterable[str]) -> str:
    near = difflib.get_close_matches(name, list(known), n=3, cutoff=0.5)
    return f"; near matches: {', '.join(near)}" if near else ""
