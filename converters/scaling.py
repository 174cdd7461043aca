"""Scaling an articulated object per axis (dataset_format.md section 5)."""

from __future__ import annotations

import numpy as np

from .description import Instance, ObjectModel


def instance_scale(instance: Instance, model: ObjectModel) -> np.ndarray:
    """Scale [3] of an instance: bounding_box / metadata.bbox_size, or its scale, or 1 (section 0 fact 2).

    Raises:
      InputError: a scale that is not positive and finite.
    """
    raise NotImplementedError


def scale_model(model: ObjectModel, s: np.ndarray | tuple[float, float, float] | float) -> ObjectModel:
    """A copy of the model scaled by s in its base link's axes.

    All meshes are baked: every shape's `scale` is 1 and its vertices are in the frame of the shape's `pose`. Joint
    origins, axes, prismatic limits, inertials and the metadata (bbox_size, base_link_offset, links, parts,
    orientations' sizes; not `raw`) are scaled too; `Link.com` is filled. `scale_model(model, 1)` only bakes.

    Raises:
      InputError: s is not positive and finite, or no rigid articulated result exists.
    """
    raise NotImplementedError
