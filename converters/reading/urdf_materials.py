"""Materials of a URDF, as urdfdom has them: defined at the top or in any visual, in any order, and used by name.

An error in a material (no such name, wrong numbers, an image that is missing) costs the colour, with a warning.
"""

from __future__ import annotations

import numpy as np

from ..base.description import Rgba
from ..base.file_access import FileGuard
from ..base.xml_reader import Element, parse_number, shortened, where
from .looks import SurfaceLook, TextureReader


class UrdfMaterials:
    """The materials of one URDF.

    Args:
      robot: its root. guard: resolves textures. warnings: gets what cannot be used.
    """

    def __init__(self, robot: Element, guard: FileGuard, warnings: list[str]):
        self._guard, self._warnings = guard, warnings
        self._named: dict[str, SurfaceLook] = {}
        inside = (m for link in robot.iterfind("link") for m in link.iterfind("visual/material"))
        for material in (*robot.iterfind("material"), *inside):
            name = (material.get("name") or "").strip()
            if not name or (material.find("color") is None and material.find("texture") is None):
                continue
            look = self._own(material)
            known = self._named.setdefault(name, look)
            if look != known and look != SurfaceLook():
                if known == SurfaceLook():
                    self._named[name] = look
                else:
                    text = f"material '{shortened(name)}' is defined more than once: each visual keeps its own"
                    self._warn(text)

    def look(self, visual: Element) -> SurfaceLook:
        """The look of a <visual>: its own material's, else that of the material it names; nothing where it has none."""
        material = visual.find("material")
        if material is None:
            return SurfaceLook()
        name = (material.get("name") or "").strip()
        own = self._own(material)
        if own != SurfaceLook():
            return own
        if name in self._named:
            return self._named[name]
        if name:
            self._warn(f"material '{shortened(name)}' is not defined: rendered without it")
        return SurfaceLook()

    def _own(self, material: Element) -> SurfaceLook:
        rgba, texture = self._colour(material), material.find("texture")
        named = None if texture is None else (texture.get("filename") or "").strip()
        if not named:
            return SurfaceLook(rgba)
        reader = TextureReader(self._guard, where(material), self._guard.folder, self._warnings)
        return SurfaceLook(rgba, reader.file(named))

    def _colour(self, material: Element) -> Rgba | None:
        """<color rgba> of a <material>, clipped to 0..1; three numbers are opaque; an alpha of 0 is drawn as 1."""
        colour = material.find("color")
        if colour is None:
            return None
        text = colour.get("rgba") or colour.get("rgb") or ""
        values = [parse_number(word.removesuffix(",")) for word in text.split()]
        if len(values) not in (3, 4) or None in values:
            self._warn(f"{where(colour)}: rgba='{shortened(text, 40)}' is not 3 or 4 numbers: rendered without it")
            return None
        if max(v for v in values if v is not None) > 1:
            said = f"{where(colour)}: rgba='{shortened(text, 40)}'"
            self._warn(f"{said} has numbers above 1, which are read as 1; are they of 255?")
        r, g, b, a = (float(v) for v in np.append(np.clip(np.array(values, dtype=float), 0, 1), 1.0)[:4])
        return r, g, b, a or 1.0

    def _warn(self, text: str) -> None:
        if text not in self._warnings:
            self._warnings.append(text)
