"""Is the converted scene sound? Measured on the compiled model, listed object by object.

`still` looks at what can be seen without moving anything, `motion` at what takes steps.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping

import mujoco

from ig2mj.scene.manifest import Manifest

from ..base.outcome import CheckResult
from ..mjcf.model_index import index_model
from . import motion, still
from .still import SourceBox


def run_checks(
    model: mujoco.MjModel,
    manifest: Manifest,
    overlaps_allowed: Collection[frozenset[str]] = (),
    sources: Mapping[str, SourceBox] | None = None,
    closed: mujoco.MjModel | None = None,
) -> list[CheckResult]:
    """All checks, in the order of `CheckResult.name`. The model is left as it was.

    Args:
      overlaps_allowed: pairs of object names from misc/bbox_overlap.json that may penetrate at t = 0.
      sources: object name -> size of its source's collision shapes, measured on them.
      closed: the same scene at another start, from which joints are moved, where `model` starts with some open.
    """
    index = index_model(model, manifest)
    checks: list[Callable[[], CheckResult]] = [
        lambda: still.check_compiles(model),
        lambda: still.check_boxes(model, manifest, index, sources or {}),
        lambda: still.check_mass(model, manifest, index),
        lambda: still.check_penetration(model, index, overlaps_allowed),
        lambda: motion.check_settle(model, manifest, index),
    ]
    results = []
    for check in checks:
        started = time.perf_counter()
        result = check()
        result.seconds = time.perf_counter() - started
        results.append(result)
    return results + motion.check_joints(closed or model, manifest, index)
