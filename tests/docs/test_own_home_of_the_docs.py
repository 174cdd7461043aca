"""The home of docs/guide/own_homes.md: its TOML, made by the page's command, and the page's Python."""

from __future__ import annotations

import json
import pathlib
import re

import numpy as np
import pytest
from own_objects import write_cup, write_table

import ig2mj
from ig2mj import cli
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.sampling.query import SceneQuery

PAGE = pathlib.Path(__file__).resolve().parents[2] / "docs" / "guide" / "own_homes.md"

pytestmark = pytest.mark.slow


def block(language: str) -> str:
    """The first block of a language."""
    found = re.search(rf"^```{language}\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    assert found is not None
    return found[1]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    """Where the page's commands are typed: the TOML, objects of one's own, and the home that was made."""
    folder = tmp_path_factory.mktemp("own_home")
    (folder / "obj").mkdir()
    write_cup(folder / "obj")
    write_table(folder / "obj", "side_table")
    (folder / "my_home.toml").write_text(block("toml"), encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert cli.call(["homes", "make", "my_home.toml"]) == 0
    return folder


def test_the_home_passes_all_checks_and_has_what_the_file_says(folder):
    scene = ig2mj.load_scene(folder / "my_home")
    checks = json.loads((folder / "my_home" / "checks.json").read_text())
    assert [c["name"] for c in checks if not c["passed"]] == []
    assert {c["name"] for c in checks} >= {"settle", "penetration", "joint_clearance", "opens", "reachable"}
    assert {"fridge", "table", "side_table", "cup", "plate_0", "plate_1", "book"} <= set(scene.object_names)
    assert scene.object("side_table").fixed and scene.object("side_table").rooms == ["living_room_0"]
    assert scene.object("apple").rooms == ["kitchen_0"] and scene.object("book").rooms == ["living_room_0"]
    assert scene.rooms is not None and set(scene.rooms.names) == {"kitchen_0", "living_room_0", "bathroom_0"}


def test_conditions_hold_at_the_start_and_everything_rests(folder):
    simulation = ig2mj.Simulation(folder / "my_home")
    for condition in (
        "(open fridge)",
        "(dusty table)",
        "(inside apple fridge)",
        "(on_top cup side_table)",
        "(under book table)",
    ):
        assert simulation.holds(condition), condition
    before = simulation.object_pose("cup")[0]
    simulation.step(count=60)
    assert np.linalg.norm(simulation.object_pose("cup")[0] - before) < 1e-3


def test_states_of_the_file_are_those_of_the_start(tmp_path):
    """Each kind of state that a condition can ask for."""
    conditions = ["(toggled_on stove)", "(dusty stove)", "(stained stove)", "(cooked apple)", "(soaked rag)"]
    conditions.append("(sliced lemon)")
    file = tmp_path / "states.toml"
    file.write_text(
        f"conditions = {json.dumps(conditions)}\n[rooms]\nkitchen = [0, 0, 4, 3]\n[furniture]\n"
        'stove = { room = "kitchen" }\ntable = { model = "breakfast_table", room = "kitchen" }\n'
        '[objects]\napple = "(on_top apple table)"\nrag = "(on_top rag table)"\nlemon = "(on_top lemon table)"\n'
    )
    assert cli.call(["homes", "make", str(file), "--out", str(tmp_path / "home")]) == 0
    simulation = ig2mj.Simulation(tmp_path / "home")
    assert [condition for condition in conditions if not simulation.holds(condition)] == []


def test_it_is_a_home_like_any_other(folder):
    """Objects can be added, and worlds stepped; halves of its apple wait outside."""
    scene = ig2mj.load_scene(folder / "my_home", objects=["mug", folder / "obj" / "cup"])
    assert [a.name for a in scene.additions] == ["mug_0", "cup_0"]
    assert SceneQuery(scene, NativeEngine(scene)).settle(10.0)
    worlds = ig2mj.Worlds(folder / "my_home", num_worlds=2, engine="native")
    batch, _ = worlds.step(worlds.start(seed=0))
    assert not np.asarray(batch.flags).any()
    env = ig2mj.make("PointNavigation", home=folder / "my_home", worlds=1, engine="native", pool_size=2)
    state = env.step(env.reset(0), np.zeros((1, len(env.action_names)), np.float32))
    assert np.isfinite(np.asarray(state.reward)).all()


def test_the_python_of_the_page_runs(folder, monkeypatch):
    monkeypatch.chdir(folder)
    exec(compile(block("python"), str(PAGE), "exec"), {"__name__": "__main__"})


def test_the_same_file_gives_the_same_home(folder, monkeypatch):
    monkeypatch.chdir(folder)
    first = (folder / "my_home" / "scene.xml").read_bytes()
    assert cli.call(["homes", "make", "my_home.toml", "--out", "again"]) == 0
    assert (folder / "again" / "scene.xml").read_bytes() == first


@pytest.mark.parametrize(
    ("where", "problem"),
    [
        ("(inside broom table)", "cannot be made true: broom: "),
        ("(open broom)", "not openable"),
        ("(on_top broom tabel)", "near matches: table"),
        ("on_top broom", "objects.broom.where"),
    ],
)
def test_conditions_that_cannot_hold_are_refused(tmp_path, where, problem, capsys):
    file = tmp_path / "small.toml"
    file.write_text(
        '[rooms]\nkitchen = [0, 0, 4, 3]\n[furniture]\ntable = { model = "breakfast_table", room = "kitchen" }\n'
        f'[objects]\nbroom = "{where}"\n'
    )
    assert cli.call(["homes", "make", str(file), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert "objects.broom.where" in error and problem in error
    assert not (tmp_path / "out").exists()
