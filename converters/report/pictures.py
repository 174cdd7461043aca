"""The pictures of the report: each object as it looks and as it collides, the scene from above and from a corner."""

from __future__ import annotations

import base64
import copy
import io
import time
from typing import Any

import mujoco
import numpy as np
from PIL import Image

from ig2mj.scene.manifest import Manifest, ObjectEntry

from ..base.description import RoomMaps
from ..checks.still import start_data
from ..mjcf.model_index import ModelIndex, geom_box
from .drawing import draw
from .room_plan import draw_plan

SIZE = (280, 220)
SCENE_SIZE = (960, 640)
SLOW = 2.0
"""Seconds per picture from which on a renderer is used for the scene only, and objects are drawn."""
SHOWN, HIDDEN = 0, 5
"""Geom groups on the copy of the model that is rendered."""
PALETTE = np.array(
    [
        (0.90, 0.45, 0.35), (0.35, 0.60, 0.85), (0.45, 0.75, 0.45), (0.90, 0.75, 0.35), (0.65, 0.50, 0.80),
        (0.40, 0.75, 0.75), (0.85, 0.55, 0.70), (0.60, 0.65, 0.35), (0.55, 0.55, 0.62), (0.80, 0.60, 0.45),
    ]
)  # fmt: skip
"""Collision geoms, one after the other."""


class Pictures:
    """Makes pictures of one compiled scene, by the given renderer or, without one or when it fails, by drawing.

    Attributes:
      note: '' or why the pictures are drawings.
    """

    def __init__(self, model: mujoco.MjModel, manifest: Manifest, index: ModelIndex, renderer: Any, view: Any):
        self.original, self.manifest, self.index = model, manifest, index
        self.renderer = renderer if view is not None else None
        self.view: Any = view
        self.note = "" if self.renderer else "nothing here renders: pictures are drawings"
        self.model = copy.copy(model)
        self.data = start_data(self.model)
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_camlight(self.model, self.data)
        self.boxes = np.array([self._box(g) for g in range(model.ngeom)]).reshape(-1, 2, 3)
        self._seconds = 0.0
        self._count = 0
        self._known: dict[tuple, tuple[str, str]] = {}

    def _box(self, geom: int) -> np.ndarray:
        if int(self.model.geom_type[geom]) in (int(mujoco.mjtGeom.mjGEOM_PLANE), int(mujoco.mjtGeom.mjGEOM_HFIELD)):
            return np.zeros((2, 3))
        rotation = self.data.geom_xmat[geom].reshape(3, 3)
        return geom_box(self.model, geom, rotation, self.data.geom_xpos[geom])

    def object(self, number: int) -> tuple[str, str]:
        """Data URIs of an object as it looks and as it collides; instances of one model at one size share them."""
        entry = self.manifest.objects[number]
        key = (entry.category, entry.model, entry.bounding_box, entry.scale)
        if entry.category in ("walls", "floors", "ceilings") or key not in self._known:
            self._known[key] = self._object(number, entry)
        return self._known[key]

    def _object(self, number: int, entry: ObjectEntry) -> tuple[str, str]:
        mine = self.index.geom_object == number
        solid = np.flatnonzero(mine & self.index.solid)
        seen = np.flatnonzero(mine & ~self.index.solid)
        if not len(seen):
            seen = solid
        self.model.geom_rgba[solid, :3] = PALETTE[np.arange(len(solid)) % len(PALETTE)]
        self.model.geom_rgba[solid, 3] = 1
        keep = self.model.geom_matid[solid].copy()
        self.model.geom_matid[solid] = -1
        try:
            by_renderer = not self._too_slow()
            return tuple(self._picture(g, SIZE, flat=True, by_renderer=by_renderer) for g in (seen, solid))  # type: ignore[return-value]
        finally:
            self.model.geom_rgba[solid] = self.original.geom_rgba[solid]
            self.model.geom_matid[solid] = keep

    def _too_slow(self) -> bool:
        return self._count > 0 and self._seconds / self._count > SLOW

    def _picture(
        self,
        geoms: np.ndarray,
        size: tuple[int, int],
        *,
        azimuth: float = 135.0,
        elevation: float = -30.0,
        flat: bool = False,
        by_renderer: bool = True,
    ) -> str:
        if not len(geoms):
            return ""
        image = self._render(geoms, size, azimuth, elevation, flat) if by_renderer else None
        if image is None:
            width, height = size
            image = draw(
                self.model, self.data, geoms.tolist(), width=width, height=height, azimuth=azimuth, elevation=elevation
            )
        return data_uri(image)

    def _render(self, geoms: np.ndarray, size: tuple[int, int], azimuth: float, elevation: float, flat: bool):
        renderer = self.renderer
        if renderer is None:
            return None
        m, (width, height) = self.model, size
        m.geom_group[:] = HIDDEN
        m.geom_group[geoms] = SHOWN
        low, high = self.boxes[geoms, 0].min(axis=0), self.boxes[geoms, 1].max(axis=0)
        middle, extent = (low + high) / 2, max(float(np.linalg.norm(high - low)), 1e-3)
        keep = (m.stat.extent, m.stat.center.copy(), m.light_active.copy())
        m.stat.extent, m.stat.center[:] = extent, middle  # near and far planes, shadows
        m.light_active[:] = 0
        m.vis.headlight.active = 1
        m.vis.headlight.ambient[:], m.vis.headlight.diffuse[:], m.vis.headlight.specular[:] = 0.45, 0.5, 0.05
        view: Any = self.view(
            tuple(float(x) for x in middle), 2.0 * extent if flat else 1.2 * extent, azimuth, elevation,
            height=self._span(geoms, azimuth, elevation, width / height) if flat else None,
        )  # fmt: skip
        started = time.perf_counter()
        try:
            image = renderer(m, self.data, view, width=width, height=height, groups=(SHOWN,))
        except Exception as e:  # whatever a driver may raise: the report must not fail for a picture
            self.renderer = None
            self.note = f"rendering failed ({' '.join(str(e).split())[:200]}): pictures are drawings"
            return None
        finally:
            m.stat.extent, m.stat.center[:], m.light_active[:] = keep
        self._seconds += time.perf_counter() - started
        self._count += 1
        return _on_light_ground(image)

    def _span(self, geoms: np.ndarray, azimuth: float, elevation: float, aspect: float) -> float:
        """Metres from the lower to the upper edge of a picture without perspective that just holds the geoms."""
        a, e = np.radians([azimuth, elevation])
        right = np.array([np.sin(a), -np.cos(a), 0.0])
        up = np.cross(right, [np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        low, high = self.boxes[geoms, 0].min(axis=0), self.boxes[geoms, 1].max(axis=0)
        across, along = (float(np.abs(axis) @ (high - low)) for axis in (right, up))
        return 1.06 * max(along, across / aspect, 1e-3)

    def scene(self, rooms: RoomMaps | None) -> list[tuple[str, str]]:
        """(caption, data URI): from above, from a corner, and the plan; ceilings and parked objects are left out."""
        if not self.manifest.objects:
            return []
        shown = [
            number
            for number, entry in enumerate(self.manifest.objects)
            if not entry.parked and entry.category != "ceilings"
        ]
        mine = np.isin(self.index.geom_object, shown)
        looks = np.flatnonzero(mine & ~self.index.solid)
        bare = [n for n in shown if not np.any((self.index.geom_object == n) & ~self.index.solid)]
        looks = np.concatenate([looks, np.flatnonzero(np.isin(self.index.geom_object, bare))])
        pictures = [
            ("From above", self._picture(looks, SCENE_SIZE, azimuth=90.0, elevation=-90.0, flat=True)),
            ("From a corner", self._picture(looks, SCENE_SIZE, azimuth=120.0, elevation=-50.0)),
        ]
        plan = draw_plan(self.model, self.data, self.manifest, self.index, rooms)
        if plan is not None:
            pictures.append(("Plan: walls and fixed things grey, loose things blue", data_uri(plan, lossless=True)))
        return [(caption, uri) for caption, uri in pictures if uri]


def _on_light_ground(image: np.ndarray) -> np.ndarray:
    """Pure black, which is what the renderers leave where nothing is, becomes the drawings' light background."""
    from .drawing import BACKGROUND

    empty = ~image.any(axis=2)
    image = image.copy()
    image[empty] = BACKGROUND
    return image


def data_uri(image: np.ndarray, *, lossless: bool = False) -> str:
    """An image [h, w, 3] as text that HTML can show without a file."""
    buffer = io.BytesIO()
    if lossless:
        Image.fromarray(image).save(buffer, "PNG", optimize=True)
    else:
        Image.fromarray(image).save(buffer, "JPEG", quality=82)
    kind = "png" if lossless else "jpeg"
    return f"data:image/{kind};base64,{base64.b64encode(buffer.getvalue()).decode()}"
