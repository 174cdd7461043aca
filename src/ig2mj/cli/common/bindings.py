"""Homes in which an activity can be bound, and the result as text."""

from __future__ import annotations

import pathlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ig2mj.scene.manifest import Manifest
    from ig2mj.tasks.bddl.binding import Binding


def find_homes(scene: str | None) -> list[Manifest]:
    """Manifests of the home that was named, or of all that ship. Raises InputError."""
    from ig2mj.scene.manifest import load_manifest
    from ig2mj.scene.paths import scene_folder, shipped_homes

    return [load_manifest(scene_folder(pathlib.Path(name))) for name in ([scene] if scene else shipped_homes())]


def binding_as_text(best: Binding | None, fit: list[str], errors: dict[str, list[str]]) -> list[str]:
    if best is None:
        near = sorted(errors, key=lambda home: len(errors[home]))[:3]
        return ["cannot be bound:", *(f"  {home}: {'; '.join(errors[home])}" for home in near)]
    lines = [f"in {best.home}:"]
    for name, bound in best.objects.items():
        room = f", {best.rooms[name]}" if name in best.rooms else ""
        added = ", added from the object library" if bound in best.added else ""
        lines.append(f"  {name:<32} {bound}{room}{added}")
    lines += [f"  {s} is not in the taxonomy: {instead} stands in" for s, instead in best.stand_ins.items()]
    others = [home for home in fit if home != best.home]
    return [*lines, *([f"also fits: {', '.join(others)}"] if others else [])]
