"""Where a hand starts, and what it is taken to reach: on free ways only."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import ig2mj
from ig2mj.agents.floating_hand import FloatingHand, add_floating_hand
from ig2mj.calibration.reach import RANGE, find_reach, hand_box
from ig2mj.errors import EngineError
from ig2mj.scene import manifest as mf

SOLID = 'group="3" friction="0.25 0.005 0.0001" gap="0.003" margin="0"'


def box(body: str, number: int, size: str, pos: str = "0 0 0") -> str:
    return f'<geom name="{body}/collision_{number}" type="box" size="{size}" pos="{pos}" density="500" {SOLID}/>'


def entry(name: str, category: str, fixed: bool) -> mf.ObjectEntry:
    return mf.ObjectEntry(name, category, "made", [name], fixed, (0.1, 0.1, 0.1), 1.0)


def write_room(folder: Path, things: dict[str, str], heavy: str = "") -> Path:
    """Two halves of a floor with a wall of 2 m between them (x = 0), a closed crate, and objects at given places."""
    crate = [("0.3 0.3 0.01", f"0 0 {z}") for z in (0.01, 0.59)]
    crate += [("0.3 0.01 0.3", f"0 {y} 0.3") for y in (0.29, -0.29)]
    crate += [("0.01 0.3 0.3", f"{x} 0 0.3") for x in (0.29, -0.29)]
    bodies = [
        f'<body name="floor" pos="0 0 -0.05">{box("floor", 0, "4 2 0.05")}</body>',
        f'<body name="wall" pos="0 0 1.5">{box("wall", 0, "0.05 3 1.5")}</body>',
        f'<body name="crate" pos="2 1 0">{"".join(box("crate", k, s, p) for k, (s, p) in enumerate(crate))}</body>',
    ]
    entries = [entry("floor", "floors", True), entry("wall", "walls", True), entry("crate", "shelf", True)]
    for name, pos in things.items():
        size = "0.3 0.3 0.3" if name == heavy else "0.03 0.03 0.04"
        bodies.append(f'<body name="{name}" pos="{pos}"><freejoint name="{name}/free"/>{box(name, 0, size)}</body>')
        entries.append(entry(name, "apple", False))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "scene.xml").write_text(
        f'<mujoco><compiler angle="radian"/><option timestep="{1 / 120!r}" gravity="0 0 -9.8">'
        f'<flag sleep="enable"/></option><worldbody>{"".join(bodies)}</worldbody></mujoco>'
    )
    mf.save_manifest(mf.Manifest(mf.FORMAT_VERSION, "room", entries), folder / "manifest.json")
    return folder


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    """Two objects on the crate, one in it, one beside it, one on the wall's other side."""
    things = {"on_a": "1.9 1 0.65", "on_b": "2.1 1.1 0.65", "inside": "2 1 0.07", "beside": "2 0.2 0.05"}
    return ig2mj.load_scene(write_room(tmp_path_factory.mktemp("room"), {**things, "behind": "-1 0 0.05"}))


def test_things_in_a_closed_crate_and_behind_a_wall_are_out_of_reach(room):
    reach = find_reach(room)
    assert {room.object_names[o] for o in reach.objects} == {"on_a", "on_b", "beside"}
    assert room.object_names[reach.objects[reach.first]].startswith("on_")
    assert reach.start[0] > 0.2


def test_the_hand_starts_where_it_touches_nothing(room):
    reach = find_reach(room)
    scene = ig2mj.load_scene(room.folder, [FloatingHand(pos=reach.start)])
    data = mujoco.MjData(scene.model)
    mujoco.mj_forward(scene.model, data)
    agent = scene.model.body_rootid[scene.model.geom_bodyid[data.contact.geom]] == scene.tables.agent_body[0]
    assert not agent.any()


def test_every_object_is_reached_from_every_node_that_leads_anywhere(room):
    reach = find_reach(room)
    count = len(reach.objects)
    assert (reach.hop[: 2 * count] >= 0).all()
    for goal in range(count):
        node, way = reach.start_node, []
        while node != goal:
            way.append(int(node))
            node = reach.hop[node, goal]
            assert len(way) < len(reach.nodes)
            assert np.linalg.norm(reach.nodes[node] - reach.nodes[way[-1]]) <= RANGE + 1e-9
        assert reach.hop[goal, goal] >= count, "from an object's place to itself it leads by the station"
    assert reach.choice[:, -1] == pytest.approx(np.ones(count))
    assert reach.choice[0, 0] == 0.0, "the next object is another one"


def test_fingers_stay_clear_of_what_a_thing_lies_on(room):
    reach = find_reach(room)
    low, high = hand_box()
    assert low[2] == pytest.approx(-0.13) and high[2] == pytest.approx(0.045)
    com = {"on_a": 0.64, "on_b": 0.64, "beside": 0.04}
    for k, o in enumerate(reach.objects):
        height = com[room.object_names[o]]
        assert reach.nodes[k, 2] + low[2] == pytest.approx(height - 0.03, abs=2e-3)  # 1 cm over the support


def test_the_thumb_makes_the_hand_wider():
    low, high = hand_box(thumb=False)
    wide = hand_box()
    assert wide[1][0] > high[0] + 0.02 and wide[0][1] < low[1] - 0.02


def test_a_heavy_thing_is_in_the_way(tmp_path):
    """A box of 108 kg right on the object: nothing leads through it."""
    things = {"under": "2 -1 0.04", "free": "3 0.5 0.04", "block": "2 -1 0.39"}
    scene = ig2mj.load_scene(write_room(tmp_path / "lid", things, heavy="block"))
    reach = find_reach(scene)
    assert "free" in {scene.object_names[o] for o in reach.objects}


def test_a_scene_with_nothing_to_push_is_named(tmp_path):
    with pytest.raises(EngineError, match="in scene 'room' there is no loose object that a hand can get at"):
        find_reach(ig2mj.load_scene(write_room(tmp_path / "crate", {"inside": "2 1 0.07"})))


def test_the_start_is_looked_for_before_the_hand_is_added(room):
    scene = ig2mj.load_scene(room.folder, [add_floating_hand])
    with pytest.raises(EngineError, match="scene 'room' has an agent"):
        find_reach(scene)
