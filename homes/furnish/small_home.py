"""The small home: one kitchen-living room, a bit more than twenty objects, placed by hand. `ig2mj demo` runs it."""

from __future__ import annotations

import math
import pathlib
import random

from ..dataset.scene_writer import write_scene
from ..objects.catalogue import find
from ..plans.openings import make_plan
from ..plans.plan import Plan, Room
from ..shapes.surfaces import insides, tops
from .kit import HomeInProgress, RoomKit
from .placed import Placed
from .start import start_home

NAME = "small_home"
HANDLE = 35.0
"""Degrees from the stove's front to its left that the pan's handle points to."""
ATTEMPTS = 24


def plan(seed: int = 0) -> Plan:
    """One room of 5.4 m by 4.2 m, its kitchen at the northern wall, the front door in the southern one."""
    kitchen = Room("kitchen_0", "kitchen", (-2.7, 0.1, 2.7, 2.2))
    living = Room("living_room_0", "living_room", (-2.7, -2.2, 2.7, 0.1))
    rng = random.Random(f"{seed}/{NAME}/plan")
    return make_plan(
        NAME, (kitchen, living), rng, open_plan=[(kitchen.name, living.name)], front=living.name, seed=seed
    )


def furnish(seed: int = 0) -> HomeInProgress:
    """The plan with everything in its place.

    Other seeds give models of other sizes: when something does not fit, other models are tried.
    """
    for attempt in range(ATTEMPTS):
        home = _furnish(seed, attempt)
        if home is not None:
            return home
    raise AssertionError(f"seed {seed}: the small home has no room for something that belongs there")


def _furnish(seed: int, index: int) -> HomeInProgress | None:
    home = start_home(plan(seed), random.Random(f"{seed}/{NAME}/{index}"), models=8, seed=seed)
    kitchen, living = (RoomKit(home, room) for room in home.plan.rooms)
    try:
        _kitchen_and_food(kitchen, index)
        _living_room(kitchen, living, index)
    except _NoRoom:
        return None
    return home


def _kitchen_and_food(kitchen: RoomKit, index: int) -> None:
    fridge = _must(kitchen.at_wall("fridge", side="north", near=(-2.4, 2.2), index=index))
    cabinet = _must(kitchen.beside(fridge, "bottom_cabinet", 1, index=index))
    stove = _must(kitchen.beside(cabinet, "stove", 1, index=index, gap=0.012))
    sink = _must(kitchen.beside(stove, "sink", 1, index=index))
    pan = _must(kitchen.on(stove, "frying_pan", index=0, at=_pan_place(stove), degrees=HANDLE))
    _must(kitchen.on(pan, "fish", index=0, at="middle", degrees=45, scale=0.62))
    _must(kitchen.inside(fridge, "milk", index=0))
    _must(kitchen.inside(fridge, "butter", index=0))
    _must(kitchen.on(cabinet, "carving_knife", index=0, degrees=80))
    _must(kitchen.on(cabinet, "chopping_board", index=0, degrees=90))
    drawers = [s for s in insides(cabinet.category, cabinet.index, cabinet.seed) if s.link > 0]
    _must(kitchen.inside(cabinet, "dishtowel", index=0, surface=drawers[0], degrees=90) if drawers else None)
    _must(kitchen.on(sink, "scrub_brush", index=0))


def _living_room(kitchen: RoomKit, living: RoomKit, index: int) -> None:
    table = _must(living.at("breakfast_table", (1.4, -0.75), 0, index=index, gap=0.02))
    for along in (-0.3, 0.3):
        _must(living.before(table, "straight_chair", -0.12, index=index, along=along))
    sofa = _must(living.at_wall("sofa", side="south", near=(-0.7, -2.2), index=index))
    coffee = _must(living.before(sofa, "coffee_table", 0.4, index=index))
    _must(living.at_wall("shelf", side="east", near=(2.7, -1.6), index=index))
    _must(living.on(table, "plate", index=0, at=(-0.18, 0.0), degrees=0))
    bowl = _must(living.on(table, "bowl", index=0, at=(0.2, 0.3), degrees=0))
    _must(living.on(bowl, "apple", index=0, at="middle", degrees=0))
    _must(living.on(table, "mug", index=1, at=(0.1, -0.25), degrees=40))
    _must(living.on(coffee, "hardback", index=0, degrees=70))


def build(root: pathlib.Path, seed: int = 0) -> pathlib.Path:
    """Writes `scenes/small_home` into a dataset root."""
    home = furnish(seed)
    return write_scene(root, home.plan, home.things, seed)


def models(seed: int = 0) -> dict[str, set[int]]:
    """The models that the home needs of the dataset, halves not counted: category -> numbers."""
    needed: dict[str, set[int]] = {}
    for thing in furnish(seed).things.things.values():
        needed.setdefault(thing.category, set()).add(thing.index % find(thing.category).count)
    return needed


def _pan_place(stove: Placed) -> tuple[float, float]:
    """Where the middle of the pan's box goes, in the stove's frame: its disc lies on the front left ring, its handle
    points `HANDLE` degrees to the left of the front, and what is in it is within 0.2 m of the heat source."""
    x, y, _ = stove.shape.model.areas["heat_source"].xyz
    base = tops("frying_pan", 0, stove.seed)[0].rect
    disc = (base[0] + base[2]) / 2  # the pan's own middle is that of disc and handle
    angle = math.radians(HANDLE)
    return (x + 0.10 - disc * math.cos(angle), y + 0.12 - disc * math.sin(angle))


class _NoRoom(Exception):
    """Something did not fit."""


def _must(thing: Placed | None) -> Placed:
    if thing is None:
        raise _NoRoom
    return thing
