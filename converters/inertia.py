"""Mass, centre of mass and inertia of an object's links (dataset_format.md section 6)."""

from __future__ import annotations

from .description import Inertial, ObjectModel


def link_inertials(model: ObjectModel, density: float | None, bullet: bool = False) -> dict[str, Inertial]:
    """Inertials of all links of a model that `scaling.scale_model` returned.

    Args:
      model: the scaled model. Warnings are appended to `model.warnings`.
      density: kg per m^3 of the bounding box, of the category; None keeps the URDF's own inertials and computes only
        missing or impossible ones (building parts, plain URDFs).
      bullet: inertia by Bullet's formula on the axis-aligned box instead of the true one of the convex hulls.

    Returns:
      link name -> Inertial (link frame), for every link. Fixed-joint children are separate: merging is the builder's.
    """
    raise NotImplementedError
