"""Debug mode dumps the last steps of a world that goes wrong, and `ig2mj view --dump` shows them."""

from __future__ import annotations

import dataclasses
import pathlib
import re

import engine_bench
import jax
import numpy as np
import pytest
from PIL import Image

from ig2mj import cli
from ig2mj.engine.base import Write
from ig2mj.engine.native.engine import NativeEngine
from ig2mj.errors import EngineError, InputError
from ig2mj.states.initial import initial_states
from ig2mj.states.model import StateModel
from ig2mj.viewer.replay import Replay, ReplayProgress
from ig2mj.worlds.core import Core
from ig2mj.worlds.debug import DebugWorlds
from ig2mj.worlds.recorder import Frames, load_dump, read_dump, save_dump
from ig2mj.worlds.rules import Rules


@pytest.fixture(scope="module")
def scene(bench_folder):
    """With a hand, so that the dump has bodies that the bare scene has not."""
    return engine_bench.bench_home(bench_folder, False)


@pytest.fixture(scope="module")
def debug(scene, tmp_path_factory) -> DebugWorlds:
    model = StateModel.of_manifest(scene.tables, scene.manifest)
    core = Core(NativeEngine(scene, 2, threads=1), Rules(model))
    return DebugWorlds(core, scene, tmp_path_factory.mktemp("dumps"), length=4)


@pytest.fixture(scope="module")
def error(debug, scene) -> str:
    """World 1 loses its box after six good steps."""
    batch = debug.start(seed=0)
    for _ in range(6):
        batch, _ = debug.step(batch)
    mask = np.zeros((2, 4), bool)
    mask[1, scene.object_index("box")] = True
    pos, quat = np.zeros((2, 4, 3)), np.tile([1.0, 0, 0, 0], (2, 4, 1))
    pos[..., 2] = -3.0
    physics = debug.core.engine.write(batch.world.physics, Write(object_mask=mask, object_pos=pos, object_quat=quat))
    batch = dataclasses.replace(batch, world=dataclasses.replace(batch.world, physics=physics))
    with pytest.raises(EngineError) as caught:
        debug.step(batch)
    return str(caught.value)


@pytest.fixture(scope="module")
def dump(debug, error) -> pathlib.Path:
    return debug.folder / "world1_step7.npz"


def test_the_error_names_world_flag_value_and_dump(error, dump, scene):
    said = r"world 1: fell: 'box' at z = -3.01 m, limit -0.3 m; step 7; the last 4 steps: ig2mj view "
    assert re.match(said, error), error
    assert error.endswith(f"ig2mj view {scene.folder} --dump {dump}") and "\n" not in error
    assert dump.is_file()


def test_a_dump_holds_the_last_steps_oldest_first(dump):
    frames, model, note = read_dump(dump, "bench")
    assert np.asarray(frames.time) == pytest.approx([4 / 30, 5 / 30, 6 / 30, 7 / 30], abs=1e-6)
    address = model.joint("box/free").qposadr[0] + 2
    height = np.asarray(frames.qpos)[:, address]
    assert height[:3] == pytest.approx(0.45, abs=1e-3) and height[3] < -3.0
    assert note["world"] == 1 and note["flags"] == 4 and model.body("hand").id > 0


def test_a_dump_is_loaded_into_an_engine_and_goes_on(dump, debug, scene):
    engine = debug.core.engine
    like = Frames(engine.snapshot(engine.reset()), initial_states(debug.core.rules.model, 2))
    frames, _ = load_dump(dump, like, "bench")
    row = jax.tree.map(lambda a: np.array(a[0]), frames.physics)
    engine = NativeEngine(scene)
    physics = engine.load(engine.reset(), row)
    physics, view = engine.step(physics)
    assert float(engine.time(physics)[0]) == pytest.approx(5 / 30, abs=1e-6)
    assert np.isfinite(view.object_pos).all()


@pytest.fixture
def bare(bench_folder):
    """The same scene as the command loads it: without the hand."""
    import ig2mj

    return ig2mj.load_scene(engine_bench.bench_home(bench_folder, False).folder)


def test_a_replay_shows_each_step_as_it_was(dump, bare):
    replay = Replay(bare, dump)
    assert len(replay) == 4 and replay.at == 0
    assert replay.data.body("box").xpos[2] == pytest.approx(0.45, abs=1e-3)
    for _ in range(9):
        replay.step()
    assert replay.at == 3 and replay.data.body("box").xpos[2] < -3.0
    assert dict(ReplayProgress(replay).lines(replay.data))["step"] == "4 of 4"
    assert "fell" in dict(ReplayProgress(replay).lines(replay.data))["dumped for"]
    replay.reset()
    assert replay.at == 0 and replay.data.time == pytest.approx(4 / 30, abs=1e-6)


def test_a_picture_shows_the_last_finite_step(dump, bare, tmp_path):
    frames, model, note = read_dump(dump, "bench")
    qpos = np.array(frames.qpos)
    qpos[2:] = np.nan
    spoiled = Frames(frames.with_whole(qpos=qpos), initial_states(_model(bare), 4))
    save_dump(spoiled, tmp_path / "d.npz", "bench", {"text": note["text"]}, model)
    replay = Replay(bare, tmp_path / "d.npz")
    assert replay.show_last() == 1
    qpos[:] = np.nan
    save_dump(spoiled, tmp_path / "e.npz", "bench", {}, model)
    with pytest.raises(EngineError, match="no step of the dump has finite positions"):
        Replay(bare, tmp_path / "e.npz").show_last()


def _model(scene) -> StateModel:
    return StateModel.of_manifest(scene.tables, scene.manifest)


@pytest.fixture(scope="module")
def can_draw() -> None:
    from ig2mj.viewer import offscreen

    if all(offscreen.probe(b) is not None for b in ("egl", "osmesa")):
        pytest.skip("no OpenGL without a display here (`ig2mj doctor` tells how to get it)")


def test_the_command_writes_a_picture_and_a_video(can_draw, dump, bare, tmp_path, capsys):
    command = ["view", str(bare.folder), "--dump", str(dump), "--size", "96", "64"]
    assert cli.call([*command, "--image", str(tmp_path / "last.png")]) == 0
    assert "(step 4 of 4)" in capsys.readouterr().err
    assert np.asarray(Image.open(tmp_path / "last.png")).shape == (64, 96, 3)
    assert cli.call([*command, "--video", str(tmp_path / "steps.gif")]) == 0
    with Image.open(tmp_path / "steps.gif") as video:
        assert video.size == (96, 64)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--dump", "absent.npz", "--image", "a.png"], "there is no such file"),
        (["--video", "a.mp4"], "--video needs --dump or --policy"),
        (["--dump", "{dump}", "--video", "a.txt"], "is not an image format"),
        (["--dump", "{dump}", "--video", "a.png"], "is not a video format"),
        (["--dump", "{dump}", "--video", "a.gif", "--image", "a.png"], "takes one of"),
        (["--dump", "{dump}", "--image", "a.png", "--seconds", "1"], "no --seconds"),
    ],
)
def test_the_command_refuses(dump, bare, tmp_path, monkeypatch, capsys, options, says):
    monkeypatch.chdir(tmp_path)
    assert cli.call(["view", str(bare.folder), *(o.format(dump=dump) for o in options)]) == 2
    assert says in capsys.readouterr().err


def test_dumps_of_other_scenes_are_refused(dump, tiny_home, bare, bench_folder, tmp_path):
    with pytest.raises(InputError, match="is a dump of scene 'bench', not a dump of 'tiny_home'"):
        Replay(tiny_home, dump)
    small = engine_bench.bench_home(bench_folder, True)
    frames, _, _ = read_dump(dump, "bench")
    file = tmp_path / "small.npz"
    save_dump(Frames(frames, initial_states(_model(bare), 4)), file, "bench", {})
    with pytest.raises(InputError, match="model: is missing"):
        Replay(bare, file)
    save_dump(Frames(frames, initial_states(_model(bare), 4)), file, "bench", {}, small.model)
    with pytest.raises(InputError, match=r"qpos: has shapes .* which do not make"):
        Replay(bare, file)


@pytest.mark.parametrize(
    ("name", "change", "says"),
    [
        ("frames.physics.scene.qvel", lambda a: a[:-1], "has arrays of different lengths"),
        ("frames.physics.agents.mocap_pos", lambda a: a[..., :-1], "has shapes"),
        ("frames.physics.scene.eq_data", lambda a: a[..., :-1], "has shapes"),
        ("model", lambda a: a.astype(float), "is of type float64, and not of bytes"),
    ],
)
def test_a_dump_whose_arrays_do_not_fit_together_is_refused(dump, bare, tmp_path, name, change, says):
    with np.load(dump) as archive:
        arrays = dict(archive)
    np.savez(tmp_path / "odd.npz", **(arrays | {name: change(arrays[name])}))
    with pytest.raises(InputError, match=says):
        Replay(bare, tmp_path / "odd.npz")
