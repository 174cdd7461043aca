"""StainLevel: particles that a soaked cleaning tool wipes off (paper table A.4, cleaning.py)."""

from __future__ import annotations

from jaxtyping import Bool

from ig2mj.engine.view import Array
from ig2mj.states.definitions import cleaning, wetness
from ig2mj.states.definitions.dirt import Dirt
from ig2mj.states.spec import EventStep


def _can_clean(step: EventStep) -> Bool[Array, "W T"]:
    soaked = wetness.soaked(step.model, step.states.wetness)[:, step.model.parameters.tool_object]
    return cleaning.working(step.model, step.states.toggled_on) & soaked


STAIN = Dirt(
    name="stain",
    ability="stainable",
    alias="stain_level",
    rows=lambda model: model.parameters.stain_rows,
    threshold=lambda model: model.parameters.stained_threshold,
    can_clean=_can_clean,
)

SPEC = STAIN.spec()
