"""A scene's floating hand, put where the commands that need one all put it."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ig2mj.calibration.reach import Reach
    from ig2mj.scene.scene import Scene


def with_hand(scene: Scene, folder: str | os.PathLike) -> tuple[Scene, Reach]:
    """The scene loaded again, with a floating hand in the free place from which it reaches most, and what it reaches.

    Args:
      scene: as loaded, without agents. folder: what it was loaded from.

    Raises:
      EngineError: a hand can get at none of its loose objects.
    """
    from ig2mj.agents.floating_hand import FloatingHand
    from ig2mj.calibration.reach import find_reach
    from ig2mj.scene.scene import load_scene

    reach = find_reach(scene)
    return load_scene(folder, [FloatingHand(pos=reach.start)]), reach
