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
from ..base.xml_reader import shortened
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

    def find(self, name: str, folder: pathlib.Path | None = None) -> pathlib.Path:
        """Path of a file that is named in a mesh or an MTL file in `folder` (default: the reader's own).

        Exporters write paths of their own machine, and names in other letters: where there is no such file, one of that
        name in the folder of the one that names it, or next to the mesh, is taken with a warning.
        The path need not exist. Raises InputError as `FileGuard.resolve`.
        """
        error: InputError | None = None
        folders = list(dict.fromkeys((folder or self.folder, self.folder)))
        paths = []
        for base in folders:
            try:
                paths.append(self.guard.resolve(name, self.element, base=base))
            except InputError as e:
                error = error or e
        for path in paths:
            if inputs.is_file(path) or encrypted_twin(path) is not None or is_encrypted(path):
                return path
        plain = name.strip().strip("\"'").replace("\\", "/")
        for base in folders:
            for near in (f for words in (plain, plain.rpartition("/")[2]) for f in _near(base, words)):
                try:
                    path = self.guard.resolve(str(near.relative_to(base)), self.element, base=base)
                except InputError:
                    continue
                self.warn(f"{self.element}: there is no file '{shortened(name)}': {near.name} next to the mesh is used")
                return path
        if error is not None and not paths:
            raise error
        return paths[0]

    def file(self, name: str, folder: pathlib.Path | None = None) -> pathlib.Path | None:
        """Path of a texture that opens as an image (see `find`); None (with a warning unless encrypted) otherwise."""
        try:
            path = self.find(name, folder)
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
        text = f"{self.element}: what has no texture coordinates is rendered in the mean colour of {look.texture.name}"
        self.warn(text)
        return SurfaceLook(mean_colour(look.texture, look.rgba))

    def warn(self, text: str) -> None:
        if text not in self.warnings:
            self.warnings.append(text)


def _near(folder: pathlib.Path, name: str) -> list[pathlib.Path]:
    """The file of that relative name, or those whose names differ in case; none for names that lead elsewhere."""
    if not name or name.startswith("/") or ":" in name or ".." in name.split("/"):
        return []
    return [folder / name] if inputs.is_file(folder / name) else inputs.namesakes(folder / name)


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
