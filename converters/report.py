"""`report.json` and `report.html`: what was converted, how well, with pictures."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import mujoco
import numpy as np

from ig2mj.scene.manifest import Manifest

from .checks import CheckResult
from .description import RoomMaps
from .pieces import LinkHulls


class Renderer(Protocol):
    """What draws pictures: `ig2mj.viewer.offscreen.render`, handed in by the caller, as the converter may not import it.

    `camera` is a `View`; the fields are those of `ig2mj.viewer.offscreen.FreeView`, which is accepted in its place.
    """

    def __call__(
        self,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        camera: Any = None,
        *,
        width: int = 640,
        height: int = 480,
        groups: Sequence[int] = (0, 1, 2),
    ) -> np.ndarray: ...


@dataclasses.dataclass
class ReportInput:
    """Everything the report tells that is not in the model and the manifest.

    Attributes:
      kind: "scene" or "object".
      hulls: object name -> link name -> its collision geometry.
      checks: of `checks.run_checks`.
      warnings: about the whole. object_warnings: object name -> lines.
      skipped: models that were missing and left out, one line each.
      timings: stage -> seconds, in order.
      rooms: maps of the scene, where it has them.
      encrypted: names of objects whose visuals were replaced by hulls.
    """

    kind: str
    hulls: Mapping[str, Mapping[str, LinkHulls]] = dataclasses.field(default_factory=dict)
    checks: Sequence[CheckResult] = ()
    warnings: Sequence[str] = ()
    object_warnings: Mapping[str, Sequence[str]] = dataclasses.field(default_factory=dict)
    skipped: Sequence[str] = ()
    timings: Mapping[str, float] = dataclasses.field(default_factory=dict)
    rooms: RoomMaps | None = None
    encrypted: Sequence[str] = ()


def write_report(
    folder: pathlib.Path,
    model: mujoco.MjModel,
    manifest: Manifest,
    given: ReportInput,
    renderer: Renderer | None = None,
    view: type | None = None,
) -> dict[str, Any]:
    """Writes `report.json` and the self-contained `report.html` into `folder`; returns what is in `report.json`.

    Args:
      renderer: `ig2mj.viewer.offscreen.render`; without it, or when it fails, simple drawings stand in.
      view: `ig2mj.viewer.offscreen.FreeView`, with which the renderer is called; needed with `renderer`.
    """
    raise NotImplementedError
