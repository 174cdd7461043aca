"""The folder `textures/` of an output: images of visual meshes as PNG, each once, and the materials that show them."""

from __future__ import annotations

import hashlib
import io
import pathlib

import mujoco
from PIL import Image

from ..base.naming import file_slug
from ..base.output import put_shared_file
from ..reading.images import ImageError, open_image
from ..reading.looks import Texture, content_of

#: Longer edges are scaled down to this many pixels: a home has hundreds of textures, and all of them lie in memory.
MAX_EDGE = 1024


class TextureStore:
    """Writes images below `folder` and registers a texture and a material of each with `spec`."""

    def __init__(self, spec: mujoco.MjSpec, folder: pathlib.Path):
        self._spec, self._folder = spec, folder
        self._by_image: dict[Texture, str | None] = {}
        self._names: set[str] = set()
        self.warnings: list[str] = []

    @property
    def files(self) -> list[str]:
        """Names of the files written so far, sorted."""
        return sorted(f"{name}.png" for name in self._names)

    def material(self, image: Texture) -> str | None:
        """Name of the material that shows an image; None (and a warning) where it cannot be read."""
        if image not in self._by_image:
            self._by_image[image] = self._register(image)
        return self._by_image[image]

    def _register(self, image: Texture) -> str | None:
        try:
            data = _png(content_of(image))
        except (OSError, ImageError) as e:
            self.warnings.append(f"{image.name}: texture left out: {e}")
            return None
        name = f"{file_slug(pathlib.PurePath(image.name).stem, 40)}-{hashlib.sha256(data).hexdigest()[:12]}"
        if name not in self._names:
            self._names.add(name)
            put_shared_file(self._folder / f"{name}.png", data)
            self._spec.add_texture(name=name, type=mujoco.mjtTexture.mjTEXTURE_2D, file=f"{name}.png")
            material = self._spec.add_material(name=name)
            material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
            material.specular, material.shininess = 0.2, 0.3
        return name


def _png(raw: bytes) -> bytes:
    """An image file as PNG bytes, RGB, no longer edge than MAX_EDGE, no metadata. Raises ImageError."""
    with open_image(raw) as opened:
        picture = opened.convert("RGB")
    if max(picture.size) > MAX_EDGE:
        picture.thumbnail((MAX_EDGE, MAX_EDGE), Image.Resampling.LANCZOS)
    buffer = io.BytesIO()
    picture.save(buffer, format="PNG", optimize=False)
    return buffer.getvalue()
