"""misc/heights_per_link.json of furniture: heights, pixels, what is free."""

from __future__ import annotations

import json
import pathlib

import numpy as np
import pytest
from ig2mj_homes.dataset.height_maps import height_maps
from ig2mj_homes.dataset.model_writer import write_model
from ig2mj_homes.objects.catalogue import build_model, catalogue, find
from ig2mj_homes.objects.model import HouseholdObject
from PIL import Image
from scipy.spatial import Delaunay


def model(category: str, index: int = 0) -> HouseholdObject:
    return build_model(find(category), index)


def points_of(free: np.ndarray) -> np.ndarray:
    """x, y of the free pixels, by the specification's formula."""
    rows, columns = np.nonzero(free)
    return np.stack([columns / 100 - 2, rows / 100 - 2], 1)


def test_a_tables_top_is_free_all_over_and_its_floor_but_for_the_legs():
    table = model("breakfast_table")
    low, high = table.bounds()
    found = height_maps(table)
    ((z, top),) = found["onTop"]["base_link"]
    assert z == pytest.approx(high[2])
    spots = points_of(top)
    np.testing.assert_allclose([spots.min(0), spots.max(0)], [low[:2], high[:2]], atol=0.011)
    assert top.sum() == pytest.approx(1e4 * np.prod((high - low)[:2]), rel=0.03)
    ((floor, under),) = found["under"]["base_link"]
    assert floor == 0 and 0.7 * top.sum() < under.sum() < top.sum()


@pytest.mark.parametrize("category", ["bottom_cabinet", "fridge", "shelf", "sink", "stand"])
def test_what_lies_on_a_free_pixel_touches_its_height_and_nothing_else(category: str):
    """Every 20th free pixel of every map: 2 mm below the height is in a hull of that link, the air above in none."""
    thing = model(category)
    hulls = [(k, Delaunay(p + link.origin)) for k, link in enumerate(thing.links) for p in link.hulls]
    names = [link.name for link in thing.links]
    checked = 0
    for predicate, links in height_maps(thing).items():
        for name, maps in links.items():
            origin = thing.links[names.index(name)].origin
            for z, free in maps:
                spots = points_of(free)[::20] + origin[:2]
                below = np.c_[spots, np.full(len(spots), z + origin[2] - 1e-3)]
                above = [below + np.array([0, 0, lift]) for lift in (0.004, 0.015, 0.03)]
                carried = np.zeros(len(spots), bool)
                for k, mesh in hulls:
                    carried |= (k == names.index(name)) & (mesh.find_simplex(below) >= 0)
                    assert not any((mesh.find_simplex(air) >= 0).any() for air in above), (predicate, name, z)
                assert predicate == "under" or carried.all(), (predicate, name, z)
                checked += len(spots)
    assert checked > 100


def test_drawers_shelves_and_basins_are_inside_and_a_sofas_seat_is_on_top():
    drawers = height_maps(model("bottom_cabinet"))["inside"]
    assert {name for name in drawers if name.startswith("drawer")} == {
        link.name for link in model("bottom_cabinet").links[1:]
    }
    fridge = height_maps(model("fridge"))["inside"]["base_link"]
    assert len(fridge) >= 3 and [z for z, _ in fridge] == sorted(z for z, _ in fridge)
    assert len(height_maps(model("bathtub"))["inside"]["base_link"]) == 1
    assert "inside" not in height_maps(model("sofa")) and "onTop" in height_maps(model("sofa"))


def test_files_are_those_of_the_specification(tmp_path: pathlib.Path):
    folder = write_model(model("stand"), tmp_path)
    heights = json.loads((folder / "misc/heights_per_link.json").read_text())
    assert set(heights) <= {"onTop", "inside", "under"} and heights["onTop"]["base_link"]
    drawn = {
        f.relative_to(folder / "misc/height_maps_per_link") for f in folder.glob("misc/height_maps_per_link/*/*/*")
    }
    told = {
        pathlib.Path(predicate, link, f"{k}.png")
        for predicate, links in heights.items()
        for link, zs in links.items()
        for k in range(len(zs))
    }
    assert drawn == told
    with Image.open(folder / "misc/height_maps_per_link/onTop/base_link/0.png") as image:
        assert image.mode == "L" and image.size == (400, 400)
        free = height_maps(model("stand"))["onTop"]["base_link"][0][1]
        np.testing.assert_array_equal(np.asarray(image) > 0, free)


def test_only_furniture_has_them(tmp_path: pathlib.Path):
    folder = write_model(model("mug"), tmp_path)
    assert not (folder / "misc/heights_per_link.json").exists()


@pytest.mark.slow
def test_all_furniture_that_is_there_to_carry_or_hold_says_where():
    found = {name: height_maps(model(name)) for name, entry in catalogue().items() if entry.fixed}
    for name in ("bathtub", "bed", "bottom_cabinet", "breakfast_table", "coffee_table", "console_table", "countertop"):
        assert "base_link" in {**found[name].get("onTop", {}), **found[name].get("inside", {})}, name
    for name in ("desk", "dishwasher", "fridge", "microwave", "oven", "shelf", "sink", "stand", "stove", "top_cabinet"):
        assert "inside" in found[name], name
    assert not any(found[name] for name in ("mirror", "picture"))
    assert not any(model(name).furniture for name in ("door", "window"))
