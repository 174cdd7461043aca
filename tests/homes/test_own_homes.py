"""Homes from a TOML: what it says stands there, and a mistake is one line that names the table and the key."""

from __future__ import annotations

import pathlib
import textwrap

import numpy as np
import pytest
from ig2mj_homes.objects.catalogue import build_model, find
from ig2mj_homes.objects.folder_model import folder_model
from ig2mj_homes.own.description import HomeDescription, copies, read_home
from ig2mj_homes.own.own_furniture import furnish_own
from ig2mj_homes.own.own_plan import make_own_plan

from ig2mj import cli
from ig2mj.errors import InputError

ROOMS = """
[rooms]
kitchen = [0, 0, 4, 3]
living_room = [4, 0, 8, 3]
"""
DOORS = """
[[doors]]
between = ["kitchen", "living_room"]
"""


def described(tmp_path: pathlib.Path, text: str, rooms: str = ROOMS) -> HomeDescription:
    file = tmp_path / "mine.toml"
    file.write_text(textwrap.dedent(rooms) + textwrap.dedent(text))
    return read_home(file)


def test_rooms_keep_their_coordinates_and_get_doors_windows_and_a_front_door(tmp_path: pathlib.Path):
    plan = make_own_plan(described(tmp_path, ""))
    assert [room.name for room in plan.rooms] == ["kitchen_0", "living_room_0"]
    assert plan.room("living_room_0").rect == (4, 0, 8, 3)
    doors = [o for o in plan.openings if o.kind == "door"]
    assert sum(o.edge.outer for o in doors) == 1 and len(doors) == 2
    assert {o.edge.rooms[0] for o in plan.openings if o.kind == "window"} == {"kitchen_0", "living_room_0"}


def test_doors_windows_and_passages_are_where_the_file_says(tmp_path: pathlib.Path):
    text = """
    [[doors]]
    between = ["outside", "kitchen"]
    wall = "west"
    at = 1.2

    [[windows]]
    room = "living_room"
    wall = "east"

    [[passages]]
    between = ["living_room", "kitchen"]
    """
    plan = make_own_plan(described(tmp_path, text))
    passage, door, window = plan.openings
    assert plan.fully_open(passage.edge) and passage.edge.rooms == ("kitchen_0", "living_room_0")
    assert (door.edge.axis, door.edge.at, door.centre, door.into) == ("y", 0, 1.2, "kitchen_0")
    assert (window.edge.at, window.centre) == (8, 1.5)


def test_pieces_stand_at_walls_at_positions_and_next_to_each_other(tmp_path: pathlib.Path):
    text = """
    [furniture]
    fridge = { room = "kitchen", wall = "west", at = 1.5 }
    cabinet = { model = "bottom_cabinet/bottom_cabinet_01", right_of = "fridge" }
    table = { model = "breakfast_table", position = [6, 1.5], yaw = 90 }
    chair_0 = { model = "straight_chair", in_front_of = "table", distance = 0.02 }
    """
    home = described(tmp_path, text)
    things = furnish_own(home, make_own_plan(home)).things.things
    fridge, cabinet, table, chair = (things[name] for name in ("fridge", "cabinet", "table", "chair_0"))
    assert fridge.centre[1] == pytest.approx(1.5) and fridge.front[0] == 1 and fridge.rooms == ("kitchen_0",)
    assert cabinet.centre[1] > fridge.centre[1], "right of it for who looks at its front, from the east"
    assert cabinet.shape.model.model == "bottom_cabinet_01"
    np.testing.assert_allclose(table.centre[:2], (6, 1.5), atol=1e-6)
    assert chair.centre[1] > table.box()[1, 1] and chair.front[1] < 0 and not chair.fixed


MISTAKES = {
    "bathroom = [3, 2, 6, 5]": "rooms.bathroom: overlaps kitchen by 1 m in x and 1 m in y",
    "bathroom = [8.1, 0, 10, 3]": "rooms.bathroom: is 0.1 m from living_room",
    "bathroom = [8, 0, 8.5, 3]": "rooms.bathroom: is 0.5 m by 3 m",
    "bathroom = [8, 0, 10]": "rooms.bathroom: expected 'list' of length 4, got 3",
    "bathroom = [20, 0, 23, 3]": "no wall of 1.55 m for a door",
    "bathroom = [0, 3, nan, 6]": "rooms.bathroom: nan",
    "kichen_1 = [8, 0, 10, 3]": "no type of room is named 'kichen'; near matches: kitchen",
    "kitchen_2 = [8, 0, 10, 3]": "rooms.kitchen_2: there is no kitchen_1",
    "bathroom = [8, 0, 10, 3]\n[[doors]]\nbetween = ['kitchen', 'bathroom']": "kitchen_0 and bathroom_0 share no wall",
    "[[doors]]\nbetween = ['kitchen', 'livingroom']": "no room is named 'livingroom'; near matches: living_room",
    "[[doors]]\nbetwen = ['kitchen', 'living_room']": "doors[0].betwen: no key of it is named 'betwen'; near",
    "[[doors]]\nbetween = ['kitchen', 'living_room']\nat = 0.1": "doors[0].at: is y = 0.1, too near to a corner",
    "[[doors]]\nbetween = ['kitchen', 'outside']": "no way leads from kitchen_0 to living_room_0",
    "[[windows]]\nroom = 'kitchen'\nwall = 'east'": "the east wall of kitchen_0 is no outer wall",
    "[[windows]]\nroom = 'kitchen'\nwall = 'left'": "it cannot be 'left' (use north, south, east or west)",
    "[room]\nkitchen = 1": "no table or key of a home is named 'room'; near matches: rooms",
    "[furniture]\nfridg = { room = 'kitchen' }": "no category is named 'fridg'; near matches: fridge",
    "[furniture]\nfridge = { room = 'kitchen', wal = 'north' }": "furniture.fridge.wal: no key of it is named 'wal'",
    "[furniture]\nfridge = { room = 'kitchen', at = 1 }": "furniture.fridge.at: needs 'wall'",
    "[furniture]\nfridge = {}": "furniture.fridge: needs a room",
    "[furniture]\nfridge = { room = 'kitchen', wall = 'north', at = 3.9 }": "wall of kitchen_0 runs from x = 0.10",
    "[furniture]\nsofa = { model = 'sofa/sofa_99', room = 'kitchen' }": "no model of sofa is named 'sofa_99'",
    "[furniture]\nsofa = { model = 'obj/sofa', room = 'kitchen' }": "obj/sofa/manifest.json",
    "[furniture]\nstove = { right_of = 'fridge' }\nfridge = { room = 'kitchen' }": "it comes later in the file",
    "[furniture]\na = { model = 'car', room = 'kitchen' }": "finds no place in kitchen_0",
    "[furniture]\nb = { model = 'bed', position = [2, 2] }\nc = { model = 'bed', position = [2, 1] }": "it overlaps b",
    "[objects]\nmug = { where = '(on_top mug table)', count = 0 }": "objects.mug.count: is 0",
}


@pytest.mark.parametrize("text", MISTAKES)
def test_a_mistake_is_one_line_that_names_the_table_and_the_key(tmp_path: pathlib.Path, text: str):
    with pytest.raises(InputError) as error:
        home = described(tmp_path, text)
        furnish_own(home, make_own_plan(home))
    message = str(error.value)
    assert message.startswith(str(tmp_path / "mine.toml")) and MISTAKES[text] in message and "\n" not in message


def test_an_error_names_a_place_where_the_piece_fits(tmp_path: pathlib.Path):
    text = "[furniture]\nfridge = {{ room = 'kitchen', wall = 'north', at = {at} }}"
    with pytest.raises(InputError, match="is free") as error:
        home = described(tmp_path, text.format(at=3.9))
        furnish_own(home, make_own_plan(home))
    at = error.value.fix.removeprefix("at = ").removesuffix(" is free")
    home = described(tmp_path, text.format(at=at))
    assert "fridge" in furnish_own(home, make_own_plan(home)).things.things


def test_copies_of_an_object_are_numbered(tmp_path: pathlib.Path):
    home = described(tmp_path, "[objects]\nplate = { where = '(on_top plate table)', count = 2 }")
    assert copies("plate", home.objects["plate"]) == ["plate_0", "plate_1"]


def test_furniture_of_the_catalogue_is_written_as_a_folder_with_the_model_asked_for(tmp_path, capsys):
    assert cli.call(["homes", "model", "console_table/console_table_01", "--out", str(tmp_path / "table")]) == 0
    found = folder_model(str(tmp_path / "table"))
    assert (found.entry.category, found.entry.model, found.entry.fixed) == ("console_table", "console_table_01", True)
    built = build_model(find("console_table"), 1)
    np.testing.assert_allclose(found.model.bounds(), built.bounds(), atol=2e-3)
    assert [j.kind for j in found.model.joints] == [j.kind for j in built.joints]
    assert cli.call(["homes", "model", "console_table/console_table_99", "--out", str(tmp_path / "other")]) == 2
    assert "near matches: console_table_0" in capsys.readouterr().err
