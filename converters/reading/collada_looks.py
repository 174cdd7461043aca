"""Materials of a COLLADA file, read the way viewers read them: what is missing or broken is a warning and no colour."""

from __future__ import annotations

import pathlib

from ..base.description import Rgba
from ..base.xml_reader import Element, parse_number
from .looks import SurfaceLook, TextureReader

SHADINGS = ("constant", "lambert", "phong", "blinn")
IMAGE_STEPS = 8
"""So many references may lie between a texture and its image's file."""


class ColladaLooks:
    """The looks of a file whose names have no namespace.

    Args:
      textures: opens images and takes warnings.
    """

    def __init__(self, root: Element, textures: TextureReader, file: pathlib.Path):
        self._textures, self._file = textures, file
        self._effects = _by_id(root.iterfind("library_effects/effect"))
        self._materials = _by_id(root.iterfind("library_materials/material"))
        self._images = _by_id(root.iterfind("library_images/image"))
        self._looks: dict[str, SurfaceLook] = {}

    def bindings(self, instance: Element) -> dict[str, str]:
        """symbol -> id of a material, of an <instance_geometry> or <instance_controller>."""
        found = {}
        for bound in instance.iterfind("bind_material/technique_common/instance_material"):
            found[bound.get("symbol") or ""] = (bound.get("target") or "").removeprefix("#")
        return found

    def look(self, symbol: str | None, bindings: dict[str, str]) -> SurfaceLook:
        """The look of a primitive with this material symbol. A symbol that is not bound may itself be a material."""
        name = bindings.get(symbol or "", symbol or "")
        if not name:
            return SurfaceLook()
        if name not in self._looks:
            self._looks[name] = self._read(name)
        return self._looks[name]

    def _read(self, name: str) -> SurfaceLook:
        material = self._materials.get(name)
        if material is None:
            return self._lost(f"material '{name}' does not exist")
        link = material.find("instance_effect")
        url = "" if link is None else (link.get("url") or "").removeprefix("#")
        effect = self._effects.get(url)
        if effect is None:
            return self._lost(f"effect '{url}' of material '{name}' does not exist")
        for shading in SHADINGS:
            found = effect.find(f"profile_COMMON/technique/{shading}")
            if found is not None:
                return self._shaded(found, effect, name)
        return self._lost(f"effect '{url}' has no colour")

    def _lost(self, text: str) -> SurfaceLook:
        self._textures.warn(f"{self._file.name}: {text}: rendered without it")
        return SurfaceLook()

    def _shaded(self, shading: Element, effect: Element, name: str) -> SurfaceLook:
        diffuse = shading.find("emission" if shading.tag == "constant" else "diffuse")
        if diffuse is None:
            return SurfaceLook()
        texture = diffuse.find("texture")
        if texture is not None:
            image = self._image(texture.get("texture") or "", effect)
            if image is None:
                return self._lost(f"the image of material '{name}' does not exist")
            found = self._textures.file(image)
            return SurfaceLook() if found is None else SurfaceLook(None, found)
        colour = self._colour(diffuse, effect, name)
        return SurfaceLook(None if colour is None else (*colour[:3], self._opacity(shading, effect, name, colour[3])))

    def _colour(self, holder: Element, effect: Element, name: str) -> Rgba | None:
        """<color>, or a <param> that names a <newparam> with one; three numbers are opaque."""
        element = holder.find("color")
        reference = holder.find("param")
        if element is None and reference is not None:
            requested = reference.get("ref") or ""
            for parameter in effect.iter("newparam"):
                if parameter.get("sid") == requested:
                    element = next((parameter.find(kind) for kind in ("float4", "float3") if
                                    parameter.find(kind) is not None), None)  # fmt: skip
        if element is None:
            return None
        values = [parse_number(word) for word in (element.text or "").split()]
        if len(values) not in (3, 4) or None in values:
            self._lost(f"the colour '{' '.join((element.text or '').split())[:40]}' of '{name}' is not 3 or 4 numbers")
            return None
        r, g, b, a = ([min(max(float(v or 0.0), 0.0), 1.0) for v in values] + [1.0])[:4]
        return (r, g, b, a)

    def _opacity(self, shading: Element, effect: Element, name: str, diffuse: float) -> float:
        """COLLADA 1.4.1, 7-5: A_ONE takes the alpha, RGB_ZERO one minus the colour, each times the transparency.

        An opacity of 0 is drawn as 1: exporters that mean "opaque" write it.
        """
        transparent = shading.find("transparent")
        amount = shading.findtext("transparency/float")
        factor = 1.0 if amount is None else parse_number(amount.strip())
        colour = None if transparent is None else self._colour(transparent, effect, name)
        if transparent is None or colour is None or factor is None:
            return diffuse or 1.0
        if (transparent.get("opaque") or "A_ONE").startswith("RGB"):
            dark = sum(w * v for w, v in zip((0.212671, 0.715160, 0.072169), colour[:3], strict=True))
            opacity = 1.0 - dark * factor if transparent.get("opaque") == "RGB_ZERO" else dark * factor
        else:
            opacity = colour[3] * factor if transparent.get("opaque") != "A_ZERO" else 1.0 - colour[3] * factor
        return min(max(opacity, 0.0), 1.0) or 1.0

    def _image(self, name: str, effect: Element) -> str | None:
        """File name of a texture: through sampler and surface (1.4), `instance_image` (1.5), or an image's own id."""
        parameters = {p.get("sid"): p for p in effect.iter("newparam")}
        for _ in range(IMAGE_STEPS):
            parameter = parameters.get(name)
            if parameter is None:
                break
            link = parameter.find("sampler2D/instance_image")
            if link is not None:
                name = (link.get("url") or "").removeprefix("#")
                break
            step = parameter.findtext("sampler2D/source") or parameter.findtext("surface/init_from")
            if step is None:
                return None
            name = step.strip()
        image = self._images.get(name)
        if image is None:
            return None
        file = image.findtext("init_from/ref") or image.findtext("init_from") or ""
        return file.strip() or None


def _by_id(elements) -> dict[str, Element]:
    found: dict[str, Element] = {}
    for element in elements:
        found.setdefault(element.get("id") or "", element)
    return found
