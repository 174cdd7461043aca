"""How much of a file is read. Each limit is a variable of the environment, which worker processes inherit.

| variable                   | default | what it bounds                                                             |
|----------------------------|---------|----------------------------------------------------------------------------|
| IG2MJ_LIMIT_TEXT_BYTES     | 64 MiB  | a file of text: JSON, TOML, BDDL, a journal                                |
| IG2MJ_LIMIT_XML_BYTES      | 16 MiB  | an MJCF file; the largest home that ships has half a MiB                   |
| IG2MJ_LIMIT_SMALL_BYTES    | 128 MiB | arrays of one file that are unpacked whatever its size                     |
| IG2MJ_LIMIT_UNPACKED_RATIO | 100     | bytes of arrays for each byte of the file, beyond `IG2MJ_LIMIT_SMALL_BYTES` |
| IG2MJ_LIMIT_UNPACKED_BYTES | 16 GiB  | all arrays that are read of one file                                       |
| IG2MJ_LIMIT_ARRAYS         | 10000   | arrays in one file                                                         |
| IG2MJ_LIMIT_MJCF_ELEMENTS  | 500000  | elements of a scene's MJCF, replicated ones counted                         |
| IG2MJ_LIMIT_MJCF_CELLS     | 50 million | cells of its height fields and built-in textures, user data, one image  |
| IG2MJ_LIMIT_GROUNDED_PARTS | 20000   | parts of an expression whose quantifiers are written out                    |
| IG2MJ_LIMIT_BDDL_OBJECTS   | 1000    | objects of an activity; BEHAVIOR-100 has up to 35                           |
"""

from __future__ import annotations

import os

from ig2mj.errors import Ig2mjError, InputError

DEFAULTS = {
    "TEXT_BYTES": 64 * 2**20,
    "XML_BYTES": 16 * 2**20,
    "SMALL_BYTES": 128 * 2**20,
    "UNPACKED_RATIO": 100,
    "UNPACKED_BYTES": 16 * 2**30,
    "ARRAYS": 10_000,
    "MJCF_ELEMENTS": 500_000,
    "MJCF_CELLS": 50_000_000,
    "GROUNDED_PARTS": 20_000,
    "BDDL_OBJECTS": 1_000,
}
"""By name without `PREFIX`. Deflate packs at most 1032 bytes into one; recordings that the project makes, and images
of rooms, have 1 to 60. Pools of thousands of rows would have more: `ig2mj.files.npz.write_npz` packs them less."""

PREFIX = "IG2MJ_LIMIT_"


def limit(name: str) -> int:
    """The limit in force: the variable `IG2MJ_LIMIT_<name>`, else the default. Raises Ig2mjError: it is no number."""
    text = os.environ.get(PREFIX + name, "")
    if not text:
        return DEFAULTS[name]
    if not (text.isascii() and text.isdigit() and len(text) < 19):
        raise Ig2mjError(f"{PREFIX}{name}={text[:40]}: must be a whole number")
    return int(text)


def refuse_more(name: str, size: int, what: str, file: object, element: str = "", unit: str = " bytes") -> None:
    """Raises InputError, naming the limit, where `size` is over the limit of that name."""
    most = limit(name)
    if size > most:
        raise InputError(
            file, f"{what} {size}{unit}, and the limit is {most}", element=element, fix=f"{PREFIX}{name} raises it"
        )


def refuse_bomb(unpacked: int, packed: int, file: object) -> None:
    """Raises InputError where a file of `packed` bytes claims more unpacked bytes than one reads of such a file."""
    refuse_more("UNPACKED_BYTES", unpacked, "holds arrays of", file)
    if is_bomb(unpacked, packed):
        fix = f"{PREFIX}UNPACKED_RATIO={-(-unpacked // max(packed, 1))} reads it, if you trust it"
        raise InputError(file, f"has {packed} bytes and claims arrays of {unpacked} bytes", fix=fix)


def is_bomb(unpacked: int, packed: int) -> bool:
    """Whether a file of `packed` bytes claims more unpacked bytes than its size explains."""
    return unpacked > max(limit("SMALL_BYTES"), packed * limit("UNPACKED_RATIO"))
