"""Formats of other projects that recordings are exported to, by name."""

from __future__ import annotations

from collections.abc import Callable

from ig2mj.demos.igibson import export_igibson
from ig2mj.demos.lerobot import export_lerobot
from ig2mj.demos.replay import Replayed
from ig2mj.demos.robomimic import export_robomimic

EXPORTS: dict[str, Callable[..., Replayed]] = {
    "robomimic": export_robomimic,
    "lerobot": export_lerobot,
    "igibson": export_igibson,
}
