"""Stained(o): more than half of the stain particles that were placed remain (table A.1)."""

from __future__ import annotations

from ig2mj.predicates.dirty import dirty
from ig2mj.states.definitions.stain import STAIN

STAINED = dirty("stained", STAIN)
