"""A planning problem as PDDL, to inspect it or to give it to another planner.

`domain.pddl` has the primitives as actions (:adl), with hands as objects, since a robot has a number of them.
`problem.pddl` has what holds now, and the reading of the goal that the plan is for; the plan itself is a comment.
Two things are left out: an object that is cut stays one object, and placements say nothing of room and support.
"""

from __future__ import annotations

import pathlib
from collections.abc import Iterable, Sequence

from ig2mj.knowledge.substances import WATER
from ig2mj.planning.domain import Domain
from ig2mj.planning.facts import Facts
from ig2mj.planning.steps import PLACE
from ig2mj.planning.task_planner import TaskPlan
from ig2mj.predicates.logic import Atom
from ig2mj.sampling.conditions import Condition

DOMAIN = """\
(define (domain ig2mj)
  (:requirements :adl)
  (:types thing room hand substance)
  (:constants water - substance)
  (:predicates
    (free ?h - hand) (in_hand ?o - thing ?h - hand) (held ?o - thing)
    (inside ?o ?c - thing) (on_top ?o ?s - thing) (under ?o ?s - thing) (next_to ?o ?s - thing)
    (in_contact_with ?o ?s - thing) (on_floor ?o - thing ?r - room)
    (open ?o - thing) (toggled_on ?o - thing) (soaked ?o - thing) (dusty ?o - thing) (stained ?o - thing)
    (sliced ?o - thing) (cooked ?o - thing) (frozen ?o - thing)
    (filled ?o - thing ?l - substance) (contains ?o - thing ?l - substance) (container ?o - thing)
    (covered ?o - thing ?l - substance) (saturated ?o - thing ?l - substance) (absorbs ?o - thing)
    (sprays ?o - thing) (stirs ?o - thing) (part_of ?i ?l - substance)
    (attached ?o ?s - thing) (fits ?o ?s - thing)
    (openable ?o - thing) (switched ?o - thing) (tool ?o - thing) (knife ?o - thing) (tap ?o - thing)
    (heats ?s ?o - thing) (cools ?s ?o - thing) (acts_inside ?s - thing) (needs_switch ?s - thing)
    (needs_closed ?s - thing))

  (:action grasp :parameters (?o - thing ?h - hand)
    :precondition (and (free ?h) (not (held ?o))
      (forall (?c - thing) (imply (and (inside ?o ?c) (openable ?c)) (open ?c))))
    :effect (and (not (free ?h)) (in_hand ?o ?h) (held ?o)
      (forall (?x - thing) (and (not (inside ?o ?x)) (not (on_top ?o ?x)) (not (under ?o ?x)) (not (next_to ?o ?x))
        (not (next_to ?x ?o)) (not (in_contact_with ?o ?x)) (not (in_contact_with ?x ?o))))
      (forall (?r - room) (not (on_floor ?o ?r)))))
{places}
  (:action place_on_floor :parameters (?o - thing ?r - room ?h - hand)
    :precondition (in_hand ?o ?h)
    :effect (and (not (in_hand ?o ?h)) (not (held ?o)) (free ?h) (on_floor ?o ?r)))
  (:action release :parameters (?o - thing ?h - hand)
    :precondition (in_hand ?o ?h)
    :effect (and (not (in_hand ?o ?h)) (not (held ?o)) (free ?h)))
  (:action attach :parameters (?o ?s - thing ?h - hand)
    :precondition (and (in_hand ?o ?h) (fits ?o ?s))
    :effect (and (not (in_hand ?o ?h)) (not (held ?o)) (free ?h) (attached ?o ?s)))
  (:action push :parameters (?o ?s - thing ?h - hand)
    :precondition (free ?h)
    :effect (in_contact_with ?o ?s))
  (:action open :parameters (?o - thing ?h - hand)
    :precondition (and (openable ?o) (free ?h))
    :effect (open ?o))
  (:action close :parameters (?o - thing ?h - hand)
    :precondition (and (openable ?o) (free ?h))
    :effect (not (open ?o)))
  (:action toggle_on :parameters (?o - thing)
    :precondition (switched ?o)
    :effect (toggled_on ?o))
  (:action toggle_off :parameters (?o - thing)
    :precondition (switched ?o)
    :effect (not (toggled_on ?o)))
  (:action wipe :parameters (?o ?t - thing)
    :precondition (and (tool ?t) (held ?t))
    :effect (not (dusty ?o)))
  (:action soak :parameters (?o ?s - thing)
    :precondition (and (tap ?s) (held ?o) (or (toggled_on ?s) (not (switched ?s))))
    :effect (soaked ?o))
  (:action fill :parameters (?o ?s - thing)
    :precondition (and (tap ?s) (container ?o) (held ?o) (or (toggled_on ?s) (not (switched ?s))))
    :effect (and (filled ?o water) (contains ?o water)))
  (:action pour :parameters (?o ?t - thing ?l - substance)
    :precondition (and (held ?o) (contains ?o ?l))
    :effect (and (when (container ?t) (and (filled ?t ?l) (contains ?t ?l)))
      (when (and (absorbs ?t) (not (container ?t))) (saturated ?t ?l))
      (when (and (not (absorbs ?t)) (not (container ?t))) (covered ?t ?l))))
  (:action spray :parameters (?o ?s - thing ?l - substance ?h - hand)
    :precondition (and (held ?s) (sprays ?s) (contains ?s ?l) (free ?h))
    :effect (and (when (absorbs ?o) (saturated ?o ?l)) (when (not (absorbs ?o)) (covered ?o ?l))))
  (:action mix :parameters (?o ?t - thing ?l - substance)
    :precondition (and (container ?o) (stirs ?t) (held ?t)
      (forall (?i - substance) (imply (part_of ?i ?l) (contains ?o ?i))))
    :effect (and (contains ?o ?l) (forall (?i - substance) (when (part_of ?i ?l) (not (contains ?o ?i))))))
  (:action scrub :parameters (?o ?t - thing)
    :precondition (and (tool ?t) (held ?t) (soaked ?t))
    :effect (not (stained ?o)))
  (:action slice :parameters (?o ?k - thing)
    :precondition (and (knife ?k) (held ?k))
    :effect (sliced ?o))
  (:action cook :parameters (?o ?s - thing)
    :precondition (and (heats ?s ?o) (or (held ?o) (acts_inside ?s)) (imply (acts_inside ?s) (inside ?o ?s))
      (imply (needs_switch ?s) (toggled_on ?s)) (imply (needs_closed ?s) (not (open ?s))))
    :effect (cooked ?o))
  (:action freeze :parameters (?o ?s - thing)
    :precondition (and (cools ?s ?o) (inside ?o ?s) (imply (needs_switch ?s) (toggled_on ?s))
      (imply (needs_closed ?s) (not (open ?s))))
    :effect (frozen ?o)))
"""

_INTO = "(and (in_hand ?o ?h) (imply (openable ?s) (open ?s)))"

_PLACES = "\n".join(
    f"""\
  (:action {primitive} :parameters (?o ?s - thing ?h - hand)
    :precondition {_INTO if predicate == "inside" else "(in_hand ?o ?h)"}
    :effect (and (not (in_hand ?o ?h)) (not (held ?o)) (free ?h) ({predicate} ?o ?s)))"""
    for predicate, primitive in PLACE.items()
    if primitive.startswith("place_") and predicate != "on_floor"
)


def domain_pddl() -> str:
    """The domain: the same for all scenes and robots."""
    return DOMAIN.format(places=_PLACES)


def problem_pddl(name: str, facts: Facts, plan: TaskPlan) -> str:
    """The problem of one world.

    Args:
      name: of the problem. facts: of the world. plan: made of these facts.
    """
    domain = facts.domain
    tables = domain.model.tables
    conditions = list(dict.fromkeys(plan.required))
    named = {a for c in conditions for a in c.arguments} | {a for s in plan.steps for a in s.arguments}
    named |= set(facts.held)
    around = {c for n in named if n in tables.object_names for c in facts.containers(n)}
    things = [n for n in tables.object_names if n in named | around]
    rooms = [r for r in dict.fromkeys((*tables.room_names, *tables.object_names)) if r in named and r not in things]
    floors = [t for t in things if t in {c.arguments[1] for c in conditions if c.predicate == "on_floor"}]
    rooms += floors  # the home's floor object stands for any room
    things = [t for t in things if t not in floors]
    hands = [f"hand_{k}" for k in range(domain.hands)]
    liquids = {a for c in conditions for a in c.arguments if a not in c.objects}
    liquids |= {a for s in plan.steps for a in s.arguments if a not in s.things}
    parts = {s: domain.recipes(s)[0].inputs for s in sorted(liquids) if domain.recipes(s)}
    liquids |= {part for inputs in parts.values() for part in inputs}
    true = [a for a, value in facts.truth(_asked(domain, conditions, things, around, liquids)).items() if value]
    lines = [f"({a.predicate} {' '.join(a.arguments)})" for a in true]
    lines += [f"(in_hand {n} {hands[k]})" for k, n in enumerate(facts.held)]
    lines += [f"(held {n})" for n in facts.held]
    lines += [f"(free {hand})" for hand in hands[len(facts.held) :]]
    lines += [f"(openable {n})" for n in things if domain.opens(n)]
    for word, ability in (("switched", "toggleable"), ("tool", "cleaningTool"), ("knife", "slicer")):
        lines += [f"({word} {n})" for n in things if domain.has(n, ability)]
    lines += [f"(tap {n})" for n in things if n in domain.taps]
    lines += [f"(container {n})" for n in things if domain.contains(n)]
    lines += [f"(fits {n} {other})" for n in things for other in domain.attachable(n) if other in things]
    lines += [f"(sprays {n})" for n in things if n in domain.sprays]
    lines += [f"(stirs {n})" for n in things if n in domain.stirrers]
    lines += [f"(part_of {part} {s})" for s, inputs in parts.items() for part in inputs]
    lines += [f"(absorbs {n})" for n in things if domain.absorbs(n)]
    for source in (s for s in domain.sources if s.name in things):
        lines += [f"(heats {source.name} {n})" for n in things if source in domain.heaters(n)]
        lines += [f"(cools {source.name} {n})" for n in things if source in domain.coolers(n)]
        flags = {"acts_inside": source.acts_inside, "needs_switch": source.needs_switch}
        flags["needs_closed"] = source.needs_closed and domain.opens(source.name)
        lines += [f"({word} {source.name})" for word, is_so in flags.items() if is_so]
    goal = [str(c) for c in conditions]
    others = liquids - {WATER}  # a constant of the domain
    return "\n".join(
        [
            *(f"; {k + 1}. {step}" for k, step in enumerate(plan.steps)),
            f"(define (problem {name})",
            "  (:domain ig2mj)",
            f"  (:objects {' '.join(hands)} - hand",
            *([f"    {' '.join(things)} - thing"] if things else []),
            *([f"    {' '.join(rooms)} - room"] if rooms else []),
            *([f"    {' '.join(sorted(others))} - substance"] if others else []),
            "  )",
            *_section(":init", lines),
            *_section(":goal (and", goal, "))"),
            ")",
            "",
        ]
    )


def write_pddl(folder: pathlib.Path, name: str, facts: Facts, plan: TaskPlan) -> None:
    """Writes `domain.pddl` and `problem.pddl`; the folder is made where it is not there."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "domain.pddl").write_text(domain_pddl(), encoding="utf-8")
    (folder / "problem.pddl").write_text(problem_pddl(name, facts, plan), encoding="utf-8")


def _asked(
    domain: Domain,
    conditions: Sequence[Condition],
    things: Sequence[str],
    around: Iterable[str],
    liquids: Iterable[str],
) -> list[Atom]:
    """Atoms that are stated where they are true: those of the goal, and states, containers and contents of things."""
    atoms = [c.atom for c in conditions]
    atoms += [Atom(p, (t,)) for t in things for p in ("open", "toggled_on", "soaked", "dusty", "stained", "sliced")]
    atoms += [Atom("inside", (t, c)) for t in things for c in around if t != c]
    atoms += [Atom("contains", (t, s)) for t in things if domain.contains(t) for s in sorted(liquids)]
    return atoms


def _section(head: str, lines: Sequence[str], end: str = ")") -> list[str]:
    return [f"  ({head}", *(f"    {line}" for line in lines), f"  {end}"]
