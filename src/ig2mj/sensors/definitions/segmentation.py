"""`seg` and `ins_seg`: what, and which one, each pixel shows. Numbers: `ig2mj.sensors.labels`."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Int

from ig2mj.engine.view import Array
from ig2mj.scene.scene import Scene
from ig2mj.sensors import labels
from ig2mj.sensors.base import Percept, Sensor, Setup, Space
from ig2mj.sensors.slots import Slots


def _segmentation(
    name: str,
    summary: str,
    numbers: int,
    of_geoms: Callable[[Scene, str], np.ndarray],
    of_slots: Callable[[Slots], Array],
) -> Sensor:
    def space(setup: Setup) -> Space:
        return Space((setup.options.height, setup.options.width, 1), np.int32, 0.0, numbers - 1.0)

    def read(setup: Setup, percept: Percept) -> Int[Array, "W Y X 1"]:
        images = percept.images
        assert images is not None and images.geom is not None and images.slots is not None
        known = of_geoms(setup.scene, setup.options.looks)
        seen = labels.looked_up(images.geom[:, 0], known, of_slots(images.slots), labels.BACKGROUND)
        return seen[..., None]

    return Sensor(name, summary, "", space, read, frozenset({"segmentation"}))


SEG = _segmentation(
    "seg", "number of the class seen, 0 for none", labels.NUM_CLASSES, labels.classes_of_geoms, labels.classes_of_slots
)
INS_SEG = _segmentation(
    "ins_seg",
    "number of the object seen, 0 for none",
    labels.NUM_INSTANCES,
    labels.instances_of_geoms,
    labels.instances_of_slots,
)
