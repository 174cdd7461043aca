"""The comparison with other engines: the same home, the same hand, and rows that are measured once."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from benchmarks.harness.made_home import write_home
from benchmarks.peers import genesis_export, genesis_scene, report
from ig2mj.calibration.pushing import push, start_pushing
from ig2mj.calibration.reach import Reach
from ig2mj.worlds.random_streams import step_keys

ROW = {"variant": "", "scene": "birch", "objects": 63, "what": "physics", "ms_per_control_step": 50.0, "spread": 0.01}
ROW |= {"hand_contact_share": 0.3, "capacity_overflows": 0, "non_finite": 0, "lost_object_worlds": 0, "compile_s": 9.0}
ROW |= {"device": "a GPU", "counts": True}


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("peers")
    genesis_export.export(str(write_home(folder / "made_20", 20)), folder / "homes" / "made_20")
    return folder / "homes" / "made_20"


def test_the_parts_of_an_exported_home_weigh_what_the_home_weighs_and_stand_where_it_settled(exported):
    home = genesis_scene.read_home(exported)
    mass, place = {}, {}
    for part in home.parts:
        model = mujoco.MjModel.from_xml_string(part.xml)
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        for body in map(model.body, range(1, model.nbody)):
            mass[body.name], place[body.name] = float(body.mass[0]), data.xipos[body.id]
    written = home.written
    assert len(written["mass"]) > 16 and written["mass"].keys() <= mass.keys()
    assert all(np.isclose(mass[name], value) for name, value in written["mass"].items())
    assert all(np.allclose(place[name], value, atol=1e-4) for name, value in written["centre_of_mass"].items())


def test_an_exported_home_keeps_every_geom_that_collides(exported):
    home = genesis_scene.read_home(exported)
    geoms = sum(mujoco.MjModel.from_xml_string(part.xml).ngeom for part in home.parts)
    assert geoms == home.written["collision_geoms"]


def test_the_hand_in_torch_does_what_the_hand_in_jax_does(exported):
    torch: Any = pytest.importorskip("torch", reason="Genesis' hand is written in torch")
    from benchmarks.peers.genesis_hand import TorchHand

    written = json.loads((exported / "home.json").read_text())
    fields: dict[str, Any] = {k: np.asarray(v) if isinstance(v, list) else v for k, v in written["reach"].items()}
    reach = Reach(**fields)
    worlds, seconds, objects = 8, 1 / 30, len(written["reach"]["objects"])
    names = [written["centre_of_mass"][name] for name in written["in_reach"]]
    com = np.broadcast_to(np.array(names, np.float32), (worlds, objects, 3)).copy()
    everything = np.zeros((worlds, int(reach.objects.max()) + 1, 3), np.float32)
    everything[:, reach.objects] = com
    keys = jax.random.split(jax.random.key(0), worlds)
    keys = jax.vmap(jax.random.key_data)(keys)
    mine, theirs = start_pushing(reach, worlds, 16), TorchHand(written["reach"], worlds, seconds, "cpu")
    palm, goals = np.broadcast_to(reach.start.astype(np.float32), (worlds, 3)), set()
    step_of = jax.jit(lambda pusher, palm, step: push(reach, pusher, everything, palm, keys, step, seconds))
    for k in range(400):
        step = jnp.full(worlds, k, jnp.int32)
        draw = jax.vmap(lambda key: jax.random.uniform(key, (2,)))(step_keys(keys, step))
        mine = step_of(mine, palm, step)
        ctrl = theirs(torch.tensor(com), torch.tensor(palm), torch.tensor(np.asarray(draw)))
        assert np.allclose(mine.ctrl, ctrl, atol=1e-4), k
        palm = palm + np.clip(np.asarray(mine.ctrl)[:, :3] + reach.start - palm, -0.06, 0.06).astype(np.float32)
        goals |= set(np.asarray(mine.goal).tolist())
    assert len(goals) > 3  # went about


def test_a_case_that_is_measured_is_not_measured_again(tmp_path):
    from benchmarks.peers import run

    rows = tmp_path / "rows.jsonl"
    rows.write_text(json.dumps({"engine": "ig2mj", "worlds": 8192, "control_steps_per_s": 1} | ROW | {"worlds": 8192}))
    args = argparse.Namespace(patience=0.0, rows=rows, work=tmp_path, most_worlds=0, measured=run.measured(rows))
    names = [job.name for job in run.ours(args, {h: h for h in report.HOMES}, "0")]
    assert "ig2mj-birch-8192-physics" not in names
    assert names[0] == "mujoco_warp-birch-8192-physics" and "ig2mj-birch-8192-full" in names


def test_a_row_that_does_not_count_is_shown_with_its_reason(tmp_path):
    rows = tmp_path / "rows.jsonl"
    lines = [
        {"engine": "ig2mj", "worlds": 4096, "control_steps_per_s": 120_000} | ROW,
        {"engine": "mujoco_warp", "worlds": 4096, "control_steps_per_s": 60_000}
        | ROW
        | {"non_finite": 2, "counts": False},
        {"engine": "genesis", "worlds": 4096} | ROW | {"error": "too many contacts", "counts": False},
    ]
    rows.write_text("\n".join(map(json.dumps, lines)))
    found = report.read([rows])
    physics = [key for key in report.NAMES if key[2] == "physics"]
    table = report.table(found, physics)
    assert table[0] == "| home | worlds | ig2mj | MuJoCo Warp as it comes |"
    assert table[2] == "| birch (63 objects) | 4,096 | 120,000 | (60,000: not finite) |"


def test_the_page_keeps_what_is_outside_the_marks(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib", reason="plots need matplotlib (extra: bench)")
    rows, page, plot = tmp_path / "rows.jsonl", tmp_path / "page.md", tmp_path / "plot.png"
    rows.write_text(json.dumps({"engine": "ig2mj", "worlds": 4096, "control_steps_per_s": 120_000} | ROW))
    page.write_text(f"before\n{report.BEGIN}\nold\n{report.END}\nafter\n")
    monkeypatch.setattr(sys, "argv", ["report.py", str(rows), "--page", str(page), "--plot", str(plot)])
    report.main()
    text = page.read_text()
    assert text.startswith("before\n") and text.endswith("\nafter\n") and "old" not in text and "120,000" in text
    assert plot.stat().st_size > 1000
