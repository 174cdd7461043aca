"""Converted homes and objects in one folder with shared meshes and textures: what `scenes_mjcf/` holds.

Reports are left out (pictures of every object are large); what a home's checks said is kept as `checks.json`.
"""

from __future__ import annotations

import json
import pathlib
import xml.etree.ElementTree as ElementTree
from collections.abc import Collection

from .object_library import FOLDER

SHARED = ("meshes", "textures")
NOT_SHIPPED = ("report.html", "report.json")


def strip_report(home: pathlib.Path, *, keep_checks: bool = True) -> list[str]:
    """Removes the report of a converted home or object, keeping `checks.json` of it; the failed checks, a line each."""
    report = home / "report.json"
    checks = json.loads(report.read_text(encoding="utf-8"))["checks"]
    kept = [{key: check[key] for key in ("name", "passed", "summary", "failures")} for check in checks]
    if keep_checks:
        (home / "checks.json").write_text(json.dumps(kept, indent=1) + "\n", encoding="utf-8", newline="\n")
    for name in NOT_SHIPPED:
        (home / name).unlink(missing_ok=True)
    return [f"{home.name}: {check['name']}: {check['summary']}" for check in kept if not check["passed"]]


def used_assets(scene: pathlib.Path) -> set[pathlib.Path]:
    """Mesh and texture files that a scene.xml or object.xml names, resolved."""
    root = ElementTree.parse(scene).getroot()
    compiler = root.find("compiler")
    assert compiler is not None, f"{scene} has no <compiler>"
    folders = {"mesh": compiler.get("meshdir", ""), "texture": compiler.get("texturedir", "")}
    return {
        (scene.parent / folders[kind] / element.get("file", "")).resolve()
        for kind in folders
        for element in root.iter(kind)
        if element.get("file")
    }


def remove_unused(homes: pathlib.Path) -> int:
    """Deletes shared meshes and textures that no home and no object of the library uses; returns how many."""
    used: set[pathlib.Path] = set()
    for file in [*homes.glob("*/scene.xml"), *homes.glob(f"{FOLDER}/*/*/object.xml")]:
        used |= used_assets(file)
    unused = [file for part in SHARED for file in (homes / part).glob("*") if file.resolve() not in used]
    for file in unused:
        file.unlink()
    return len(unused)


def total_bytes(homes: pathlib.Path, parts: Collection[str] = ("**/*",)) -> int:
    """Size of all files below a folder."""
    return sum(file.stat().st_size for part in parts for file in homes.glob(part) if file.is_file())
