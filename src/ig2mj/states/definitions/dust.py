"""DustinessLevel: particles that any cleaning tool wipes off (paper table A.4, cleaning.py)."""

from __future__ import annotations

from ig2mj.states.definitions import cleaning
from ig2mj.states.definitions.dirt import Dirt

DUST = Dirt(
    name="dust",
    ability="dustyable",
    alias="dustiness_level",
    rows=lambda model: model.parameters.dust_rows,
    threshold=lambda model: model.parameters.dusty_threshold,
    can_clean=lambda step: cleaning.working(step.model, step.states.toggled_on),
)

SPEC = DUST.spec()
