"""Warp's cache of kernels in a folder that cannot be written to, on a full disk, and with a broken file."""

from __future__ import annotations

import os
import shutil
import types

import pytest
import warp as wp

from ig2mj.errors import EngineError
from ig2mj.process import kernel_cache, program_cache


@pytest.fixture
def module(monkeypatch):
    """In place of Warp's module: it writes a file where there is none, and loads what is whole."""

    class Module:
        def _compile(self, device=None, output_dir=None, output_name=None):
            if not (output_dir / output_name).exists():
                output_dir.mkdir()
                (output_dir / output_name).write_bytes(b"whole")

        def load(self, folder):
            self._compile(None, folder / "wp_a", "a.cubin")
            if (folder / "wp_a" / "a.cubin").read_bytes() != b"whole":
                raise Exception("Failed to load CUDA module 'a'")
            return "loaded"

    monkeypatch.setattr(wp._src.context, "Module", Module)
    kernel_cache.keep_kernels_sound.__wrapped__()
    return Module()


def test_a_broken_kernel_is_compiled_again_and_said(module, tmp_path, capsys):
    (tmp_path / "wp_a").mkdir()
    (tmp_path / "wp_a" / "a.cubin").write_bytes(b"who")
    assert module.load(tmp_path) == "loaded"
    assert f"broken kernels in {tmp_path / 'wp_a'} are removed and compiled again" in capsys.readouterr().err
    assert module.load(tmp_path) == "loaded" and not capsys.readouterr().err


def test_a_full_disk_is_one_line_with_the_remedy_before_anything_is_written(module, tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda _: types.SimpleNamespace(free=2**20))
    with pytest.raises(EngineError, match=f"less than 32 MiB are free in {tmp_path}: free some space"):
        module.load(tmp_path)
    assert not list(tmp_path.iterdir())
    monkeypatch.undo()


def test_a_folder_that_cannot_be_written_to_is_replaced_for_this_process(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(wp.config, "kernel_cache_dir", str(tmp_path))
    monkeypatch.setattr(os, "access", lambda *_: False)
    program_cache.say_not_kept.cache_clear()
    own = kernel_cache.usable_kernel_folder()
    assert own != tmp_path and not list(own.iterdir())
    said = capsys.readouterr().err
    assert f"compiled kernels are not kept in {tmp_path} (it cannot be written to): free some space" in said
