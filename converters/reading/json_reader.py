"""JSON that Python wrote: with NaN, Infinity and -Infinity, as iGibson's own files have it."""

from __future__ import annotations

import json
import os
import pathlib
from typing import Any

import numpy as np

from ig2mj.errors import InputError

from ..base.read_limits import check_limit
from ..base.text import LFS_FIX, LFS_POINTER, without_mark
from ..base.xml_reader import MAX_NUMBER, read_bytes

MAX_JSON_BYTES = 64 * 2**20


def decode_json(text: str | bytes, file: object, element: str = "") -> Any:
    """Raises InputError: no JSON, nested too deeply, or over the limit `json_values`."""
    raw = text.encode("utf-8", errors="surrogatepass") if isinstance(text, str) else text
    count = sum(raw.count(sign) for sign in (b",", b":", b"[", b"{"))
    check_limit("json_values", count, file, "values", element=element)
    try:
        return json.loads(text)
    except RecursionError as e:
        raise InputError(file, "is JSON that is nested too deeply", element=element) from e
    except ValueError as e:
        fix = LFS_FIX if raw.startswith(LFS_POINTER) else ""
        raise InputError(file, f"is not valid JSON: {e}", element=element, fix=fix) from e


def read_json(file: str | os.PathLike, kind: type) -> Any:
    """A JSON file whose top is a `kind` (dict or list). Raises InputError."""
    value = decode_json(without_mark(read_bytes(pathlib.Path(file), MAX_JSON_BYTES)), file)
    if not isinstance(value, kind):
        raise InputError(file, f"holds a {type(value).__name__} instead of a {kind.__name__}")
    return value


def vector(value: Any, count: int, file: object, element: str) -> np.ndarray:
    """A list of `count` finite numbers -> [count]. Raises InputError."""
    if (
        not isinstance(value, list)
        or len(value) != count
        or not all(isinstance(v, int | float) and not isinstance(v, bool) for v in value)
    ):
        raise InputError(file, f"is not a list of {count} numbers", element=element)
    try:
        array = np.array(value, dtype=float)
    except OverflowError:
        array = np.array([np.inf])
    if not np.all(np.abs(array) <= MAX_NUMBER):
        raise InputError(file, "has a number that is not finite", element=element)
    return array


def scalar(value: Any, file: object, element: str) -> float:
    """One finite number. Raises InputError."""
    return float(vector([value], 1, file, element)[0])
