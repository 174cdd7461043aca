"""Options of a conversion."""

from __future__ import annotations

import dataclasses
import functools
import pathlib
from collections.abc import Callable, Collection, Sequence
from typing import Any, Literal, ParamSpec, Protocol, TypeVar

from ig2mj.callbacks import ProgressCallback, no_progress

from .read_limits import ReadLimits, limits_of


class ReportRenderer(Protocol):
    """What draws images: `ig2mj.viewer.offscreen.render`, handed in because the converter may not import it.

    `camera` is given as an `ig2mj.viewer.offscreen.FreeView`.
    """

    def __call__(
        self,
        model: Any,
        data: Any,
        camera: Any = None,
        *,
        width: int = 640,
        height: int = 480,
        groups: Sequence[int] = (0, 1, 2),
    ) -> Any: ...


@dataclasses.dataclass(frozen=True)
class ConvertOptions:
    """Options of both conversions. Those in the first group decide what comes out; the rest only how it is made.

    Attributes:
      seed: chooses models named "random", and seeds the decomposition.
      fixed_furniture: fix the 12 categories that BEHAVIOR's `_fixed_furniture` scenes fix.
      only_rooms, only_categories: what stays of a scene (building parts always do).
      skip_missing: leave out models that are not in the dataset.
      ceiling_collision: give ceilings collision geoms.
      max_hulls, max_hull_vertices: most pieces per link, most vertices per piece. A link gets as few pieces as keep
        its volume's error under 15 % and its openings open (see `HullOptions`).
      bullet_inertia: inertia of the bounding box, as Bullet computes it, instead of the hulls'.
      colours: of visuals without a texture: the source's, or household ones by category. "auto": the source's, unless
        every object of a scene is of one flat colour, which comes from the modelling program.
      assets: folder that gets `meshes/` and `textures/`, relative to the output's, so that many scenes can share them.
      keep_hovering: start loose objects exactly where the source has them, even in mid-air.
      jobs: processes. cache: use the caches of decompositions and of finished outputs.
      report: write report.json and report.html. timed: they contain the duration of each stage.
      strict: take warnings for errors, and leave no output.
      mesh_root, package_path: of an object: a folder below which its meshes may lie, although it is not above the URDF;
        folders in which packages (`package://`) are looked for first.
      limits: how much the readers take from one input.
      renderer, view: what draws the report's images (see `report.write_report`).
    """

    seed: int = 0
    fixed_furniture: bool = False
    only_rooms: Collection[str] | None = None
    only_categories: Collection[str] | None = None
    skip_missing: bool = False
    ceiling_collision: bool = False
    max_hulls: int = 64
    max_hull_vertices: int = 32
    bullet_inertia: bool = False
    colours: Literal["auto", "source", "category"] = "auto"

    keep_hovering: bool = False
    assets: str = "."

    jobs: int = 1
    cache: bool = True
    report: bool = True
    timed: bool = True
    strict: bool = False
    mesh_root: pathlib.Path | None = None
    package_path: tuple[pathlib.Path, ...] = ()
    limits: ReadLimits = dataclasses.field(default_factory=ReadLimits)
    renderer: ReportRenderer | None = None
    view: Callable[..., Any] | None = None
    progress: ProgressCallback = no_progress

    def record(self) -> dict[str, Any]:
        """What the manifest keeps of the options: those that decide what comes out."""
        kept = ("seed", "fixed_furniture", "ceiling_collision", "max_hulls", "max_hull_vertices", "bullet_inertia")
        kept += ("colours", "keep_hovering")
        record: dict[str, Any] = {name: getattr(self, name) for name in kept}
        for name in ("only_rooms", "only_categories"):
            value = getattr(self, name)
            if value is not None:
                record[name] = sorted(value)
        return record


Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")


def under_limits(conversion: Callable[Arguments, Result]) -> Callable[Arguments, Result]:
    """A conversion whose readers keep to the limits of its keyword argument `options`."""

    @functools.wraps(conversion)
    def run(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
        options = kwargs.get("options")
        with limits_of(options.limits if isinstance(options, ConvertOptions) else ReadLimits()):
            return conversion(*args, **kwargs)

    return run
