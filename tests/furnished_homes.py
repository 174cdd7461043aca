"""Our homes, each furnished once in a run (seconds for a large one)."""

from __future__ import annotations

import functools

from ig2mj_homes.dataset.shipped_homes import furnished

home = functools.cache(furnished)
