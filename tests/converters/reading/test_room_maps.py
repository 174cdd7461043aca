"""iGibson's room maps: layout images, room names, traversable floor, rooms.npz."""

from __future__ import annotations

import numpy as np
import pytest
from ig2mj_converters.reading.room_maps import name_rooms, read_room_maps, room_at, traversable, write_rooms

from ig2mj.errors import InputError
from ig2mj.scene.rooms import load_rooms

TYPES = ["bathroom", "bedroom", "kitchen"]


def layout(root, semantic, instance, **others):
    for name, pixels in {"semseg": semantic, "insseg": instance, **others}.items():
        root.image(f"layout/floor_{name}_0.png", pixels)
    return read_room_maps(root.root, TYPES)


@pytest.fixture
def maps(folder):
    """40 x 40 cells of 10 pixels: instance 9 a bedroom, 4 a kitchen, 7 another bedroom."""
    instance, semantic = np.zeros((400, 400)), np.zeros((400, 400))
    for value, kind, rows, cols in (
        (9, 2, (0, 100), (0, 400)),
        (4, 3, (100, 200), (0, 200)),
        (7, 2, (300, 400), (0, 50)),
    ):
        instance[slice(*rows), slice(*cols)] = value
        semantic[slice(*rows), slice(*cols)] = kind
    return layout(folder, semantic, instance)


def test_names_count_ascending_instance_ids_within_a_type(maps):
    assert maps.names == ["kitchen_0", "bedroom_0", "bedroom_1"]
    assert maps.types == ["kitchen", "bedroom", "bedroom"]
    assert maps.room_map.shape == (40, 40)
    assert maps.room_map[0, 0] == 3, "instance 9 is the second bedroom"
    assert maps.room_map[35, 0] == 2, "instance 7 is the first"
    assert maps.room_map[25, 25] == 0


def test_row_is_y_column_is_x_and_nothing_is_flipped(maps):
    """row = int(y / res + N / 2), col = int(x / res + N / 2); N / 2 = 20 cells of 0.1 m."""
    assert room_at(maps, 1.9, -1.95) == "bedroom_1"
    assert room_at(maps, -1.9, -0.95) == "kitchen_0"
    assert room_at(maps, 0.05, -0.95) is None
    assert room_at(maps, -1.99, 1.95) == "bedroom_0"


def test_coordinates_are_truncated_not_rounded(maps, tmp_path):
    write_rooms(maps, tmp_path / "rooms.npz")
    rooms = load_rooms(tmp_path)
    for y, name in ((-1.01, "bedroom_1"), (-1.0, "kitchen_0"), (-0.01, "kitchen_0"), (0.0, None), (-2.05, "bedroom_1")):
        assert room_at(maps, -1.0, y) == name
        assert rooms.room_at((-1.0, y)) == name
    assert rooms.room_at((-1.0, -2.11)) is None
    assert rooms.room_at((50.0, 0.0)) is None
    assert rooms.room_at((np.nan, 0.0)) is None


def test_the_type_is_that_of_the_first_pixel_after_the_resize(folder):
    semantic, instance = np.zeros((200, 200)), np.zeros((200, 200))
    instance[50:150, 50:150] = 1
    semantic[50:150, 50:150] = 2
    semantic[50:60, 50:60] = 3  # one cell: the first of the room
    semantic[40:50, :] = 1  # outside the room
    assert layout(folder, semantic, instance).names == ["kitchen_0"]


def test_the_resize_takes_the_nearest_pixel(folder):
    """A room thinner than a cell can vanish or stay; Pillow's nearest pixel decides: the sixth of ten."""
    semantic, instance = np.full((100, 100), 1), np.full((100, 100), 1)
    instance[25, :], instance[32, :] = 2, 3
    maps = layout(folder, semantic, instance)
    assert maps.names == ["bathroom_0", "bathroom_1"]
    assert set(np.unique(maps.room_map[2])) == {2}


def test_without_segmentation_there_are_no_rooms(folder):
    warnings: list[str] = []
    assert read_room_maps(folder.root, TYPES, warnings) is None
    assert "no rooms" in warnings[0]


@pytest.mark.parametrize(
    ("semantic", "instance", "message"),
    [
        (np.full((100, 100), 4), np.ones((100, 100)), r"floor_semseg_0.png.*room instance 1.*pixel value 4.*3 lines"),
        (np.zeros((100, 100)), np.ones((100, 100)), r"floor_semseg_0.png.*pixel value 0"),
        (np.ones((100, 200)), np.ones((100, 100)), r"floor_semseg_0.png.*not square but 200 x 100"),
        (np.ones((100, 100)), np.ones((200, 200)), r"floor_insseg_0.png.*size differs"),
        (np.ones((2, 2)), np.ones((2, 2)), r"floor_semseg_0.png.*2 pixels a side"),
        (np.ones((100, 100, 3)), np.ones((100, 100)), r"floor_semseg_0.png.*colour image"),
    ],
)
def test_broken_maps_are_refused(folder, semantic, instance, message):
    with pytest.raises(InputError, match=message):
        layout(folder, semantic, instance)


def test_traversable_cells_are_wholly_white_and_eroded_towards_higher_rows():
    """Bilinear resize to 0.1 m, erosion with ones(2, 2), anything below 255 is not free. OpenCV's anchor of a 2 x 2
    kernel is its last cell, so a cell is free if it and its lower neighbours are."""
    image = np.zeros((100, 100), dtype=np.uint8)
    image[20:60, 30:70] = 255
    free = traversable(image)
    assert free.shape == (10, 10)
    rows, cols = np.nonzero(free)
    assert (rows.min(), rows.max(), cols.min(), cols.max()) == (3, 5, 4, 6)
    assert free.sum() == 9
    assert traversable(image, erosion=0).sum() == 16


def test_a_half_grey_cell_is_not_traversable():
    image = np.full((100, 100), 255, dtype=np.uint8)
    image[50, :] = 254  # never sampled: the samples lie between pixels 4 and 5 of ten
    assert traversable(image).all()
    image[55, :] = 0
    assert not traversable(image)[5:7].any()


def test_only_the_largest_8_connected_component_is_traversable():
    image = np.zeros((200, 200), dtype=np.uint8)
    image[0:60, 0:60] = 255
    image[60:120, 60:120] = 255  # touches the first at a corner
    image[150:200, 0:50] = 255
    free = traversable(image, erosion=0)
    assert free.sum() == 72
    assert not free[15:].any()


def test_rooms_npz_holds_all_and_equal_maps_give_equal_bytes(folder, tmp_path):
    one = np.ones((100, 100))
    maps = layout(folder, one, one, trav=one * 255, trav_no_obj=one * 255)
    write_rooms(maps, tmp_path / "a.npz")
    write_rooms(maps, tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    rooms = load_rooms(tmp_path / "a.npz")
    assert rooms.names == ("bathroom_0",)
    assert rooms.types == ("bathroom",)
    assert rooms.resolution == rooms.trav_resolution == 0.1
    np.testing.assert_array_equal(rooms.room_map, maps.room_map)
    np.testing.assert_array_equal(rooms.traversable, maps.traversable)
    np.testing.assert_array_equal(rooms.traversable_no_obj, maps.traversable_no_obj)
    assert rooms.centre("bathroom_0") == pytest.approx([0, 0])


def test_index_at_takes_many_points(maps, tmp_path):
    write_rooms(maps, tmp_path / "rooms.npz")
    points = np.array([[[-1.9, -0.95], [5.0, 5.0]], [[1.9, -1.95], [0.0, 0.05]]])
    np.testing.assert_array_equal(load_rooms(tmp_path).index_at(points), [[0, -1], [2, -1]])


@pytest.mark.parametrize("content", [None, b"", b"no archive", b"PK\3\4broken"])
def test_a_broken_rooms_npz_is_an_input_error(tmp_path, content):
    file = tmp_path / "rooms.npz"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(InputError, match=r"rooms.npz.*convert the scene again"):
        load_rooms(file)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format_version": 2}, "format version 2"),
        ({"names": None}, "lacks an array.*names"),
        ({"room_map": np.full((3, 3), 9)}, "room_map.*do not exist"),
        ({"room_map": np.zeros((3, 4), np.int16)}, "room_map: has shape .3, 4., and a map is square"),
        ({"room_map": np.zeros((3, 3))}, "room_map: is 2-dimensional float64"),
        ({"room_map": np.zeros((0, 0), np.int16)}, "room_map: has shape"),
        ({"names": np.array(["a", "a"]), "types": np.array(["a", "a"])}, "names and types do not fit together"),
        (
            {"names": np.arange(40_000).astype(str), "types": np.full(40_000, "a")},
            "40000 rooms, and the limit is 32767",
        ),
        ({"resolution": 0.0}, r"resolution: is 0 m, and must be in"),
        ({"trav_resolution": np.nan}, r"trav_resolution: is nan m, and must be in"),
        ({"traversable": np.array([["x"]])}, "traversable: is 2-dimensional <U1"),
    ],
)
def test_a_rooms_npz_that_does_not_fit_is_an_input_error(tmp_path, change, message):
    arrays = {
        "format_version": 1,
        "names": np.array(["a_0"]),
        "types": np.array(["a"]),
        "room_map": np.zeros((3, 3), np.int16),
        "resolution": 0.1,
        "trav_resolution": 0.1,
    } | change
    np.savez(tmp_path / "rooms.npz", **{k: v for k, v in arrays.items() if v is not None})
    with pytest.raises(InputError, match=message):
        load_rooms(tmp_path)


def test_more_rooms_than_a_map_can_number_are_refused(tmp_path):
    """Of an image with an id for each pixel."""
    ids = np.arange(1, 200 * 200 + 1).reshape(200, 200)
    with pytest.raises(InputError, match="has 40000 rooms, and the limit is 32767"):
        name_rooms(np.ones_like(ids), ids, ["kitchen"], "floor_insseg_0.png")
    few = np.minimum(ids, 30_000)
    room_map, names, types = name_rooms(np.ones_like(few), few, ["kitchen"], "floor_insseg_0.png")
    assert len(names) == len(types) == room_map.max() == 30_000 and names[-1] == "kitchen_29999"
