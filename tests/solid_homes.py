"""The small home with a bowl, with and without a part that only physics knows of."""

from __future__ import annotations

import pytest

import ig2mj
import ig2mj.scene.scene as scenes
from ig2mj.scene.scene import Scene


def with_and_without(part: str) -> tuple[Scene, Scene]:
    """As it comes, and without the function of `scene.scene` that makes the part."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(scenes, part, lambda spec, manifest: None)
        without = ig2mj.load_scene("small_home", objects=["bowl"])
    return ig2mj.load_scene("small_home", objects=["bowl"]), without
