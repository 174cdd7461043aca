"""JAX's cache of programs after a killed process, on a full disk, and in a folder that cannot be written to."""

from __future__ import annotations

import errno
import os
import pathlib
import subprocess
import sys

import pytest
from jax._src import compilation_cache, lru_cache

from ig2mj.process import program_cache

CUT_OFF = """
import pathlib, sys
from ig2mj.process.settings import prepare_jax
import jax
folder = prepare_jax()
assert folder == pathlib.Path(sys.argv[1]) / "jax", folder
jax.jit(lambda x: x * 3)(1.0)
whole = {file: file.read_bytes() for file in folder.iterdir()}
assert whole
for file, content in whole.items():
    file.write_bytes(content[: len(content) // 2])
jax.clear_caches()
assert float(jax.jit(lambda x: x * 3)(1.0)) == 3.0
assert all(len(file.read_bytes()) > len(content) // 2 for file, content in whole.items())
"""


def test_an_entry_that_was_cut_off_is_made_again_and_said_once(tmp_path):
    environ = {**os.environ, "IG2MJ_CACHE_DIR": str(tmp_path), "JAX_PLATFORMS": "cpu"}
    environ.pop("JAX_COMPILATION_CACHE_DIR", None)
    done = subprocess.run(
        [sys.executable, "-c", CUT_OFF, str(tmp_path)], env=environ, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("ig2mj: ") == 1 and f"broken programs in {tmp_path / 'jax'}" in done.stderr


@pytest.fixture
def entries(tmp_path, monkeypatch):
    """A cache in a folder of its own, and functions that are put back."""
    monkeypatch.setattr(lru_cache.LRUCache, "put", lru_cache.LRUCache.put)
    monkeypatch.setattr(compilation_cache, "get_executable_and_time", compilation_cache.get_executable_and_time)
    program_cache.keep_entries_sound.__wrapped__()
    program_cache.say_not_kept.cache_clear()
    return lru_cache.LRUCache(str(tmp_path), max_size=-1)


def test_an_entry_is_there_whole_or_not_at_all(entries, tmp_path):
    entries.put("key", b"program")
    entries.put("key", b"another")
    assert [file.read_bytes() for file in tmp_path.iterdir()] == [b"program"] and entries.get("key") == b"program"


def test_on_a_full_disk_nothing_is_left_and_one_line_names_the_remedy(entries, tmp_path, monkeypatch, capsys):
    write = pathlib.Path.write_bytes

    def full(self: pathlib.Path, content: bytes) -> int:
        write(self, content[:3])
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(pathlib.Path, "write_bytes", full)
    entries.put("one", b"program")
    entries.put("two", b"program")
    assert list(tmp_path.iterdir()) == []
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "No space left on device" in said and "IG2MJ_CACHE_DIR" in said
