"""Bytes, text and JSON of a file, of a bounded size."""

from __future__ import annotations

import json
import os
import pathlib
import stat
from typing import Any, TypeVar

import msgspec

from ig2mj.errors import InputError
from ig2mj.files.limits import refuse_more

Kind = TypeVar("Kind")


def regular_file(file: str | os.PathLike, *, error: type[InputError] = InputError, fix: str = "") -> int:
    """Size in bytes of a regular file; a device or a pipe, on which reading might never end, is none.

    Raises:
      InputError (or `error`, a subclass): it is missing, no regular file, or out of reach.
    """
    try:
        facts = pathlib.Path(file).stat()
    except FileNotFoundError as e:
        raise error(file, "there is no such file", fix=fix) from e
    except OSError as e:
        raise error(file, f"cannot be read: {e.strerror or e}", fix=fix) from e
    except ValueError as e:  # a null byte in the name
        raise error(repr(str(file)), "is not a file name", fix=fix) from e
    if not stat.S_ISREG(facts.st_mode):
        raise error(file, "is a folder or a device", fix=fix)
    return facts.st_size


def read_bytes(
    file: str | os.PathLike, *, limit: str = "TEXT_BYTES", error: type[InputError] = InputError, fix: str = ""
) -> bytes:
    """All bytes of a file.

    Args:
      limit: of `ig2mj.files.limits`.

    Raises:
      InputError (or `error`): as `regular_file`, or it is larger than the limit.
    """
    refuse_more(limit, regular_file(file, error=error, fix=fix), "has", file)
    try:
        return pathlib.Path(file).read_bytes()
    except OSError as e:
        raise error(file, f"cannot be read: {e.strerror or e}", fix=fix) from e


def read_text(file: str | os.PathLike, *, error: type[InputError] = InputError, fix: str = "") -> str:
    """A text in UTF-8, with or without a byte-order mark. Raises as `read_bytes`, and where it is no UTF-8."""
    try:
        return read_bytes(file, error=error, fix=fix).decode("utf-8-sig")
    except UnicodeDecodeError as e:
        raise error(file, f"is not text in UTF-8: byte {e.start}", fix=fix) from e


def decode_json(
    text: str | bytes, file: object, *, kind: type | None = None, error: type[InputError] = InputError, fix: str = ""
) -> Any:
    """A JSON value, as `json` reads it.

    Args:
      kind: what the value must be: dict or list; None: anything.

    Raises:
      InputError (or `error`): no JSON, nested too deeply, or another kind of value.
    """
    try:
        value = json.loads(text)
    except RecursionError as e:
        raise error(file, "is JSON that is nested too deeply", fix=fix) from e
    except ValueError as e:  # of no JSON, of no UTF-8, or of a number with thousands of digits
        raise error(file, f"is not valid JSON: {e}", fix=fix) from e
    if kind is not None and not isinstance(value, kind):
        raise error(file, f"holds a {type(value).__name__} instead of a {kind.__name__}", fix=fix)
    return value


def read_json(
    file: str | os.PathLike, *, kind: type | None = None, error: type[InputError] = InputError, fix: str = ""
) -> Any:
    """A file of JSON; arguments and errors as `read_bytes` and `decode_json`."""
    return decode_json(read_bytes(file, error=error, fix=fix), file, kind=kind, error=error, fix=fix)


def decode_struct(
    raw: bytes, kind: type[Kind], file: object, *, error: type[InputError] = InputError, fix: str = ""
) -> Kind:
    """JSON checked against a type of msgspec.

    Raises:
      InputError (or `error`): no JSON, nested too deeply, or it does not fit the type.
    """
    try:
        found = msgspec.json.decode(raw, type=kind)
        msgspec.json.encode(found)  # a lone surrogate, which no file can hold and no terminal shows
    except msgspec.ValidationError as e:
        raise error(file, str(e), fix=fix) from e
    except RecursionError as e:
        raise error(file, "is JSON that is nested too deeply", fix=fix) from e
    except (msgspec.MsgspecError, ValueError, OverflowError) as e:
        raise error(file, f"is not valid JSON: {e}", fix=fix) from e
    return found


def read_struct(
    file: str | os.PathLike, kind: type[Kind], *, error: type[InputError] = InputError, fix: str = ""
) -> Kind:
    """A file of JSON checked against a type of msgspec; arguments and errors as `read_bytes` and `decode_struct`."""
    return decode_struct(read_bytes(file, error=error, fix=fix), kind, file, error=error, fix=fix)
