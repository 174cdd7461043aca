"""Where an object may be put to make a kinematic predicate true: one rule per file, one line each in `PLACEMENTS`."""

from __future__ import annotations

from collections.abc import Callable

from ig2mj.sampling.placement import Areas
from ig2mj.sampling.query import SceneQuery
from ig2mj.sampling.rules import inside, next_to, on_floor, on_top, touching, under

Rule = Callable[[SceneQuery, int, int], Areas]
"""Areas for the predicate of an object and a second argument (an object; for `on_floor` a room, or any)."""

PLACEMENTS: dict[str, Rule] = {
    "on_top": on_top.areas,
    "inside": inside.areas,
    "under": under.areas,
    "on_floor": on_floor.areas,
    "next_to": next_to.areas,
    "in_contact_with": touching.areas,
}
"""By the predicate's name. The first four are the paper's (table A.5); it does not sample the last two."""
