"""Homes converted on another processor differ in the last digits of poses that were simulated, and in nothing else."""

from __future__ import annotations

import pathlib

import pytest
from ig2mj_homes.comparison import differences

SCENE = '<body name="apple_0" pos="1.25 -0.4 0.90123456" quat="1 0 0 1e-07"/>'


def home(folder: pathlib.Path, scene: str = SCENE, **files: str) -> pathlib.Path:
    (folder / "birch").mkdir(parents=True)
    for name, text in {"scene.xml": scene, "engine_profile_a.json": str(folder), **files}.items():
        (folder / "birch" / name).write_text(text)
    return folder


@pytest.mark.parametrize(
    "scene, differ, rounded",
    [
        (SCENE, [], []),
        (SCENE.replace("0.90123456", "0.90120156"), [], ["birch/scene.xml: numbers differ by up to 3.3e-05"]),
        (SCENE.replace("0.90123456", "0.9"), ["birch/scene.xml: differs, numbers by up to 0.0012"], []),
        (SCENE.replace(' quat="1 0 0 1e-07"', ""), [], ["birch/scene.xml: numbers differ by up to 0"]),
        (SCENE.replace("1 0 0 1e-07", "0.7071 0 0 0.7071"), ["birch/scene.xml: differs"], []),
        (SCENE.replace("apple_0", "apple_1"), ["birch/scene.xml: differs"], []),
    ],
)
def test_numbers_may_round_and_all_else_is_the_same(tmp_path, scene, differ, rounded):
    assert differences(home(tmp_path / "made", scene), home(tmp_path / "shipped")) == (differ, rounded)


def test_files_of_one_side_alone_and_bytes_of_other_files_are_differences(tmp_path):
    made = home(tmp_path / "made", **{"a.obj": "v 0.1", "more.obj": ""})
    shipped = home(tmp_path / "shipped", **{"a.obj": "v 0.10000001"})
    differ, rounded = differences(made, shipped)
    assert differ == [f"birch/more.obj: only in {made}", "birch/a.obj: differs"] and not rounded
