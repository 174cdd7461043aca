"""`understand`: the steps that an instruction in plain words asks for."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Sequence

from ig2mj.knowledge.substances import WATER
from ig2mj.planning.facts import Facts
from ig2mj.planning.steps import PRIMITIVES, Step, make_step
from ig2mj.planning.words.instruction import Instruction
from ig2mj.planning.words.nouns import Lexicon, NotUnderstoodError, Phrase, Reader, choose
from ig2mj.planning.words.treatment import bringing, stirring, treatment
from ig2mj.planning.words.verbs import (
    ADJECTIVES,
    CARRY,
    FILLERS,
    FROM,
    GET,
    LONGEST,
    OPENERS,
    PUT,
    RELATIONS,
    VERBS,
    base_forms,
)
from ig2mj.sampling.conditions import Condition

MOST_WORDS = 200
"""Words of an instruction; more is not an instruction."""

PLACES = {
    "inside": "place_inside",
    "on_top": "place_on_top",
    "next_to": "place_next_to",
    "under": "place_under",
    "in_contact_with": "push",
}

ONTO = ("into", "inside", "in", "onto", "on top of", "on", "over", "to")
"""Prepositions of where something is poured."""

_TOKEN = re.compile(r"[\w'-]+|[.,;:!?]")
_ENDS = frozenset(".;:!?")


def understand(text: str, facts: Facts) -> Instruction:
    """The steps that an instruction asks for, over the objects of a scene.

    Args:
      text: English, such as "put the apple into the fridge and close it". facts: what holds at the start; "the mug in
        the kitchen" and "everything on the table" are looked up in it.

    Raises:
      NotUnderstoodError: quotes what has no meaning, and names near words.
    """
    words = _TOKEN.findall(text.lower().replace("’", "'"))
    if not any(w[0].isalnum() for w in words):
        raise NotUnderstoodError("the instruction is empty")
    if len(words) > MOST_WORDS:
        raise NotUnderstoodError(f"the instruction has {len(words)} words; give at most {MOST_WORDS}")
    return _Clauses(Lexicon(facts), words).read(text)


class _Clauses:
    """Reads clauses one after another."""

    def __init__(self, lexicon: Lexicon, words: Sequence[str]):
        self.lexicon, self.reader = lexicon, Reader(lexicon, words)
        self.domain = lexicon.facts.domain
        self.steps: list[Step] = []
        self.notes: list[str] = []
        self.mentioned: list[Phrase] = []
        self.taken: list[str] = []  # objects that the clause before took, and left without a place
        self.kind = ""
        self.room_steps: list[Step] = []  # "take it to the kitchen": for those that no later step places

    def read(self, text: str) -> Instruction:
        reader = self.reader
        while True:
            self._skip()
            if reader.at >= len(reader.words):
                break
            self._clause()
        return Instruction(text, tuple(self._without_means()), tuple(dict.fromkeys(self.notes)))

    def _skip(self) -> None:
        """Passes separators, fillers and polite openings."""
        reader = self.reader
        while reader.at < len(reader.words):
            if reader.word in _ENDS or reader.word in (",", "and") or reader.word in FILLERS:
                reader.at += 1
            elif not reader.take(*sorted(OPENERS, key=len, reverse=True)):
                return

    def _fillers(self) -> None:
        while self.reader.word in FILLERS and not self.reader.sees("next to"):
            self.reader.at += 1

    def _verb(self) -> str:
        """The kind of the verb that stands here, which is passed; "": none."""
        reader = self.reader
        for length in range(LONGEST, 0, -1):
            words = reader.words[reader.at : reader.at + length]
            if len(words) < length:
                continue
            for first in base_forms(words[0]):
                if kind := VERBS.get((first, *words[1:])):
                    reader.at += length
                    return kind
        return ""

    def _clause(self) -> None:
        began = self.reader.at
        kind = self._verb()
        if not kind:
            kind = self.kind  # "... and the watch on the table": the verb of the clause before
            phrase = self.reader.phrase(self.mentioned) if kind in (PUT, CARRY) else None
            self.reader.at = began
            if phrase is None:
                raise self._unknown()
        if kind == "want":
            kind = self._verb() or PUT
        self.kind = kind
        self._fillers()
        if kind in (PUT, CARRY, GET):
            self._move(kind)
        elif kind == "make":
            self._make()
        elif kind == "turn":
            self._turn()
        elif kind == "navigate_to":
            self._fillers()
            self.reader.take("over to", "to", "towards", "into", "over")
            self._each("navigate_to", self._objects())
        elif kind == "pour":
            self._pour()
        elif kind == "spray":
            self._spray()
        elif kind == "mix":
            self._mix()
        else:
            self._treat(kind)

    def _unknown(self, expected: str = "") -> NotUnderstoodError:
        word = self.reader.word
        if not word or word in _ENDS or word in (",", "and"):
            return NotUnderstoodError(f"the sentence ends where {expected or 'a verb'} should follow")
        verbs = [" ".join(v) for v in VERBS]
        rest = []
        for w in self.reader.words[self.reader.at :]:
            if w in _ENDS or w in (",", "and"):
                break
            rest.append(w)
        what = " ".join(rest[:4])
        where = f" as {expected}" if expected else ""
        return NotUnderstoodError(f"'{what}' is not understood{where}{self.lexicon.near(rest[:4], verbs)}")

    def _objects(
        self, expected: str = "an object", single: bool = False, mentioned: Sequence[Phrase] | None = None
    ) -> list[Phrase]:
        """A list of noun phrases: "the plate, the bowl and a mug".

        Args:
          single: just one, since what follows "and" is another clause. mentioned: what "it" may be; None: all that was.
        """
        reader, found = self.reader, []
        while True:
            self._fillers()
            phrase = reader.phrase(self.mentioned if mentioned is None else mentioned)
            if phrase is None:
                raise self._unknown(expected)
            found.append(phrase)
            if single or not self._more():
                return found

    def _more(self) -> bool:
        """Whether another noun phrase of a list follows, after its separator, which is passed."""
        reader, began = self.reader, self.reader.at
        while reader.word in (",", "and", "as") or reader.sees("well as"):
            reader.at += 1 + reader.sees("well as")
        if reader.at == began:
            return False
        start = reader.at
        verb = self._verb()
        reader.at = start
        if not verb and reader.word not in FILLERS and reader.phrase(self.mentioned) is not None:
            reader.at = start
            return True
        reader.at = began
        return False

    def _names(self, phrases: Sequence[Phrase], predicate: str = "", *others: str) -> list[str]:
        """The objects that phrases mean; of several, those that can be so."""
        found = []
        for phrase in phrases:
            if not phrase.candidates:
                raise NotUnderstoodError(f"'{phrase.words}' is a room, and an object was expected")
            names = choose(phrase, lambda n: self._can(predicate, n, others), self.notes)
            self.mentioned.append(dataclasses.replace(phrase, candidates=names, count=0, pronoun=False))
            found.extend(names)
        return list(dict.fromkeys(found))

    def _can(self, predicate: str, name: str, others: Sequence[str] = ()) -> bool:
        if not predicate:
            return True
        if predicate == "held":
            return not self.domain.fixed(name)
        if predicate == "container":
            return self.domain.opens(name) or name in self.domain.taps
        return not self.domain.impossible(Condition(predicate, (name, *others), True))

    def _each(self, primitive: str, phrases: Sequence[Phrase]) -> None:
        """A primitive of one argument on each object, those that can be so."""
        predicate = next(iter(PRIMITIVES[primitive].makes), "")
        for name in self._names(phrases, predicate):
            if predicate and (reason := self.domain.impossible(Condition(predicate, (name,), True))):
                raise NotUnderstoodError(f"cannot {primitive} {name}: {reason}")
            self.steps.append(make_step(primitive, (name,)))

    # Kinds of clauses.

    def _make(self) -> None:
        self.reader.take("that")
        objects = self._objects()
        self.reader.take("is", "are", "be", "to be", "gets", "get")
        self.reader.take("turned", "switched")
        kind = ADJECTIVES.get(self.reader.word)
        if kind is None:
            raise self._unknown("a state")
        self.reader.at += 1
        self._do(kind, objects)

    def _turn(self) -> None:
        objects = self._objects()
        particle = self.reader.take("on", "off")
        if not particle:
            raise self._unknown("'on' or 'off'")
        self._each(f"toggle_{particle}", objects)

    def _treat(self, kind: str) -> None:
        self.reader.take("off", "down")
        self._do(kind, self._objects())

    def _do(self, kind: str, objects: Sequence[Phrase]) -> None:
        """A primitive on objects, with the tool or the source that follows."""
        reader = self.reader
        if kind in ("push", "attach"):
            names = self._names(objects)
            if not reader.take("against", "up to", "to", "towards", "onto", "into", "on", "in"):
                raise self._unknown("'to' or 'against'")
            (other,) = self._target()
            self.steps.extend(make_step(kind, (n, other)) for n in names)
            for wish in (w for step in self.steps[-len(names) :] for w in step.adds if kind == "attach"):
                if reason := self.domain.impossible(wish):
                    raise NotUnderstoodError(f"cannot attach {wish.arguments[0]}: {reason}")
            return
        if kind in PRIMITIVES and len(PRIMITIVES[kind].arguments) == 1:
            self._each(kind, objects)
            return
        names = self._names(objects, PRIMITIVES[kind].makes[0] if kind in ("cook", "freeze", "slice") else "")
        self._fillers()
        reader.take("clean", "dry")
        if kind == "fill":
            reader.take(f"with {WATER}")
        said = self._with(kind)
        for name in names:
            self.steps.append(treatment(self.lexicon.facts, kind, name, said))

    def _pour(self) -> None:
        """ "the milk into the mug", "water from the jug over the plant", "the jug into the bowl"."""
        reader, facts = self.reader, self.lexicon.facts
        substance, source = self._substance(), ""
        if not substance:
            (source,) = self._names(self._objects("a container or a substance", single=True), "held")[:1]
        elif reader.take(*FROM):
            (source,) = self._names(self._objects("a container", single=True), "held")[:1]
        self._fillers()
        if not reader.take(*ONTO):
            raise self._unknown("'into' or 'over'")
        (target,) = self._target(moved=[source])
        self.steps.append(bringing(facts, "pour", source, target, substance))
        self.mentioned.append(Phrase("it", (target,), 0))

    def _spray(self) -> None:
        """ "the plant with water", "water onto the plant", "the plant with the atomizer"."""
        reader, spray = self.reader, ""
        if substance := self._substance():
            reader.take(*ONTO)
            targets = self._names(self._objects())
        else:
            targets = self._names(self._objects())
            if reader.take("with") and not (substance := self._substance(last=True)):
                (spray,) = self._names(self._objects("a spray or a substance", single=True), "held")[:1]
        self.steps.extend(bringing(self.lexicon.facts, "spray", spray, target, substance) for target in targets)

    def _mix(self) -> None:
        """ "lemonade in the bowl", "the bowl with the spoon", "the bowl into lemonade"."""
        reader, tool = self.reader, ""
        substance = self._substance(last=True)
        if substance and not reader.take("in", "inside"):
            raise self._unknown("'in'")
        (name,) = self._target() if substance else self._names(self._objects("a container", single=True))[:1]
        if not substance and reader.take("into", "to"):
            substance = self._substance(last=True)
        if reader.take("with", "using"):
            (tool,) = self._names(self._objects("what stirs", single=True), "held")[:1]
        self.steps.append(stirring(self.lexicon.facts, name, tool, substance))
        self.mentioned.append(Phrase("it", (name,), 0))

    def _substance(self, last: bool = False) -> str:
        """A substance in use that is named here, which is passed; "": none.

        Args:
          last: nothing need follow; else where it goes or comes from.
        """
        reader, began = self.reader, self.reader.at
        used = self.domain.model.substances
        reader.take("the", "some", "a bit of", "some of the", "all of the", "all the")
        for name in sorted(() if used is None else used.names, key=len, reverse=True):
            if reader.take(name.replace("_", " ").replace("  ", " ")):
                if last or any(map(reader.sees, (*FROM, *ONTO))):
                    return name
                break
        reader.at = began
        return ""

    def _with(self, kind: str) -> str:
        """The tool or source that is named after an object; "": none."""
        tools = ("with", "using", "by")
        places = ("in", "on", "under", "inside", "with", "at", "using")
        reader = self.reader
        if kind in ("wipe", "scrub", "clean", "slice") and reader.take(*tools):
            return self._names(self._objects("a tool", single=True))[0]
        if kind in ("cook", "freeze", "soak", "fill") and reader.take(*places, "from"):
            return self._names(self._objects("a place", single=True))[0]
        return ""

    def _move(self, kind: str) -> None:
        """An object, where it is taken from, and where it goes."""
        reader = self.reader
        objects = self._objects()
        if reader.take("with"):  # "set the table with four plates"
            what = self._names(self._objects("an object"), "held")
            (where,) = self._names(objects[:1])
            self.steps.extend(make_step("place_on_top", (name, where)) for name in what)
            return
        self._fillers()
        objects = self._taken_from(objects)
        self._fillers()
        relation = self._relation()
        names = self._names(objects, "held")
        if not relation:
            if kind == PUT and not self._again(names):
                raise self._unknown("a place")
            if kind != PUT:
                self.steps.extend(make_step("grasp", (n,)) for n in names)
            return
        if relation == "floor":
            room = self._room_of_floor(names)
            self.steps.extend(make_step("place_on_floor", (n, room)) for n in names)
            return
        if relation == "it":  # "put the bowl inside"
            inside = [c for p in self.mentioned[::-1] for c in p.candidates if self._can("container", c)]
            if not inside:
                raise NotUnderstoodError("'inside' stands for nothing that was named before")
            self.steps.extend(make_step("place_inside", (n, inside[0])) for n in names)
            return
        if relation == "to" and (room := self._to_room()):
            self.room_steps.extend(make_step("place_on_floor", (n, room)) for n in names)
            self.steps.extend(self.room_steps[-len(names) :])
            return
        (where,) = self._target("container" if relation == "inside" else "", names)
        if relation == "to":
            relation = "inside" if self._can("container", where) else "on_top"
        self.steps.extend(make_step(PLACES[relation], (n, where)) for n in names)
        self.mentioned.append(Phrase("it", tuple(names), 0))  # "it" is what was moved rather than its place

    def _again(self, names: Sequence[str]) -> bool:
        """ "put it down": the object is in a hand, and its place is not said."""
        held = [n for n in names if n in self.lexicon.facts.held]
        self.steps.extend(make_step("release", (n,)) for n in held)
        return bool(held)

    def _taken_from(self, objects: Sequence[Phrase]) -> list[Phrase]:
        """ "off the shelf": of several objects, those that are there."""
        if not self.reader.source():
            return list(objects)
        if self.reader.word in ("", ",", "and") or self.reader.word in _ENDS:
            return list(objects)
        place = self._objects("a place", single=True)[0]
        found = []
        for phrase in objects:
            there = phrase.candidates
            if place.room:
                there = self.lexicon.in_room(there, place.room)
            else:
                there = tuple(
                    n
                    for n in there
                    if any(self.lexicon.facts.holds(p, n, c) for c in place.candidates for p in ("inside", "on_top"))
                )
            found.append(dataclasses.replace(phrase, candidates=there or phrase.candidates))
        self.mentioned.append(place)
        return found

    def _relation(self) -> str:
        reader = self.reader
        if reader.take("on the floor", "onto the floor", "to the floor", "on the ground"):
            return "floor"
        if reader.word in ("inside", "in") and (
            reader.at + 1 >= len(reader.words) or reader.words[reader.at + 1] in (*_ENDS, ",", "and")
        ):
            reader.at += 1
            return "it"
        text = reader.take(*sorted(RELATIONS, key=len, reverse=True))
        return RELATIONS[text] if text else ""

    def _room_of_floor(self, names: Sequence[str]) -> str:
        if self.reader.take("of the", "in the", "of", "in") and (phrase := self.reader.phrase(())) and phrase.room:
            return phrase.room
        return self.lexicon.facts.room(names[0])

    def _to_room(self) -> str:
        began = self.reader.at
        phrase = self.reader.phrase(self.mentioned)
        if phrase is not None and phrase.room:
            return phrase.room
        self.reader.at = began
        return ""

    def _target(self, predicate: str = "", moved: Sequence[str] = ()) -> list[str]:
        """The one object that something is placed at."""
        others = [p for m in self.mentioned if (p := m.without(moved)).candidates]
        phrase = self._objects("a place", single=True, mentioned=others)[0].without(moved)
        if phrase.count == 0 and len(phrase.candidates) > 1:
            raise NotUnderstoodError(f"'{phrase.words}' are several places; name one")
        return self._names([phrase], predicate)[:1]

    # The end.

    def _without_means(self) -> list[Step]:
        """Steps without those that only lead to a later one on the same object: taking what is then placed."""
        found = []
        for k, step in enumerate(self.steps):
            later = {s.object for s in self.steps[k + 1 :]}
            means = step.primitive in ("grasp", "navigate_to") or any(step is s for s in self.room_steps)
            if not (means and step.object in later):
                found.append(step)
        return found
