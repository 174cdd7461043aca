"""Each kind of thing is one file and one line: those that docs/design/adding.md shows work in a copy of the package."""

from __future__ import annotations

import json
import os
import pathlib
import shutil
import subprocess
import sys

import pytest

import ig2mj
from ig2mj.agents import registry
from ig2mj.agents.fetch import Fetch
from ig2mj.envs.setups import Control, able_robots, setup_activity
from ig2mj.errors import EngineError, UnknownNameError
from ig2mj.tasks.experts import Expert
from ig2mj.tasks.registry import TASKS, load_task

FILES = {
    "A predicate": "ig2mj/predicates/definitions/raised.py",
    "A sensor": "ig2mj/sensors/definitions/clearance.py",
    "A robot": "ig2mj/agents/trolley.py",
    "An activity": "ig2mj/tasks/activities/clearing_table.py",
    "A primitive": "ig2mj/planning/lifting.py",
    "A sub-command": "ig2mj/cli/rooms.py",
    "An overlay": "ig2mj/viewer/speed.py",
    "A mesh format": "ig2mj_converters/reading/off_files.py",
}
"""Section of the page -> the file that it shows."""

LINES = {
    "ig2mj/predicates/registry.py": [
        ("from ig2mj.predicates.definitions.sliced", "from ig2mj.predicates.definitions.raised import RAISED\n"),
        ("        INSIDE,\n", "        RAISED,\n"),
    ],
    "ig2mj/sensors/registry.py": [
        ("from ig2mj.sensors.definitions.colour", "from ig2mj.sensors.definitions.clearance import CLEARANCE\n"),
        ("        RGB,\n", "        CLEARANCE,\n"),
    ],
    "ig2mj/agents/registry.py": [('    "fetch": ', '    "trolley": "ig2mj.agents.trolley:Trolley",\n')],
    "ig2mj/tasks/registry.py": [
        ('    "GraspingBook": ', '    "ClearingTable": "ig2mj.tasks.activities.clearing_table:CLEARING_TABLE",\n')
    ],
    "ig2mj/planning/steps.py": [
        (
            '    Primitive("release"',
            '    Primitive("lift", ("object",), "the object is in a hand", "it is 0.1 m higher"),\n',
        )
    ],
    "ig2mj/planning/primitives.py": [
        ("from ig2mj.planning.moves", "from ig2mj.planning.lifting import lift\n"),
        ('    "navigate_to": ', '    "lift": lift,\n'),
    ],
    "ig2mj/cli/__init__.py": [('    "states": ', '    "rooms": "list the rooms of a home",\n')],
    "ig2mj/viewer/overlays.py": [
        ("    return [\n        ObjectNames(scene),", "    from ig2mj.viewer.speed import Speed\n\n"),
        ("        ObjectNames(scene),\n", "        Speed(scene),\n"),
    ],
    "ig2mj_converters/reading/mesh_files.py": [
        ("from .trimesh_files ", "from .off_files import read_off\n"),
        ('    ".stl": read_stl,\n', '    ".off": read_off,\n'),
    ],
}
"""Registry -> how it begins where a line is put, and that line."""

STORY = """
import contextlib, io, json, pathlib, sys

home, folder = sys.argv[1:]
told = {}

from ig2mj.envs.names import NAMES, short_name
from ig2mj.agents.registry import ROBOTS, make_robot

told["names before loading"] = [short_name("ig2mj/ClearingTable-v0"), "trolley" in ROBOTS, "mujoco" in sys.modules]

from ig2mj import cli

with contextlib.redirect_stdout(io.StringIO()) as out:
    told["command"] = cli.call(["rooms", "birch"])
told["rooms"] = out.getvalue()
with contextlib.redirect_stdout(io.StringIO()) as out:
    cli.call(["--help"])
told["help"] = out.getvalue()

import numpy as np
import ig2mj
from ig2mj.engine.registry import make_engine
from ig2mj.envs.registry import find_task, list_envs
from ig2mj.envs.setups import able_robots
from ig2mj.errors import EngineError
from ig2mj.sensors.base import SensorOptions
from ig2mj.sensors.suite import SensorSuite
from ig2mj.states import StateModel, initial_states
from ig2mj.tasks.experts import Expert
from ig2mj.tasks.task import place_robot
from ig2mj.viewer.overlays import default_overlays

scene = ig2mj.load_scene(home, agents=[make_robot("trolley")])
world = ig2mj.Simulation(scene)
told["raised"] = [world.predicate("raised", name) for name in ("apple", "stove")]
start = np.array(world.view.agent.base_pos)[0, 0]
world.robots.act(forward=1.0, count=5)
told["driven"] = float((np.array(world.view.agent.base_pos)[0, 0] - start)[0])
(speed,) = [o for o in default_overlays(scene) if o.title == "speed"]
told["overlay"] = speed.lines(scene.start_data())

engine = make_engine("native", scene, 1)
model = StateModel.of_manifest(scene.tables, scene.manifest)
controller = make_robot("trolley").controller(scene.tables, 0)
suite = SensorSuite(engine, scene, model, controller, ("clearance",), SensorOptions())
physics = engine.reset()
states = initial_states(model, 1)
readings, _ = suite.read(physics, engine.view(physics), states, controller.initial(1), None, None)
told["clearance"] = float(np.asarray(readings["clearance"])[0, 0])

task = find_task("ClearingTable")
told["listed"] = list_envs()[0]
told["able"] = {name: able_robots(find_task(name)) for name in ("PointNavigation", "Reaching", "ClearingTable")}
placed, humanoid = place_robot(task, "humanoid")
birch = ig2mj.load_scene(task.home, agents=[humanoid])
model = StateModel.of_manifest(birch.tables, birch.manifest)
engine = make_engine("native", birch, 1)
expert = Expert(task, "humanoid", birch, model)
told["expert"] = np.asarray(expert(engine.view(engine.reset()), initial_states(model, 1)))[0].tolist()
try:
    place_robot(task, "trolley")
except EngineError as error:
    told["no hand"] = str(error)

from ig2mj_converters.base.file_access import FileGuard
from ig2mj_converters.reading.mesh_files import read_collision

scene = ig2mj.load_scene(home, agents=[make_robot("humanoid").at(-0.45, 0.0, 0.0)])
world = ig2mj.Simulation(scene, grasping="assisted")
told["lift"] = []
for name in ("lift", "grasp", "lift"):
    height = world.object_pose("apple")[0][2]
    outcome = world.agent.do(name, "apple")
    told["lift"].append([outcome.done, outcome.detail, float(world.object_pose("apple")[0][2] - height)])

mesh = pathlib.Path(folder) / "tetrahedron.off"
mesh.write_text("OFF 4 4 6  0 0 0  1 0 0  0 1 0  0 0 1  3 0 2 1  3 0 1 3  3 0 3 2  3 1 2 3")
meshes, _ = read_collision(mesh, FileGuard(mesh))
told["faces"] = [len(m.faces) for m in meshes]
print(json.dumps(told))
"""


def shown(page: str, section: str) -> str:
    """The first block of Python of a section."""
    return page.split(f"## {section}\n")[1].split("```python\n")[1].split("```")[0]


@pytest.fixture(scope="module")
def told(repository: pathlib.Path, tiny_home_folder: pathlib.Path, tmp_path_factory: pytest.TempPathFactory) -> dict:
    """What a copy of both packages reports of everything that the page adds."""
    folder = tmp_path_factory.mktemp("added")
    ignore = shutil.ignore_patterns("__pycache__")
    shutil.copytree(pathlib.Path(ig2mj.__file__).parent, folder / "ig2mj", ignore=ignore)
    shutil.copytree(repository / "converters", folder / "ig2mj_converters", ignore=ignore)
    (folder / "ig2mj_scenes").symlink_to(repository / "scenes_mjcf")
    page = (repository / "docs" / "design" / "adding.md").read_text()
    for section, file in FILES.items():
        (folder / file).write_text(shown(page, section))
    for file, places in LINES.items():
        text = (folder / file).read_text()
        for before, line in places:
            assert before in text, f"{file} has another form than this test knows"
            text = text.replace(before, line + before, 1)
        (folder / file).write_text(text)
    (folder / "story.py").write_text(STORY)
    done = subprocess.run(
        [sys.executable, "story.py", str(tiny_home_folder), str(folder)],
        cwd=folder,  # which stands first on the path
        env={**os.environ, "PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads(done.stdout.splitlines()[-1])


def test_a_predicate_is_one_file_and_one_line(told):
    assert told["raised"] == [False, False]


def test_a_sensor_is_one_file_and_one_line(told):
    assert 0.0 < told["clearance"] < 3.0


def test_a_robot_is_one_file_and_one_line(told):
    """It is known by name without being loaded, it drives, and an activity refuses it for the lack of hands."""
    assert told["names before loading"][1:] == [True, False]
    assert told["driven"] > 0.1
    assert told["able"] == {
        "PointNavigation": ["turtlebot", "fetch", "trolley"],
        "Reaching": ["fetch"],
        "ClearingTable": ["humanoid", "fetch"],
    }
    assert "robot 'trolley' has no hand: it cannot do ClearingTable" in told["no hand"]


def test_an_activity_with_its_expert_is_one_file_and_one_line(told):
    assert told["names before loading"][0] == told["listed"] == "ClearingTable"
    assert len(told["expert"]) == 6 and max(map(abs, told["expert"])) == pytest.approx(1.0)


def test_a_primitive_is_one_file_and_two_lines(told, repository):
    (refused, why, _), (taken, _, _), (lifted, _, by) = told["lift"]
    assert not refused and why == "no hand holds apple"
    assert taken and lifted and by == pytest.approx(0.1, abs=0.03)
    (_, line) = LINES["ig2mj/planning/steps.py"][0]
    assert line.strip(" ,\n") in (repository / "docs" / "design" / "adding.md").read_text()


def test_a_sub_command_is_one_file_and_one_line(told):
    assert told["command"] == 0 and "kitchen_0" in told["rooms"].split()
    assert "list the rooms of a home" in told["help"]


def test_an_overlay_is_one_file_and_one_line(told):
    assert told["overlay"][0][0] == "fastest"


def test_a_mesh_format_is_one_file_and_one_line(told):
    assert told["faces"] == [4]


@pytest.mark.usefixtures("registered")
def test_a_registered_robot_is_made_by_its_name():
    registry.register("mine", lambda: Fetch(name="mine"))
    assert registry.make_robot("mine").name == "mine"
    with pytest.raises(EngineError, match="already registered"):
        registry.register("mine", Fetch)
    with pytest.raises(UnknownNameError, match="near matches: mine"):
        registry.make_robot("mime")


@pytest.mark.usefixtures("registered")
def test_a_registered_robot_takes_the_place_of_the_listed_one_that_stands_lowest():
    """Its base is on the floor where Fetch's would be, it acts with its first hand, and it has an expert."""
    registry.register("mine", lambda: Fetch(name="mine"))
    task = load_task("GraspingBook")
    setup = setup_activity(task, "mine", "assisted", None, "train", None, False, Control())
    place = setup.scene.start_data().xpos[setup.scene.tables.agent_body[0]]
    assert place == pytest.approx([2.3, 0.0, Fetch().stands], abs=0.02)
    assert setup.actions.names[-1] == "gripper" and setup.actions.size == 7
    assert able_robots(task) == ["humanoid", "fetch", "mine"]
    Expert(task, "mine", setup.scene, setup.rules.model, "assisted")


@pytest.mark.usefixtures("registered")
def test_what_is_registered_must_be_a_robot():
    with pytest.raises(EngineError, match="register its class or a function"):
        registry.register("mine", 7)
    registry.register("mine", lambda: 7)
    with pytest.raises(EngineError, match="'mine' is a int: derive it from"):
        registry.make_robot("mine")


def test_every_robot_and_task_of_the_registries_can_be_loaded():
    assert [load_task(name).name for name in TASKS] == list(TASKS)
    assert [registry.make_robot(name).name for name in registry.ROBOTS] == list(registry.ROBOTS)


def test_every_kind_is_in_the_table_of_the_page(repository):
    text = (repository / "docs" / "design" / "adding.md").read_text()
    for section, file in FILES.items():
        assert f"## {section}\n" in text
        assert f"`{file.rpartition('/')[0].removeprefix('ig2mj/').replace('ig2mj_converters', 'converters')}/`" in text
