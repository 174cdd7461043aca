"""`report.json` and `report.html`: what was converted, how well, with pictures."""

from __future__ import annotations

import dataclasses
import json
import math
import pathlib
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np

from ig2mj.scene.manifest import Manifest, ObjectEntry

from ..base.description import RoomMaps
from ..base.options import ReportRenderer
from ..base.outcome import CheckResult
from ..hulls.pieces import LinkHulls
from ..mjcf.model_index import ModelIndex, index_model
from .pictures import Pictures

FORMAT_VERSION = 1
RENDERED = "rendered"
"""What the report says of its pictures where they are not drawings."""


@dataclasses.dataclass
class ReportInput:
    """Everything in the report that is not in the model and the manifest.

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
    renderer: ReportRenderer | None = None,
    view: Callable[..., Any] | None = None,
) -> dict[str, Any]:
    """Writes `report.json` and the self-contained `report.html` into `folder`; returns what is in `report.json`.

    Args:
      renderer: `ig2mj.viewer.offscreen.render`; without it, or when it fails, simple drawings stand in.
      view: `ig2mj.viewer.offscreen.FreeView`, with which the renderer is called; needed with `renderer`.
    """
    index = index_model(model, manifest)
    facts = collect(model, manifest, index, given)
    pictures = Pictures(model, manifest, index, renderer, view)
    scene_pictures = pictures.scene(given.rooms) if given.kind == "scene" else []
    object_pictures = [pictures.object(number) for number in range(len(manifest.objects))]
    facts["pictures"] = pictures.note or RENDERED
    folder = pathlib.Path(folder)
    text = json.dumps(facts, indent=1, allow_nan=False, ensure_ascii=False)
    (folder / "report.json").write_text(text + "\n", encoding="utf-8")
    (folder / "report.html").write_text(_page(facts, scene_pictures, object_pictures), encoding="utf-8")
    return facts


def collect(model: mujoco.MjModel, manifest: Manifest, index: ModelIndex, given: ReportInput) -> dict[str, Any]:
    """Everything in `report.json` but how the pictures were made. Plain numbers, strings, lists and dicts."""
    checks = [dataclasses.asdict(check) for check in given.checks]
    complaints: dict[str, list[dict[str, Any]]] = {}
    for check in given.checks:
        for failure in check.failures:
            for name in {failure.get("object"), failure.get("other")} - {None}:
                problem = failure["problem"]
                if name == failure.get("other") and name != failure.get("object"):
                    problem = f"{failure['object']} {problem}"
                line = {"check": check.name, "problem": problem, "advisory": check.advisory}
                complaints.setdefault(str(name), []).append(line)
    measured = {check.name: check.measured for check in given.checks}
    objects = [
        _object(entry, index.joints[number], given, complaints.get(entry.name, []), measured)
        for number, entry in enumerate(manifest.objects)
    ]
    facts = {
        "format_version": FORMAT_VERSION,
        "kind": given.kind,
        "name": manifest.name,
        "source": manifest.source,
        "totals": _totals(model, manifest, index, objects, given),
        "checks": sorted(checks, key=lambda c: (c["passed"], c["advisory"])),
        "warnings": list(given.warnings),
        "skipped": list(given.skipped),
        "rooms": _rooms(manifest),
        "timings": dict(given.timings),
        "objects": objects,
    }
    return _plain(facts)


def _object(entry: ObjectEntry, joints: list[int], given: ReportInput, complaints: list, measured: dict) -> dict:
    links = {name: _link(hulls) for name, hulls in given.hulls.get(entry.name, {}).items()}
    kinds: dict[str, int] = {}
    for link in links.values():
        for kind, count in link["kinds"].items():
            kinds[kind] = kinds.get(kind, 0) + count
    before = sum(h.volume_before for h in given.hulls.get(entry.name, {}).values())
    after = sum(h.volume for h in given.hulls.get(entry.name, {}).values())
    box = measured.get("bounding_box", {}).get(entry.name, {})
    warnings = list(given.object_warnings.get(entry.name, []))
    return {
        "name": entry.name,
        "category": entry.category,
        "model": entry.model,
        "fixed": entry.fixed,
        "parked": entry.parked,
        "encrypted": entry.name in given.encrypted,
        "rooms": entry.rooms,
        "scale": entry.scale,
        "bounding_box": {"asked": entry.bounding_box, "got": box.get("got")},
        "mass": entry.mass,
        "joints": len(joints),
        "abilities": sorted(entry.abilities),
        "hulls_before": sum(link["before"] for link in links.values()),
        "hulls_after": sum(link["after"] for link in links.values()),
        "kinds": kinds,
        "volume_error": after / before - 1 if before > 0 else 0.0,
        "links": links,
        "warnings": warnings,
        "complaints": complaints,
        "status": _status(complaints, warnings),
    }


def _status(complaints: list, warnings: list) -> str:
    if any(not c["advisory"] for c in complaints):
        return "failed"
    return "warning" if warnings or complaints else "ok"


def _link(hulls: LinkHulls) -> dict[str, Any]:
    return {
        "method": hulls.method,
        "before": hulls.before,
        "after": hulls.after,
        "kinds": hulls.kinds(),
        "volume_error": hulls.volume_error,
        "volume": hulls.volume,
        "source_volume": hulls.source_volume,
        "fit_error": max((p.fit_error for p in hulls.pieces), default=0.0),
        "fits": [
            {"kind": p.kind, "distance": p.fit_error, "volume_error": p.volume_error, "source": p.source}
            for p in hulls.pieces
        ],
        "vertices": max((len(p.vertices) for p in hulls.pieces if p.kind == "hull"), default=0),
        "warnings": hulls.warnings,
        "seconds": hulls.seconds,
        "cached": hulls.cached,
    }


def _totals(model: mujoco.MjModel, manifest: Manifest, index: ModelIndex, objects: list[dict], given: ReportInput):
    kinds: dict[str, int] = {}
    for o in objects:
        for kind, count in o["kinds"].items():
            kinds[kind] = kinds.get(kind, 0) + count
    warnings = len(given.warnings) + sum(len(o["warnings"]) for o in objects)
    return {
        "objects": len(objects),
        "fixed": sum(o["fixed"] for o in objects),
        "loose": sum(not o["fixed"] for o in objects),
        "articulated": sum(o["joints"] > 0 for o in objects),
        "parked": sum(o["parked"] for o in objects),
        "joints": sum(o["joints"] for o in objects),
        "rooms": len(manifest.rooms.instances),
        "bodies": model.nbody,
        "degrees_of_freedom": model.nv,
        "collision_geoms": int(index.solid.sum()),
        "hulls_before": sum(o["hulls_before"] for o in objects),
        "hulls_after": sum(o["hulls_after"] for o in objects),
        "kinds": kinds,
        "loose_mass": float(sum(o["mass"] for o in objects if not o["fixed"])),
        "warnings": warnings,
        "failed_checks": sum(not c.passed and not c.advisory for c in given.checks),
        "seconds": float(sum(given.timings.values())),
    }


def _rooms(manifest: Manifest) -> list[dict[str, Any]]:
    return [
        {
            "name": name,
            "type": room.type,
            "floor": room.floor,
            "objects": sum(name in o.rooms for o in manifest.objects),
        }
        for name, room in manifest.rooms.instances.items()
    ]


def _plain(value: Any) -> Any:
    """The value in JSON's own types; numbers that JSON does not have become null."""
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [_plain(v) for v in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if isinstance(value, str | int | bool | type(None)) else str(value)


def _page(facts: dict, scene_pictures: list[tuple[str, str]], object_pictures: list[tuple[str, str]]) -> str:
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(pathlib.Path(__file__).parent),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters |= {
        "metres": _metres,
        "percent": _percent,
        "kg": _kilograms,
        "counted": _counted,
        "words": _words,
    }
    return environment.get_template("page.html.j2").render(
        facts=facts, totals=facts["totals"], scene_pictures=scene_pictures, object_pictures=object_pictures
    )


def _metres(values: Sequence[float] | None) -> str:
    return " × ".join(f"{v:.3f}" for v in values) if values else "none"


def _percent(value: float | None) -> str:
    if value is None:
        return ""
    return f"{value:+.1%}" if abs(value) >= 0.0005 else "0.0%"


def _counted(kinds: Mapping[str, int]) -> str:
    """{"box": 2, "hull": 1} -> "2 boxes, 1 hull"."""
    plural = {kind: f"{kind}es" if kind.endswith("x") else f"{kind}s" for kind in kinds}
    return ", ".join(f"{count} {kind if count == 1 else plural[kind]}" for kind, count in kinds.items())


def _kilograms(value: float) -> str:
    return f"{value:.3g}" if value < 100 else f"{value:.0f}"


def _words(name: str) -> str:
    return name.replace("_", " ")
