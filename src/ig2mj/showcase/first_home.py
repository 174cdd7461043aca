"""The first demo: a home just converted runs, and tells what stands where.

    1. `load_and_run`  loads it and lets it stand for two seconds
    2. `what_stands_where`  asks the predicates on_top and inside
    3. `take_images`

Each is a function of its own; `ig2mj.cli.demo` converts the home, calls them one after the other and talks.
"""

from __future__ import annotations

import dataclasses
import pathlib
from typing import Any

import numpy as np

from ig2mj.simulation import Simulation

SECONDS = 2.0
"""That the home stands before anybody looks."""
CONTROL_STEP = 1 / 30
"""s, of one `Simulation.step`."""
NEAR = 0.02
"""m: boxes further apart are neither on top of nor inside each other."""


@dataclasses.dataclass
class FirstHomePlace:
    """Where one loose object is: "on top of" or "inside" something, or "loose" where no predicate holds."""

    object: str
    relation: str
    support: str
    room: str


def load_and_run(folder: pathlib.Path, seconds: float = SECONDS) -> tuple[Simulation, float]:
    """The running world after some seconds, and how far (m) the object that moved most has moved in them."""
    world = Simulation(folder, states=None)  # extended states are the cooking demo's
    before = np.array(world.view.object_pos[0])
    world.step(count=round(seconds / CONTROL_STEP))
    loose = ~(world.scene.tables.object_fixed | world.scene.tables.object_parked)
    moved = np.linalg.norm(np.array(world.view.object_pos[0]) - before, axis=-1)[loose]
    return world, float(moved.max(initial=0.0))


def what_stands_where(world: Simulation) -> list[FirstHomePlace]:
    """Every loose object with what it is on top of or inside of (paper table A.1), asked of the predicates.

    Of several answers the smallest object is named: the fish is in the pan rather than on the stove.
    """
    from ig2mj.predicates.host_queries import HostQueries
    from ig2mj.predicates.registry import find
    from ig2mj.states import StateModel, initial_states

    scene, view = world.scene, world.view
    pairs, names = _near_pairs(world), scene.tables.object_names
    model = StateModel.of_manifest(scene.tables, scene.manifest)
    states, queries = initial_states(model, 1), HostQueries.of(model)
    volume = {entry.name: float(np.prod(entry.bounding_box)) for entry in scene.manifest.objects}
    found: dict[str, tuple[float, str, str]] = {}
    for relation in ("inside", "on_top"):
        for (a, b), holds in zip(pairs, queries.holds(find(relation), pairs, states, view)[0], strict=True):
            thing, support = names[a], names[b]
            if holds and (thing not in found or volume[support] < found[thing][0]):
                found[thing] = (volume[support], relation, support)
    places = []
    for entry in scene.manifest.objects:
        if entry.fixed or entry.parked:
            continue
        _, relation, support = found.get(entry.name, (0.0, "loose", "-"))
        x, y = view.object_pos[0, scene.object_index(entry.name), :2]
        room = scene.rooms.room_at((float(x), float(y))) if scene.rooms else None
        places.append(FirstHomePlace(entry.name, relation.replace("_", " "), support, room or "-"))
    return places


def _near_pairs(world: Simulation) -> list[tuple[int, int]]:
    """(loose object, other object) whose boxes meet, as indices: only of these anything can hold."""
    view, tables = world.view, world.scene.tables
    low, high = np.asarray(view.aabb_low[0]) - NEAR / 2, np.asarray(view.aabb_high[0]) + NEAR / 2
    meet = np.all((low[:, None] < high[None]) & (high[:, None] > low[None]), axis=-1)
    return [
        (a, b)
        for a, b in np.argwhere(meet).tolist()
        if a != b and not (tables.object_fixed[a] or tables.object_parked[a] or tables.object_parked[b])
    ]


def take_images(world: Simulation, folder: pathlib.Path) -> list[pathlib.Path]:
    """The home from outside, from above, and from each room's camera, as PNG files in `folder`."""
    from PIL import Image

    from ig2mj.viewer.offscreen import default_backend
    from ig2mj.viewer.overview import home_overview

    views: dict[str, Any] = {"home": home_overview(world.scene, world.data), "top": "top"}
    views |= {name: name for name in world.scene.manifest.rooms.instances}
    if default_backend() == "warp":  # seconds each: one is enough
        views = {"home": views["home"]}
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for name, view in views.items():
        files.append(folder / f"{name}.png")
        Image.fromarray(world.render(view, width=960, height=720)).save(files[-1])
    return files
