"""Every benchmark of the native engine runs with tiny settings, and says what it measured.

The homes are made of the project's own objects; PyBullet is an extra ("bench").
"""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib", reason="plots need matplotlib (extra: bench)")

from benchmarks.harness import homes as homes_at_hand
from benchmarks.harness import idle_robot, made_dataset, timing
from benchmarks.harness.one_world import OneWorld
from benchmarks.speed import idle_a6, idle_robots, states_share
from ig2mj.states.model import StateModel


@pytest.fixture(scope="module")
def work(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the homes of this module are built."""
    return tmp_path_factory.mktemp("bench")


@pytest.fixture(scope="module")
def home(work: Path) -> homes_at_hand.Home:
    """Table A.7's home of 20."""
    return homes_at_hand.made_homes((20,), work)[0]


def result(out: Path, name: str) -> dict:
    """What a benchmark left, after a look at all that it should leave."""
    folder = out / name
    assert (folder / "plot.png").stat().st_size > 5_000
    assert (folder / "table.md").read_text().startswith("### ")
    found = json.loads((folder / "result.json").read_text())
    assert found["benchmark"] == name
    assert set(found["machine"]) >= {"processor", "versions", "cores", "ig2mj_commit"}
    assert str(out) not in json.dumps(found)  # no folder of this machine
    return found


def test_table_a7s_smallest_home_has_twenty_objects_of_which_fifteen_are_cracker_boxes(home) -> None:
    scene = home.load()
    categories = list(scene.tables.object_categories)
    assert len(categories) == 20
    assert categories.count("cracker_box") == 15
    assert {"fridge", "countertop", "coffee_table"} <= set(categories)


@pytest.mark.slow
def test_things_on_furniture_do_not_overlap(work) -> None:
    dataset = made_dataset.write_dataset(work / "rooms", (60,))
    items = [item for item in made_dataset._one_room(dataset, 60) if item.category in made_dataset.THINGS]
    assert len(items) > 30
    half = np.array([dataset.model(i.category, i.model).metadata.bbox_size for i in items]) / 2
    middle = np.array([i.pos for i in items])
    apart = (np.abs(middle[:, None] - middle[None]) - half[:, None] - half[None]).max(-1)
    assert apart[~np.eye(len(items), dtype=bool)].min() > 0.0


def test_the_robot_stands_where_it_is_put_and_never_sleeps(home) -> None:
    place = home.robot_place()
    scene = home.load(place)
    world = OneWorld(scene, StateModel.of_manifest(scene.tables, scene.manifest))
    for _ in range(90):
        world.engine_step()
    model, data = world.mujoco
    assert np.allclose(data.body(idle_robot.NAME).xpos, place[0], atol=1e-3)
    assert data.body(idle_robot.NAME).xmat[8] > 0.9999  # upright
    assert data.tree_asleep[model.body_treeid[model.body(idle_robot.NAME).id]] < 0
    assert world.awake() == []  # and all objects do


def test_blocks_take_turns_and_rates_are_medians() -> None:
    order: list[str] = []

    def block(name: str, seconds: float):
        def run(count: int) -> tuple[float, float]:
            order.append(name)
            return count * seconds, count * seconds / 2

        return run

    rates = timing.interleave({"a": block("a", 0.01), "b": block("b", 0.02)}, seconds=0.1, rounds=3)
    assert order[4:] == ["a", "b"] * 3  # after two calls each that find out the length
    assert (rates["a"].block, rates["b"].block) == (10, 5)
    assert rates["a"].steps_per_s == pytest.approx(100)
    assert rates["b"].steps_per_cpu_s == pytest.approx(100)


def test_table_a6_runs(home, tmp_path) -> None:
    args = idle_a6.Args(homes=(str(home.folder),), steps=140, repeats=1, pictures=False, work=tmp_path, out=tmp_path)
    (row,) = idle_a6.main(args)
    rates = {kind: row["rates"][kind]["steps_per_cpu_s"] for kind in ("mujoco", "ig2mj")}
    assert 10 < rates["ig2mj"] < rates["mujoco"]
    assert len(row["course"]) == 2
    assert result(tmp_path, "idle_a6")["settings"]["summary"]["ig2mj, all states"]["mean"] == pytest.approx(
        rates["ig2mj"]
    )


@pytest.mark.slow
def test_states_share_runs(home, tmp_path) -> None:
    args = states_share.Args(
        homes=(str(home.folder),), rest_steps=60, episode=30, rounds=1, seconds=0.02, work=tmp_path, out=tmp_path
    )
    rows = states_share.main(args)
    assert [row["case"] for row in rows] == ["settled", "idle robot", "disturbed"]
    assert rows[2]["awake"] > 0  # the hand does push something about
    for row in rows:
        assert 0 <= row["share"] < 1
    result(tmp_path, "states_share")


@pytest.mark.slow
def test_idle_robots_run_in_the_scene_and_far_away(home, tmp_path) -> None:
    args = idle_robots.Args(
        homes=(str(home.folder),), robots=("fetch",), rest_steps=30, rounds=1, seconds=0.02, pictures=False,
        work=tmp_path, out=tmp_path,
    )  # fmt: skip
    rows = idle_robots.main(args)
    assert [(row["robot"], row["far"]) for row in rows] == [(None, False), ("fetch", False), ("fetch", True)]
    assert all(row["rates"]["ig2mj"]["steps_per_cpu_s"] > 10 for row in rows)
    result(tmp_path, "idle_robots")
