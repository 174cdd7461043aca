"""What all conversions take: their common options."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

if TYPE_CHECKING:
    from ig2mj_converters.base.options import ConvertOptions

Flag = Annotated[bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(help_behavior_hint="")]

COLOURS = Literal["auto", "source", "category"]


@dataclasses.dataclass(frozen=True)
class Common:
    """What all conversions take.

    Attributes:
      jobs: processes that work side by side: on the models of a scene, on the parts of a single object.
      seed: seeds convex decomposition, and chooses models that a scene names "random".
      max_hulls: most convex pieces per link. A link of more than 16 gets as few as keep the error of its volume under
        15 % and its openings open.
      max_hull_vertices: most vertices per piece.
      bullet_inertia: inertia of each link's box, as Bullet computes it, instead of that of its hulls.
      colours: of visuals without a texture: the source's, or household ones by category; auto prefers the source's,
        unless every object of a scene is of one flat colour.
      no_cache: convert anew even if nothing has changed, and keep nothing for the next time.
      strict: take warnings for errors: exit status 2, and no output.
      no_report: no checks, no report.json and report.html.
      json: print what was done as JSON.
    """

    jobs: int = 1
    seed: int = 0
    max_hulls: int = 64
    max_hull_vertices: int = 32
    bullet_inertia: Flag = False
    colours: COLOURS = "auto"
    no_cache: Flag = False
    strict: Flag = False
    no_report: Flag = False
    json: Flag = False


DEFAULTS = Common()


def options_of(common: Common, **of_command: Any) -> ConvertOptions:
    """Conversion options from the command line, and the renderer for the report's pictures."""
    from ig2mj_converters.base.options import ConvertOptions

    from ig2mj.errors import InputError

    for name, least in (("jobs", 1), ("max_hulls", 1), ("max_hull_vertices", 8)):
        if (given := getattr(common, name)) < least:
            element = "--" + name.replace("_", "-")
            raise InputError("command line", f"is {given}, must be at least {least}", element=element)
    return ConvertOptions(
        jobs=common.jobs,
        seed=common.seed,
        max_hulls=common.max_hulls,
        max_hull_vertices=common.max_hull_vertices,
        bullet_inertia=common.bullet_inertia,
        colours=common.colours,
        cache=not common.no_cache,
        report=not common.no_report,
        strict=common.strict,
        renderer=None if common.no_report else _render,
        view=None if common.no_report else _free_view,
        **of_command,
    )


def _render(*arguments: Any, **options: Any) -> Any:
    """`ig2mj.viewer.offscreen.render`, imported when there is something to draw."""
    from ig2mj.viewer.offscreen import render

    return render(*arguments, **options)


def _free_view(*arguments: Any, **options: Any) -> Any:
    """`ig2mj.viewer.offscreen.FreeView`, likewise."""
    from ig2mj.viewer.offscreen import FreeView

    return FreeView(*arguments, **options)
