"""What a category can do: its abilities with every parameter filled in."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any, Literal

from ig2mj.errors import UnknownNameError
from ig2mj.knowledge.ability_table import ABILITIES, Ability
from ig2mj.knowledge.further import further_categories
from ig2mj.knowledge.overrides import Changes, Overrides, shipped_overrides
from ig2mj.knowledge.taxonomy import synset, taxonomy

Compat = Literal["paper", "igibson"]
Abilities = dict[str, dict[str, float | bool]]


def abilities(
    category: str, model: str | None = None, *, compat: Compat = "paper", overrides: Overrides | None = None
) -> Abilities:
    """The abilities of a category, in alphabetical order, each with all of its parameters.

    A parameter's value comes from, the later the stronger: the default in `ability_table.ABILITIES` (iGibson's state
    constructors, paper tables A.1 and A.4), the taxonomy, the shipped `overrides.json` (its category, then its model),
    then `overrides` likewise. With compat="igibson", iGibson's hard-coded exceptions follow the taxonomy (floors are
    dusty and stained above 0.75). Temperatures are degrees Celsius, heating rates 1/s, lengths metres, forces newtons.

    Args:
      category: iGibson category, or one of `further_categories`. Others have no abilities but those of an override.
      model: model name within the category, for overrides per model.
      compat: "paper", or "igibson" for the code's rule where the two differ (docs/design/rules.md).
      overrides: a project's own, from `load_overrides`.

    Returns:
      {ability: {parameter: value}}, a copy. At most one of heatSource and coldSource: both are the same state, and
      the alphabetically first one wins (iGibson's factory.py).
    """
    found = {name: dict(parameters) for name, parameters in _shipped(category, model, compat)}
    if overrides is not None:
        _change(found, overrides, category, model, compat)
        found = _settle(found)
    return found


def abilities_of_synset(name: str) -> Abilities:
    """The abilities that the taxonomy gives a synset, defaults filled in. Raises UnknownNameError."""
    if name not in taxonomy():
        raise UnknownNameError("synset", name, taxonomy())
    return _settle({a: _numbers(p) for a, p in taxonomy()[name].abilities.items()})


def required_states(ability: str) -> tuple[str, ...]:
    """Extended states that an object with this ability carries (table A.2). Raises UnknownNameError.

    Table A.2 gives every heat source the toggled state; in the data it is optional, and a fridge has none
    (`requires_toggled_on` says which; docs/design/rules.md#sources).
    """
    return _ability(ability).states


def required_links(ability: str, parameters: Mapping[str, float | bool] | None = None) -> tuple[str, ...]:
    """Kinds of annotated links that a model with this ability must have (table A.3). Raises UnknownNameError.

    Table A.3 asks every heat source for its link. Given the ability's `parameters`, the rule is iGibson's: a source
    that acts on what is inside it (an oven) does not need the link.
    """
    links = _ability(ability).links
    if parameters is not None and parameters.get("requires_inside"):
        return tuple(link for link in links if link != "heat_source")
    return links


def predicate(ability: str) -> str | None:
    """The logical predicate an ability makes meaningful (cookable: "cooked"), or None. Raises UnknownNameError."""
    return _ability(ability).predicate


@functools.cache
def _shipped(
    category: str, model: str | None, compat: Compat
) -> tuple[tuple[str, tuple[tuple[str, float | bool], ...]], ...]:
    name = synset(category)
    given = further_categories().get(category, {}) if name is None else taxonomy()[name].abilities
    found: Abilities = {a: _numbers(p) for a, p in given.items()}
    _change(found, shipped_overrides(), category, model, compat)
    return tuple((a, tuple(p.items())) for a, p in _settle(found).items())


def _change(found: Abilities, overrides: Overrides, category: str, model: str | None, compat: Compat) -> None:
    """Applies overrides to `found`, in place."""
    steps: list[Changes] = [overrides.compat.get(compat, {}).get(category, {}), overrides.categories.get(category, {})]
    if model is not None:
        steps.append(overrides.models.get(f"{category}/{model}", {}))
    for changes in steps:
        for ability, parameters in changes.items():
            if parameters is None:
                found.pop(ability, None)
            else:
                found.setdefault(ability, {}).update(_numbers(parameters))


def _settle(found: Abilities) -> Abilities:
    """Alphabetical order, defaults filled in, heatSource gone where there is a coldSource."""
    if "coldSource" in found:
        found.pop("heatSource", None)
    return {name: {**_defaults(name), **found[name]} for name in sorted(found)}


def _defaults(ability: str) -> Mapping[str, float | bool]:
    return ABILITIES[ability].defaults if ability in ABILITIES else {}


def _numbers(parameters: Mapping[str, Any]) -> dict[str, float | bool]:
    return {name: value if isinstance(value, bool) else float(value) for name, value in parameters.items()}


def _ability(name: str) -> Ability:
    if name not in ABILITIES:
        raise UnknownNameError("ability", name, ABILITIES)
    return ABILITIES[name]
