"""The cooking demo in the small home: temperatures to the step, as computed by hand."""

from __future__ import annotations

import csv
import json

import numpy as np
import pytest

from ig2mj.errors import EngineError, StateError
from ig2mj.scene.scene import load_scene
from ig2mj.showcase.button_hand import HOLD, PRESS, REST, ButtonHand
from ig2mj.showcase.cooking import cook, missing
from ig2mj.showcase.cooking_plot import plot
from ig2mj.showcase.kitchen import Kitchen, enter_kitchen
from ig2mj.showcase.temperature_log import TemperatureLog
from ig2mj.simulation import Simulation
from ig2mj.states.definitions import toggled_on

pytestmark = pytest.mark.slow


def _first_step_at(log: TemperatureLog, name: str, celsius: float) -> int | None:
    """The first control step after which the object is on the other side of a temperature than at the start."""
    values = log.temperatures[name]
    rising = values[0] < celsius
    return next((k for k, v in enumerate(values) if (v >= celsius if rising else v <= celsius)), None)


@pytest.fixture(scope="module")
def cooked() -> tuple[Simulation, Kitchen, TemperatureLog]:
    world, kitchen = enter_kitchen("small_home")
    return world, kitchen, cook(world, kitchen)


def test_everything_happens(cooked):
    _, kitchen, log = cooked
    assert missing(log, kitchen) == []


@pytest.mark.parametrize("celsius, steps", [(70.0, 156), (100.0, 264), (200.0, 696)])
def test_the_stove_heats_the_fish_from_23_degrees_in_this_many_steps(cooked, celsius, steps):
    _, kitchen, log = cooked
    switched_on = log.first("toggled_on", kitchen.stove)
    reached = _first_step_at(log, kitchen.fish, celsius)
    assert switched_on is not None and reached is not None
    before = switched_on.step - 1  # the step that flips the switch heats already
    assert log.temperatures[kitchen.fish][before] == 23.0
    assert reached - before == steps


def test_the_first_step_on_the_stove_warms_by_0_318_degrees(cooked):
    _, kitchen, log = cooked
    switched_on = log.first("toggled_on", kitchen.stove)
    assert switched_on is not None
    assert log.temperatures[kitchen.fish][switched_on.step] - 23.0 == pytest.approx(0.318, abs=1e-3)


def test_the_closed_fridge_freezes_the_milk_in_1235_steps(cooked):
    _, kitchen, log = cooked
    frozen = log.first("frozen", kitchen.milk)
    assert frozen is not None
    assert frozen.step == _first_step_at(log, kitchen.milk, 0.0) == 1235


def test_cooked_and_burnt_come_with_their_temperatures_and_the_cooled_fish_stays_burnt(cooked):
    _, kitchen, log = cooked
    for predicate, celsius in (("cooked", kitchen.cook), ("burnt", kitchen.burn)):
        moment = log.first(predicate, kitchen.fish)
        assert moment is not None and moment.step == _first_step_at(log, kitchen.fish, celsius)
    assert log.temperatures[kitchen.fish][-1] < kitchen.burn < max(log.temperatures[kitchen.fish])
    assert log.truths["burnt", kitchen.fish][-1]
    assert not log.truths["cooked", kitchen.fish][-1]  # the paper's rule: cooked is below burnt


def test_two_presses_flip_the_switch_on_and_off_and_no_more(cooked):
    log = cooked[2]
    assert [m.value for m in log.moments if m.predicate == "toggled_on"] == [True, False]


def test_the_physics_stays_calm_while_the_hand_presses(cooked):
    world, kitchen, _ = cooked
    assert world.predicate("on_top", kitchen.fish, "frying_pan_0")
    assert world.predicate("inside", kitchen.milk, kitchen.fridge)
    assert np.isfinite(world.data.qpos).all()


def test_the_files_hold_the_whole_log(cooked, tmp_path):
    _, kitchen, log = cooked
    log.write_csv(tmp_path / "t.csv")
    log.write_json(tmp_path / "t.json")
    with (tmp_path / "t.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    found = json.loads((tmp_path / "t.json").read_text(encoding="utf-8"))
    assert len(rows) == len(found["time_s"]) == log.steps + 1
    for k in (0, 500, log.steps):
        assert float(rows[k][f"{kitchen.fish}_celsius"]) == pytest.approx(log.temperatures[kitchen.fish][k], abs=1e-4)
        assert found["celsius"][kitchen.milk][k] == pytest.approx(log.temperatures[kitchen.milk][k], abs=1e-4)
        assert rows[k][f"burnt_{kitchen.fish}"] == str(int(found["predicates"][f"burnt {kitchen.fish}"][k]))
    assert [(m["predicate"], m["step"]) for m in found["moments"]] == [(m.predicate, m.step) for m in log.moments]


def test_the_table_has_a_bold_row_for_every_moment(cooked):
    _, _, log = cooked
    table = log.table()
    steps = {m.step for m in log.moments}
    assert sum(row.style == "bold" for row in table.rows) == len(steps)
    assert len(table.rows) >= len(steps) + log.times[-1] // 5


def test_the_plot_is_a_picture(cooked, tmp_path):
    from PIL import Image

    _, kitchen, log = cooked
    plot(log, kitchen, tmp_path / "plot.png")
    image = np.asarray(Image.open(tmp_path / "plot.png").convert("RGB"))
    assert image.shape[0] > 400 and len(np.unique(image.reshape(-1, 3), axis=0)) > 20


def test_the_film_shows_stove_and_milk_and_has_the_frames_it_was_given(cooked, tmp_path):
    from ig2mj.showcase import cooking_video
    from ig2mj.showcase.cooking_images import KitchenCameras
    from ig2mj.viewer import offscreen

    if all(offscreen.probe(b) is not None for b in ("egl", "osmesa")):
        pytest.skip("no OpenGL without a display here (`ig2mj doctor` tells how to get it)")
    import imageio_ffmpeg

    world, kitchen, log = cooked
    colours = world.model.geom_rgba.copy()
    cameras = KitchenCameras(world, kitchen)
    closed = world.render(cameras._milk, width=64, height=64)
    assert np.abs(cameras.milk(64, 64).astype(int) - closed).mean() > 5  # the doors are see-through
    assert (world.model.geom_rgba == colours).all()

    short = TemperatureLog(log.objects, log.predicates)
    video = cooking_video.CookingVideo(tmp_path / "video.mp4", cameras, kitchen)
    for _ in range(cooking_video.STRIDE + 1):
        short.record(world)
        video.see(short)
    video.close()
    frames, seconds = imageio_ffmpeg.count_frames_and_secs(str(tmp_path / "video.mp4"))
    assert frames == 2 and seconds == pytest.approx(2 / cooking_video.FRAMES_PER_SECOND, abs=0.01)


def test_a_film_that_cannot_be_written_is_one_error(cooked, tmp_path):
    from ig2mj.showcase.cooking_images import KitchenCameras
    from ig2mj.showcase.cooking_video import CookingVideo

    world, kitchen, _ = cooked
    video = CookingVideo(tmp_path / "no_such_folder" / "video.mp4", KitchenCameras(world, kitchen), kitchen)
    with pytest.raises(EngineError, match=r"ffmpeg wrote no video: .*No such file"):
        video.close()
    video.close()


def test_the_hand_stays_long_enough_within_reach_and_comes_back():
    hand = ButtonHand(np.array([0.0, 1.0, 0.0]), 1 / 30)
    assert hand.at_rest
    hand.press()
    way = []
    while not hand.at_rest:
        way.append(float(hand.ctrl()[1]))
        assert len(way) < 200
    assert max(way) == pytest.approx(REST - PRESS)
    assert sum(y == max(way) for y in way) >= HOLD > toggled_on.HOLD
    assert way[-1] == 0.0
    assert max(np.abs(np.diff(way))) <= 0.35 / 30 + 1e-9


def test_a_home_without_a_fish_is_refused(tiny_home):
    with pytest.raises(StateError, match="has no fish"):
        Kitchen.of(tiny_home)


def test_the_small_home_has_the_taxonomys_stove_and_fridge():
    scene = load_scene("small_home")
    kitchen = Kitchen.of(scene)
    stove, fridge = scene.object(kitchen.stove).abilities, scene.object(kitchen.fridge).abilities
    assert (stove["heatSource"]["temperature"], stove["heatSource"]["heating_rate"]) == (500.0, 0.02)
    assert stove["heatSource"]["distance_threshold"] == 0.2 and stove["heatSource"]["requires_toggled_on"]
    assert (fridge["coldSource"]["temperature"], fridge["coldSource"]["heating_rate"]) == (-18.0, 0.02)
    assert fridge["coldSource"]["requires_inside"] and fridge["coldSource"]["requires_closed"]
    assert (kitchen.cook, kitchen.burn, kitchen.freeze) == (70.0, 200.0, 0.0)
    assert kitchen.approach @ kitchen.approach == pytest.approx(1.0) and kitchen.approach[2] == 0.0
