"""An entry of the converter's caches that was changed is taken as absent, whatever it claims."""

from __future__ import annotations

import io
import zipfile

import numpy as np
import pytest
from ig2mj_converters.hulls import piece_cache
from limits import run_limited


def bomb() -> bytes:
    """An archive of 1 MB whose array has 1 GiB, all zeros."""
    out, block = io.BytesIO(), bytes(2**24)
    with (
        zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("points.npy", "w", force_zip64=True) as f,
    ):
        np.lib.format.write_array_header_1_0(f, {"descr": "|u1", "fortran_order": False, "shape": (2**30,)})
        for _ in range(2**30 // len(block)):
            f.write(block)
    return out.getvalue()


@pytest.mark.slow
@pytest.mark.parametrize("content", [b"", b"nothing", "bomb", "no facts"])
def test_changed_results_of_geometry_are_absent(tmp_path, monkeypatch, content):
    monkeypatch.setattr(piece_cache, "folder", lambda: tmp_path)
    piece_cache.store("aa", {"n": 1}, {"points": np.zeros((2, 3))})
    found = piece_cache.load("aa")
    assert found is not None and found[0]["n"] == 1
    if content == "no facts":
        np.savez(tmp_path / "aa" / "aa.npz", points=np.zeros(3))
    else:
        (tmp_path / "aa" / "aa.npz").write_bytes(bomb() if content == "bomb" else content)
    outcome = run_limited(load_in, tmp_path, "aa").check()
    assert outcome.value is None


def load_in(folder, key: str):
    piece_cache.folder = lambda: folder
    return piece_cache.load(key)
