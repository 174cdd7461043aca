"""A floating hand, at the position where it reaches most objects of a scene."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ig2mj.calibration.reach import Reach
    from ig2mj.scene.scene import Scene


def with_hand(scene: Scene, folder: str | os.PathLike) -> tuple[Scene, Reach]:
    """The scene loaded again with a floating hand where it reaches most objects, and what it reaches.

    Args:
      scene: as loaded, without agents. folder: what it was loaded from.

    Raises:
      EngineError: a hand reaches none of its loose objects.
    """
    from ig2mj.agents.floating_hand import FloatingHand
    from ig2mj.calibration.reach import find_reach
    from ig2mj.scene.scene import load_scene

    reach = find_reach(scene)
    return load_scene(folder, [FloatingHand(pos=reach.start)], scene.requested), reach
