"""Engine profiles: safe defaults, files, and measuring a home."""

from __future__ import annotations

import json
import shutil

import engine_bench
import msgspec
import mujoco
import pytest

import ig2mj
from ig2mj import cli
from ig2mj.agents import Humanoid
from ig2mj.agents.floating_hand import FloatingHand
from ig2mj.calibration.measuring import SAFETY, _wider, calibrate
from ig2mj.calibration.reach import find_reach
from ig2mj.engine.health import Overflow
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.engine.warp.buffer_sizes import ALIGN
from ig2mj.engine.warp.engine import WarpEngine
from ig2mj.engine.warp.profile import (
    PROFILE_FILE,
    EngineProfile,
    default_profile,
    fit,
    holding,
    holds_everything,
    load_profile,
    profile_of_scene,
    save_profile,
)
from ig2mj.errors import EngineError, InputError
from ig2mj.scene import manifest as mf
from ig2mj.scene.paths import shipped_homes

PROFILE = EngineProfile(awake_dofs=12, constraints=64, contacts=16, convex_contacts=8, measured={"peak_contacts": 12.5})


def test_a_profile_survives_its_file(tiny_home, tmp_path):
    assert save_profile(PROFILE, tmp_path) == tmp_path / PROFILE_FILE
    assert load_profile(tmp_path, tiny_home.model) == PROFILE


def test_without_a_file_everything_fits(tiny_home, tmp_path):
    profile = load_profile(tmp_path, tiny_home.model)
    assert profile == default_profile(tiny_home.model)
    assert profile.awake_dofs == tiny_home.model.nv
    assert profile.constraints > 4 * profile.contacts >= 4 * 64


def test_measured_buffers_do_not_hold_a_scene_before_it_has_come_to_rest(tiny_home):
    """Then worlds start settled; small_home started in nine worlds with contacts lost, and objects flew off."""
    widest = default_profile(tiny_home.model)
    assert holds_everything(widest, tiny_home.model)
    for name in ("awake_dofs", "constraints", "contacts", "convex_contacts"):
        less = msgspec.structs.replace(widest, **{name: getattr(widest, name) - 1})
        assert not holds_everything(less, tiny_home.model)


def test_no_more_can_be_awake_than_there_is(tiny_home):
    assert fit(msgspec.structs.replace(PROFILE, awake_dofs=10_000), tiny_home.model).awake_dofs == tiny_home.model.nv


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("awake", "is not valid JSON"),
        ("[]", "Expected `object`, got `array`"),
        ('{"awake_dofs": 12}', "missing required field `constraints`"),
        ('{"awake_dofs": "x", "constraints": 1, "contacts": 1, "convex_contacts": 1}', "Expected `int`"),
        (
            '{"awake_dofs": 12, "constraints": 0, "contacts": 1, "convex_contacts": 1}',
            "constraints: must be between 1",
        ),
        ('{"awake_dofs": 12, "constraints": 9, "contacts": -4, "convex_contacts": 1}', "contacts: must be between 1"),
        (
            '{"awake_dofs": 1, "constraints": 9, "contacts": 4, "convex_contacts": 1, "spare_contacts": -1}',
            "spare_contacts: must be between 0",
        ),
    ],
)
def test_a_broken_file_is_named_with_its_mend(tiny_home, tmp_path, text, says):
    (tmp_path / PROFILE_FILE).write_text(text)
    with pytest.raises(InputError) as caught:
        load_profile(tmp_path, tiny_home.model)
    message = str(caught.value)
    assert says in message and str(tmp_path / PROFILE_FILE) in message and "ig2mj calibrate" in message


def test_the_warp_engine_reads_the_file_beside_the_manifest(bench_folder, tmp_path):
    folder = engine_bench.bench_home(bench_folder, True).folder
    shutil.copytree(folder, tmp_path / "home")
    scene = ig2mj.load_scene(tmp_path / "home")
    assert WarpEngine(scene).profile == default_profile(scene.model)
    save_profile(PROFILE, tmp_path / "home")
    engine = WarpEngine(scene, 3)
    assert engine.profile == PROFILE
    data = engine._template
    assert data._impl.contact__dist.shape == (3 * 16,) and data._impl.nvmax == 12


def test_a_profile_holds_one_worlds_worst_in_any_batch():
    profile = msgspec.structs.replace(PROFILE, spare_contacts=100, spare_convex_contacts=10)
    alone, many = profile.for_worlds(1), profile.for_worlds(1000)
    assert (alone.contacts, alone.convex_contacts) == (116, 18)
    assert (many.contacts, many.convex_contacts) == (17, 9)
    assert alone.spare_contacts == many.spare_contacts == 0
    assert alone.for_worlds(1) == alone


@pytest.mark.parametrize("worlds", [1, 2, 40])
def test_an_engine_takes_over_its_scenes_start_whatever_its_sizes_say(tiny_home, worlds):
    """MJX refuses lists that do not hold the contacts and rows of the state that it is given."""
    start = _start(tiny_home.model)
    assert start.ncon > 1 and start.nefc > 1
    tiny = EngineProfile(awake_dofs=tiny_home.model.nv, constraints=1, contacts=1, convex_contacts=900)
    engine = WarpEngine(tiny_home, worlds, profile=tiny, initial=NativeEngine(tiny_home).first_world()[0])
    sizes = engine.profile
    assert sizes.contacts * worlds >= start.ncon > (sizes.contacts - 1) * worlds or sizes.contacts == 1
    assert sizes.constraints == start.nefc and sizes.convex_contacts == sizes.contacts
    assert engine._template._impl.contact__dist.shape == (worlds * sizes.contacts,)


@pytest.mark.slow
@pytest.mark.parametrize("agents", [[], [Humanoid()]], ids=["bare", "humanoid"])
def test_sizes_of_every_home_hold_its_start_in_any_batch(agents):
    """Cedar has 428 contacts before it has come to rest, and its profile room for 324 in two worlds together."""
    homes = shipped_homes()
    assert {"cedar", "small_home", "willow"} <= set(homes)
    for name in homes:
        scene = ig2mj.load_scene(name, agents=agents)
        start, measured = _start(scene.model), profile_of_scene(scene)
        for worlds in (1, 2, 3, 8, 64, 1000):
            own = measured.for_worlds(worlds)
            sizes = holding(own, start, worlds)
            assert worlds * sizes.contacts >= start.ncon and sizes.constraints >= start.nefc, name
            assert sizes.convex_contacts <= sizes.contacts and sizes.awake_dofs == own.awake_dofs, name
        assert holding(own, start, 1000) == own, f"{name}: large batches take no more memory"


def _start(model: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    return data


def test_a_disturbed_home_is_measured_natively(tiny_home):
    seen = []
    profile = calibrate(tiny_home, engine="native", num_worlds=2, rounds=1, progress=lambda *a: seen.append(a))
    assert seen == [(1, 1)]
    measured = profile.measured
    assert 6 <= measured["peak_awake_dofs"] <= profile.awake_dofs <= tiny_home.model.nv
    for name in ("constraints", "contacts"):
        size, peak = getattr(profile, name), float(measured[f"peak_{name}"])
        assert measured[f"p99_{name}"] <= measured[f"p9999_{name}"] <= peak
        size += profile.spare_contacts if name == "contacts" else 0
        assert size >= SAFETY["native"] * peak > 0
        assert getattr(profile, name) % ALIGN == 0
    assert measured["mean_pairs"] > 0
    again = calibrate(tiny_home, engine="native", num_worlds=2, rounds=1)
    assert again == profile, "the same seed measures the same"


def test_a_hand_that_pushes_asks_for_more(tiny_home_folder):
    bare = ig2mj.load_scene(tiny_home_folder)
    reach = find_reach(bare)
    scene = ig2mj.load_scene(tiny_home_folder, [FloatingHand(pos=reach.start)])
    without = calibrate(bare, engine="native", num_worlds=1, rounds=1)
    with_hand = calibrate(scene, reach, engine="native", num_worlds=1, rounds=1)
    assert with_hand.measured["peak_awake_dofs"] >= without.measured["peak_awake_dofs"] + 16


@pytest.mark.slow
def test_the_warp_engine_measures_itself_and_fits_what_it_measured(bench_folder):
    scene = engine_bench.bench_home(bench_folder, True)
    profile = calibrate(scene, engine="warp", num_worlds=2, rounds=1)
    measured = profile.measured
    assert measured["engine"] == "warp"
    assert measured["peak_contacts"] > 0
    assert profile.constraints >= measured["peak_constraints"]
    assert profile.for_worlds(1).contacts >= measured["peak_contacts"]


def test_what_overflows_is_made_larger_and_only_that(tiny_home):
    wider = _wider(PROFILE, int(Overflow.NARROWPHASE), tiny_home.model)
    assert wider.contacts == 2 * PROFILE.contacts
    assert (wider.constraints, wider.awake_dofs) == (PROFILE.constraints, PROFILE.awake_dofs)
    assert _wider(PROFILE, int(Overflow.NVMAX), tiny_home.model).awake_dofs == 2 * PROFILE.awake_dofs
    full = msgspec.structs.replace(PROFILE, awake_dofs=int(tiny_home.model.nv))
    assert _wider(full, int(Overflow.NVMAX), tiny_home.model).awake_dofs == tiny_home.model.nv


def test_only_two_engines_can_measure(tiny_home):
    with pytest.raises(EngineError, match="there is no engine 'jax' to calibrate with"):
        calibrate(tiny_home, engine="jax")


def test_the_command_writes_the_files_where_it_is_told(tiny_home_folder, tmp_path, capsys):
    home = tmp_path / "home"
    shutil.copytree(tiny_home_folder, home)
    command = ["calibrate", str(home), "--engine", "native", "--worlds", "1", "--rounds", "1"]
    assert cli.call([*command, "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert list(printed.values()) == [json.loads((home / PROFILE_FILE).read_text())]
    (profile,) = printed.values()
    assert profile["measured"]["worlds"] == 1
    (home / PROFILE_FILE).unlink()
    assert cli.call([*command, "--no-hand", "--out", str(tmp_path / "profiles")]) == 0
    assert (tmp_path / "profiles" / "home" / PROFILE_FILE).exists() and not (home / PROFILE_FILE).exists()
    assert "geom pairs" in capsys.readouterr().out


def test_a_home_with_nothing_to_push_is_measured_without_a_hand(tmp_path, capsys):
    """All there is lies in a closed box."""
    home = tmp_path / "bare"
    home.mkdir()
    sides = [(f"{x} 0 0", "0.01 0.3 0.3") for x in (-0.3, 0.3)] + [(f"0 {y} 0", "0.3 0.01 0.3") for y in (-0.3, 0.3)]
    sides += [(f"0 0 {z}", "0.3 0.3 0.01") for z in (-0.3, 0.3)]
    shell = [
        f'<geom name="shell/collision_{k}" type="box" group="3" size="{s}" pos="{p}"/>'
        for k, (p, s) in enumerate(sides)
    ]
    (home / "scene.xml").write_text(
        '<mujoco><option><flag sleep="enable"/></option><worldbody>'
        f'<body name="shell">{"".join(shell)}</body><body name="thing" pos="0 0 -0.2"><freejoint name="thing/free"/>'
        '<geom name="thing/collision_0" type="box" group="3" size="0.03 0.03 0.03"/></body></worldbody></mujoco>'
    )
    objects = [
        mf.ObjectEntry("shell", "shelf", "made", ["shell"], True, (0.6, 0.6, 0.6), 1.0),
        mf.ObjectEntry("thing", "apple", "made", ["thing"], False, (0.06, 0.06, 0.06), 1.0),
    ]
    mf.save_manifest(mf.Manifest(mf.FORMAT_VERSION, "bare", objects), home / "manifest.json")
    assert cli.call(["calibrate", str(home), "--engine", "native", "--worlds", "1", "--rounds", "1"]) == 0
    assert "no loose object that a hand can get at; measured without a hand" in capsys.readouterr().err
    assert (home / PROFILE_FILE).exists()


def test_the_command_names_what_it_cannot_take(capsys):
    assert cli.call(["calibrate"]) != 0
    assert "name at least one scene" in capsys.readouterr().err
    assert cli.call(["calibrate", "aspen", "--rounds", "0"]) != 0
    assert "--rounds at least 1" in capsys.readouterr().err
    assert cli.call(["calibrate", "aspen", "--safety", "nan"]) != 0, "it would ruin a profile that ships"
    assert "--safety must be finite" in capsys.readouterr().err
