"""The end of every conversion: warnings gathered, manifest written, the result checked and reported."""

from __future__ import annotations

import hashlib
import pathlib
import time
from collections.abc import Collection, Mapping, Sequence
from typing import Any

import mujoco

from ig2mj.errors import InputError
from ig2mj.process.own_version import own_version
from ig2mj.scene.manifest import Manifest, check_manifest, save_manifest

from .base.description import RoomMaps
from .base.options import ConvertOptions
from .base.outcome import CheckResult, ConversionOutcome
from .bodies.joint_rules import openable_ends
from .checks.run import run_checks
from .checks.still import SourceBox
from .hulls.insides import add_insides
from .mjcf.model_builder import ModelBuilder
from .mjcf.scene import HOVERS
from .model_task import BuiltModel
from .report.page import RENDERED, ReportInput, write_report

FIRST_WARNINGS = 5
"""So many warnings are printed; the report has all."""


def version_record(options: ConvertOptions) -> dict[str, Any]:
    """Converter, engine and options: with the source's hashes all that decides the output's bytes."""
    return {
        "converter": f"ig2mj {own_version()}",
        "mujoco": mujoco.__version__,
        "options": options.record(),
    }


def finish(
    folder: pathlib.Path,
    model: mujoco.MjModel,
    manifest: Manifest,
    built: Mapping[str, BuiltModel],
    builder: ModelBuilder,
    options: ConvertOptions,
    *,
    kind: str,
    timings: dict[str, float],
    overlaps_allowed: Collection[frozenset[str]] = (),
    warnings: Sequence[str] = (),
    skipped: Sequence[str] = (),
    rooms: RoomMaps | None = None,
) -> ConversionOutcome:
    """Writes `manifest.json`, runs the checks, writes the report.

    Args:
      model: as loaded from the written file. built: object name -> the model it is an instance of.
      timings: stage -> seconds so far; the checks' are added.
      warnings: about the whole scene.
    """
    checks: list[CheckResult] = []
    add_insides(manifest, model)
    check_manifest(manifest)
    if options.report or options.strict:
        start = time.perf_counter()
        checks = run_checks(model, manifest, overlaps_allowed, _source_boxes(built))
        timings["checks"] = time.perf_counter() - start
    lines = [*warnings, *builder.textures.warnings, *builder.warnings.get("", [])]
    per_object = {name: _object_warnings(name, model_built, builder) for name, model_built in built.items()}
    for name, text in _unsettled(checks):
        per_object.get(name, lines).append(text)
    said = [*lines, *(f"{name}: {line}" for name, found in per_object.items() for line in found)]
    said.sort(key=lambda line: HOVERS in line)  # common, and harmless: after everything that was lost
    if options.strict and said:
        more = f" (and {len(said) - 1} more warnings)" if len(said) > 1 else ""
        raise InputError(manifest.name, f"{said[0]}{more}", fix="--strict treats warnings as errors")
    save_manifest(manifest, folder / "manifest.json")
    provisional = [
        f"'{name}': the decomposition of link '{link}' was stopped"
        for name, model_built in built.items()
        for link, found in model_built.hulls.items()
        if found.stopped
    ]
    if options.report:
        given = ReportInput(
            kind=kind,
            hulls={name: model_built.hulls for name, model_built in built.items()},
            checks=checks,
            warnings=lines,
            object_warnings={name: lines for name, lines in per_object.items() if lines},
            skipped=skipped,
            timings=timings if options.timed else {},
            rooms=rooms,
            encrypted=[name for name, model_built in built.items() if model_built.encrypted],
        )
        facts = write_report(folder, model, manifest, given, options.renderer, options.view)
        if options.renderer is not None and facts["pictures"] != RENDERED:
            provisional.append(facts["pictures"])
    written = hashlib.sha256((folder / "manifest.json").read_bytes()).hexdigest()
    return ConversionOutcome(
        len(manifest.objects),
        list(skipped),
        checks if options.report else [],
        len(said),
        timings,
        provisional,
        written,
        builder.files_outside(),
        first_warnings=list(dict.fromkeys(said))[:FIRST_WARNINGS],
    )


def _unsettled(checks: Sequence[CheckResult]) -> list[tuple[str, str]]:
    """(object, warning) of loose objects that do not stay where they start; '' for the model as a whole."""
    return [
        (str(failure.get("object", "")), f"does not stay at rest in the first second: {failure['problem']}")
        for check in checks
        if check.name == "settle"
        for failure in check.failures
    ]


def _source_boxes(built: Mapping[str, BuiltModel]) -> dict[str, SourceBox]:
    """Object name -> the size of its source's collision shapes, and how far fitted primitives may be off it."""
    boxes = {}
    for name, model in built.items():
        if model.source_box is not None:
            pieces = [piece for link in model.hulls.values() for piece in link.pieces]
            fit = max((piece.fit_error for piece in pieces if piece.kind != "hull"), default=0.0)
            boxes[name] = SourceBox(model.source_box[1] - model.source_box[0], fit)
    return boxes


def _object_warnings(name: str, built: BuiltModel, builder: ModelBuilder) -> list[str]:
    lines = [*built.assembly.warnings, *openable_ends(built.assembly)[1], *builder.warnings.get(name, [])]
    if built.encrypted:
        lines.append("visuals are encrypted: the collision hulls are shown instead")
    return list(dict.fromkeys(lines))
