"""Every category that can be built: its real size and mass, the function that builds it, how many models of it.

Families (files of this folder, listed in families.py) each export `CATEGORIES`, a list of `Entry`; this module gathers
them and builds models.
"""

from __future__ import annotations

import functools
import random

import numpy as np

from ig2mj.errors import UnknownNameError

from .entry import Entry
from .families import FAMILIES
from .folder_model import folder_entry, folder_model, is_folder
from .halves import add_halves
from .hinges import friction
from .model import HouseholdObject, ObjectBuilder

IN_WALLS = ("door", "window")


@functools.cache
def catalogue() -> dict[str, Entry]:
    """All entries by category name, in alphabetical order."""
    entries: dict[str, Entry] = {}
    for family in FAMILIES:
        for entry in family.CATEGORIES:
            assert entry.category not in entries, f"category {entry.category} stands in two families"
            entries[entry.category] = entry
    return dict(sorted(entries.items()))


def find(category: str) -> Entry:
    """The entry of a category, or of the folder of a converted object. Raises UnknownNameError."""
    if is_folder(category):
        return folder_entry(category)
    entries = catalogue()
    if category not in entries:
        raise UnknownNameError("category", category, entries)
    return entries[category]


def model_number(entry: Entry, model: str, seed: int = 0) -> int:
    """The number of a category's model by its name, such as "sofa_02". Raises UnknownNameError."""
    names = [build_model(entry, index, seed).model for index in range(entry.count + entry.extra)]
    if model not in names:
        raise UnknownNameError(f"model of {entry.category}", model, names)
    return names.index(model)


def build_model(entry: Entry, index: int, seed: int = 0) -> HouseholdObject:
    """The category's model number `index`, with its halves where it is sliceable. Same arguments, same model."""
    if is_folder(entry.category):
        return folder_model(entry.category).model
    rng = random.Random(f"{seed}/{entry.category}/{index}")
    vary = entry.vary * (2 if entry.wide and index >= entry.count else 1)
    if entry.uniform:
        factor = rng.uniform(1 - vary, 1 + vary)
        size = tuple(edge * factor for edge in entry.size)
    else:
        size = tuple(edge * rng.uniform(1 - vary, 1 + vary) for edge in entry.size)
    builder = ObjectBuilder(entry.category, "", size, rng, index, entry.rest)
    entry.build(builder, **entry.options)
    model = builder.finish()
    model.furniture = entry.fixed and entry.category not in IN_WALLS
    mass = entry.mass * float(np.prod(size) / np.prod(entry.size))
    for joint in model.joints:
        joint.friction = friction(model, joint, mass)
    # iGibson's task sampler takes only models named articulated_* where a small object must open.
    moving = any(joint.openable for joint in model.joints) and not entry.fixed
    model.model = f"{'articulated_' if moving else ''}{entry.category}_{index:02d}"
    if entry.flesh:
        add_halves(model, entry.flesh(rng))
    return model
