"""`Step` and `Outcome`: a request to a primitive, and its result. `PRIMITIVES` lists all primitives.

A primitive is named by a verb. Its arguments are names of objects or rooms of the scene, the object that it acts on
first. It ends when a predicate holds, not when a position is reached.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from ig2mj.errors import Ig2mjError, UnknownNameError
from ig2mj.sampling.conditions import Condition

REASONS = {
    "no_base": "no free floor from which the robot reaches it",
    "no_grasp": "no hand can take hold of it: out of reach, shut in, too heavy, or the hands are full",
    "no_path": "no path there without a collision",
    "slipped": "the hand lost what it held",
    "not_true_after": "the motion ended and the condition is false",
    "timeout": "the time limit passed",
}
"""Why a primitive fails."""


class PlanningError(Ig2mjError):
    """A goal that cannot be planned for, or a request that no primitive of the robot can carry out."""


class UnsupportedPrimitive(PlanningError):
    """A primitive that the robot lacks something for, which the error names."""


@dataclasses.dataclass(frozen=True)
class Primitive:
    """One primitive.

    Attributes:
      name: verb. arguments: what each argument is. before: what must hold first. until: what ends it with success.
      adds: conditions that hold afterwards, with `?0`, `?1` for the arguments, and names of substances.
      one_of: conditions of which one holds afterwards; which, the step says itself (`Step.also`, `Domain.meant`).
    """

    name: str
    arguments: tuple[str, ...]
    before: str
    until: str
    adds: tuple[tuple[str, ...], ...] = ()
    one_of: tuple[tuple[str, ...], ...] = ()

    @property
    def makes(self) -> tuple[str, ...]:
        """Predicates of the conditions that hold afterwards, or are false."""
        return tuple(template[template[0] == "not"] for template in (*self.adds, *self.one_of))


_PRIMITIVES = (
    Primitive(
        "navigate_to", ("object",), "a path over free floor", "the robot stands where its hands reach the object"
    ),
    Primitive(
        "grasp", ("object",), "a free hand, or both for what one does not lift; the object is not shut in",
        "a hand holds the object, or both do",
    ),
    Primitive(
        "place_on_top", ("object", "support"), "the object is in a hand", "on_top(object, support)",
        (("on_top", "?0", "?1"),),
    ),
    Primitive(
        "place_inside", ("object", "container"), "the object is in a hand; the container is open",
        "inside(object, container)", (("inside", "?0", "?1"),),
    ),
    Primitive(
        "place_next_to", ("object", "other"), "the object is in a hand", "next_to(object, other)",
        (("next_to", "?0", "?1"),),
    ),
    Primitive(
        "place_under", ("object", "other"), "the object is in a hand", "under(object, other)",
        (("under", "?0", "?1"),),
    ),
    Primitive(
        "place_on_floor", ("object", "room"), "the object is in a hand", "on_floor(object, room)",
        (("on_floor", "?0", "?1"),),
    ),
    Primitive("release", ("object",), "the object is in a hand", "no hand holds the object"),
    Primitive("open", ("object",), "a free hand", "open(object)", (("open", "?0"),)),
    Primitive("close", ("object",), "a free hand", "not open(object)", (("not", "open", "?0"),)),
    Primitive("toggle_on", ("object",), "a free finger", "toggled_on(object)", (("toggled_on", "?0"),)),
    Primitive("toggle_off", ("object",), "a free finger", "not toggled_on(object)", (("not", "toggled_on", "?0"),)),
    Primitive(
        "wipe", ("object", "tool"), "the cleaning tool is in a hand", "not dusty(object)", (("not", "dusty", "?0"),)
    ),
    Primitive(
        "soak", ("object", "source"), "the object is in a hand; the water runs", "soaked(object)", (("soaked", "?0"),)
    ),
    Primitive(
        "scrub", ("object", "tool"), "the soaked cleaning tool is in a hand", "not stained(object)",
        (("not", "stained", "?0"),),
    ),
    Primitive(
        "fill", ("object", "source"), "the object, a container, is in a hand, nothing is in it; the water runs",
        "filled(object, water)",
        (("filled", "?0", "water"),),
    ),
    Primitive("slice", ("object", "knife"), "the knife is in a hand", "sliced(object)", (("sliced", "?0"),)),
    Primitive(
        "cook", ("object", "source"), "the source is on; the object is in a hand, or inside a source that acts inside",
        "cooked(object), never burnt(object)", (("cooked", "?0"),),
    ),
    Primitive(
        "freeze", ("object", "source"), "the object is inside the source, which is closed", "frozen(object)",
        (("frozen", "?0"),),
    ),
    Primitive(
        "push", ("object", "other"), "a free hand", "in_contact_with(object, other)",
        (("in_contact_with", "?0", "?1"),),
    ),
    Primitive(
        "pour", ("object", "target", "substance"), "the object, which contains the substance, is in a hand",
        "contains(target, substance); of what absorbs, saturated; of anything else, covered",
        one_of=(
            ("contains", "?1", "?2"), ("filled", "?1", "?2"), ("saturated", "?1", "?2"), ("covered", "?1", "?2"),
        ),
    ),
    Primitive(
        "spray", ("object", "spray", "substance"),
        "the spray, which contains the substance, is in a hand; another hand is free",
        "covered(object, substance); of what absorbs, saturated",
        one_of=(("covered", "?0", "?2"), ("saturated", "?0", "?2")),
    ),
    Primitive(
        "attach", ("object", "other"), "the object is in a hand", "attached(object, other); the hand lets go of it",
        (("attached", "?0", "?1"),),
    ),
    Primitive(
        "mix", ("object", "tool", "substance"),
        "the tool, which stirs, is in a hand; the object contains what a recipe of the substance takes",
        "contains(object, substance)", (("contains", "?0", "?2"),),
    ),
)  # fmt: skip

SUBSTANCE = "substance"
"""What an argument is that names neither an object nor a room."""

PRIMITIVES: dict[str, Primitive] = {p.name: p for p in _PRIMITIVES}

PLACE = {
    "inside": "place_inside",
    "on_top": "place_on_top",
    "under": "place_under",
    "next_to": "place_next_to",
    "in_contact_with": "push",
    "on_floor": "place_on_floor",
}
"""Primitive that makes a placement true; of several conditions on one object the first of this order is the rule, the
others are checked."""


@dataclasses.dataclass(frozen=True)
class Step:
    """A request to a primitive.

    Attributes:
      primitive: name of one of `PRIMITIVES`. arguments: names of objects and rooms.
      also: further conditions on the object that is placed, or that gets a substance, which must hold afterwards, too.
      serves: the condition of the goal that it is for; None: it was asked for by itself.
      flat: a placement lays the object on its flattest side, since it is to bear something.
    """

    primitive: str
    arguments: tuple[str, ...]
    also: tuple[Condition, ...] = ()
    serves: Condition | None = None
    flat: bool = False

    @property
    def object(self) -> str:
        """Name of the object that it acts on."""
        return self.arguments[0]

    @property
    def things(self) -> tuple[str, ...]:
        """Its arguments without substances: objects and rooms."""
        roles = PRIMITIVES[self.primitive].arguments
        return tuple(a for a, role in zip(self.arguments, roles, strict=True) if role != SUBSTANCE)

    @property
    def adds(self) -> tuple[Condition, ...]:
        """Conditions that hold when it is done, those of `also` among them."""
        found = [self.condition(template) for template in PRIMITIVES[self.primitive].adds]
        return (*found, *(c for c in self.also if c not in found))

    def condition(self, template: Sequence[str]) -> Condition:
        """A template of its primitive with its arguments."""
        value = template[0] != "not"
        name, *places = template if value else template[1:]
        return Condition(name, tuple(map(self._argument, places)), value)

    def _argument(self, word: str) -> str:
        return self.arguments[int(word[1:])] if word.startswith("?") else word

    def __str__(self) -> str:
        return " ".join((self.primitive, *self.arguments))


def make_step(primitive: str, arguments: Sequence[str]) -> Step:
    """A step, checked.

    Raises:
      UnknownNameError: no such primitive. PlanningError: too many or too few arguments.
    """
    if primitive not in PRIMITIVES:
        raise UnknownNameError("primitive", primitive, PRIMITIVES)
    required = PRIMITIVES[primitive].arguments
    if len(arguments) != len(required):
        raise PlanningError(
            f"primitive '{primitive}' takes {' and '.join(required)}, not {len(arguments)} "
            f"argument{'s' * (len(arguments) != 1)}"
        )
    return Step(primitive, tuple(arguments))


@dataclasses.dataclass(frozen=True)
class Outcome:
    """How a primitive ended.

    Attributes:
      reason: a key of `REASONS`, or "" for success. detail: more about a failure, in words.
      time: simulated seconds that it took. attempts: tries within the primitive.
      planning: processor seconds that planning its motion took.
    """

    reason: str = ""
    detail: str = ""
    time: float = 0.0
    attempts: int = 1
    planning: float = 0.0

    @property
    def done(self) -> bool:
        """It succeeded."""
        return not self.reason
