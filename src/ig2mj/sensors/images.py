"""`Images`: what cameras and rays of any engine deliver, before sensors make readings of it.

Axes: W worlds, C cameras, Y rows, X columns, N rays of a pattern.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, Protocol, runtime_checkable

import mujoco
import numpy as np
from flax import struct
from jaxtyping import Bool, Float, Int, UInt8

from ig2mj.engine.view import Array, PhysicsView
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.sensors.slots import Slots
from ig2mj.states.world import ExtendedStates
from ig2mj.worlds.draw import Draw

NOTHING = -1
"""In a segmentation: no object there (sky, agents, the world's own geoms). In `geom`: nothing was hit."""

Pose = tuple[Float[Array, "W 3"], Float[Array, "W 4"]]
"""World frame: m, w-x-y-z."""


@dataclasses.dataclass(frozen=True, eq=False)
class RayPattern:
    """Rays that leave one point.

    Attributes:
      name: of their pose among those that a camera is called with.
      directions: unit length, in the sensor's frame (x forward, y left, z up).
      near, far: m from the point; nothing nearer or farther is seen.
    """

    name: str
    directions: Float[np.ndarray, "N 3"]
    near: float
    far: float


@struct.dataclass
class Images:
    """Images of all worlds; what was not requested is None.

    Attributes:
      rgb: 0..255, row 0 on top. depth: metres along the optical axis, 0 where nothing is hit.
      segmentation: index of the object seen, `NOTHING` where there is none; a particle counts as its object.
      geom: id of the geom seen, `NOTHING` where there is none; those from the model's number of geoms on are slots.
      slots: the particles that were drawn.
      rays: distances along the rays of each pattern, m; infinite where nothing is hit.
    """

    rgb: UInt8[Array, "W C Y X 3"] | None
    depth: Float[Array, "W C Y X"] | None
    segmentation: Int[Array, "W C Y X"] | None
    geom: Int[Array, "W C Y X"] | None = None
    slots: Slots | None = None
    rays: Mapping[str, Float[Array, "W N"]] = dataclasses.field(default_factory=dict)


@runtime_checkable
class Camera(Protocol):
    """`BatchCamera` or `NativeCamera`."""

    def prepare_devices(self, devices: Sequence[Any]) -> None:
        """Allocates memory on other devices of this process, before programs for them are compiled."""
        ...

    def __call__(
        self,
        physics: Any,
        view: PhysicsView,
        states: ExtendedStates,
        eyes: Mapping[str, Pose] | None = None,
        rendered: Bool[Array, "W"] | None = None,
        draw: Draw | None = None,
    ) -> Images:
        """Images of the present state of every world. `rendered`: the worlds that matter; those of the others cost next
        to nothing, and mean nothing. None: all. `draw`: lights and fields of view of the worlds, where they differ."""
        ...


def check_request(
    cameras: Sequence[str],
    rays: Sequence[RayPattern],
    requested: Sequence[bool],
    width: int,
    height: int,
    rows: tuple[int, int] | None = None,
) -> None:
    """Raises EngineError where there is nothing to make images of, or with."""
    if rows is not None and not 0 <= rows[0] < rows[1] <= height:
        raise EngineError(f"rows {rows[0]} to {rows[1]} are empty for images of {height} rows")
    if (cameras and (not any(requested) or min(width, height) < 1)) or not (cameras or rays):
        raise EngineError("a camera must have pixels and produce at least one of rgb, depth and segmentation")


def camera_id(model: mujoco.MjModel, name: str) -> int:
    """Number of a camera. Raises UnknownNameError: the model has no such camera."""
    number = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA, name)
    if number < 0:
        raise UnknownNameError("camera", name, [model.camera(c).name for c in range(model.ncam)])
    return number
