"""The first view of `ig2mj play`: nothing opaque hides the robot, names are of what is seen, texts fit the window."""

from __future__ import annotations

import dataclasses
import textwrap

import mujoco
import numpy as np
import pytest

import ig2mj
from ig2mj.agents.fetch.controller import FetchController
from ig2mj.agents.humanoid.controller import HumanoidController
from ig2mj.envs.registry import find_task, list_envs
from ig2mj.scene.rooms import Rooms
from ig2mj.viewer.interactive import ViewerState
from ig2mj.viewer.label_space import CHARACTER, Sight, off_texts, text_size
from ig2mj.viewer.offscreen import FreeView
from ig2mj.viewer.overlays import Label
from ig2mj.viewer.play.first_view import ASPECT, first_view
from ig2mj.viewer.play.goal import COLUMNS, LINES
from ig2mj.viewer.play.keys import BINDINGS, key_rows
from ig2mj.viewer.play.names import VisibleObjectNames, VisibleRoomNames
from ig2mj.viewer.play.session import PlaySession
from ig2mj.viewer.sight_lines import SightLines, surface_points

WALL = '<geom name="wall" type="box" size="0.05 3 1.5" pos="-0.8 0 1.5" rgba="{rgba}"/>'
ROOM = """<mujoco><worldbody>
  <light pos="0 0 3"/>
  <geom name="floor" type="box" size="4 4 0.1" pos="0 0 -0.1"/>
  {wall}
  <body name="robot"><freejoint/><geom name="robot" type="box" size="0.2 0.2 0.5" pos="0 0 0.5"/></body>
  <body name="apple" pos="1.5 0 0.1"><geom name="apple" type="sphere" size="0.1"/></body>
</worldbody></mujoco>"""

FOVY = 45.0
"""Degrees: MuJoCo's, of the window's camera."""

NO_POINTS = np.zeros((0, 3))


def room(wall: str = "") -> tuple[mujoco.MjModel, mujoco.MjData, SightLines]:
    model = mujoco.MjModel.from_xml_string(ROOM.format(wall=wall))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data, SightLines(model)


def robot_in_sight(model, data, lines, view: FreeView, geoms: np.ndarray) -> float:
    """Share of rays through the frame towards the robot that meet it before anything else."""
    sight = Sight.of_view(view, FOVY, ASPECT)
    points = surface_points(model, data, geoms).reshape(-1, 3)
    met, _ = lines.towards(data, sight.eye, points)
    return float(np.mean(np.isin(met, geoms) & sight.frames(points)))


def side_of(view: FreeView, heading: float = 0.0) -> float:
    return abs((view.azimuth - heading + 180.0) % 360.0 - 180.0)


def test_in_a_free_room_the_camera_stands_behind_the_robot_whichever_way_it_looks():
    model, data, lines = room()
    robot = np.array([model.geom("robot").id])
    for heading in (0.0, 130.0):
        view = first_view(lines, model, data, robot, heading, NO_POINTS)
        assert side_of(view, heading) < 1e-6 and view.elevation > -45
        assert robot_in_sight(model, data, lines, view, robot) == 1.0


def test_no_wall_stands_between_the_camera_and_a_robot_with_its_back_to_one():
    model, data, lines = room(WALL.format(rgba="1 1 1 1"))
    robot = np.array([model.geom("robot").id])
    behind = FreeView((0, 0, 0.5), 2.2, 0.0, -25.0)
    assert robot_in_sight(model, data, lines, behind, robot) == 0.0, "what is to be avoided"
    view = first_view(lines, model, data, robot, 0.0, NO_POINTS)
    assert robot_in_sight(model, data, lines, view, robot) == 1.0
    eye = Sight.of_view(view, FOVY, ASPECT).eye
    assert abs(eye[0] + 0.8) > 0.05, "nor is it inside the wall"


def test_glass_hides_nothing():
    model, data, lines = room(WALL.format(rgba="1 1 1 0.3"))
    robot = np.array([model.geom("robot").id])
    view = first_view(lines, model, data, robot, 0.0, NO_POINTS)
    assert side_of(view) < 1e-6
    assert robot_in_sight(model, data, lines, view, robot) == 1.0


def test_a_robot_of_glass_is_not_hidden_either():
    text = ROOM.format(wall=WALL.format(rgba="1 1 1 1")).replace(
        'name="robot" type', 'name="robot" rgba="1 1 1 0.4" type'
    )
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    lines, robot = SightLines(model), np.array([model.geom("robot").id])
    assert not lines.opaque[robot].any()
    view = first_view(lines, model, data, robot, 0.0, NO_POINTS)
    eye = Sight.of_view(view, FOVY, ASPECT).eye
    _, far = lines.towards(data, eye, np.array([[0.0, 0.0, 0.5]]))
    assert far[0] > np.linalg.norm(eye - (0.0, 0.0, 0.5))


def test_the_camera_shows_the_goals_object_along_with_the_robot():
    model, data, lines = room('<geom name="shelf" type="box" size="0.05 0.5 0.35" pos="0.9 0 0.35"/>')
    robot, apple = np.array([model.geom("robot").id]), np.array([model.geom("apple").id])
    view = first_view(lines, model, data, robot, 0.0, NO_POINTS, [apple])
    assert robot_in_sight(model, data, lines, view, apple) > 0
    assert robot_in_sight(model, data, lines, view, robot) > 0.9


def view_of_home(height: float) -> Sight:
    """From the middle of the tiny home's southern side to the north, from so many metres above the floor."""
    return Sight.of_view(FreeView((0.0, 0.0, height), 1.9, 90.0, 0.0), FOVY, ASPECT)


def named(home, data, sight: Sight, goal=()) -> list[str]:
    names = VisibleObjectNames(home, SightLines(home.model), goal)
    names.look(data, sight)
    return [label.text for label in names.labels(data)]


def put(home, data, name: str, pos) -> None:
    address = int(home.model.joint(f"{name}/free").qposadr[0])
    data.qpos[address : address + 3] = pos
    mujoco.mj_kinematics(home.model, data)


@pytest.fixture
def data(tiny_home) -> mujoco.MjData:
    fresh = tiny_home.start_data()
    mujoco.mj_forward(tiny_home.model, fresh)
    return fresh


def test_names_are_of_objects_in_sight_and_not_of_those_behind_others_or_outside_the_window(tiny_home, data):
    sight = view_of_home(1.5)
    put(tiny_home, data, "box", (0.0, -1.0, 1.5))
    assert "box" in named(tiny_home, data, sight)
    assert "box (goal)" in named(tiny_home, data, sight, ["box"])
    put(tiny_home, data, "pan", (0.0, 0.5, 1.5))
    assert "pan" not in named(tiny_home, data, sight), "behind the box"
    put(tiny_home, data, "box", (0.0, -3.0, 1.5))
    after = named(tiny_home, data, sight)
    assert "pan" in after and "box" not in after, "the box is behind the camera"
    put(tiny_home, data, "pan", (0.0, 0.5, -1.0))
    assert "pan" not in named(tiny_home, data, sight), "below the floor"


def test_a_room_is_named_where_its_floor_is_seen_at_that_point(tiny_home, data):
    room_map = np.zeros((40, 40), dtype=np.int16)
    room_map[18:22, 18:22], room_map[0:5, 0:5] = 1, 2
    rooms = Rooms(("under_the_table_0", "corner_0"), ("den", "corner"), room_map, 0.1)
    home = dataclasses.replace(tiny_home, rooms=rooms)
    names = VisibleRoomNames(home, SightLines(home.model))
    assert names.labels(data) == [], "nothing is seen yet"
    names.look(data, Sight.of_view(FreeView((0.0, 0.0, 0.0), 4.0, 90.0, -89.0), FOVY, (800, 800)))
    assert [label.text for label in names.labels(data)] == [], "one is below the table, one outside the window"
    names.look(data, Sight.of_view(FreeView((0.0, 0.0, 0.0), 8.0, 90.0, -89.0), FOVY, (800, 800)))
    assert [label.text for label in names.labels(data)] == ["corner_0"]


def test_every_name_stands_where_its_object_or_free_space_is_seen(tiny_home, data):
    lines, sight = SightLines(tiny_home.model), view_of_home(1.2)
    names = VisibleObjectNames(tiny_home, lines)
    names.look(data, sight)
    labels = names.labels(data)
    assert labels
    for label in labels:
        met, far = lines.towards(data, sight.eye, np.array([label.pos]))
        owner = int(tiny_home.tables.geom_object[met[0]]) if met[0] >= 0 else -1
        free = far[0] > np.linalg.norm(np.array(label.pos) - sight.eye) - 0.05
        assert free or tiny_home.object_names[owner] == label.text, label


def test_a_name_that_would_lie_under_a_text_of_the_window_is_left_out():
    sight = Sight(np.zeros(3), np.array([[0.0, -1, 0], [0, 0, 1], [1, 0, 0]]), np.pi / 2, (800, 600))
    corner = Label((1.0, -1.2, 0.9), "under")  # right and up
    middle = Label((1.0, 0.0, 0.0), "free")
    texts = [(150, mujoco.mjtGridPos.mjGRID_TOPRIGHT, "goal\ntime", "0%\n1 s")]
    assert off_texts([corner, middle], sight, texts) == [middle]
    assert off_texts([corner, middle], sight, []) == [corner, middle]
    left = Label((1.0, -0.95, 0.9), "reaches under the text")
    (moved,) = off_texts([left], sight, texts)
    (at, before), _ = sight.pixels(np.array([moved.pos, left.pos]))
    width = text_size(*texts[0][2:])[0]
    assert at[0] < before[0] < 800 - width and at[1] == pytest.approx(before[1]), "shifted to the left"
    assert at[0] + CHARACTER[0] * len(left.text) == pytest.approx(800 - width)


class Lines:
    """Stands for the session, with the most that its rows hold."""

    title = "robot"

    def __init__(self, summary: str):
        task = textwrap.wrap(summary, COLUMNS, max_lines=LINES, placeholder=" ...")
        self._rows = [*(("task", line) for line in task), ("goal", "50%"), ("next", "coffee_table_0, 10.1 m behind")]
        self._rows += [("left hand", "x" * 20), ("> right hand", "x" * 20)]

    def labels(self, data):
        return []

    def lines(self, data):
        return self._rows


class Clock(Lines):
    def __init__(self):
        self._rows = [("time", "10000.0 s"), ("awake", "100 of 100"), ("contacts", "1000")]


@pytest.mark.parametrize("names", [HumanoidController.action_names, FetchController.action_names, ("forward",)])
@pytest.mark.parametrize("size", [ASPECT, (1280, 720)])
def test_the_keys_and_the_task_fit_the_window(names, size, data):
    summaries = [find_task(env).summary for env in list_envs()]
    assert len(summaries) > 6
    for summary in summaries:
        state = ViewerState([Lines(""), Lines(""), Clock(), Lines(summary)], more_keys=key_rows(names))
        state.overlays[0]._rows = state.overlays[1]._rows = []  # names have no rows
        state.paused = state.help = True
        taken = {corner: np.array(text_size(*columns)) for _, corner, *columns in state.texts(data)}
        grid = mujoco.mjtGridPos
        left, right, top = (taken[c] for c in (grid.mjGRID_BOTTOMLEFT, grid.mjGRID_BOTTOMRIGHT, grid.mjGRID_TOPRIGHT))
        assert left[1] <= size[1] and right[1] + top[1] <= size[1], "in height"
        assert left[0] + right[0] <= size[0] and top[0] <= size[0], "in width"


def test_the_list_of_keys_is_of_the_robots_own_and_complete():
    humanoid = key_rows(HumanoidController.action_names)
    assert len(humanoid) == (len(BINDINGS) - 4) / 2 + 4, "all of them, movements in pairs"
    assert ("pad 8 2, T V", "hand forward, back") in humanoid
    fetch, turtlebot = (dict(key_rows(n)).values() for n in (FetchController.action_names, ("forward", "turn_left")))
    assert "other hand" not in fetch and "close or open" in fetch
    assert list(turtlebot) == ["forward, backward", "turn left, right", "see with the robot's eye"]


ACTIVITIES = [
    (name, robot)
    for name in ("GraspingBook", "SoakingTowel", "CleaningStainedShelf", "CookingMeat", "SlicingFruit")
    for robot in ("humanoid", "fetch")
]
MORE = [("BimanualPickAndPlace", "humanoid"), ("PointNavigation", "turtlebot"), ("Reaching", "fetch")]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "robot"), [*ACTIVITIES, *MORE])
def test_at_the_start_of_an_episode_the_robot_is_seen_whole_and_the_goal_is_marked(name, robot):
    env = ig2mj.make(name, robot, 1, engine="native", pool_size=2, whole_actions=True, period=1 / 30)
    session = PlaySession(env, clock=lambda: 0.0)
    model, tables = session.scene.model, session.scene.tables
    geoms = np.flatnonzero(session.sight_lines.opaque & (tables.body_agent[model.geom_bodyid] == 0))
    for _ in range(2):
        view = session.view()
        assert view is not None and session.view() is None, "then the camera is the mouse's"
        assert robot_in_sight(model, session.data, session.sight_lines, view, geoms) > 0.85
        assert side_of(view, session.heading) <= 110.0, "not from the front"
        point = session.goal.point(session.state)
        assert len(session.goal.marks(session.data, session.state)) == len(session.goal.objects) + (point is not None)
        if session.goal.objects:
            sight = Sight.of_view(view, FOVY, ASPECT)
            names = session.overlays()[0]
            names.look(session.data, sight)
            shown = {label.text for label in names.labels(session.data)}
            assert any(f"{name} (goal)" in shown for name in session.goal.objects)
        session.reset()
    env.close()
