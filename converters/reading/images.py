"""Untrusted images, opened with an explicit list of formats: others may start a program (EPS)."""

from __future__ import annotations

import contextlib
import io
import threading
import warnings as python_warnings
from collections.abc import Iterator

from PIL import Image, UnidentifiedImageError

from ig2mj.errors import Ig2mjError

from ..base.read_limits import limits
from ..base.text import LFS_FIX, LFS_POINTER

FORMATS = ("PNG", "JPEG", "BMP", "TGA", "TIFF", "GIF", "WEBP")
"""Formats of textures and room maps: each is decoded inside this process."""
SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tga", ".tif", ".tiff", ".gif", ".webp")


class ImageError(ValueError):
    """An image cannot be read; the text says why."""


@contextlib.contextmanager
def open_image(raw: bytes) -> Iterator[Image.Image]:
    """An image of one of `FORMATS`, whatever the file is called, not yet decoded.

    Raises:
      ImageError: of another format, broken, or over the limit `image_pixels`; also where decoding in the block fails.
    """
    most = limits().image_pixels
    try:
        with _pillow_limit(most), python_warnings.catch_warnings():
            python_warnings.simplefilter("ignore")  # about odd metadata
            with Image.open(io.BytesIO(raw), formats=FORMATS) as image:
                width, height = image.size
                if width * height > most:
                    option = "--limit image-pixels=N"
                    raise ImageError(f"{width} x {height} pixels are over the limit of {most} ({option})")
                yield image
    except (ImageError, Ig2mjError, MemoryError):
        raise
    except UnidentifiedImageError as e:
        why = LFS_FIX if raw.startswith(LFS_POINTER) else ", ".join(FORMATS)
        raise ImageError(f"is no image that is read ({why})") from e
    except Exception as e:  # Pillow's decoders raise a dozen kinds of errors on broken files
        raise ImageError(f"is a broken image: {e}") from e


_lock = threading.Lock()


@contextlib.contextmanager
def _pillow_limit(pixels: int) -> Iterator[None]:
    """Pillow's own limit refuses what is over twice its value; it is raised where the user's limit is higher."""
    before = Image.MAX_IMAGE_PIXELS
    if before is None or pixels <= before:
        yield
        return
    with _lock:
        Image.MAX_IMAGE_PIXELS = pixels
        try:
            yield
        finally:
            Image.MAX_IMAGE_PIXELS = before
