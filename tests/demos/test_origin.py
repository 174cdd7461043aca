"""What a recording belongs to: a compiled model, wherever its files lie."""

from __future__ import annotations

import mujoco

from ig2mj.demos.origin import model_hash

MESH = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"

SCENE = """<mujoco><asset><mesh name="m" file="{mesh}"/></asset>
<worldbody><body name="b"><freejoint/><geom type="mesh" mesh="m" friction="0.5"/></body></worldbody></mujoco>"""


def model(folder) -> mujoco.MjModel:
    folder.mkdir()
    (folder / "mesh.obj").write_text(MESH)
    return mujoco.MjModel.from_xml_string(SCENE.format(mesh=folder / "mesh.obj"))


def test_the_hash_of_a_model_is_the_same_in_another_folder_and_another_for_another_model(tmp_path):
    here, there = model(tmp_path / "here"), model(tmp_path / "a_longer_name")
    assert here.paths != there.paths and model_hash(here) == model_hash(there)
    there.geom_friction[0, 0] *= 1.001
    assert model_hash(here) != model_hash(there)
    before = model_hash(here)
    here.opt.timestep *= 2
    assert model_hash(here) != before
