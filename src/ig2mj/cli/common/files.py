"""Checks of output files, before a command starts its work."""

from __future__ import annotations

import pathlib
from collections.abc import Iterable

from ig2mj.errors import InputError


def check_output(file: pathlib.Path) -> None:
    """Raises InputError: the folder does not exist, or the file is a folder."""
    if not file.parent.is_dir():
        raise InputError(file, f"the folder {file.parent} does not exist", fix="create it, or choose another path")
    if file.is_dir():
        raise InputError(file, "is a folder", fix="name a file")


def check_image(file: pathlib.Path, others: Iterable[str] = ()) -> None:
    """Raises InputError: Pillow does not write this format and it is none of `others`, or see `check_output`."""
    from PIL import Image

    Image.init()
    endings = {ending for ending, form in Image.registered_extensions().items() if form in Image.SAVE}
    if file.suffix.lower() not in {*endings, *others}:
        raise InputError(file, "is not an image format that can be written", fix="use .png or .jpg")
    check_output(file)


def check_video(file: pathlib.Path, others: Iterable[str] = ()) -> None:
    """Raises InputError: this is no video format and none of `others`, or see `check_output`."""
    from ig2mj.viewer.video import FORMATS

    if file.suffix.lower() not in {*FORMATS, *others}:
        raise InputError(file, "is not a video format that can be written", fix=f"use {' or '.join(FORMATS)}")
    check_output(file)
