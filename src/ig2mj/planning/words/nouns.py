"""Noun phrases: which objects of a scene words such as "both bowls in the kitchen" mean."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Callable, Collection, Iterable, Sequence

import numpy as np

from ig2mj.planning.facts import Facts
from ig2mj.planning.steps import PlanningError
from ig2mj.planning.words.verbs import FROM, RELATIONS

SYNONYMS = {
    "tv": ("standing tv",),
    "television": ("standing tv",),
    "telly": ("standing tv",),
    "counter": ("countertop",),
    "worktop": ("countertop",),
    "book": ("hardback", "notebook", "comic book"),
    "refrigerator": ("fridge",),
    "freezer": ("fridge",),
    "tap": ("sink",),
    "faucet": ("sink",),
    "couch": ("sofa",),
    "cupboard": ("cabinet",),
    "towel": ("dishtowel", "bath towel", "hand towel"),
    "cloth": ("rag", "dishtowel"),
    "rug": ("carpet",),
    "cooker": ("stove",),
    "hob": ("stove",),
    "pot": ("saucepan", "stockpot"),
    "bin": ("ashcan",),
    "can": ("canned food",),
    "plant": ("pot plant",),
    "shoe": ("gym shoe", "sneaker"),
    "closet": ("cabinet",),
    "bookshelf": ("shelf",),
}
"""Words of everyday English -> categories, of which the first that the scene has is meant."""

USUAL = {"table": ("breakfast table", "coffee table"), "chair": ("straight chair",), "lamp": ("table lamp",)}
"""Words that end the names of several categories -> those that are meant first."""

IRREGULAR = {"knives": "knife", "shelves": "shelf", "loaves": "loaf", "dishes": "dish", "people": "person"}

NUMBERS = dict(one=1, two=2, three=3, four=4, five=5, six=6, seven=7, eight=8, nine=9, ten=10)

PRONOUNS = ("it", "them", "they", "this", "that", "these", "those")

PARTS = ("drawer", "drawers", "door", "doors", "lid", "top", "button", "surface")
"""Parts of an object by which it is named: "every drawer of the cabinet"."""

IGNORED = frozenset(("wall", "walls", "floor", "floors", "ceiling", "ceilings"))
"""Categories of a house's shell that are not things to handle."""


class NotUnderstoodError(PlanningError):
    """Words of an instruction that have no meaning here; the message quotes them."""


@dataclasses.dataclass(frozen=True)
class Phrase:
    """A noun phrase that was read.

    Attributes:
      words: as they stand. candidates: names of objects that they may mean, in the scene's order.
      count: how many; 0: all; None: the one ("the mug").
      room: name of a room, where the words mean one. pronoun: "it": candidates are what was named before, last first.
    """

    words: str
    candidates: tuple[str, ...] = ()
    count: int | None = None
    room: str = ""
    pronoun: bool = False

    def without(self, names: Collection[str]) -> Phrase:
        return dataclasses.replace(self, candidates=tuple(c for c in self.candidates if c not in names))


def singular(word: str) -> Iterable[str]:
    """What a plural may be of."""
    if word in IRREGULAR:
        yield IRREGULAR[word]
    if word.endswith("ies"):
        yield word[:-3] + "y"
    if word.endswith("es"):
        yield word[:-2]
    if word.endswith("s") and not word.endswith("ss"):
        yield word[:-1]


class Lexicon:
    """Words for the objects and rooms of one world.

    Attributes:
      facts: what holds in it.
    """

    def __init__(self, facts: Facts):
        self.facts = facts
        tables = facts.domain.model.tables
        self.rooms: dict[str, str] = {}
        for name in tables.room_names:
            spoken = name.replace("_", " ")
            self.rooms.setdefault(spoken, name)
            self.rooms.setdefault(spoken.rsplit(" ", 1)[0], name)
        usable = ~np.asarray(tables.object_parked)
        pairs = zip(tables.object_names, tables.object_categories, usable, strict=True)
        self._category = {n: c.replace("_", " ") for n, c, free in pairs if free and c not in IGNORED}
        self._named = {spoken: n for n in self._category for spoken in (n, n.replace("_", " "))}
        self._known: dict[str, tuple[str, ...]] = {}

    def noun(self, words: Sequence[str]) -> tuple[tuple[str, ...], bool] | None:
        """Objects that words name, and whether the words are a plural; None: none."""
        text = " ".join(words)
        if text in self._named:
            return (self._named[text],), False
        if found := self._called(text):
            return found, False
        for single in singular(words[-1]):
            if found := self._called(" ".join((*words[:-1], single))):
                return found, True
        return None

    def _called(self, text: str) -> tuple[str, ...]:
        """Objects of the category, of one that ends with these words, or of what they are another word for."""
        if text not in self._known:
            self._known[text] = self._look_up(text)
        return self._known[text]

    def _look_up(self, text: str) -> tuple[str, ...]:
        exact = tuple(n for n, c in self._category.items() if c == text)
        ends = exact or tuple(n for n, c in self._category.items() if c.endswith(" " + text))
        if ends:
            first = USUAL.get(text, ())
            return tuple(n for c in first for n in ends if self._category[n] == c) or ends
        for other in SYNONYMS.get(text, ()):
            if found := self._called(other):
                return found
        return ()

    def in_room(self, names: Sequence[str], room: str) -> tuple[str, ...]:
        """Those of some objects that are in a room."""
        return tuple(n for n in names if self.facts.room(n) == room)

    def related(self, predicate: str, names: Sequence[str], other: str) -> tuple[str, ...]:
        """Those of some objects that are in a relation to another."""
        return tuple(n for n in names if n != other and self.facts.holds(predicate, n, other))

    def loose(self) -> tuple[str, ...]:
        """All objects that can be carried."""
        return tuple(n for n in self._category if not self.facts.domain.fixed(n))

    def near(self, words: Sequence[str], others: Iterable[str] = ()) -> str:
        """Words that are written nearly like the first of some that has such, for a message."""
        known = {w for c in self._category.values() for w in (c, c.rsplit(" ", 1)[-1])} | {*self.rooms, *others}
        each = (difflib.get_close_matches(w, sorted(known), n=2, cutoff=0.7) for w in words if len(w) > 3)
        found = next((f for f in each if f), [])
        return f" (did you mean {' or '.join(found)}?)" if found else ""


class Reader:
    """Reads noun phrases from a list of words.

    Attributes:
      words: of the sentence, with separators. at: the next one.
    """

    def __init__(self, lexicon: Lexicon, words: Sequence[str]):
        self.lexicon, self.words, self.at = lexicon, list(words), 0

    def sees(self, text: str) -> bool:
        parts = text.split()
        return self.words[self.at : self.at + len(parts)] == parts

    def take(self, *texts: str) -> str:
        """The first of these texts that stands here, which is passed; "": none."""
        for text in texts:
            if self.sees(text):
                self.at += len(text.split())
                return text
        return ""

    @property
    def word(self) -> str:
        return self.words[self.at] if self.at < len(self.words) else ""

    def phrase(self, mentioned: Sequence[Phrase]) -> Phrase | None:
        """The noun phrase that stands here; None: none, and nothing is passed."""
        began = self.at
        found = self._phrase(mentioned)
        if found is None:
            self.at = began
        return found

    def _phrase(self, mentioned: Sequence[Phrase]) -> Phrase | None:
        began = self.at
        if self.take("everything", "all things", "all objects", "anything"):
            return self._modified(Phrase("everything", self.lexicon.loose(), 0), required=True)
        if self.word in PRONOUNS and (pronoun := self._pronoun(mentioned)):
            return pronoun
        count, definite = self._determiner()
        if self.word in PARTS and self.words[self.at + 1 : self.at + 2] == ["of"]:
            self.at += 2
            whole = self._phrase(mentioned)
            return whole and dataclasses.replace(whole, count=None)
        if definite and self.word in ("door", "lid", "drawer") and mentioned and not self._of_rooms():
            opens = [c for p in mentioned[::-1] for c in p.candidates if self.lexicon.facts.domain.opens(c)]
            if opens:
                self.at += 1
                return Phrase(self.word, (opens[0],))
        room = self._room_before_noun()
        for length in range(min(4, len(self.words) - self.at), 0, -1):
            spoken = self.words[self.at : self.at + length]
            if noun := self.lexicon.noun(spoken):
                self.at += length
                names, plural = noun
                names = (self.lexicon.in_room(names, room) or names) if room else names
                if count is None and plural:
                    count = 0
                return self._modified(Phrase(" ".join(self.words[began : self.at]), names, count))
            if " ".join(spoken) in self.lexicon.rooms:
                self.at += length
                return Phrase(" ".join(spoken), room=self.lexicon.rooms[" ".join(spoken)])
        return None

    def _of_rooms(self) -> bool:
        """The door of a room follows: "the door to the kitchen"."""
        return any(" ".join(self.words[self.at + 1 : self.at + k]) in ("to the", "of the") for k in (3,))

    def _pronoun(self, mentioned: Sequence[Phrase]) -> Phrase | None:
        many = self.word in ("them", "they", "these", "those")
        after = self.words[self.at + 1 : self.at + 2]
        if self.word not in ("it", "them", "they") and after and self.lexicon.noun(after):
            return None  # "this mug"
        things = [p for p in mentioned if p.candidates]
        if not things:
            raise NotUnderstoodError(f"'{self.word}' stands for nothing that was named before")
        self.at += 1
        if not many:
            recent = dict.fromkeys(c for p in things[::-1] for c in p.candidates[:1])
            return Phrase("it", tuple(recent), 1, pronoun=True)
        several = [p for p in things if len(p.candidates) > 1]
        if several:
            return dataclasses.replace(several[-1], count=0)
        return Phrase("them", tuple(dict.fromkeys(c for p in things for c in p.candidates)), 0)

    def _determiner(self) -> tuple[int | None, bool]:
        """How many, and whether it is a certain one."""
        if self.take("all of the", "all the", "all of", "all", "every", "each of the", "each", "any"):
            return 0, False
        if self.take("both of the", "both the", "both"):
            return 2, False
        if self.take("one of the", "a", "an", "some", "another"):
            return 1, False
        certain = bool(self.take("the", "my", "your", "our", "this", "that", "these", "those"))
        if self.word in NUMBERS or self.word.isdigit():
            number = NUMBERS.get(self.word) or int(self.word)
            self.at += 1
            return number, certain
        return None, certain

    def _room_before_noun(self) -> str:
        """ "kitchen" of "kitchen cabinet", "dining" of "dining table"."""
        for room, name in self.lexicon.rooms.items():
            for spoken in (room, room.split()[0]):
                length = len(spoken.split())
                rest = self.words[self.at + length : self.at + length + 3]
                named = any(self.lexicon.noun(rest[:k]) for k in range(len(rest), 0, -1))
                if self.sees(spoken) and named and not self.lexicon.noun(self.words[self.at : self.at + length + 1]):
                    self.at += length
                    return name
        return ""

    def _modified(self, phrase: Phrase, required: bool = False) -> Phrase:
        """With "in the kitchen", "that is on the table", "from the living room" after it.

        Args:
          required: "on the table" belongs to the phrase without "that is", too.
        """
        began = self.at
        said = bool(self.take("that is", "that are", "which is", "which are", "that's", "lying", "standing"))
        relation = self.take(*sorted(RELATIONS, key=len, reverse=True), "of", "from")
        if not relation:
            self.at = began
            return phrase
        self.take("the")
        room = self._room()
        if room and relation in ("in", "inside", "of", "from"):
            found = self.lexicon.in_room(phrase.candidates, room)
            if not found:
                raise NotUnderstoodError(f"there is no {phrase.words} in {room}")
            return dataclasses.replace(phrase, candidates=found)
        if (said or required) and not room:
            other = self._phrase(())
            predicates = ("inside", "on_top") if relation == "from" else (RELATIONS.get(relation, "to"),)
            if other is not None and other.candidates and "to" not in predicates:
                found = tuple(
                    n for p in predicates for n in self.lexicon.related(p, phrase.candidates, other.candidates[0])
                )
                if not found:
                    raise NotUnderstoodError(f"nothing is {relation} {other.words}")
                return dataclasses.replace(phrase, candidates=found)
        self.at = began
        if required:
            raise NotUnderstoodError(f"'{phrase.words}' needs a place, such as 'everything on the table'")
        return phrase

    def _room(self) -> str:
        for length in (3, 2, 1):
            spoken = " ".join(self.words[self.at : self.at + length])
            if spoken in self.lexicon.rooms:
                rest = self.words[self.at + length : self.at + length + 1]
                if rest and self.lexicon.noun(rest):
                    return ""  # "in the kitchen sink"
                self.at += length
                return self.lexicon.rooms[spoken]
        return ""

    def source(self) -> str:
        """A preposition of where something is taken from."""
        return self.take(*FROM)


Suits = Callable[[str], bool]


def choose(phrase: Phrase, suits: Suits, notes: list[str]) -> tuple[str, ...]:
    """The objects that a phrase means.

    Args:
      suits: whether an object can be meant, where several may be. notes: gets a line for each free choice.

    Raises:
      NotUnderstoodError: there are fewer than were asked for.
    """
    able = tuple(c for c in phrase.candidates if suits(c)) or phrase.candidates
    if phrase.count == 0:
        return able
    number = phrase.count or 1
    if len(able) < number:
        raise NotUnderstoodError(f"'{phrase.words}': there are {len(able)}")
    if len(able) > number and not phrase.pronoun:
        notes.append(f"'{phrase.words}': took {', '.join(able[:number])} of {', '.join(able)}")
    return able[:number]
