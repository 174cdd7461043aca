"""Homes that ship, and entries of the catalogue of models, for commands that list and render them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ig2mj_homes.objects.entry import Entry


def shipped_homes() -> list[dict[str, Any]]:
    """Name, rooms and number of objects (see `ObjectEntry.in_household`) of every home in scenes_mjcf/."""
    from ig2mj.scene import paths
    from ig2mj.scene.manifest import load_manifest

    homes = []
    for name in paths.shipped_homes():
        manifest = load_manifest(paths.SHIPPED_HOMES / name)
        objects = [o for o in manifest.objects if o.in_household]
        rooms = list(manifest.rooms.instances)
        movable = sum(not o.fixed for o in objects)
        homes.append({"home": name, "rooms": rooms, "objects": len(objects), "movable": movable})
    return homes


def entries_of(only: tuple[str, ...]) -> list[Entry]:
    """Entries of these categories, of all where there are none. Raises UnknownNameError."""
    from ig2mj_homes.objects.catalogue import catalogue, find

    return [find(name) for name in only] if only else list(catalogue().values())
