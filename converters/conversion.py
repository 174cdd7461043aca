"""Conversions of scenes and objects with a cache of outputs: unchanged inputs give the cached result.

What does the work (`convert_scene`, `convert_object`) is imported only when there is work: that alone takes seconds.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import Any

from .base import inputs, output_cache
from .base.options import ConvertOptions
from .base.outcome import ConversionOutcome

Path = str | os.PathLike


def convert_scene(
    dataset_root: Path, name: str, out: Path, *, urdf: Path | None = None, options: ConvertOptions | None = None
) -> ConversionOutcome:
    """As `convert_scene.convert_scene`, with the cache of finished outputs before it."""
    options = options or ConvertOptions()

    def work() -> ConversionOutcome:
        from .convert_scene import convert_scene as convert

        return convert(dataset_root, name, out, urdf=urdf, options=options)

    request = {"kind": "scene", "dataset": _absolute(dataset_root), "name": name}
    if urdf is not None:
        request |= {"urdf": os.fspath(urdf), "urdf_file": _absolute(urdf)}
    return _done(request, out, options, work)


def convert_object(
    urdf: Path,
    category: str,
    out: Path,
    *,
    model: str | None = None,
    bounding_box: tuple[float, float, float] | None = None,
    fixed: bool = False,
    annotations: Path | None = None,
    options: ConvertOptions | None = None,
) -> ConversionOutcome:
    """As `convert_object.convert_object`, with the cache of finished outputs before it."""
    options = options or ConvertOptions()

    def work() -> ConversionOutcome:
        from .convert_object import convert_object as convert

        how = {"model": model, "bounding_box": bounding_box, "fixed": fixed, "annotations": annotations}
        return convert(urdf, category, out, **how, options=options)

    box = None if bounding_box is None else [float(v) for v in bounding_box]
    request = {"kind": "object", "urdf": _absolute(urdf), "category": category, "model": model, "box": box}
    if fixed:
        request["fixed"] = True
    if annotations is not None:
        request["annotations"] = _absolute(annotations)
    return _done(request, out, options, work)


def _done(
    request: dict[str, Any], out: Path, options: ConvertOptions, work: Callable[[], ConversionOutcome]
) -> ConversionOutcome:
    if not options.cache:
        return work()
    start = time.perf_counter()
    options.progress(0, 1, "comparing with earlier conversions")
    key = output_cache.key_of(request, options)
    known = output_cache.fetch(key, out)
    if known is not None:
        known.timings = {"cache": time.perf_counter() - start}
        return known
    with inputs.recording() as record:
        outcome = work()
    if not outcome.provisional and record.consistent:
        output_cache.store(key, record, outcome, out)
    return outcome


def _absolute(path: Path) -> str:
    return os.path.abspath(path)  # noqa: PTH100  pathlib's keeps "..", which would give one folder two names
