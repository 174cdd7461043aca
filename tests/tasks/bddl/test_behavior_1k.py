"""BEHAVIOR-1K's definitions: fetching them, and reading all 1,016 as bddl 3.6's own parser does."""

import hashlib
import io
import pathlib
import subprocess
import sys
import tarfile

import pytest
from bddl_package import compare, package_says

from ig2mj.errors import InputError, MissingDependencyError, UnknownNameError
from ig2mj.tasks.bddl import behavior1k
from ig2mj.tasks.bddl.definitions import activity_names, load_activity
from ig2mj.tasks.bddl.vocabulary import VocabularyError

ODD = frozenset({"loading_the_car", "passing_out_drinks", "wash_a_baseball_cap"})
"""Definitions of 3.6.0 with a second condition in the goal, an object declared twice, a stray backslash."""


def made_archive(folder: pathlib.Path, members: dict[str, str]) -> pathlib.Path:
    file = folder / "bddl-3.6.0.tar.gz"
    with tarfile.open(file, "w:gz") as tar:
        for name, text in members.items():
            info = tarfile.TarInfo(name)
            info.size = len(text)
            tar.addfile(info, io.BytesIO(text.encode()))
    return file


def test_without_the_definitions_the_command_that_fetches_them_is_named(tmp_path, monkeypatch):
    monkeypatch.setenv("IG2MJ_CACHE_DIR", str(tmp_path))
    with pytest.raises(MissingDependencyError, match="ig2mj activity fetch"):
        activity_names(behavior_1k=True)


def test_only_definitions_hierarchy_and_licence_are_unpacked(tmp_path):
    inside = {
        "bddl-3.6.0/LICENSE": "MIT",
        "bddl-3.6.0/setup.py": "raise SystemExit",
        "bddl-3.6.0/bddl/parsing.py": "",
        "bddl-3.6.0/bddl/activity_definitions/a/problem0.bddl": "(define)",
        "bddl-3.6.0/bddl/activity_definitions/domain_omnigibson.bddl": "",
        "bddl-3.6.0/bddl/activity_definitions/../../../../problem.bddl": "",
        "bddl-3.6.0/bddl/generated_data/output_hierarchy.json": "{}",
    }
    archive = made_archive(tmp_path, inside)
    behavior1k.unpack(archive, tmp_path / "out", hashlib.sha256(archive.read_bytes()).hexdigest())
    found = sorted(str(f.relative_to(tmp_path / "out")) for f in (tmp_path / "out").rglob("*") if f.is_file())
    assert found == ["LICENSE", "activity_definitions/a/problem0.bddl", "output_hierarchy.json"]


def test_a_package_with_another_hash_is_refused(tmp_path):
    with pytest.raises(InputError, match="has the SHA-256"):
        behavior1k.unpack(made_archive(tmp_path, {"bddl-3.6.0/LICENSE": "MIT"}), tmp_path / "out")
    assert not (tmp_path / "out").exists()


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    """A Python with bddl 3.6.0 of its own, and the definitions fetched into a cache of its own."""
    folder = tmp_path_factory.mktemp("bddl36")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("IG2MJ_CACHE_DIR", str(folder / "cache"))
        behavior1k.fetch()
        target = folder / "packages"
        install = [sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--target", str(target)]
        subprocess.run([*install, f"bddl=={behavior1k.VERSION}", "future", "numpy"], check=True, capture_output=True)
        yield target
        behavior1k.hierarchy.cache_clear()


@pytest.mark.slow
def test_all_1016_definitions_read_as_bddl_3_6_reads_them(package):
    names = activity_names(behavior_1k=True)
    assert len(names) == 1016
    compare(names, package_says(sys.executable, str(package), "omnigibson", names), behavior_1k=True, odd=ODD)


@pytest.mark.slow
def test_definitions_without_cloth_attachment_and_dicing_can_be_expressed(package):
    expressed = []
    for name in activity_names(behavior_1k=True):
        try:
            expressed.append(load_activity(name, behavior_1k=True))
        except VocabularyError:
            continue
    assert len(expressed) == 934
    with pytest.raises(UnknownNameError, match="near matches"):
        load_activity("loading_the_cars", behavior_1k=True)
