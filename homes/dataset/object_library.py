"""The object library: converted models that can be added to any home when it is loaded (`load_scene(objects=...)`).

One model of every category that is not fixed to a house, the first but for `MODELS`. The categories that the six
activities are about have three (`ig2mj.tasks.variants`), those that iGibson does not have two. The former and others of
their kinds have further ones, so that a split has some to hold out (`ig2mj.tasks.splits`). All that an activity may
place somewhere is there, also what homes have fixed but BEHAVIOR places; beds, sinks and cabinets belong to homes.
"""

from __future__ import annotations

import pathlib

from ig2mj.knowledge.further import further_categories

from ..objects.catalogue import catalogue

FOLDER = "objects"
"""Below the folder of the homes: `objects/<category>/<model>/object.xml`."""
ASSETS = "../../.."
"""From a model's folder to the meshes and textures that all homes and models share."""


PLACED = ("car", "christmas_tree", "christmas_tree_decorated", "grill", "painting", "pool")
"""Fixed where a home has them, but activities put them anywhere: free in the library."""

VARIED = ("apple", "bath_towel", "carving_knife", "cauldron", "hand_towel", "notebook", "steak")
"""What the six activities are about: three models of each."""

LIKE_THEM = ("banana", "hardback", "lemon", "magazine", "orange", "pear", "tomato")
"""Fruits and books: four models of each."""

PACKED = ("backpack", "casserole", "jeans", "pumpkin", "stocking", "sweater", "t-shirt", "teapot", "underwear")
"""What activities pack, or put something into: folded, small, large or hollow from model 4 on."""

MODELS = {
    **dict.fromkeys(further_categories(), (0, 1)),
    "carton": (5, 2),
    **dict.fromkeys(("dishtowel", "rag"), (5, 0)),
    "shelf": (14,),
    **dict.fromkeys(("parsley", "pop_case", "salad"), (3, 0)),
    **dict.fromkeys(PACKED, (4, 0)),
    **dict.fromkeys(VARIED, (0, 1, 2)),
    "bath_towel": (0, 1, 2, 5, 6, 7),
    "carving_knife": (0, 1, 2, 4, 5, 6),
}
"""Numbers of the models where it is not the first alone; the first here is the one that the category's name stands for
(`PREFERRED_FILE`). Carton 5 holds what activities pack; casserole 4 is an empty dish, salad 3 lies on a plate;
the shelf is a board for a wall, which no home has; bath towels 5 to 7 are rolled and carving knives 4 to 6 stand on
their handles, for hands to which nothing sticks."""

FOR_SPLITS = {
    "carton": (0, 1, 3, 4),
    **dict.fromkeys(("dishtowel", "rag"), (1, 2, 3, 4)),
    **dict.fromkeys(LIKE_THEM, (1, 2, 3)),
    **dict.fromkeys(VARIED, (3, 4, 5, 6, 7)),
    "bath_towel": (3, 4, 8, 9, 10),
    "carving_knife": (3, 7, 8, 9, 10),
}
"""Numbers of further models, with which policies are trained and judged; activities are bound to others
(`VARIANTS_FILE`)."""

VARIANTS_FILE = "variants.json"
"""Next to the categories: category -> the models of `FOR_SPLITS`."""

PREFERRED_FILE = "preferred.json"
"""Next to the categories: category -> the model that its name stands for, where that is not the first by name."""


def preferred_models(models: list[tuple[str, str, pathlib.Path]]) -> dict[str, str]:
    """What `PREFERRED_FILE` holds, from the models as `library_models` gives them."""
    by_category: dict[str, dict[int, str]] = {}
    for category, model, _ in models:
        by_category.setdefault(category, {})[int(model.rpartition("_")[2])] = model
    found = {}
    for category, numbered in by_category.items():
        requested = MODELS.get(category, (0,))[0]
        if requested in numbered and requested != min(numbered):
            found[category] = numbered[requested]
    return found


def split_models(models: list[tuple[str, str, pathlib.Path]]) -> dict[str, list[str]]:
    """What `VARIANTS_FILE` holds, from the models as `library_models` gives them."""
    found: dict[str, list[str]] = {}
    for category, model, _ in models:
        if int(model.rpartition("_")[2]) in FOR_SPLITS.get(category, ()):
            found.setdefault(category, []).append(model)
    return found


def is_fixed(category: str) -> bool:
    """Whether the library's models of a category must be given a place, where they stay (`load_scene`)."""
    return catalogue()[category].fixed and category not in PLACED


def library_models(dataset: pathlib.Path) -> list[tuple[str, str, pathlib.Path]]:
    """(category, model, URDF) of each model of the library that the dataset holds, sorted by category."""
    found = []
    for category in catalogue():
        if is_fixed(category) and category not in MODELS:
            continue
        for number in (*MODELS.get(category, (0,)), *FOR_SPLITS.get(category, ())):
            folders = (f for f in (dataset / "objects" / category).glob(f"*{category}_{number:02d}") if f.is_dir())
            found += [(category, folder.name, folder / f"{folder.name}.urdf") for folder in sorted(folders)]
    return found
