"""Same seed, same bytes: in other processes, with other hash seeds and numbers of jobs."""

from __future__ import annotations

import hashlib
import os
import pathlib
import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow

KINDS = {
    ".obj": "meshes", ".png": "textures, room maps and height maps", ".urdf": "models and scenes", ".json": "metadata",
    ".mtl": "materials", ".txt": "lists",
}  # fmt: skip


def run(hash_seed: int, cache: pathlib.Path, *arguments: object) -> subprocess.Popen[str]:
    environment = {**os.environ, "PYTHONHASHSEED": str(hash_seed), "IG2MJ_CACHE_DIR": str(cache)}
    command = [sys.executable, "-m", "ig2mj", "homes", *map(str, arguments)]
    return subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def finish(*processes: subprocess.Popen[str]) -> None:
    for process in processes:
        told, _ = process.communicate()
        assert process.returncode == 0, told


def digest(root: pathlib.Path) -> dict[str, str]:
    files = sorted(f for f in root.rglob("*") if f.is_file())
    return {str(f.relative_to(root)): hashlib.sha256(f.read_bytes()).hexdigest() for f in files}


def test_families_and_a_home_built_and_converted_twice_are_the_same_to_the_byte(tmp_path: pathlib.Path):
    """Once in one process with one hash seed, once in two with another, each with a cache of its own."""
    ways = [(1, 1, tmp_path / "a"), (4711, 2, tmp_path / "b")]
    finish(
        *(
            run(seed, at / "cache", "build", "--out", at / "dataset", "--home", "aspen", "--jobs", jobs)
            for seed, jobs, at in ways
        )
    )
    finish(
        *(
            run(seed, at / "cache", "convert", "--dataset", at / "dataset", "--out", at / "homes", "--jobs", jobs)
            for seed, jobs, at in ways
        )
    )
    built, homes = ([digest(at / part) for _, _, at in ways] for part in ("dataset", "homes"))
    assert built[0] == built[1]
    assert homes[0] == homes[1]
    for kind, what in KINDS.items():
        assert sum(name.endswith(kind) for name in built[0]) >= 2, what
    assert any("height_maps_per_link" in name for name in built[0])
    assert any("/layout/" in name for name in built[0])
    for part in ("meshes/", "textures/"):
        assert sum(name.startswith(part) for name in homes[0]) > 10
    assert {"aspen/scene.xml", "aspen/manifest.json", "aspen/rooms.npz"} <= set(homes[0])
