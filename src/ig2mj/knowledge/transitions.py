"""Transition rules: what contents of a container, and objects in it, become. A table in a data file, extensible.

A file is a list of rules, which apply in its order:

    [{"name": "syrup", "from": ["granulated_sugar", "water"], "makes": "sugar_syrup", "temperature": 80}]

A rule applies in a container that contains every input, and then turns all of them into `makes`. An input is a
substance in use, or else an object in the container of that kind (`stands_for`); {"raw_egg": 2, "flour": 1} in place
of a list asks for numbers of objects. `makes` is a substance, at equal volume; with `count` it is so many objects that
do not exist yet (`real`). `temperature` is the least of the container, `cold` the most, Celsius; `stir`: a stirrer
touches the container, or it is a mixing machine that is switched on.

"*" in `from` and `makes` stands for any substance, or for any object: {"from": ["*"], "makes": "cooked__*"}. An object
melts into `melted__*` wherever it is warm enough, and with `cut` a blade turns it into `makes`.
"""

from __future__ import annotations

import dataclasses
import functools
import os
import pathlib
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from ig2mj.errors import InputError, UnknownNameError
from ig2mj.files.content import read_json
from ig2mj.knowledge.substances import DERIVED, substance, substances

ANY = "*"

COOKED, DICED, MELTED = "cooked__", "diced__", "melted__"

HALF = "half_"
"""Beginning of categories of halves."""

STIRRERS = ("spoon", "soup_ladle", "spatula", "tablefork", "tongs", "dipper", "straw", "chopstick", "toothbrush")
"""Categories of objects that mix what is in a container when they touch it."""

MIXERS = ("blender", "coffee_maker", "electric_mixer", "food_processor", "waffle_iron", "crock_pot")
"""Categories of containers that mix what is in them while they are switched on."""

WASHERS = ("washer", "dishwasher")
"""Categories of machines that take water from the main and wash what is in them while they are on."""

DRYERS = ("clothes_dryer", "dryer")
"""Categories of machines that dry what is in them while they are on."""

MOST_MADE = 16
"""Objects that one application of a rule makes, at most."""


@dataclasses.dataclass(frozen=True)
class Transition:
    """One rule.

    Attributes:
      inputs: names of substances. output: that they become. temperature: Celsius, -inf: none is asked for. stir: it
        takes a stirrer, or a mixing machine that is on. objects: kinds of objects that it uses up, with numbers.
        count: objects that it makes; 0: `output` is a substance. cold: Celsius at most, inf: none is asked for.
        cut: a blade does it.
    """

    name: str
    inputs: tuple[str, ...]
    output: str
    temperature: float = -float("inf")
    stir: bool = False
    objects: tuple[tuple[str, int], ...] = ()
    count: int = 0
    cold: float = float("inf")
    cut: bool = False

    @property
    def needs(self) -> tuple[str, ...]:
        """All inputs by name, objects last."""
        return (*self.inputs, *(kind for kind, _ in self.objects))

    @property
    def of_single_objects(self) -> bool:
        """Whether it is of one object wherever it is, in a container or not."""
        return not self.inputs and not self.count and (self.cut or self.output.startswith(MELTED))


_added: list[Transition] = []


def transitions() -> tuple[Transition, ...]:
    """All rules, shipped ones first; `ANY` is not expanded, and inputs without numbers are in `inputs`."""
    return (*_shipped(), *_added)


def stands_for(kind: str, category: str) -> bool:
    """Whether objects of a category are of the kind that a rule names: "onion" is a "vidalia_onion", too; so are
    halves."""
    name = category.removeprefix(HALF)
    return kind in (name, category) or (not kind.startswith(DERIVED) and kind.endswith(f"_{name}"))


def transitions_of(names: Sequence[str], categories: Collection[str] = ()) -> tuple[Transition, ...]:
    """The rules that some substances and objects can need.

    Args:
      names: substances in use. categories: of the objects that are there.

    Returns:
      Rules whose inputs and output are all among them, `ANY` expanded. An input that is no substance in use is an
      object.
    """
    known = set(categories)
    found: list[Transition] = []
    for rule in transitions():
        for expanded in _expanded(rule, names):
            split = _split(expanded, names, known)
            if split is not None:
                found.append(split)
    return tuple(found)


def _expanded(rule: Transition, names: Sequence[str]) -> list[Transition]:
    if rule.inputs != (ANY,):
        return [rule]
    prefix = rule.output.removesuffix(ANY)
    bases = [name.removeprefix(prefix) for name in names if name.startswith(prefix)]
    return [dataclasses.replace(rule, inputs=(base,), output=f"{prefix}{base}") for base in bases]


def _split(rule: Transition, names: Collection[str], known: Collection[str]) -> Transition | None:
    """The rule with its inputs as substances and objects; None: something is missing."""
    if rule.count:
        if not any(stands_for(rule.output, category) for category in known):
            return None
    elif rule.output not in names:
        return None
    numbers = dict(rule.objects)
    inputs, objects = list[str](), list[tuple[str, int]]()
    for name in dict.fromkeys(rule.needs):
        if name in names and not rule.cut:
            inputs.append(name)
        elif not rule.output.startswith(COOKED) and any(stands_for(name, category) for category in known):
            objects.append((name, numbers.get(name, 1)))
        else:
            return None
    if rule.output in inputs:
        return None
    return dataclasses.replace(rule, inputs=tuple(inputs), objects=tuple(objects))


def sources_of(name: str) -> tuple[str, ...]:
    """What the first rule that makes a substance or a kind of objects needs; none where no rule does."""
    return next(iter(recipes_of(name)), ())


def recipes_of(name: str) -> list[tuple[str, ...]]:
    """What each rule that makes a substance or a kind of objects needs."""
    found = [rule.needs for rule in transitions() if rule.inputs != (ANY,) and rule.output == name]
    for rule in transitions():
        if rule.inputs != (ANY,):
            continue
        prefix = rule.output.removesuffix(ANY)
        base = name.removeprefix(prefix)
        if name.startswith(prefix) and base and (prefix != COOKED or base in substances() or recipes_of(base)):
            found.append((base,))
    return found


def is_makeable(name: str, given: Collection[str] | None = None) -> bool:
    """Whether rules make a substance or a kind of objects, perhaps one after another.

    Args:
      given: names of substances and kinds of objects that are there; None: all that no rule makes.
    """
    return intermediates(name, given) is not None


def intermediates(name: str, given: Collection[str] | None = None) -> tuple[str, ...] | None:
    """What is made on the way to something that rules make; None: they cannot make it. Arguments: `is_makeable`."""
    return _on_the_way(name, None if given is None else frozenset(given), frozenset())


def _on_the_way(name: str, given: frozenset[str] | None, open_: frozenset[str]) -> tuple[str, ...] | None:
    for needs in recipes_of(name):
        found: dict[str, None] = {}
        for need in needs:
            if given is not None and (need in given or any(stands_for(need, g.replace("__", "_")) for g in given)):
                continue
            inner = None if need in open_ else _on_the_way(need, given, open_ | {name})
            if inner is not None:
                found |= dict.fromkeys((*inner, need))
            elif given is not None or need in open_:
                break
        else:
            return tuple(found)
    return None


def makes_objects(name: str) -> bool:
    """Whether a rule makes objects of this kind."""
    return any(rule.count and rule.output == name for rule in transitions())


def load_transitions(file: str | os.PathLike) -> tuple[str, ...]:
    """Adds a file's rules for the rest of this process; their names.

    Raises:
      InputError: the file cannot be read, or a rule is wrong; it names the rule.
    """
    found = _read(read_json(file, fix="name a JSON file of transition rules"), file)
    taken = {rule.name for rule in transitions()}
    for rule in found:
        if rule.name in taken:
            raise InputError(file, "has the name of a rule that is known", element=rule.name, fix="rename it")
        taken.add(rule.name)
    _added.extend(found)
    return tuple(rule.name for rule in found)


@functools.cache
def _shipped() -> tuple[Transition, ...]:
    file = pathlib.Path(__file__).with_name("transitions.json")
    return tuple(_read(read_json(file), file))


def _read(said: Any, file: str | os.PathLike) -> list[Transition]:
    if not isinstance(said, list):
        raise InputError(file, "must be a list of rules")
    return [_rule(entry, number, file) for number, entry in enumerate(said)]


KEYS = ("name", "from", "makes", "temperature", "cold", "stir", "count", "objects", "cut")


def _rule(entry: Any, number: int, file: str | os.PathLike) -> Transition:
    element = f"rule {number}"
    if not isinstance(entry, Mapping) or not set(entry) <= set(KEYS) or not {"name", "from", "makes"} <= set(entry):
        raise InputError(file, f"needs name, from and makes, and may have {', '.join(KEYS[3:])}", element=element)
    name, said, output = entry["name"], entry["from"], entry["makes"]
    if not isinstance(name, str) or not isinstance(output, str):
        raise InputError(file, "has a name or a 'makes' that is no text", element=element)
    element = f"rule '{name[:60]}'"
    numbers = dict(said) if isinstance(said, Mapping) else {}
    inputs = list(said) if isinstance(said, Mapping | list) else said
    if not isinstance(inputs, list) or not inputs or not all(isinstance(i, str) for i in inputs):
        raise InputError(file, "makes something of nothing: 'from' must be a list of names", element=element)
    if not all(_is_count(n) and n >= 1 for n in numbers.values()):
        raise InputError(file, "has a number of objects that is no whole number from 1", element=element)
    if (ANY in output) != (inputs == [ANY]) or (inputs != [ANY] and ANY in inputs):
        raise InputError(file, f"has '{ANY}' in one of 'from' and 'makes' only", element=element)
    if ANY in output and output.replace(ANY, "") not in DERIVED:
        raise InputError(file, f"makes '{output}': one of {', '.join(d + ANY for d in DERIVED)}", element=element)
    temperature, cold = entry.get("temperature", -float("inf")), entry.get("cold", float("inf"))
    stir, count, cut = entry.get("stir", False), entry.get("count", 0), entry.get("cut", False)
    if not _is_number(temperature) or not _is_number(cold) or not isinstance(stir, bool) or not isinstance(cut, bool):
        raise InputError(file, "has a temperature that is no number, or a stir that is no truth", element=element)
    if not _is_count(count) or not 0 <= count <= MOST_MADE:
        raise InputError(file, f"has a count that is no whole number up to {MOST_MADE}", element=element)
    objects = entry.get("objects", [])  # inputs that are objects and no substances
    if not isinstance(objects, list) or not set(map(str, objects)) <= set(inputs):
        raise InputError(file, "has 'objects' that are not among its inputs", element=element)
    of_substances = [i for i in inputs if i not in objects and i not in numbers]
    for required in (*of_substances, *(() if count else (output,))) if ANY not in output else ():
        try:
            made = substance(required)
        except UnknownNameError as e:
            raise InputError(file, str(e), element=element) from e
        if not made.has_volume:
            raise InputError(file, f"'{required}' covers objects, and is never in a container", element=element)
    if output in inputs:
        raise InputError(file, f"makes {output} of itself", element=element)
    counted = tuple((i, int(numbers.get(i, 1))) for i in inputs if i in objects or i in numbers)
    plain = tuple(i for i in inputs if i not in dict(counted))
    return Transition(name, plain, output, float(temperature), stir, counted, count, float(cold), cut)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_count(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)
