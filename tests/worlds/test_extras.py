"""Further states in worlds: attached, broken, on fire."""

from __future__ import annotations

import numpy as np
import pytest

import ig2mj
from ig2mj.engine.writes import teleports
from ig2mj.errors import AbilityError, Ig2mjError, StateError, UnknownNameError
from ig2mj.scene import manifest as mf
from ig2mj.simulation import Simulation

EXTRAS = ("with:attached:lamp>board", "with:attached:lamp>paper", "with:broken", "with:on_fire")


def _body(name: str, half, pos, free: bool) -> str:
    joint = f'<freejoint name="{name}/free"/>' if free else ""
    size, at = " ".join(map(str, half)), " ".join(map(str, pos))
    geom = f'<geom type="box" size="{size}" density="300" group="3" gap="0.003" margin="0"/>'
    return f'<body name="{name}" pos="{at}">{joint}{geom}</body>'


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A board that hangs in the air, a lamp that would fall off its edge, a glass 1 m high, and two papers."""
    made = tmp_path_factory.mktemp("extras")
    things = {
        "floor": ("floors", (3, 3, 0.05), (0, 0, -0.05), False),
        "board": ("shelf", (0.3, 0.3, 0.02), (0, 0, 1.5), False),
        "lamp": ("light_bulb", (0.05, 0.05, 0.05), (0.34, 0, 1.571), True),
        "glass": ("glass", (0.04, 0.04, 0.04), (1, 0, 1.0), True),
        "paper": ("newspaper", (0.1, 0.1, 0.02), (-1, 0, 0.02), True),
        "letter": ("envelope", (0.1, 0.1, 0.02), (-1, 0.3, 0.02), True),
    }
    bodies = "".join(_body(name, half, pos, free) for name, (_, half, pos, free) in things.items())
    option = '<option timestep="0.008333333333333333"><flag sleep="enable"/></option>'
    (made / "scene.xml").write_text(f"<mujoco>{option}<worldbody>{bodies}</worldbody></mujoco>")
    objects = [
        mf.ObjectEntry(
            name=name,
            category=category,
            model="m",
            bodies=[name],
            fixed=not free,
            bounding_box=(0.1, 0.1, 0.1),
            mass=0.3,
        )
        for name, (category, _, _, free) in things.items()
    ]
    mf.save_manifest(
        mf.Manifest(format_version=mf.FORMAT_VERSION, name="extras", objects=objects), made / "manifest.json"
    )
    return made


@pytest.fixture(scope="module")
def scene(folder):
    return ig2mj.load_scene(folder, objects=EXTRAS)


@pytest.fixture
def simulation(scene):
    return Simulation(scene)


def _height(simulation: Simulation, name: str) -> float:
    return float(np.asarray(simulation.view.object_com)[0, simulation.scene.object_index(name), 2])


def _celsius(simulation: Simulation, name: str) -> float:
    return float(np.asarray(simulation.states.temperature)[0, simulation.scene.object_index(name)])


def test_what_touches_its_place_is_attached_and_hangs_and_a_fall_breaks_glass(simulation):
    for _ in range(60):
        simulation.step()
    assert simulation.predicate("attached", "lamp", "board") and _height(simulation, "lamp") > 1.42
    assert not simulation.predicate("attached", "lamp", "paper") and simulation.state("attached", "lamp") == "board"
    assert simulation.predicate("broken", "glass") and not simulation.predicate("broken", "lamp")


def test_detached_it_falls_and_is_not_attached_again_until_it_was_apart(simulation):
    simulation.step()
    assert simulation.set_predicate("attached", "lamp", "board", value=False)
    for _ in range(60):
        simulation.step()
    assert not simulation.predicate("attached", "lamp", "board") and _height(simulation, "lamp") < 0.2


@pytest.mark.parametrize(
    "place, holds", [("0.3,0,0.02", True), pytest.param("-0.3,0,0.02", False, marks=pytest.mark.slow)]
)
def test_a_pair_with_a_place_is_attached_there_and_nowhere_else(folder, place, holds):
    simulation = Simulation(ig2mj.load_scene(folder, objects=[f"with:attached:lamp>board@{place}"]))
    for _ in range(12):
        simulation.step()
    assert simulation.predicate("attached", "lamp", "board") == holds, "the lamp falls onto the edge at x = 0.3"
    assert simulation.set_predicate("attached", "lamp", "board", seed=1)
    x = float(np.asarray(simulation.view.object_com)[0, simulation.scene.object_index("lamp"), 0])
    assert x == pytest.approx(0.34 if holds else -0.3, abs=0.08)


def test_setting_attaches_it_somewhere_on_the_other(simulation):
    assert simulation.set_predicate("attached", "lamp", "paper", seed=3)
    assert simulation.predicate("attached", "lamp", "paper") and not simulation.predicate("attached", "lamp", "board")
    with pytest.raises(StateError, match="with:attached:glass>board"):
        simulation.set_predicate("attached", "glass", "board")


def test_a_joint_gives_way_to_a_pull_of_more_than_250_newtons_a_kilogram(simulation):
    simulation.step()
    model, data = simulation.engine.to_mujoco(simulation.physics, 0)
    body, mass = model.body("lamp").id, float(model.body("lamp").mass[0])
    for share, holds in ((0.5, True), (2.0, False)):
        data.xfrc_applied[body, 2] = -share * 250 * mass
        for _ in range(4):
            simulation.step()
        assert simulation.predicate("attached", "lamp", "board") == holds


@pytest.mark.slow
def test_fire_spreads_to_what_is_near_and_burns_out(simulation):
    assert simulation.set_predicate("on_fire", "paper") and simulation.predicate("on_fire", "paper")
    assert _celsius(simulation, "paper") == pytest.approx(1000)
    for _ in range(400):
        simulation.step()
    assert simulation.predicate("on_fire", "letter") and not simulation.predicate("on_fire", "glass")
    for _ in range(3300):
        simulation.step()
    assert not simulation.predicate("on_fire", "paper") and _celsius(simulation, "paper") < 1000


def test_what_cannot_break_or_burn_is_not_set_so(simulation):
    with pytest.raises(AbilityError, match="'broken' of 'board': its category 'shelf' is not breakable"):
        simulation.set_predicate("broken", "board")
    with pytest.raises(AbilityError, match="'on_fire' of 'glass': its category 'glass' is not flammable"):
        simulation.set_state("on_fire", "glass", True)
    assert simulation.set_predicate("broken", "board", value=False) and simulation.set_predicate("broken", "glass")
    assert simulation.predicate("broken", "glass") and not simulation.predicate("broken", "board")


def test_scenes_that_ask_for_nothing_have_none_of_it(folder):
    plain = ig2mj.load_scene(folder)
    assert plain.model.neq == 0 and plain.requested == []
    simulation = Simulation(plain)
    assert not simulation.predicate("broken", "glass") and not simulation.predicate("attached", "lamp", "board")
    with pytest.raises(StateError, match="with:broken"):
        simulation.set_predicate("broken", "glass")


@pytest.mark.parametrize(
    "extra, error",
    [
        ("with:wet", "with:on_fire"),
        ("with:attached:lamp", "with:on_fire"),
        ("with:attached:lamp>lamp", "itself"),
        ("with:attached:board>lamp", "fixed"),
        ("with:attached:lamp>board@1,2", "three numbers"),
        ("with:attached:lamp>board@a,b,c", "three numbers"),
        ("with:broken:x", "with:on_fire"),
    ],
)
def test_wrong_extras_are_refused(folder, extra, error):
    with pytest.raises(Ig2mjError, match=error):
        ig2mj.load_scene(folder, objects=[extra])


def test_an_unknown_object_is_named(folder):
    with pytest.raises(UnknownNameError, match="lmp"):
        ig2mj.load_scene(folder, objects=["with:attached:lmp>board"])


@pytest.mark.slow
def test_worlds_of_a_batch_keep_what_they_attach(scene):
    worlds = ig2mj.Worlds(scene, 2, "native")
    batch = worlds.start()
    for _ in range(30):
        batch, _ = worlds.step(batch)
    assert np.asarray(batch.world.states.attached).tolist() == [[True, False]] * 2
    lamp = scene.object_index("lamp")
    away = teleports(scene.tables.num_objects, lamp, np.array([0, 0, 0.8]), np.array([1.0, 0, 0, 0]))
    assert away.object_mask is not None
