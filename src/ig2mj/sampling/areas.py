"""Where an object may be put so that several conditions hold: the areas of one condition, narrowed by the others."""

from __future__ import annotations

from collections.abc import Sequence

from ig2mj.predicates.literals import object_index, room_index
from ig2mj.sampling.conditions import Condition
from ig2mj.sampling.placement import Areas, holding_at_once
from ig2mj.sampling.query import SceneQuery
from ig2mj.sampling.rules import PLACEMENTS, elsewhere, next_to, on_floor
from ig2mj.sampling.rules.borne_by import borne_by
from ig2mj.states.model import StateModel

WITHOUT_CONTACT = frozenset(("inside", "next_to", "under"))
"""Placements that can be evaluated before the object has come to rest."""


def areas_for(query: SceneQuery, model: StateModel, name: str, requested: Sequence[Condition]) -> Areas:
    """Areas for an object of which placements are requested together."""
    index = object_index(model, name)
    rule, others = _proposing(requested)
    if rule.predicate == "on_floor":
        second = room_index(model, rule.arguments[1])
    else:
        second = object_index(model, rule.other_than(name))
    if rule.value and rule.predicate == "next_to":
        areas = next_to.beside(query, second, None, looks=rule.arguments[0] == name)
    else:
        areas = (PLACEMENTS[rule.predicate] if rule.value else elsewhere.areas)(query, index, second)
    for other in others:
        if other.predicate == "on_floor":
            areas = on_floor.within(areas, query, room_index(model, other.arguments[1]))
        elif other.predicate == "next_to":
            neighbour = object_index(model, other.other_than(name))
            areas = next_to.narrowed(areas, query, neighbour, looks=other.arguments[0] == name)
        elif rule.predicate == "next_to" and other.predicate in ("inside", "on_top"):
            bearer = object_index(model, other.arguments[1])
            areas = borne_by(areas, query, bearer, loose=other.predicate == "inside")
    if rule.predicate == "next_to" and all(c.predicate in WITHOUT_CONTACT for c in requested):
        return holding_at_once(areas)
    return areas


def _proposing(requested: Sequence[Condition]) -> tuple[Condition, list[Condition]]:
    """The condition that proposes places, and those that narrow them: a neighbour says most precisely where."""
    if not requested[0].value:
        return requested[0], []
    needed = [c for c in requested if c.value]
    inner = any(c.predicate in ("inside", "on_top") for c in needed)
    rule = next((c for c in needed if inner and c.predicate == "next_to"), needed[0])
    return rule, [c for c in needed if c is not rule]
