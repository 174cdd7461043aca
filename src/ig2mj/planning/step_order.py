"""In which order the literals of a reading are made true: what depends on what comes first.

1. what is opened for its own sake; what is cut, cleaned, soaked, cooked, filled and covered, where it stands;
2. what is taken away, then what is placed: supports before what they bear, large things before small ones;
3. what is attached;
4. what is frozen;
5. what is switched and shut.

What a hand holds already comes before, and what has failed several times comes last.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence

from ig2mj.planning.domain import Domain
from ig2mj.planning.steps import PLACE
from ig2mj.sampling.conditions import Condition

LATER, GIVE_UP = 2, 6
"""Failures of a condition after which the others come first, and after which no step is planned for it."""

FIRST = ("sliced", "dusty", "stained", "soaked", "saturated", "cooked", "contains", "filled", "covered")
"""Predicates that come before placements, in this order."""


def ordered(
    missing: Sequence[Condition],
    failed: Mapping[Condition, int],
    held: Collection[str],
    tool: Callable[[Condition], str],
    domain: Domain,
    begun: Condition | None = None,
    stuck: Collection[Condition] = (),
    ajar: Callable[[str], float] = lambda name: 0.0,
) -> list[Condition]:
    """Conditions in the order in which they are made true, without those that failed `GIVE_UP` times.

    Args:
      missing: conditions that are false. failed: how often steps of a condition failed. held: what hands hold.
      tool: what cleans or cuts for a condition. begun: condition that the last step was for; it is gone on with if a
        hand holds one of its objects, or it has failed before, since its steps change what others need. stuck:
        conditions that failed in the world as it is now; they come after the others. ajar: share of its range to which
        an object is open, 0 to 1. Those that are shut come in this order: of a door that stands wide open the leaf is
        within reach only in the room that it opens into, in which a robot that shuts it is shut in.
    """
    targets = list(dict.fromkeys(c.arguments[-1] for c in missing))
    first = sorted((c for c in missing if c.predicate in FIRST), key=lambda c: FIRST.index(c.predicate))
    places = [c for c in missing if c.predicate in PLACE]
    places.sort(key=lambda c: (failed.get(c, 0), targets.index(c.arguments[-1]), -domain.volume(c.arguments[0])))
    away = [c for c in places if not c.value]
    down = supports_first([c for c in places if c.value])
    attached = [c for c in missing if c.predicate == "attached"]
    frozen = [c for c in missing if c.predicate == "frozen"]
    opens = [c for c in missing if c.predicate == "open" and c.value]
    switches = [c for c in missing if c.predicate == "toggled_on"]
    shut = sorted((c for c in missing if c.predicate == "open" and not c.value), key=lambda c: ajar(c.arguments[0]))
    order = [*opens, *first, *away, *down, *attached, *frozen, *switches, *shut]
    in_hand = [c for c in order if c.arguments[0] in held and c.predicate in (*PLACE, *FIRST, "attached")]
    tools = [c for c in order if c.predicate in ("dusty", "stained", "sliced") and tool(c) in held]
    order = list(dict.fromkeys([*tools, *in_hand, *order]))
    tried = [c for c in order if failed.get(c, 0) < GIVE_UP]

    def goes_on(c: Condition) -> bool:
        return c == begun and (failed.get(c, 0) > 0 or (c.predicate in PLACE and any(a in held for a in c.arguments)))

    return sorted(tried, key=lambda c: (not goes_on(c), c in stuck, failed.get(c, 0) >= LATER))


def supports_first(places: Sequence[Condition]) -> list[Condition]:
    """Placements, what bears before what it bears, what is next to a container after what fills it, else in the given
    order."""
    import networkx  # 90 ms that importing ig2mj.Simulation does not spend

    graph = networkx.DiGraph()
    graph.add_nodes_from(dict.fromkeys(c.arguments[0] for c in places))
    for c in places:
        if c.arguments[-1] in graph and c.predicate != "next_to":
            graph.add_edge(c.arguments[-1], c.arguments[0])
    for c in places:  # neighbours come after their partners, where nothing says otherwise
        a, b = c.arguments
        if c.predicate == "next_to" and b in graph and not networkx.has_path(graph, a, b):
            graph.add_edge(b, a)
    for c in places:  # what is next to a container after what goes into that: it may be carried elsewhere to be filled
        for d in places if c.predicate == "next_to" else ():
            a, b = d.arguments[0], c.arguments[0]
            fills = d.predicate == "inside" and d.arguments[1] in c.arguments and a not in c.arguments
            if fills and b != d.arguments[1] and not networkx.has_path(graph, b, a):
                graph.add_edge(a, b)
    given = {name: k for k, name in enumerate(graph)}
    try:
        names = list(networkx.lexicographical_topological_sort(graph, key=given.__getitem__))
    except networkx.NetworkXUnfeasible:
        names = list(graph)
    return sorted(places, key=lambda c: names.index(c.arguments[0]))
