"""Which primitive and which tool treat an object that an instruction says to clean, cook or slice, or to pour onto."""

from __future__ import annotations

from ig2mj.planning.domain import Domain
from ig2mj.planning.facts import Facts
from ig2mj.planning.steps import Step, make_step
from ig2mj.planning.supplies import held_substances, ingredients
from ig2mj.planning.words.nouns import NotUnderstoodError


def treatment(facts: Facts, kind: str, name: str, tool: str) -> Step:
    """The step that treats an object.

    Args:
      kind: a primitive, or "clean": the one that cleans what is on the object. tool: "": the first that can.

    Raises:
      NotUnderstoodError: the object cannot be treated so, or not with this tool, or nothing in the scene can do it.
    """
    domain = facts.domain
    if kind in ("clean", "wipe"):
        kind = _cleaning(facts, kind, name)
    (wish,) = Step(kind, (name, tool)).adds
    if reason := domain.impossible(wish):
        raise NotUnderstoodError(f"cannot {kind} {name}: {reason}")
    tools = {
        "wipe": domain.tools,
        "scrub": _brushes(domain),
        "slice": domain.knives,
        "soak": domain.taps,
        "fill": domain.taps,
        "cook": tuple(s.name for s in domain.heaters(name)) if kind == "cook" else (),
        "freeze": tuple(s.name for s in domain.coolers(name)) if kind == "freeze" else (),
    }[kind]
    able = [t for t in tools if t != name]
    if tool and tool not in able:
        raise NotUnderstoodError(f"'{tool}' cannot {kind} {name} (can: {', '.join(able) or 'nothing here'})")
    if not able:
        raise NotUnderstoodError(f"nothing here can {kind} {name}")
    return make_step(kind, (name, tool or able[0]))


def bringing(facts: Facts, kind: str, source: str, target: str, substance: str) -> Step:
    """The step that pours or sprays.

    Args:
      kind: pour or spray. source: what holds the substance; "": the first that can be carried. substance: "": what
        there is most of.

    Raises:
      NotUnderstoodError: nothing holds it, or it cannot be brought there.
    """
    domain = facts.domain
    usable = [n for n in (domain.sprays if kind == "spray" else domain.pourable) if n != target]
    if not substance:
        held = (held_substances(facts, n) for n in ([source] if source else usable))
        substance = next((found[0] for found in held if found), "")
    full = [n for n in usable if substance in held_substances(facts, n)]
    if not substance or not full or (source and source not in full):
        what = substance or "anything that flows"
        none = f"no {'spray' if kind == 'spray' else 'container'} that can be carried contains {what}"
        raise NotUnderstoodError(f"{source} does not contain {what}" if source in usable else none)
    first = source or full[0]
    step = domain.meant(make_step(kind, (first, target, substance) if kind == "pour" else (target, first, substance)))
    if reason := domain.impossible(step.adds[0]):
        raise NotUnderstoodError(f"cannot {kind} {target}: {reason}")
    return step


def stirring(facts: Facts, name: str, tool: str, substance: str) -> Step:
    """The step that stirs what a container holds.

    Args:
      tool: "": the first that can. substance: "": the first for which the container has what it takes.

    Raises:
      NotUnderstoodError: the container cannot contain it, nothing here stirs, or there is no recipe.
    """
    domain = facts.domain
    if not domain.contains(name):
        raise NotUnderstoodError(f"'{name}' is no container of substances")
    able = [s for s in domain.stirrers if s != name]
    if not able or (tool and tool not in able):
        raise NotUnderstoodError(f"{tool or 'nothing here'} {'cannot stir' if tool else 'stirs'}")
    ready = [s for s in domain.mixable if s == substance or not (substance or ingredients(facts, name, s))]
    if not ready:
        what = f"makes {substance}" if substance else f"is for what '{name}' contains"
        raise NotUnderstoodError(f"no recipe that is stirred {what}")
    return make_step("mix", (name, tool or able[0], ready[0]))


def _cleaning(facts: Facts, kind: str, name: str) -> str:
    """The primitive that cleans an object: by what is on it now, else by what can be and by the verb."""
    now = {p: facts.holds(predicate, name) for p, predicate in (("scrub", "stained"), ("wipe", "dusty"))}
    able = {"scrub": facts.domain.has(name, "stainable"), "wipe": facts.domain.has(name, "dustyable")}
    order = ("wipe", "scrub") if kind == "wipe" else ("scrub", "wipe")
    return next((p for p in order if now[p]), next((p for p in order if able[p]), order[0]))


def _brushes(domain: Domain) -> tuple[str, ...]:
    """Tools that scrub, brushes first."""
    tools = [t for t in domain.tools if domain.has(t, "soakable")]
    return tuple(sorted(tools, key=lambda t: "brush" not in t))
