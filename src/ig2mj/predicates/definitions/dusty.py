"""Dusty(o): more than half of the dust particles that were placed remain (table A.1)."""

from __future__ import annotations

from ig2mj.predicates.dirty import dirty
from ig2mj.states.definitions.dust import DUST

DUSTY = dirty("dusty", DUST)
