"""`SceneEngine`: what every engine is made with."""

from __future__ import annotations

from collections.abc import Sequence

from ig2mj.engine.base import PHYSICS_TIMESTEP, SUBSTEPS, TOUCH_TOLERANCE, check_arguments
from ig2mj.engine.model_fields import check_names
from ig2mj.process import prepare_jax
from ig2mj.scene.scene import Scene


class SceneEngine:
    """Base of the engines.

    Attributes:
      scene, tables, num_worlds, substeps, timestep: see `ig2mj.engine.base.Engine`.
      boxes, touch_tolerance, model_fields: as given.
    """

    scene: Scene
    num_worlds: int

    def __repr__(self) -> str:
        count = f"{self.num_worlds} world{'s' * (self.num_worlds != 1)}"
        return f"{type(self).__name__}('{self.scene.name}', {count})"

    def __init__(
        self,
        scene: Scene,
        num_worlds: int = 1,
        *,
        substeps: int = SUBSTEPS,
        timestep: float = PHYSICS_TIMESTEP,
        touch_tolerance: float = TOUCH_TOLERANCE,
        boxes: str = "tight",
        model_fields: Sequence[str] = (),
    ):
        """Checks the arguments, and prepares JAX.

        Args:
          scene: shared by all worlds.
          num_worlds: W.
          substeps, timestep: physics steps in a control step, and their length in seconds.
          touch_tolerance: metres up to which surfaces touch. The native engine sees no contacts farther apart than the
            geoms' `gap`.
          boxes: rule of the view's world boxes, "tight" or "igibson" (`ig2mj.engine.base.BOX_RULES`).
          model_fields: fields of the model that may differ per world (`ig2mj.engine.model_fields`).

        Raises:
          EngineError: an argument is out of range.
        """
        check_arguments(boxes, num_worlds, substeps, timestep)
        prepare_jax()
        self.scene, self.tables = scene, scene.tables
        self.num_worlds = num_worlds
        self.substeps, self.timestep = substeps, timestep
        self.boxes, self.touch_tolerance = boxes, touch_tolerance
        self.model_fields = check_names(model_fields)
