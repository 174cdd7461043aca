"""Checks of the files that a command is to write, before it works for minutes."""

from __future__ import annotations

import pathlib
from collections.abc import Iterable

from ig2mj.errors import InputError


def check_output(file: pathlib.Path) -> None:
    """The folder must be there, and no folder in the file's place. Raises InputError."""
    if not file.parent.is_dir():
        raise InputError(file, f"the folder {file.parent} does not exist", fix="create it, or choose another path")
    if file.is_dir():
        raise InputError(file, "is a folder", fix="name a file")


def check_image(file: pathlib.Path, others: Iterable[str] = ()) -> None:
    """The ending must be one that Pillow writes, or of `others`, and the folder must be there. Raises InputError."""
    from PIL import Image

    Image.init()
    endings = {ending for ending, form in Image.registered_extensions().items() if form in Image.SAVE}
    if file.suffix.lower() not in {*endings, *others}:
        raise InputError(file, "is not an image format that can be written", fix="use .png or .jpg")
    check_output(file)


def check_video(file: pathlib.Path, others: Iterable[str] = ()) -> None:
    """The ending must be that of a film, or of `others`, and the folder must be there. Raises InputError."""
    from ig2mj.viewer.video import FORMATS

    if file.suffix.lower() not in {*FORMATS, *others}:
        raise InputError(file, "is not a video format that can be written", fix=f"use {' or '.join(FORMATS)}")
    check_output(file)
