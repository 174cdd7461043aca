"""What a visual looks like: a colour, or a texture. An error in it is a warning, and never costs geometry."""

from __future__ import annotations

import dataclasses
import pathlib

import numpy as np
from PIL import Image

from ig2mj.errors import InputError

from ..base import inputs
from ..base.description import PackedImage, Rgba
from ..base.file_access import FileGuard
from .images import SUFFIXES, ImageError, open_image

Texture = pathlib.Path | PackedImage


def is_encrypted(file: pathlib.Path) -> bool:
    """A BEHAVIOR file that only iGibson's renderer may open: name `*.encrypted.*`."""
    return ".encrypted." in file.name.lower()


def encrypted_twin(file: pathlib.Path) -> pathlib.Path | None:
    """The `x.encrypted.obj` that stands where `x.obj` is named and missing."""
    twin = file.with_name(f"{file.stem}.encrypted{file.suffix}")
    return twin if not inputs.is_file(file) and inputs.is_file(twin) else None


@dataclasses.dataclass(frozen=True)
class SurfaceLook:
    """rgba: flat colour; with a texture its factor. Both None: nothing said."""

    rgba: Rgba | None = None
    texture: Texture | None = None


@dataclasses.dataclass
class TextureReader:
    """Resolves the images that a file names; what cannot be used is a warning.

    Attributes:
      guard: of the URDF. element: that leads to them, for messages. folder: that relative names start from.
    """

    guard: FileGuard
    element: str
    folder: pathlib.Path
    warnings: list[str]

    def file(self, name: str) -> pathlib.Path | None:
        """Path of a texture that opens as an image; None (with a warning unless it is encrypted) otherwise."""
        try:
            path = self.guard.resolve(name, self.element, base=self.folder)
        except InputError as e:
            self.warn(f"a texture is left out: {e}")
            return None
        if is_encrypted(path) or encrypted_twin(path):
            return None
        try:
            if path.suffix.lower() not in SUFFIXES:
                raise ImageError(f"is not one of {', '.join(SUFFIXES)}")
            _verify(inputs.content(path))
        except (OSError, ImageError) as e:
            self.warn(f"texture {path.name} is left out: {getattr(e, 'strerror', None) or e}")
            return None
        return path

    def packed(self, name: str, content: bytes) -> PackedImage | None:
        """An image inside another file, if it opens as one."""
        try:
            _verify(content)
        except ImageError as e:
            self.warn(f"the texture '{name}' inside {self.folder.name} is left out: {e}")
            return None
        return PackedImage(name, content)

    def flat(self, look: SurfaceLook) -> SurfaceLook:
        """The look of what has no texture coordinates: the image's mean colour, with a warning."""
        if look.texture is None:
            return look
        text = f"{self.element}: it has no texture coordinates, and is drawn in the mean colour of"
        self.warn(f"{text} {look.texture.name}")
        return SurfaceLook(mean_colour(look.texture, look.rgba))

    def warn(self, text: str) -> None:
        if text not in self.warnings:
            self.warnings.append(text)


def content_of(texture: Texture) -> bytes:
    """Bytes of a texture's image. Raises OSError."""
    return texture.content if isinstance(texture, PackedImage) else inputs.content(texture)


def mean_colour(texture: Texture, factor: Rgba | None) -> Rgba | None:
    """Mean colour of an image times a factor; the factor where it cannot be decoded."""
    try:
        with open_image(content_of(texture)) as image:
            pixel = np.asarray(image.convert("RGB").resize((1, 1), Image.Resampling.BOX))[0, 0]
    except (ImageError, OSError):
        return factor
    r, g, b = (float(v) / 255.0 for v in pixel)
    fr, fg, fb, fa = factor or (1.0, 1.0, 1.0, 1.0)
    return (r * fr, g * fg, b * fb, fa)


def mean_vertex_colour(colours: np.ndarray) -> tuple[Rgba, bool]:
    """(mean of [n, 3] or [n, 4] colours of 0..1, whether they differ by more than 2 %)."""
    values = np.clip(np.nan_to_num(np.asarray(colours, dtype=float)), 0.0, 1.0)
    r, g, b, a = (float(v) for v in np.append(values.mean(axis=0), 1.0)[:4])
    return (r, g, b, a), bool(np.any(np.ptp(values, axis=0) > 0.02))


def _verify(raw: bytes) -> None:
    with open_image(raw) as image:
        image.verify()
