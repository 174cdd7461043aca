"""Inertia of what is small in all directions: large enough that a fall does not turn it by a radian in a physics step.

What falls from a table at 4 m/s and touches the floor with one corner turns at speed / (2 k) at most, where k is its
radius of gyration: half a strawberry (k = 8 mm) at 250 rad/s, two radians in a physics step of 1/120 s. Contacts
cannot resolve that, and the body gains energy with each (`engine/speed_limits.py`). Rotation takes longer where k is
larger; how it falls, slides and is held stays. `docs/notes/lost.md`.
"""

from __future__ import annotations

import mujoco
import numpy as np

from ig2mj.scene.manifest import Manifest

SMALLEST_GYRATION = 0.02
"""Metres: radius of gyration, sqrt(inertia / mass), about each axis of what would have less about all of them. Long
bodies, such as pens and knives, are not changed: they gain energy in far fewer falls."""


def steady_small_bodies(spec: mujoco.MjSpec, manifest: Manifest) -> None:
    """Gives small objects that move freely the inertia of `SMALLEST_GYRATION`, in a scene that is not compiled yet.

    Only where the file states principal moments, as converters write them; objects with several links stay.
    """
    for entry in manifest.objects:
        if entry.fixed or len(entry.bodies) != 1:
            continue
        body = spec.body(entry.bodies[0])
        if body.bodies or not body.explicitinertial or not np.isnan(body.fullinertia[0]):
            continue
        least = body.mass * SMALLEST_GYRATION**2
        if 0.0 < body.inertia.max() < least:
            body.inertia = np.full(3, least)
