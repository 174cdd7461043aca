"""A state is one file and one line: a made-up one works everywhere, and one with a missing piece is refused."""

from __future__ import annotations

import json
import os
import pathlib
import re
import shutil
import subprocess
import sys

import jaxtyping
import numpy as np
import pytest
from hand_world import HandWorld, Item

import ig2mj
from ig2mj.states import initial, initial_states, registry
from ig2mj.states.spec import KEEPS, StateSpec, copied, filled, given_from_outside, nothing_saved
from ig2mj.states.update import EVENTS, HEAT
from ig2mj.states.world import ExtendedStates

STORY = """
import json, sys

import jax
import numpy as np

import ig2mj
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.states import StateModel, states_of_manifest
from ig2mj.worlds import Pool, Worlds, load_pool, save_pool

home, folder = sys.argv[1:]
scene = ig2mj.load_scene(home)
world = ig2mj.Simulation(scene)
told = {"initial": world.state("age", "apple")}
world.step(count=3)
told["after three steps"] = world.state("age")
world.set_state("sliced", "apple", True)
told["after the cut"] = world.state("age")
world.save(folder + "/saved.npz")
world.set_state("age", "apple", 50)
told["set"] = world.state("age", "apple")
world.load(folder + "/saved.npz")
told["restored"] = world.state("age", "apple")

model = StateModel.of_manifest(scene.tables, scene.manifest)
scene.manifest.objects[scene.object_index("apple")].state = {"age": 7.0}
aged = states_of_manifest(model, scene.manifest, {})
told["of a manifest"] = float(aged.age[0, scene.object_index("apple")])

engine = NativeEngine(scene)
physics = jax.tree.map(lambda leaf: np.asarray(leaf)[None], engine.export(engine.reset(), 0))
save_pool(Pool(physics=physics, states=aged), folder + "/pool.npz", scene)
pool = load_pool(folder + "/pool.npz", scene)
worlds = Worlds(scene, 2, "native", pool=pool)
batch = worlds.start(seed=0)
batch = worlds.reset(worlds.step(batch)[0], np.array([True, True]))
told["of a pool"] = np.asarray(batch.world.states.age)[:, scene.object_index("apple")].tolist()
print(json.dumps(told))
"""


@pytest.fixture(scope="module")
def told(repository: pathlib.Path, tiny_home_folder: pathlib.Path, tmp_path_factory: pytest.TempPathFactory) -> dict:
    """A copy of the package with the state that docs/design/adding.md adds: one file, one line of the order."""
    folder = tmp_path_factory.mktemp("made_up")
    package = folder / "ig2mj"
    shutil.copytree(pathlib.Path(ig2mj.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    page = (repository / "docs" / "design" / "adding.md").read_text()
    (package / "states/definitions/age.py").write_text(
        page.split("## A state")[1].split("```python\n")[1].split("```")[0]
    )
    update = package / "states/update.py"
    text = update.read_text()
    text = text.replace("    dust,\n", "    age,\n    dust,\n", 1)
    update.write_text(re.sub(r"(    wetness\.SPEC,.*\n)", r"\1    age.SPEC,\n", text, count=1))
    (folder / "story.py").write_text(STORY)
    done = subprocess.run(
        [sys.executable, "story.py", str(tiny_home_folder), str(folder)],
        cwd=folder,  # which stands first on the path
        env={**os.environ, "PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_a_made_up_state_is_initialised_updated_and_shown(told):
    assert told["initial"] == 0.0
    assert told["after three steps"] == pytest.approx({"apple": 0.1, "apple_half_0": 0.0, "apple_half_1": 0.0})


def test_halves_inherit_a_made_up_state(told):
    assert told["after the cut"] == pytest.approx({"apple": 0.1, "apple_half_0": 0.1, "apple_half_1": 0.1})


def test_a_made_up_state_is_set_saved_and_restored(told):
    assert told["set"] == 50.0
    assert told["restored"] == pytest.approx(0.1)


def test_a_made_up_state_is_read_from_a_manifest_and_from_a_pool(told):
    assert told["of a manifest"] == 7.0
    assert told["of a pool"] == [7.0, 7.0]


PIECES = {
    "initial": lambda model: filled(model, "age", float, 0.0),
    "update": given_from_outside,
    "inherit": copied("age"),
    "from_manifest": nothing_saved,
}
FIELDS = {"age": jaxtyping.Float[np.ndarray, "W O"]}


def _spec(pieces: dict, fields: dict = FIELDS) -> StateSpec:
    return StateSpec(name="age", get=lambda *_: 0.0, abilities=None, fields=fields, **pieces)


def test_the_pieces_of_a_state_with_fields_are_these():
    assert set(PIECES) == set(KEEPS)
    assert _spec(PIECES).fields == FIELDS


@pytest.mark.parametrize("piece", KEEPS)
def test_a_spec_with_a_missing_piece_is_refused(piece):
    with pytest.raises(ValueError, match=f"state 'age' keeps age but lacks {piece}"):
        _spec({name: part for name, part in PIECES.items() if name != piece})


def test_a_spec_that_keeps_nothing_and_yet_updates_is_refused():
    with pytest.raises(ValueError, match="has update but no fields"):
        _spec({"update": given_from_outside}, {})


def test_a_state_that_does_not_start_all_its_fields_is_refused(monkeypatch):
    forgetful = _spec({**PIECES, "initial": lambda model: {}})
    monkeypatch.setattr(initial, "SPECS", (*registry.SPECS, forgetful))
    with pytest.raises(ValueError, match="'age' has fields \\['age'\\] but starts"):
        initial_states(HandWorld(Item("rock")).model(), 1)


def test_every_state_that_keeps_something_has_its_place_in_the_order_of_update():
    keeping = [spec for spec in registry.SPECS if spec.fields]
    assert sorted(spec.name for spec in keeping) == sorted(spec.name for spec in (*EVENTS, *HEAT))
    assert {name for spec in keeping for name in spec.fields} == set(ExtendedStates.__dataclass_fields__)


def test_every_state_is_in_the_documentation(repository):
    text = (repository / "docs" / "guide" / "states.md").read_text()
    for spec in registry.SPECS:
        assert f"`{spec.name}`" in text, spec.name
