"""Images of single objects: how they look, where their functional parts and their frame are, what collides."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Sequence

import mujoco
import numpy as np
from jaxtyping import Float
from PIL import Image, ImageDraw, ImageFont

from ig2mj.scene.scene import Scene
from ig2mj.viewer.label_space import Sight
from ig2mj.viewer.offscreen import FreeView, render

SIDE, SMALL = 560, 220
"""Pixels: edges of a tile of an object alone, and of one of a library."""

COLUMNS = 6
SHARPER = 2
"""Images are rendered this much larger, and scaled down."""

AZIMUTH, ELEVATION = 215.0, -28.0
MARGIN = 1.25
INK, PAPER = (25, 30, 38), (255, 255, 255)

COLOURS = {
    "heat_source": (0.95, 0.35, 0.15),
    "toggle_button": (0.85, 0.15, 0.55),
    "water_source": (0.20, 0.50, 0.95),
    "water_sink": (0.15, 0.30, 0.70),
    "slicer": (0.55, 0.35, 0.80),
    "cleaning_tool_area": (0.20, 0.65, 0.35),
}
AXES = (("x", (0.85, 0.1, 0.1)), ("y", (0.1, 0.65, 0.1)), ("z", (0.1, 0.2, 0.9)))

Rgb = tuple[float, float, float]


@dataclasses.dataclass(frozen=True)
class Annotated:
    """A functional part: its kind, where it is (m, world), and for a box its half sizes and its rotation matrix."""

    kind: str
    pos: Float[np.ndarray, "3"]
    half: Float[np.ndarray, "3"] | None = None
    matrix: Float[np.ndarray, "3 3"] | None = None

    def edges(self) -> list[tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]]:
        """Of a box, world frame; none of a point."""
        if self.half is None or self.matrix is None:
            return []
        corners = np.array(list(itertools.product((-1, 1), repeat=3)))
        points = self.pos + (corners * self.half) @ self.matrix.T
        pairs = itertools.combinations(range(8), 2)
        return [(points[a], points[b]) for a, b in pairs if np.sum(corners[a] != corners[b]) == 1]


def object_image(scene: Scene, title: str = "") -> Image.Image:
    """The first object of a scene: its look with its frame and its annotated links, next to its collision geometry.

    Args:
      scene: of a folder that `ig2mj convert object` wrote. title: stands above.
    """
    data = scene.start_data()
    view, reach = _view(scene, data)
    parts = annotated_links(scene, data)
    frame = np.array(data.xpos[scene.tables.object_root[0]]), data.xmat[scene.tables.object_root[0]].reshape(3, 3)

    def mark(drawn: mujoco.MjvScene) -> None:
        for part in parts:
            _draw_part(drawn, part, reach)

    look, solid = (_tile(scene, data, view, SIDE, *how) for how in (((0, 1, 2), mark), ((3,), None)))
    pen = ImageDraw.Draw(look)
    sight = Sight.of_view(view, float(scene.model.vis.global_.fovy), (SIDE, SIDE))
    for k, (_, colour) in enumerate(AXES):
        _write_line(pen, sight, frame[0], frame[0] + 0.5 * reach * frame[1][:, k], colour)
    for part in parts:
        for start, end in part.edges():
            _write_line(pen, sight, start, end, COLOURS[part.kind])
    labels = [(name, frame[0] + 0.58 * reach * frame[1][:, k], colour) for k, (name, colour) in enumerate(AXES)]
    labels += [(part.kind, part.pos, COLOURS[part.kind]) for part in parts]
    _write_labels(pen, sight, labels)
    sheet = Image.new("RGB", (2 * SIDE, SIDE + 34), PAPER)
    sheet.paste(look, (0, 34))
    sheet.paste(solid, (SIDE, 34))
    pen, font = ImageDraw.Draw(sheet), ImageFont.load_default(size=16)
    pen.text((10, 8), title, fill=INK, font=font)
    pen.text((SIDE + 10, 8), "collision geometry", fill=INK, font=font)
    return sheet


def library_image(scenes: Sequence[tuple[str, Scene]], columns: int = COLUMNS) -> Image.Image:
    """A contact sheet of objects, each with its name. Args: scenes: names, and scenes as of `object_image`."""
    columns = min(columns, len(scenes)) or 1
    rows = math.ceil(len(scenes) / columns)
    sheet = Image.new("RGB", (columns * SMALL, rows * SMALL), PAPER)
    for k, (name, scene) in enumerate(scenes):
        data = scene.start_data()
        tile = _tile(scene, data, _view(scene, data)[0], SMALL, (0, 1, 2), None)
        pen = ImageDraw.Draw(tile)
        pen.rectangle([0, SMALL - 17, SMALL, SMALL], fill=PAPER)
        pen.text((4, SMALL - 15), name, fill=INK)
        sheet.paste(tile, (k % columns * SMALL, k // columns * SMALL))
    return sheet


def annotated_links(scene: Scene, data: mujoco.MjData) -> list[Annotated]:
    """The functional parts of the scene's first object."""
    found = []
    for kind, link in scene.manifest.objects[0].links.items():
        if link.site is not None:
            found.append(Annotated(kind, np.array(data.site(link.site).xpos)))
        elif link.geom is not None:
            geom = data.geom(link.geom)
            half = np.array(scene.model.geom(link.geom).size)
            found.append(Annotated(kind, np.array(geom.xpos), half, np.array(geom.xmat).reshape(3, 3)))
    return found


def _view(scene: Scene, data: mujoco.MjData) -> tuple[FreeView, float]:
    """What shows the whole first object, and the radius of the ball around it (m)."""
    entry, root = scene.manifest.objects[0], scene.tables.object_root[0]
    centre = data.xpos[root] + data.xmat[root].reshape(3, 3) @ np.asarray(entry.base_link_offset)
    reach = max(math.hypot(*entry.bounding_box) / 2, 0.01)
    distance = MARGIN * reach / math.sin(math.radians(float(scene.model.vis.global_.fovy)) / 2)
    x, y, z = map(float, centre)
    return FreeView((x, y, z), distance, AZIMUTH, ELEVATION), reach


def _tile(
    scene: Scene,
    data: mujoco.MjData,
    view: FreeView,
    side: int,
    groups: Sequence[int],
    mark: Callable[[mujoco.MjvScene], None] | None,
) -> Image.Image:
    pixels = min(SHARPER * side, int(scene.model.vis.global_.offheight), int(scene.model.vis.global_.offwidth))
    drawn = render(scene.model, data, view, width=pixels, height=pixels, groups=groups, decorate=mark)
    return Image.fromarray(drawn).resize((side, side), Image.Resampling.LANCZOS)


def _write_labels(pen: ImageDraw.ImageDraw, sight: Sight, labels: Sequence[tuple[str, np.ndarray, Rgb]]) -> None:
    """Names of points, those of parts on the right with a line to the part."""
    at, _ = sight.pixels(np.array([pos for _, pos, _ in labels]))
    row, font = 12, ImageFont.load_default(size=15)
    for (name, _, colour), (x, up) in zip(labels, at, strict=True):
        y, ink = sight.size[1] - up, tuple(round(255 * c) for c in colour)
        if len(name) == 1:
            pen.text((x - 4, y - 8), name, fill=ink, font=font)
            continue
        width = pen.textlength(name, font=font)
        left = sight.size[0] - width - 14
        pen.line([(left - 4, row + 9), (x, y)], fill=ink, width=2)
        pen.ellipse([x - 4, y - 4, x + 4, y + 4], outline=PAPER, fill=ink)
        pen.rectangle([left - 4, row - 2, left + width + 4, row + 20], fill=PAPER, outline=ink)
        pen.text((left, row), name, fill=ink, font=font)
        row += 28


def _draw_part(scene: mujoco.MjvScene, part: Annotated, reach: float) -> None:
    if part.half is None or part.matrix is None:
        kind, size, matrix, alpha = mujoco.mjtGeom.mjGEOM_SPHERE, np.full(3, 0.05 * reach), np.eye(3), 1.0
    else:
        kind, size, matrix, alpha = mujoco.mjtGeom.mjGEOM_BOX, part.half, part.matrix, 0.55
    rgba = np.array([*COLOURS[part.kind], alpha], np.float32)
    if scene.ngeom < scene.maxgeom:
        mujoco.mjv_initGeom(scene.geoms[scene.ngeom], kind, size, part.pos, matrix.ravel(), rgba)
        scene.ngeom += 1


def _write_line(pen: ImageDraw.ImageDraw, sight: Sight, start: np.ndarray, end: np.ndarray, colour: Rgb) -> None:
    at, depth = sight.pixels(np.array([start, end]))
    if np.all(depth > 0):
        ends = [(float(x), sight.size[1] - float(up)) for x, up in at]
        pen.line(ends, fill=tuple(round(255 * c) for c in colour), width=2)
