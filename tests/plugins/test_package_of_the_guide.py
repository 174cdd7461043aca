"""The package of docs/guide/plugins.md is installed from its files, and everything that it adds is there."""

from __future__ import annotations

import json
import os
import pathlib
import subprocess
import sys
import zipfile

import pytest

BUILD = "import sys; from setuptools import build_meta; print(build_meta.build_wheel(sys.argv[1]))"

STORY = """
import contextlib, io, json, sys

home, engine, folder = sys.argv[1:]
found = {}


def typed(*words):
    from ig2mj import cli

    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(out):
        status = cli.call(list(words))
    return [status, out.getvalue()]


found["help"] = typed("--help")[1]
found["imported for help"] = "ig2mj_ripeness" in sys.modules
found["plugins"] = typed("plugins", "--json")
found["ripen"] = typed("ripen", home, "--seconds", "0")
found["ripen help"] = typed("ripen", "--help")[1]

import numpy as np

import ig2mj
from ig2mj.viewer.overlays import default_overlays
from ig2mj.worlds import Worlds

scene = ig2mj.load_scene(home)
apple = scene.object_index("apple")
world = ig2mj.Simulation(scene)
world.step(count=30)
found["state"] = world.state("ripeness", "apple")
found["ripe"] = [world.predicate("ripe", "apple")]
world.set_state("ripe", "apple", True)
found["ripe"].append(world.holds("(ripe apple)"))
world.save(folder + "/world.npz")
world.reset()
world.load(folder + "/world.npz")
found["loaded"] = world.state("ripeness", "apple")
(overlay,) = [o for o in default_overlays(scene, world) if o.title == "ripeness"]
found["overlay"] = [label.text for label in overlay.labels(world.data)]

states, view = world.states, world.view
if engine:
    worlds = Worlds(scene, 2, engine, goal="(not (ripe apple))")
    batch = worlds.start(seed=0)
    for _ in range(3):
        batch, status = worlds.step(batch)
    states, view = batch.world.states, batch.world.view
    found["batch"] = np.asarray(states.ripeness)[:, apple].tolist()
    found["goal"] = np.asarray(status.holds).tolist()


class Setup:
    model, scene = world.state_model, scene


from ig2mj.sensors.base import Percept
from ig2mj.sensors.registry import find_sensor

sensor = find_sensor("fruit")
reading = sensor.read(Setup, Percept(view, states, None))
found["sensor"] = [list(sensor.space(Setup).shape), np.asarray(reading)[:, 0].tolist()]
found["states"] = np.asarray(states.ripeness)[:, apple].tolist()
print(json.dumps(found))
"""


def shown(page: str, language: str) -> str:
    """The block of this language in the section on packages."""
    return page.split("\n## A package\n")[1].split(f"```{language}\n")[1].split("```")[0]


@pytest.fixture(scope="module")
def installed(repository: pathlib.Path, tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    """A folder for packages with the wheel of the page's files in it; nothing is fetched."""
    work = tmp_path_factory.mktemp("package")
    page = (repository / "docs" / "guide" / "plugins.md").read_text()
    (work / "pyproject.toml").write_text(shown(page, "toml"))
    (work / "ig2mj_ripeness.py").write_text(shown(page, "python"))
    wheels = work / "wheels"
    wheels.mkdir()
    built = subprocess.run([sys.executable, "-c", BUILD, str(wheels)], cwd=work, capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    (wheel,) = wheels.glob("*.whl")
    with zipfile.ZipFile(wheel) as packed:  # what pip does with a wheel of Python files
        packed.extractall(work / "site")
    return work / "site"


def told(installed: pathlib.Path, home: pathlib.Path, engine: str, folder: pathlib.Path) -> dict:
    """What a program finds of the package, in a process that has it."""
    done = subprocess.run(
        [sys.executable, "-c", STORY, str(home), engine, str(folder)],
        env={**os.environ, "PYTHONPATH": str(installed), "IG2MJ_PLUGINS": ""},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads(done.stdout.splitlines()[-1])


SLOW = [pytest.param(name, marks=pytest.mark.slow) for name in ("native", "warp")]


@pytest.fixture(scope="module", params=["", *SLOW], ids=["one_world", "native", "warp"])
def found(request, installed, tiny_home_folder, tmp_path_factory) -> dict:
    return told(installed, tiny_home_folder, request.param, tmp_path_factory.mktemp("told"))


def test_it_is_listed_before_any_of_it_is_imported(found):
    assert "ripen        fruit that ripens (ig2mj-ripeness 0.1.0)" in found["help"]
    assert found["imported for help"] is False


def test_all_of_it_works(found):
    status, out = found["plugins"]
    rows = json.loads(out)
    assert status == 0 and {row["from"] for row in rows} == {"ig2mj-ripeness 0.1.0"}
    assert {(row["kind"], row["name"], row["state"]) for row in rows} == {
        ("state", "ripeness", "works"),
        ("predicate", "ripe", "works"),
        ("sensor", "fruit", "works"),
        ("command", "ripen", "works"),
        ("overlay", "ripeness", "works"),
    }


def test_its_command_runs(found):
    assert found["ripen"] == [0, "apple 0.0000\n"]
    assert "Show how ripe the fruit of a home becomes." in found["ripen help"]


def test_its_state_is_stepped_and_its_predicate_asked_set_and_saved(found):
    assert found["state"] == pytest.approx(1 / 3600, rel=1e-3)
    assert found["ripe"] == [False, True] and found["loaded"] == 1.0


def test_batches_step_its_state_and_have_goals_of_its_predicate(found):
    if "batch" in found:
        assert found["batch"] == pytest.approx([0.1 / 3600] * 2, rel=1e-3)
        assert found["goal"] == [True, True]


def test_its_sensor_reads_and_its_overlay_writes(found):
    shape, reading = found["sensor"]
    assert shape == [1] and reading == found["states"]
    assert found["overlay"] == ["100%"]


def test_the_module_has_about_sixty_lines_of_code(repository):
    text = shown((repository / "docs" / "guide" / "plugins.md").read_text(), "python")
    assert sum(bool(line.strip()) for line in text.splitlines()) <= 62
