"""The wheel: what `pip install` brings works in another folder, shipped homes included."""

from __future__ import annotations

import os
import pathlib
import shutil
import subprocess
import sys

import pytest

ROOT = pathlib.Path(__file__).resolve().parents[1]

BLOCKER = """
import sys

class Blocker:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {"trimesh", "matplotlib"}:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Blocker())
"""
"""A sitecustomize.py that hides two packages of the extras, as in an environment without them."""


pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def installed(tmp_path_factory) -> pathlib.Path:
    """A folder that the wheel was installed into; built from a copy, so that nothing of an older build gets in."""
    work = tmp_path_factory.mktemp("wheel")
    source = work / "source"
    for folder in ("src", "converters", "demonstrations", "homes", "policies", "scenes_mjcf"):
        shutil.copytree(ROOT / folder, source / folder, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    run(sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", work, source, cwd=work)
    (wheel,) = work.glob("*.whl")
    installer = [sys.executable, "-m", "pip"] if has_pip() else ["uv", "pip"]
    run(*installer, "install", "--quiet", "--no-deps", "--target", work / "site", wheel, cwd=work)
    return work / "site"


def has_pip() -> bool:
    return subprocess.run([sys.executable, "-m", "pip", "--version"], capture_output=True).returncode == 0


def run(*command: object, cwd: pathlib.Path, **variables: str) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(
        [str(c) for c in command], cwd=cwd, capture_output=True, text=True, env={**os.environ, **variables}
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done


def test_shipped_homes_come_with_the_wheel_and_open_from_any_folder(installed, tmp_path):
    code = (
        "import ig2mj, ig2mj.scene.paths as paths\n"
        "simulation = ig2mj.Simulation('willow')\n"
        "simulation.step(count=2)\n"
        "print(ig2mj.__file__, simulation.scene.folder, len(paths.shipped_homes()))"
    )
    done = run(sys.executable, "-c", code, cwd=tmp_path, PYTHONPATH=str(installed))
    module, folder, count = done.stdout.split()
    assert pathlib.Path(module).is_relative_to(installed)
    assert pathlib.Path(folder) == installed / "ig2mj_scenes" / "willow"
    assert int(count) == len(list((ROOT / "scenes_mjcf").glob("*/manifest.json")))


def test_the_page_of_a_headset_comes_with_the_wheel(installed):
    """Its own files; three.js too, where `make web` has fetched it."""
    made, packed = ROOT / "src" / "ig2mj" / "vr" / "page", installed / "ig2mj" / "vr" / "page"
    names = {f.relative_to(made).as_posix() for f in made.rglob("*") if f.is_file()}
    assert names == {f.relative_to(packed).as_posix() for f in packed.rglob("*") if f.is_file()}
    assert {"index.html", "main.js", "home.js"} <= names


def test_a_picture_of_a_shipped_home_from_any_folder(installed, tmp_path):
    command = [sys.executable, "-m", "ig2mj", "view", "small_home", "--image", "p.png"]
    run(*command, "--size", "64", "48", cwd=tmp_path, PYTHONPATH=str(installed))
    assert (tmp_path / "p.png").stat().st_size > 500


def test_the_demonstration_without_its_extras_gives_the_one_command_that_installs_both(installed, tmp_path):
    (tmp_path / "sitecustomize.py").write_text(BLOCKER)
    paths = f"{installed}{os.pathsep}{tmp_path}"
    command = [sys.executable, "-m", "ig2mj", "demo"]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": paths}
    )
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "ig2mj[convert,demo]" in line


def test_the_demonstration_runs_from_the_wheel(installed, tmp_path):
    done = run(sys.executable, "-m", "ig2mj", "demo", cwd=tmp_path, PYTHONPATH=str(installed))
    assert (tmp_path / "out" / "demo" / "small_home" / "report.html").is_file(), done.stdout
