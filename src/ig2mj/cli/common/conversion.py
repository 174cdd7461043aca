"""Options of all conversions."""

from __future__ import annotations

import dataclasses
import pathlib
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

if TYPE_CHECKING:
    from ig2mj_converters.base.options import ConvertOptions

Flag = Annotated[bool, tyro.conf.FlagCreatePairsOff, tyro.conf.arg(help_behavior_hint="")]

COLOURS = Literal["auto", "source", "category"]


@dataclasses.dataclass(frozen=True)
class Common:
    """Options of every conversion.

    Attributes:
      jobs: number of processes, over which the models of a scene or the links of an object are distributed; default:
        1, for a single object or robot one per processor.
      seed: random seed of convex decomposition and of models that a scene names "random".
      max_hulls: largest number of convex pieces per link. A link gets more than 16 only as far as it needs them to keep
        its volume error under 15 % and its openings open.
      max_hull_vertices: largest number of vertices per piece.
      bullet_inertia: use the inertia of each link's bounding box, as Bullet does, instead of that of its hulls.
      colours: colours of untextured visuals: the source's, or household colours by category; auto prefers the
        source's, unless every object of a scene is of one flat colour.
      no_cache: convert again what has not changed, and write nothing to the cache.
      strict: treat warnings as errors: exit status 2, no output.
      no_report: skip the checks, report.json and report.html.
      limit: raise or lower limits of the readers, e.g. mesh-faces=3000000 (see docs/guide/untrusted_input.md).
      json: print what was done as JSON.
    """

    jobs: Annotated[int | None, tyro.conf.arg(help_behavior_hint="")] = None
    seed: int = 0
    max_hulls: int = 64
    max_hull_vertices: int = 32
    bullet_inertia: Flag = False
    colours: COLOURS = "auto"
    no_cache: Flag = False
    strict: Flag = False
    no_report: Flag = False
    limit: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME=N", help_behavior_hint="")] = ()
    json: Flag = False


DEFAULTS = Common()


def options_of(common: Common, *, default_jobs: int = 1, **of_command: Any) -> ConvertOptions:
    """Conversion options from the command line, and the renderer for the report's images.

    default_jobs: processes where `--jobs` does not say how many.
    """
    from ig2mj_converters.base.options import ConvertOptions
    from ig2mj_converters.base.read_limits import ReadLimits

    from ig2mj.errors import InputError

    for name, least in (("jobs", 1), ("max_hulls", 1), ("max_hull_vertices", 8)):
        if (given := getattr(common, name)) is not None and given < least:
            element = "--" + name.replace("_", "-")
            raise InputError("command line", f"is {given}, must be at least {least}", element=element)
    return ConvertOptions(
        jobs=common.jobs or default_jobs,
        seed=common.seed,
        max_hulls=common.max_hulls,
        max_hull_vertices=common.max_hull_vertices,
        bullet_inertia=common.bullet_inertia,
        colours=common.colours,
        cache=not common.no_cache,
        report=not common.no_report,
        strict=common.strict,
        limits=ReadLimits.from_words(common.limit),
        renderer=None if common.no_report else _render,
        view=None if common.no_report else _free_view,
        **of_command,
    )


def check_kind(out: pathlib.Path, kind: Literal["home", "object", "robot"]) -> None:
    """Raises InputError: `out` holds a result of another kind, which the conversion would replace."""
    from ig2mj.errors import InputError

    kinds: dict[str, str] = {"scene.xml": "home", "robot.json": "robot", "object.xml": "object"}
    held = next((kinds[name] for name in kinds if (out / name).is_file()), kind)
    if held != kind:
        article = "an" if held == "object" else "a"
        problem = f"holds {article} {held}, and is not overwritten by another kind of output ({kind})"
        raise InputError(out, problem, element="--out", fix="name a new or empty folder")


def _render(*arguments: Any, **options: Any) -> Any:
    """`ig2mj.viewer.offscreen.render`, imported when there is something to draw."""
    from ig2mj.viewer.offscreen import render

    return render(*arguments, **options)


def _free_view(*arguments: Any, **options: Any) -> Any:
    """`ig2mj.viewer.offscreen.FreeView`, likewise."""
    from ig2mj.viewer.offscreen import FreeView

    return FreeView(*arguments, **options)
