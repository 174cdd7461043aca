"""Assigning objects of an activity to objects of a home: bipartite matching, and a search over rooms."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

Match = dict[str, str]
"""Object of the activity -> what it is bound to."""


def match(candidates: Mapping[str, Sequence[str]]) -> Match:
    """A largest matching that gives each key one of its candidates, no candidate twice (augmenting paths).

    Keys and candidates that come first are preferred, so that equal input gives equal output.
    """
    owner: dict[str, str] = {}
    for key in sorted(candidates, key=lambda k: len(candidates[k])):
        _augment(key, candidates, owner, set())
    found = {key: value for value, key in owner.items()}
    return {key: found[key] for key in candidates if key in found}


def _augment(key: str, candidates: Mapping[str, Sequence[str]], owner: dict[str, str], seen: set[str]) -> bool:
    for value in candidates[key]:
        if value not in seen:
            seen.add(value)
            if value not in owner or _augment(owner[value], candidates, owner, seen):
                owner[value] = key
                return True
    return False


def search_rooms(
    clusters: Sequence[Sequence[str]],
    rooms: Sequence[str],
    fits: Callable[[Mapping[str, Sequence[str]]], int | None],
) -> dict[str, list[str]] | None:
    """Distributes clusters of objects over rooms, so that as few as possible are used.

    Args:
      clusters: objects that must be in one room. rooms: in order of preference.
      fits: room -> the objects in it; how many objects must be added for it, or None where it cannot be.

    Returns:
      room -> its objects, or None: it cannot be done. Of distributions over equally many rooms the one with the fewest
      additions is taken, of those the first.
    """
    best: tuple[int, int, dict[str, list[str]]] | None = None
    waiting: list[dict[str, list[str]]] = [{}]
    numbers = [0]
    while waiting:  # depth first; the first room of the last cluster is taken up first
        given, number = waiting.pop(), numbers.pop()
        cost = fits(given)
        if cost is None or (best is not None and (len(given), cost) >= best[:2]):
            continue  # more objects in a room never make it easier
        if number == len(clusters):
            best = (len(given), cost, given)
            continue
        for room in reversed(rooms):
            waiting.append({**given, room: [*given.get(room, []), *clusters[number]]})
            numbers.append(number + 1)
    return None if best is None else best[2]


def clusters_of(names: Sequence[str], pairs: Sequence[tuple[str, str]]) -> list[list[str]]:
    """Names joined by pairs, as lists in the order of `names`; pairs with other names are passed over."""
    leader = {name: name for name in names}

    for a, b in pairs:
        if a in leader and b in leader:
            first, second = _root(leader, a), _root(leader, b)
            leader[second] = first
    found: dict[str, list[str]] = {}
    for name in names:
        found.setdefault(_root(leader, name), []).append(name)
    return list(found.values())


def _root(leader: dict[str, str], name: str) -> str:
    while leader[name] != name:
        name = leader[name]
    return name
