"""Transition rules: what the contents of a container become. A table in a data file, which a project's own may extend.

A file is a list of rules, which apply in its order:

    [{"name": "syrup", "from": ["granulated_sugar", "water"], "makes": "sugar_syrup", "temperature": 80}]

A rule applies in a container that contains every substance of `from`, and then turns all of them into `makes`, at equal
volume. `temperature` is the least of the container, Celsius; `stir`: a stirrer touches the container, or it is a mixing
machine that is switched on. "*" in `from` and `makes` stands for any substance: {"from": ["*"], "makes": "cooked__*"}.
"""

from __future__ import annotations

import dataclasses
import functools
import os
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

from ig2mj.errors import InputError, UnknownNameError
from ig2mj.files.content import read_json
from ig2mj.knowledge.substances import DERIVED, substance, substances

ANY = "*"

STIRRERS = ("spoon", "soup_ladle", "spatula", "tablefork", "tongs", "dipper", "straw", "chopstick", "toothbrush")
"""Categories of objects that mix what is in a container when they touch it."""

MIXERS = ("blender", "coffee_maker")
"""Categories of containers that mix what is in them while they are switched on."""


@dataclasses.dataclass(frozen=True)
class Transition:
    """One rule.

    Attributes:
      inputs: names of substances. output: that they become. temperature: Celsius, -inf: none is asked for. stir: it
        takes a stirrer, or a mixing machine that is on.
    """

    name: str
    inputs: tuple[str, ...]
    output: str
    temperature: float = -float("inf")
    stir: bool = False


_added: list[Transition] = []


def transitions() -> tuple[Transition, ...]:
    """All rules, shipped ones first; `ANY` is not expanded."""
    return (*_shipped(), *_added)


def transitions_of(names: Sequence[str]) -> tuple[Transition, ...]:
    """The rules whose inputs and output are all among some substances, `ANY` expanded."""
    found: list[Transition] = []
    for rule in transitions():
        for name in names if rule.inputs == (ANY,) else (ANY,):
            inputs = (name,) if rule.inputs == (ANY,) else rule.inputs
            output = rule.output.replace(ANY, name)
            if output in names and set(inputs) <= set(names) and output not in inputs:
                found.append(dataclasses.replace(rule, inputs=inputs, output=output))
    return tuple(found)


def sources_of(name: str) -> tuple[str, ...]:
    """Substances from which the first rule that makes a substance makes it; none where no rule does."""
    for rule in transitions():
        if rule.inputs != (ANY,):
            if rule.output == name:
                return rule.inputs
        elif name.startswith(prefix := rule.output.replace(ANY, "")):
            base = name.removeprefix(prefix)
            if base in substances() or sources_of(base):
                return (base,)
    return ()


def is_makeable(name: str) -> bool:
    """Whether a rule makes a substance."""
    return bool(sources_of(name))


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


def _rule(entry: Any, number: int, file: str | os.PathLike) -> Transition:
    element = f"rule {number}"
    known = {"name", "from", "makes", "temperature", "stir"}
    if not isinstance(entry, Mapping) or not set(entry) <= known or not {"name", "from", "makes"} <= set(entry):
        raise InputError(file, "needs name, from and makes, and may have temperature and stir", element=element)
    name, inputs, output = entry["name"], entry["from"], entry["makes"]
    if not isinstance(name, str) or not isinstance(output, str):
        raise InputError(file, "has a name or a 'makes' that is no text", element=element)
    element = f"rule '{name[:60]}'"
    if not isinstance(inputs, list) or not inputs or not all(isinstance(i, str) for i in inputs):
        raise InputError(file, "makes something of nothing: 'from' must be a list of substances", element=element)
    if (ANY in output) != (inputs == [ANY]) or (inputs != [ANY] and ANY in inputs):
        raise InputError(file, f"has '{ANY}' in one of 'from' and 'makes' only", element=element)
    if ANY in output and output.replace(ANY, "") not in DERIVED:
        raise InputError(file, f"makes '{output}': one of {', '.join(d + ANY for d in DERIVED)}", element=element)
    temperature, stir = entry.get("temperature", -float("inf")), entry.get("stir", False)
    if isinstance(temperature, bool) or not isinstance(temperature, int | float) or not isinstance(stir, bool):
        raise InputError(file, "has a temperature that is no number, or a stir that is no truth", element=element)
    for required in (*inputs, output) if ANY not in output else ():
        try:
            made = substance(required)
        except UnknownNameError as e:
            raise InputError(file, str(e), element=element) from e
        if not made.has_volume:
            raise InputError(file, f"'{required}' covers objects, and is never in a container", element=element)
    if output in inputs:
        raise InputError(file, f"makes {output} of itself", element=element)
    return Transition(name, tuple(inputs), output, float(temperature), stir)
