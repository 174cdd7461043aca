"""Which categories of objects may stand for a synset of an activity.

BEHAVIOR-100 speaks of synsets of ig2mj's own taxonomy (`ig2mj.knowledge`). BEHAVIOR-1K has a finer one of its own; for
what ours does not know something near stands in, and says so: a synset with a category of the same name, the object in
`carton__of__milk` (milk, else a carton), the synset right above; a few are named one by one.
"""

from __future__ import annotations

import dataclasses
import functools

from ig2mj.knowledge import abilities, categories, categories_of, synset, taxonomy
from ig2mj.knowledge.further import further_categories
from ig2mj.tasks.bddl import behavior1k

FLOOR = "floor.n.01"
AGENT = "agent.n.01"
MOST_CATEGORIES = 8
"""A synset above with more categories than these is too general to stand in (furniture, container, grocery)."""

STAND_INS = {
    "bookcase.n.01": "shelf.n.01",
    "bratwurst.n.01": "sausage.n.01",
    "bottle__of__soda.n.01": "pop.n.02",
    "can__of__soda.n.01": "pop.n.02",
    "mail.n.04": "envelope.n.01",
    "packing_box.n.02": "carton.n.02",
    "sunglasses.n.02": "sunglass.n.01",
    "canister.n.02": "jar.n.01",
    "comic_book.n.01": "magazine.n.02",
    "hinged_jar.n.01": "jar.n.01",
    "hingeless_jar.n.01": "jar.n.01",
    "mixing_bowl.n.01": "bowl.n.01",
    "mop_bucket.n.01": "bucket.n.01",
    "pot.n.04": "caldron.n.01",
    "raw_egg.n.01": "egg.n.02",
    "textbook.n.01": "hardback.n.01",
    "sponge.n.01": "rag.n.01",
    "tupperware.n.01": "bowl.n.01",
    "watering_can.n.01": "kettle.n.01",
}
"""Synsets of BEHAVIOR-1K that are the same thing under another name here, though their taxonomy does not say so, or a
container or tool of the same use."""

CONTAINERS = {
    "bottle": ("vinegar", "detergent", "shampoo", "wine_bottle"),
    "jar": ("jar",),
    "shaker": ("salt", "pepper_grinder"),
    "bag": ("paper_bag",),
    "box": ("carton",),
    "carton": ("milk", "carton"),
    "package": ("package", "carton"),
    "tin": ("canned_food", "pop"),
    "can": ("pop",),
}
"""Kinds of container (`salt__shaker`, `liquid_soap__bottle`) and the categories that stand for one of any content."""

OF_THEIR_OWN = ("salt", "flour")
"""Categories of a content that are containers of it; those of liquids are, too."""
ROOM_STAND_INS = {"private_office": "home_office", "shared_office": "home_office"}
"""Kinds of room of BEHAVIOR-1K that a home has under another name."""


@dataclasses.dataclass(frozen=True)
class Kinds:
    """Categories for a synset, those that name it best first; `instead`: what stands in where ours does not know it."""

    categories: tuple[str, ...]
    instead: str | None = None


@functools.cache
def kinds(name: str, behavior_1k: bool = False) -> Kinds:
    """The categories whose objects may be bound to a synset; none where nothing fits.

    Args:
      behavior_1k: the synset may be of BEHAVIOR-1K's taxonomy, which must have been fetched then.
    """
    if name in taxonomy():
        # As iGibson: the leaves below; inner nodes with categories of their own only where there is nothing else.
        return Kinds(_ordered(name, categories_of(name) or categories_of(name, include_inner=True)))
    if not behavior_1k or name not in behavior1k.hierarchy():
        return Kinds(())
    above, own = behavior1k.hierarchy()[name]
    known = {*categories(), *further_categories()}
    stem = name.split(".")[0]
    content, _, container_kind = stem.rpartition("__")
    if container_kind in CONTAINERS and not content.endswith("__of"):
        named = [content] if content in OF_THEIR_OWN or (content in known and "liquid" in abilities(content)) else []
        return Kinds(tuple(dict.fromkeys([*named, *CONTAINERS[container_kind]])), (named or [container_kind])[0])
    for word in (*own, stem, *reversed(stem.split("__of__"))):
        if word in known and name not in STAND_INS:
            return Kinds((word,), word)
    container = [f"{stem.split('__of__')[0]}.n.01"] if "__of__" in stem else []
    for synset_above in (STAND_INS.get(name, ""), *above, *container):
        if synset_above in taxonomy() and 0 < len(found := categories_of(synset_above)) <= MOST_CATEGORIES:
            return Kinds(_ordered(synset_above, found), synset_above)
    return Kinds(())


def _ordered(name: str, found: tuple[str, ...]) -> tuple[str, ...]:
    """The synset's own categories first, halves last: an apple does not mean half of one."""
    return tuple(sorted(found, key=lambda c: (c.startswith("half_"), synset(c) != name, c)))
