"""The taxonomy: which synset an iGibson category stands for, and what is a kind of what.

Read from `hierarchy_owned.json` of bddl 1.0.1: a tree of `{name, igibson_categories, abilities, children}`. The same
synset may occur in several places of the tree, always with the same data, so that by name it is a directed graph
without cycles. Every category belongs to one synset; halves (`half_apple`) share the whole's.
"""

from __future__ import annotations

import dataclasses
import functools
import json
from typing import Any

from ig2mj.errors import InputError, UnknownNameError
from ig2mj.knowledge.bddl_data import bddl_folder
from ig2mj.knowledge.overrides import shipped_overrides


@dataclasses.dataclass(frozen=True)
class Node:
    """One synset: its categories, its abilities as the file gives them, the synsets directly below and above it."""

    name: str
    categories: tuple[str, ...]
    abilities: dict[str, dict[str, Any]]
    children: frozenset[str]
    parents: frozenset[str]


@functools.cache
def taxonomy() -> dict[str, Node]:
    """Synset name -> Node, the whole taxonomy. Read once. Raises InputError if the file is not what it should be."""
    file = bddl_folder() / "hierarchy_owned.json"
    try:
        root = json.loads(file.read_bytes())
    except (OSError, ValueError) as e:
        raise InputError(file, f"cannot be read: {e}", fix="reinstall bddl==1.0.1") from e
    raw: dict[str, dict[str, Any]] = {}
    children: dict[str, set[str]] = {}
    parents: dict[str, set[str]] = {}
    stack = [root]
    while stack:
        node = stack.pop()
        name = node["name"]
        raw[name] = node
        children.setdefault(name, set())
        parents.setdefault(name, set())
        for child in node.get("children", ()):
            children[name].add(child["name"])
            parents.setdefault(child["name"], set()).add(name)
            stack.append(child)
    return {
        name: Node(
            name,
            tuple(node["igibson_categories"]),
            node["abilities"],
            frozenset(children[name]),
            frozenset(parents[name]),
        )
        for name, node in raw.items()
    }


@functools.cache
def _synset_of_category() -> dict[str, str]:
    return {category: node.name for node in taxonomy().values() for category in node.categories}


def categories() -> tuple[str, ...]:
    """All iGibson categories that the taxonomy knows (393), sorted."""
    return tuple(sorted(_synset_of_category()))


def synsets() -> tuple[str, ...]:
    """All synsets of the taxonomy, sorted."""
    return tuple(sorted(taxonomy()))


def synset(category: str) -> str | None:
    """The synset a category stands for, e.g. "fridge" -> "electric_refrigerator.n.01"; None if it has none."""
    return _synset_of_category().get(category)


def ancestors(name: str) -> frozenset[str]:
    """All synsets above a synset, itself not among them. Raises UnknownNameError."""
    return _closure(name, "parents")


def descendants(name: str) -> frozenset[str]:
    """All synsets below a synset, itself not among them. Raises UnknownNameError."""
    return _closure(name, "children")


def is_a(name: str, ancestor: str) -> bool:
    """Whether a synset, or a category, is a kind of the synset `ancestor`. Every synset is a kind of itself.

    A category that the taxonomy does not know is a kind of nothing. Raises UnknownNameError for an unknown synset.
    """
    own = name if "." in name else synset(name)
    _node(ancestor)
    return own is not None and (own == ancestor or ancestor in ancestors(own))


@functools.cache
def categories_of(name: str, *, include_inner: bool = False) -> tuple[str, ...]:
    """The categories whose objects may stand for a synset in an activity, sorted (`get_subtree_igibson_categories`).

    A leaf's own categories, else those of all leaves below it. Categories of inner nodes (perfume, cord, cracker_box,
    medicine) are missed by that rule; `include_inner` adds them. A stove may also be a burner: iGibson's own
    exception, kept in `overrides.json`.

    Raises:
      UnknownNameError: no synset has that name.
    """
    nodes = taxonomy()
    below = {_node(name).name, *descendants(name)}
    found = {c for n in below if include_inner or not nodes[n].children for c in nodes[n].categories}
    for other in shipped_overrides().also_accepts.get(name, ()):
        found.update(categories_of(other, include_inner=include_inner))
    return tuple(sorted(found))


@functools.cache
def _closure(name: str, direction: str) -> frozenset[str]:
    found: set[str] = set()
    stack = list(getattr(_node(name), direction))
    while stack:
        current = stack.pop()
        if current not in found:
            found.add(current)
            stack.extend(getattr(taxonomy()[current], direction))
    return frozenset(found)


def _node(name: str) -> Node:
    node = taxonomy().get(name)
    if node is None:
        raise UnknownNameError("synset", name, taxonomy())
    return node
