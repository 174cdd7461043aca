"""The object library: converted models that can be added to any home when it is loaded (`load_scene(objects=...)`).

One model of every category that is not fixed to a house, the first but for `OTHERS`: more of a category are copies of
it. All that an activity may place somewhere is there, also what homes have fixed but BEHAVIOR places; beds, sinks and
cabinets belong to homes.
"""

from __future__ import annotations

import pathlib

from ..objects.catalogue import catalogue

FOLDER = "objects"
"""Below the folder of the homes: `objects/<category>/<model>/object.xml`."""
ASSETS = "../../.."
"""From a model's folder to the meshes and textures that all homes and models share."""


PLACED = ("car", "christmas_tree", "christmas_tree_decorated", "grill", "painting", "pool")
"""Fixed where a home has them, but activities put them anywhere: free in the library."""

OTHERS = {"carton": 2}
"""Number of the model where it is not the first: the roomiest carton, which holds what activities pack."""


def library_models(dataset: pathlib.Path) -> list[tuple[str, str, pathlib.Path]]:
    """(category, model, URDF) of each model of the library that the dataset holds, sorted by category."""
    found = []
    for category, entry in catalogue().items():
        if entry.fixed and category not in PLACED:
            continue
        number = OTHERS.get(category, 0)
        folders = sorted(f for f in (dataset / "objects" / category).glob(f"*{category}_{number:02d}") if f.is_dir())
        found += [(category, folder.name, folder / f"{folder.name}.urdf") for folder in folders]
    return found
