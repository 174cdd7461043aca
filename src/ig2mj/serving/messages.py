"""Messages of policy servers: msgpack with arrays of NumPy's, in three forms.

| form | an array is | source |
|---|---|---|
| openpi | a map with the keys `__ndarray__`, `data`, `dtype`, `shape` as bytes | the package openpi-client 0.1 |
| vla-eval | the same with keys as text, in an envelope `type`, `payload`, `seq`, `timestamp` | vla-eval's protocol |
| GR00T | a map with `__ndarray_class__` and the bytes of a .npy file | GR00T's server_client, N1.6 |

What comes from a peer is checked: size of a message, kinds and sizes of arrays. Nothing is unpickled.
"""

from __future__ import annotations

import io
import math
from typing import Any

import numpy as np

from ig2mj.errors import PolicyServerError

MOST_BYTES = 256 << 20
"""Of a message."""

MOST_ITEMS, MOST_AXES = 100_000, 8
"""Items of a map or list, and axes of an array."""

KINDS = "biuf"
"""Kinds of dtypes that arrays may have: truth, whole numbers and floats."""


def pack(message: Any, text_keys: bool = False) -> bytes:
    """Bytes of a message. `text_keys`: of arrays, as vla-eval has them."""
    import msgpack

    def encoded(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            fields = {"__ndarray__": True, "data": value.tobytes(), "dtype": value.dtype.str, "shape": value.shape}
            return fields if text_keys else {name.encode(): field for name, field in fields.items()}
        if isinstance(value, np.generic):
            return value.item()
        raise TypeError(f"{type(value).__name__} cannot be sent")

    return bytes(msgpack.packb(message, default=encoded) or b"")


def unpack(packed: Any) -> Any:
    """A message of openpi's or vla-eval's form.

    Raises:
      PolicyServerError: no msgpack, or an array that is none.
    """
    return _unpack(packed, _array)


def pack_npy(message: Any) -> bytes:
    """Bytes of a message of GR00T's form."""
    import msgpack

    def encoded(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            with io.BytesIO() as out:
                np.save(out, value, allow_pickle=False)
                return {"__ndarray_class__": True, "as_npy": out.getvalue()}
        if isinstance(value, np.generic):
            return value.item()
        raise TypeError(f"{type(value).__name__} cannot be sent")

    return bytes(msgpack.packb(message, default=encoded) or b"")


def unpack_npy(packed: bytes) -> Any:
    """A message of GR00T's form. Raises PolicyServerError."""
    return _unpack(packed, _npy)


def _unpack(packed: Any, hook: Any) -> Any:
    import msgpack

    if isinstance(packed, str):
        raise PolicyServerError(f"the peer reports: {packed.strip().splitlines()[-1][:300] if packed.strip() else ''}")
    limits = {
        "max_bin_len": MOST_BYTES,
        "max_str_len": MOST_BYTES,
        "max_array_len": MOST_ITEMS,
        "max_map_len": MOST_ITEMS,
    }
    try:
        return msgpack.unpackb(packed, object_hook=hook, strict_map_key=False, **limits)
    except PolicyServerError:
        raise
    except Exception as e:  # msgpack has errors of many kinds
        raise PolicyServerError(f"a message of {len(packed)} bytes is no msgpack: {e}") from e


def _array(value: dict[Any, Any]) -> Any:
    for keys in ((b"__ndarray__", b"data", b"dtype", b"shape"), ("__ndarray__", "data", "dtype", "shape")):
        if keys[0] in value:
            return _checked(*(value.get(key) for key in keys[1:]))
    if b"__npgeneric__" in value:
        return value.get(b"data")
    return value


def _checked(data: Any, dtype: Any, shape: Any) -> np.ndarray:
    """An array of a peer's bytes. Raises PolicyServerError."""
    try:
        kind = np.dtype(dtype.decode() if isinstance(dtype, bytes) else dtype)
        sizes = tuple(int(n) for n in shape)
    except (TypeError, ValueError, AttributeError) as e:
        raise PolicyServerError(f"an array has no dtype or shape: {e}") from e
    if kind.kind not in KINDS:
        raise PolicyServerError(f"an array is of {kind}; numbers and truth values are taken")
    if len(sizes) > MOST_AXES or any(n < 0 for n in sizes) or not isinstance(data, bytes):
        raise PolicyServerError(f"an array has the shape {sizes}")
    if len(data) != math.prod(sizes) * kind.itemsize:
        raise PolicyServerError(f"an array of shape {list(sizes)} and {kind} has {len(data)} bytes")
    return np.frombuffer(data, kind).reshape(sizes)


def _npy(value: dict[Any, Any]) -> Any:
    if "__ndarray_class__" not in value:
        return value
    try:
        array = np.load(io.BytesIO(value["as_npy"]), allow_pickle=False)
    except (KeyError, TypeError, ValueError, OSError) as e:
        raise PolicyServerError(f"an array is no .npy: {e}") from e
    if array.dtype.kind not in KINDS:
        raise PolicyServerError(f"an array is of {array.dtype}; numbers and truth values are taken")
    return array
