"""The sixteen homes: drawings, sizes, and how many objects each holds. 119 rooms in all.

A drawing has one letter per cell (see `plan.grid_rooms`); `columns` from the left and `rows` from the top, metres.
Three homes have the sizes of the paper's table A.7: aspen 20, birch 60, spruce 120 objects. Sequoia
has what BEHAVIOR-100's activities ask for and no other home has.
"""

from __future__ import annotations

import dataclasses
import random
from collections.abc import Mapping

from .openings import make_plan
from .plan import Plan, grid_rooms

KINDS = {
    "B": "bedroom", "C": "corridor", "D": "dining_room", "E": "exercise_room", "G": "garage", "H": "childs_room",
    "K": "kitchen", "L": "living_room", "M": "bedroom", "N": "closet", "O": "home_office", "P": "pantry_room",
    "Q": "playroom", "R": "library", "S": "storage_room", "T": "bathroom", "U": "bathroom", "V": "balcony",
    "W": "utility_room", "X": "staircase", "Y": "lobby", "Z": "television_room",
}  # fmt: skip
"""Letters of the drawings. M and U: a second bedroom and bathroom."""


@dataclasses.dataclass(frozen=True)
class Drawing:
    """A home on paper.

    Attributes:
      objects: that it holds in all, doors and windows included, walls, floors and ceilings not.
      columns, rows, cells: see the module.
      open_plan, passages: pairs of letters with no wall, and with a wide opening, between them.
      pieces: room kind -> furniture that its rooms get in addition to that of their kind (`furnish_home`).
    """

    objects: int
    columns: tuple[float, ...]
    rows: tuple[float, ...]
    cells: str
    open_plan: tuple[str, ...] = ()
    passages: tuple[str, ...] = ()
    pieces: Mapping[str, tuple[str, ...]] = dataclasses.field(default_factory=dict)


BEHAVIOR_PIECES = {
    "bedroom": ("bottom_cabinet", "bottom_cabinet", "bottom_cabinet"),
    "closet": ("bottom_cabinet", "shelf"),
    "garage": ("bottom_cabinet", "shelf"),
    "home_office": ("bottom_cabinet",),
    "kitchen": ("countertop", "countertop", "oven", "breakfast_table"),
    "living_room": ("bottom_cabinet",),
    "storage_room": ("sink", "console_table", "shelf"),
    "utility_room": ("sink",),
}
"""What BEHAVIOR-100's activities ask for that no other home has."""


DRAWINGS: dict[str, Drawing] = {
    "alder": Drawing(84, (3.4, 2.0, 3.2), (3.0, 1.4, 3.6), "B T O / C C C / L L K", ("LK",), ("CL",)),
    "aspen": Drawing(20, (3.4, 2.1), (2.2, 3.3), "K T / L L", ("KL",)),
    "birch": Drawing(60, (3.2, 2.1, 3.8), (2.9, 1.4, 3.0), "B T L / C C L / K K L", ("KL",)),
    "cedar": Drawing(86, (3.1, 1.4, 3.6), (3.2, 2.4, 2.9), "B C L / T C L / H C K", ("LK",), ("CL",)),
    "elm": Drawing(100, (3.2, 2.2, 2.2, 3.4), (3.0, 1.4, 3.4), "B T P K / C C C K / L L L D", ("KD",), ("CL", "LD")),
    "fir": Drawing(108, (3.4, 1.4, 2.9, 3.0), (2.9, 2.1, 3.2), "B C L L / T C L L / H C K D", ("KD",), ("CL", "LD")),
    "hazel": Drawing(52, (3.2, 2.2, 3.3), (2.4, 3.5), "K T B / L L B", ("KL",)),
    "juniper": Drawing(110, (3.2, 2.2, 2.1, 4.7), (3.1, 1.4, 3.4), "B T W G / C C C G / L L L K", ("LK",), ("CL",)),
    "larch": Drawing(124, (3.4, 2.1, 3.0, 3.2), (3.2, 1.4, 3.5), "B T O K / C C C K / M L L D", ("KD",), ("CL", "LD")),
    "linden": Drawing(128, (3.4, 1.4, 3.5), (3.1, 2.2, 2.8, 3.2), "B C L / T C L / Q C K / H C D", ("KD",), ("CL",)),
    "maple": Drawing(136, (3.3, 2.3, 2.8, 3.6), (3.2, 1.5, 3.6), "B T R L / C C C L / M K K D", ("KD",), ("LD",)),
    "poplar": Drawing(
        140, (3.4, 2.2, 3.2, 2.2, 3.5), (3.3, 1.4, 3.6), "B T X W K / C C C C K / M L L L D", ("KD",), ("CL", "LD")
    ),
    "rowan": Drawing(
        146, (3.4, 1.4, 4.0, 1.8), (3.1, 2.2, 2.5, 3.1), "B C L V / T C L V / S C K K / O C D D", ("KD",), ("CL",)
    ),
    "sequoia": Drawing(
        150,
        (6.2, 2.4, 3.9, 3.2, 5.4),
        (3.8, 1.5, 4.8),
        "B T O N S / C C C C C / G W L D K",
        (),
        ("CL", "LD"),
        BEHAVIOR_PIECES,
    ),
    "spruce": Drawing(
        120, (3.6, 2.2, 2.4, 3.0, 3.6), (3.4, 1.5, 3.7), "B N T H K / C C C C K / E L L Z D", ("KD",), ("CL", "CK")
    ),
    "willow": Drawing(
        150,
        (4.7, 2.1, 2.4, 3.2, 2.2, 3.6),
        (3.4, 1.5, 4.5),
        "B U T M P K / C C C C C K / G Y L L L D",
        ("KD",),
        ("CL", "LD", "CY"),
    ),
}


LEAVES_AT_WALLS = ("alder", "fir", "hazel", "juniper", "maple", "poplar", "sequoia", "spruce")
"""Homes whose doors open towards corners, and whose furniture leaves ways past open doors. The rooms of the others stay
joined without it, but for a corner of birch's bathroom; birch and cedar stay as the start states, recordings and
policies that ship know them."""


def plan(name: str, seed: int = 0) -> Plan:
    """A home's floor plan with its openings."""
    drawing = DRAWINGS[name]
    lines = drawing.cells.replace("/", "\n")
    kinds = {letter: KINDS[letter] for letter in dict.fromkeys(drawing.cells) if letter in KINDS}
    rooms = grid_rooms(kinds, drawing.columns, drawing.rows, lines)
    names = dict(zip(kinds, (room.name for room in rooms), strict=True))

    def pairs(letters: tuple[str, ...]) -> list[tuple[str, str]]:
        return [(names[pair[0]], names[pair[1]]) for pair in letters]

    rng = random.Random(f"{seed}/{name}/plan")
    return make_plan(
        name,
        rooms,
        rng,
        open_plan=pairs(drawing.open_plan),
        passages=pairs(drawing.passages),
        seed=seed,
        leaves_at_walls=name in LEAVES_AT_WALLS,
    )
