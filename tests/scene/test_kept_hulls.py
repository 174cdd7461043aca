"""Hulls of meshes are read where they are known, and made wherever anything that they depend on is another."""

from __future__ import annotations

import pathlib

import numpy as np
import pytest

from ig2mj.process.compilation import CACHE_VARIABLE
from ig2mj.scene import kept_hulls
from ig2mj.scene.convex_pieces import hull_planes
from ig2mj.scene.kept_hulls import FOLDER, hulls_of

RANDOM = np.random.default_rng(0)
MESHES = [RANDOM.normal(size=(count, 3)) for count in (12, 40, 7)]


@pytest.fixture
def folder(tmp_path, monkeypatch) -> pathlib.Path:
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path))
    return tmp_path / FOLDER


@pytest.fixture
def source(tmp_path) -> pathlib.Path:
    file = tmp_path / "source.py"
    file.write_text("one")
    return file


@pytest.fixture
def hulls(source):
    """Hulls of meshes, and how many of them were made."""

    def find(meshes=MESHES):
        made = []
        found = hulls_of(meshes, lambda mesh: made.append(mesh) or hull_planes(mesh), source)
        return found, len(made)

    return find


def check(found, meshes=MESHES):
    for pair, mesh in zip(found, meshes, strict=True):
        for array, expected in zip(pair, hull_planes(mesh), strict=True):
            assert array.dtype == expected.dtype and np.array_equal(array, expected)


def test_known_hulls_are_bit_for_bit_those_that_were_made(folder, hulls):
    for made in (3, 0, 0):
        found, count = hulls()
        assert count == made
        check(found)
    assert len([*folder.iterdir()]) == 1


def test_other_meshes_sources_and_versions_are_other_hulls(folder, hulls, source, monkeypatch):
    hulls()
    moved = [mesh + np.array([0, 0, 1e-12]) for mesh in MESHES]
    found, count = hulls(moved)
    assert count == 3
    check(found, moved)
    assert hulls(MESHES[::-1])[1] == 3 and hulls(MESHES[:2])[1] == 2 and hulls([m.astype("f4") for m in MESHES])[1] == 3
    source.write_text("two")
    assert hulls()[1] == 3 and hulls()[1] == 0
    monkeypatch.setattr(kept_hulls.importlib.metadata, "version", lambda name: "0")
    assert hulls()[1] == 3
    assert hulls([]) == ([], 0)


@pytest.mark.parametrize("kept", [0, 10, 500, -1])
def test_broken_files_are_made_anew(folder, hulls, kept):
    hulls()
    (file,) = folder.iterdir()
    file.write_bytes(file.read_bytes()[:kept])
    found, count = hulls()
    assert count == 3
    check(found)
    assert hulls()[1] == 0


def test_a_file_of_fewer_hulls_is_not_believed(folder, hulls):
    hulls(MESHES[:2])
    (few,) = folder.iterdir()
    hulls()
    (whole,) = (file for file in folder.iterdir() if file != few)
    few.replace(whole)
    found, count = hulls()
    assert count == 3
    check(found)


def test_without_a_folder_hulls_are_made_each_time(tmp_path, hulls, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "file"))
    for _ in range(2):
        found, count = hulls()
        assert count == 3
        check(found)
