"""`ig2mj pool --hand`: the hand is where it is free and reaches something, not wherever (0, 0, 1) happens to be."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import ig2mj
from ig2mj import cli
from ig2mj.agents.floating_hand import FloatingHand
from ig2mj.calibration.reach import find_reach
from ig2mj.sampling.settled import make_pool
from ig2mj.scene import manifest as mf
from ig2mj.states.model import StateModel
from ig2mj.worlds.archive import read_header
from ig2mj.worlds.pool import load_pool


def write_room(folder: Path, loose: bool = True) -> Path:
    """A floor, a cupboard that fills the place at (0, 0, 1), and an apple."""

    def body(name: str, pos: str, size: str, joint: str = "") -> str:
        geom = f'<geom name="{name}/collision_0" type="box" size="{size}" density="500" group="3" gap="0.003"/>'
        return f'<body name="{name}" pos="{pos}">{joint}{geom}</body>'

    bodies = body("floor", "0 0 -0.05", "2 2 0.05") + body("cupboard", "0 0 1", "0.3 0.3 1")
    bodies += body("apple", "0.9 0 0.04", "0.03 0.03 0.04", '<freejoint name="apple/free"/>' if loose else "")
    folder.mkdir()
    (folder / "scene.xml").write_text(
        f'<mujoco><compiler angle="radian"/><option timestep="{1 / 120!r}" gravity="0 0 -9.8">'
        f'<flag sleep="enable"/></option><worldbody>{bodies}</worldbody></mujoco>'
    )
    kinds = {"floor": ("floors", True), "cupboard": ("shelf", True), "apple": ("apple", not loose)}
    entries = [mf.ObjectEntry(n, c, "made", [n], fixed, (0.1, 0.1, 0.1), 1.0) for n, (c, fixed) in kinds.items()]
    mf.save_manifest(mf.Manifest(mf.FORMAT_VERSION, "room", entries), folder / "manifest.json")
    return folder


def hits_the_cupboard(scene: ig2mj.Scene, qpos: np.ndarray) -> bool:
    model = scene.model
    data = mujoco.MjData(model)
    data.qpos[:] = qpos
    mujoco.mj_forward(model, data)
    pairs = model.geom_bodyid[data.contact.geom]
    return bool(((pairs == model.body("cupboard").id).any(1) & (pairs != model.body("apple").id).all(1)).any())


def test_the_hand_of_a_pool_is_in_a_free_place_that_the_file_and_the_command_tell(tmp_path, capsys):
    home = write_room(tmp_path / "room")
    file = tmp_path / "pool.npz"
    assert cli.call(["pool", str(home), "--hand", "--count", "2", "--threads", "1", "--out", str(file)]) == 0
    start = read_header(file)["hand"]
    assert f"with a hand at ({start[0]:.3f}, {start[1]:.3f}, {start[2]:.3f})" in capsys.readouterr().out
    assert start == find_reach(ig2mj.load_scene(home)).start.tolist(), "as `ig2mj calibrate` has it"

    scene = ig2mj.load_scene(home, [FloatingHand(pos=start)])
    like = make_pool(scene, StateModel.of_manifest(scene.tables, scene.manifest), 1, share=0.0, threads=1)
    pool = load_pool(file, scene)
    assert pool.size == 2
    assert not any(hits_the_cupboard(scene, qpos) for qpos in np.asarray(pool.physics.qpos))
    inside = ig2mj.load_scene(home, [FloatingHand(pos=(0, 0, 1))])
    assert hits_the_cupboard(inside, np.asarray(like.physics.qpos)[0]), "where it was put before"


@pytest.mark.parametrize("options", [["--hand"], []], ids=["with a hand", "without"])
def test_a_scene_with_nothing_loose_has_a_pool_but_none_with_a_hand(options, tmp_path, capsys):
    home = write_room(tmp_path / "room", loose=False)
    code = cli.call(["pool", str(home), *options, "--count", "1", "--threads", "1", "--out", str(tmp_path / "p.npz")])
    told = capsys.readouterr()
    assert (code, (tmp_path / "p.npz").exists()) == ((2, False) if options else (0, True)), told
    assert ("no loose object that a hand can get at" in told.err) == bool(options)
