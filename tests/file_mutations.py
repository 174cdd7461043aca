"""Mutations of files of known formats: JSON, lines of text, npz and HDF5, in their content and in their bytes."""

from __future__ import annotations

import io
import json
import random
import zipfile
from typing import Any

import h5py
import numpy as np
from fuzz import mutated_bytes, mutated_json


def json_or_bytes(raw: bytes, seed: int) -> bytes:
    """A JSON text with odd values, or with changed bytes."""
    if seed % 3 == 0:
        return mutated_bytes(raw, seed)
    return json.dumps(mutated_json(json.loads(raw), seed)).encode()


def lines_or_bytes(raw: bytes, seed: int) -> bytes:
    """Lines of JSON, one of them with odd values, or with changed bytes."""
    if seed % 3 == 0:
        return mutated_bytes(raw, seed)
    lines = raw.splitlines()
    at = random.Random(seed).randrange(len(lines))
    lines[at] = json.dumps(mutated_json(json.loads(lines[at]), seed)).encode()
    return b"\n".join(lines)


def npz_or_bytes(raw: bytes, seed: int, kept: tuple[str, ...] = ()) -> bytes:
    """An archive with odd arrays, or with changed bytes. `kept`: entries that stay as they are."""
    if seed % 4 == 0:
        return mutated_bytes(raw, seed)
    random_ = random.Random(seed)
    with zipfile.ZipFile(io.BytesIO(raw)) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    for name in random_.sample(sorted(entries.keys() - {*kept}), random_.randint(1, 2)):
        what = random_.random()
        if what < 0.15:
            del entries[name]
        elif what < 0.3:
            entries[name] = mutated_bytes(entries[name], seed)
        elif entries[name].lstrip(b"\x93NUMPY").find(b"|u1") >= 0 and b"{" in entries[name][100:]:
            array = np.load(io.BytesIO(entries[name]))
            text = json.dumps(mutated_json(json.loads(array.tobytes()), seed)).encode()
            entries[name] = _npy(np.frombuffer(text, np.uint8))
        else:
            entries[name] = _npy(_odd(np.load(io.BytesIO(entries[name])), random_))
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name, content in entries.items():
            archive.writestr(name, content)
    return out.getvalue()


def hdf5_or_bytes(raw: bytes, seed: int) -> bytes:
    """An HDF5 file with odd arrays, attributes and links, or with changed bytes."""
    if seed % 3 == 0:
        return mutated_bytes(raw, seed)
    random_, buffer = random.Random(seed), io.BytesIO(raw)
    with h5py.File(buffer, "a") as file:
        names: list[str] = []
        file.visit(names.append)
        for _ in range(random_.randint(1, 2)):
            there = [name for name in names if _is_own(file, name)]
            if not there:
                break
            name = random_.choice([*there, "/"])
            if (random_.random() < 0.5 or name == "/") and len(file[name].attrs):
                _change_attribute(file[name].attrs, random_)
            elif name != "/":
                _change_array(file, name, random_)
    return buffer.getvalue()


def _is_own(file: Any, name: str) -> bool:
    """Whether it is still there, and no link that an earlier change made."""
    parts = name.split("/")
    paths = ["/".join(parts[: k + 1]) for k in range(len(parts))]
    return all(p in file and isinstance(file.get(p, getlink=True), h5py.HardLink) for p in paths)


def _change_attribute(attributes: Any, random_: random.Random) -> None:
    name = random_.choice(sorted(attributes))
    value = attributes[name]
    del attributes[name]
    odd = [None, 7, -1, 2**40, 1.5, float("nan"), "", "[]", "{}", "null", "[[1]]", '{"a": [1]}', "../x", "\ud800x"]
    odd += [np.zeros(3), np.zeros((2, 2), int), np.array([["a"]], h5py.string_dtype())]
    if isinstance(value, str) and value.startswith(("[", "{")) and random_.random() < 0.6:
        attributes[name] = json.dumps(mutated_json(json.loads(value), random_.randrange(10**6)))
    elif isinstance(value, np.ndarray) and random_.random() < 0.6:
        attributes[name] = _odd(value, random_, for_text=False)
    elif (new := random_.choice(odd)) is not None:
        attributes[name] = new.encode("utf-8", "surrogatepass") if isinstance(new, str) and "\ud800" in new else new


def _change_array(file: Any, name: str, random_: random.Random) -> None:
    old = file[name]
    values = old[()] if isinstance(old, h5py.Dataset) else None
    del file[name]
    links = [h5py.SoftLink("/"), h5py.ExternalLink("/etc/hostname", "/"), h5py.ExternalLink("none.h5", "/x")]
    if (what := random_.random()) < 0.2:
        return
    if what < 0.3:
        file[name] = random_.choice(links)
    elif what < 0.4:
        file.create_group(name)
    elif values is not None:
        file[name] = _odd(np.asarray(values), random_, for_text=False)
    else:
        file[name] = 1.0


def _npy(array: np.ndarray) -> bytes:
    out = io.BytesIO()
    np.save(out, array)
    return out.getvalue()


def _odd(array: np.ndarray, random_: random.Random, for_text: bool = True) -> np.ndarray:
    """An array of another type, shape or content."""
    kinds = [np.float64, np.float16, np.int64, np.uint8, np.bool_, np.str_, np.complex64, ">f4", "S3"]
    changes = [
        lambda a: a.astype(random_.choice(kinds)),
        lambda a: a[..., None],
        lambda a: a[0] if a.ndim else a,
        lambda a: a[:-1] if a.ndim else a,
        lambda a: a[..., :-1] if a.ndim else a,
        lambda a: np.concatenate([a, a]) if a.ndim else a,
        lambda a: a[:0] if a.ndim else a,
        lambda a: a.reshape(-1),
        lambda a: a.T,
        lambda a: np.zeros((0, 3), a.dtype),
    ]
    numbers: list[Any] = [0, -1, 1, 127, 2**31 - 1, -(2**31), 2**62]
    if array.dtype.kind == "f":
        numbers += [np.nan, np.inf, -np.inf, 1e30, 65000.0, 5e-324]
    if not for_text:
        kinds.remove(np.str_)
    if array.dtype.kind in "iuf" and array.size and random_.random() < 0.6:
        array = array.copy()
        with np.errstate(all="ignore"):
            array.reshape(-1)[random_.randrange(array.size)] = np.array(random_.choice(numbers)).astype(array.dtype)
        return array
    with np.errstate(all="ignore"):
        try:
            return np.asarray(random_.choice(changes)(array))
        except (ValueError, IndexError):
            return array.reshape(-1)
