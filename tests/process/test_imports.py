"""What is imported when: a start does not wait for libraries that it does not call."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from ig2mj.cli import train
from ig2mj.cli.train import _has_several_programs, _on_one_device
from ig2mj.learn.run_files import run_table
from ig2mj.process import imports
from ig2mj.process.settings import SCRATCH_IN_PLACE


def imported(code: str) -> set[str]:
    shown = "import sys; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", f"{code}\n{shown}"], capture_output=True, text=True, check=True)
    return set(done.stdout.splitlines()[-1].split())


@pytest.mark.parametrize("name", ["Simulation", "Worlds", "make", "load_scene"])
def test_the_public_names_import_neither_gpu_libraries_nor_what_only_sampling_and_meshes_need(name):
    found = imported(f"import ig2mj; ig2mj.{name}")
    assert "mujoco" in found
    assert found.isdisjoint({"warp", "mujoco.mjx", "trimesh", "networkx", "scipy.spatial", "scipy.signal"})


def test_mjx_is_imported_without_trimesh_and_calls_it_all_the_same():
    code = """
from ig2mj.process.imports import import_mjx
import_mjx()
import sys
from mujoco.mjx._src import mesh
assert not {"trimesh", "scipy.spatial"} & sys.modules.keys()
corners = [[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]
assert mesh.trimesh.Trimesh(corners).convex_hull.volume == 1.0
assert mesh.spatial.ConvexHull(corners).volume == 1.0
import trimesh
assert type(trimesh.Trimesh(corners)) is trimesh.Trimesh
"""
    assert {"mujoco.mjx", "trimesh", "scipy.spatial"} <= imported(code)


def test_only_kernels_of_mjx_are_not_searched_for_what_they_depend_on(tmp_path):
    code = """
import warp as wp
search = wp._src.context.Module._find_references
from ig2mj.process.imports import import_mjx
import_mjx()
from mujoco.mjx.third_party.mujoco_warp._src import math, smooth
assert not wp.get_module(math.__name__).dependents
assert wp._src.context.Module._find_references is search
@wp.kernel
def turn(x: wp.array(dtype=wp.quat)):
    x[0] = math.mul_quat(x[0], x[1])
assert wp.get_module(math.__name__).dependents == {turn.module}
"""
    file = tmp_path / "turns.py"  # Warp reads the sources of kernels
    file.write_text(code)
    subprocess.run([sys.executable, str(file)], check=True)


def test_libraries_that_are_there_already_stay():
    code = "import trimesh; before = trimesh\nfrom ig2mj.process.imports import import_mjx; import_mjx()\n"
    assert "mujoco.mjx" in imported(code + "from mujoco.mjx._src import mesh; assert mesh.trimesh is before")


def test_devices_are_found_during_imports_and_every_caller_is_told_what_is_wrong():
    code = """
import threading, time
from ig2mj.process.imports import find_devices
find_devices()
while any(thread.name == "ig2mj-devices" for thread in threading.enumerate()):
    time.sleep(0.01)
import jax
jax.devices()
"""
    done = {
        platform: subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, env={**os.environ, "JAX_PLATFORMS": platform}
        )
        for platform in ("cpu", "none")
    }
    assert done["cpu"].returncode == 0 and done["none"].returncode != 0
    assert "in thread" not in done["none"].stderr.lower() and "RuntimeError" in done["none"].stderr


def test_devices_are_looked_for_before_imports_only_where_jax_will_use_a_gpu(monkeypatch, tmp_path):
    looked = []
    monkeypatch.setattr(imports, "find_devices", lambda: looked.append(1))
    assert not imports.find_gpu({}, tmp_path)
    (tmp_path / "nvidiactl").touch()
    assert not imports.find_gpu({}, tmp_path)
    (tmp_path / "nvidia0").touch()
    for hidden in ({"JAX_PLATFORMS": "cpu"}, {"CUDA_VISIBLE_DEVICES": ""}, {"CUDA_VISIBLE_DEVICES": "-1"}):
        assert not imports.find_gpu(hidden, tmp_path)
    assert not looked
    for seen in ({}, {"JAX_PLATFORMS": "cuda,cpu"}, {"CUDA_VISIBLE_DEVICES": "1"}):
        assert imports.find_gpu(seen, tmp_path)
    assert len(looked) == 3


def test_a_training_looks_for_them_early_on_one_device_once_options_of_xla_are_set():
    one = run_table("CookingMeat")
    assert _on_one_device(one, (), None, {}) and _on_one_device({}, ("image_size=64",), "1", {})
    assert not _on_one_device(one, ("engine=native",), None, {})
    assert _has_several_programs(one, ()) and not _has_several_programs(one, ("programs=1",))
    assert _has_several_programs(run_table("CookingMeat-homes"), ("programs=1",)), "one for each home"
    assert not _on_one_device(one, (), "all", {}) and not _on_one_device({**one, "devices": "2"}, (), None, {})
    slurm = {"SLURM_STEP_NODELIST": "a[1-2]", "SLURM_NTASKS": "2", "SLURM_JOB_ID": "1", "SLURM_PROCID": "0"}
    assert not _on_one_device(one, (), None, slurm)


@pytest.mark.parametrize(("changes", "kept"), [((), True), (("programs=1",), False), (("homes=birch,elm",), True)])
def test_options_of_xla_are_set_before_the_gpu_is_looked_for(monkeypatch, changes, kept):
    """XLA reads them once: where an iteration is several programs, scratch memory stays in place."""
    monkeypatch.setenv("XLA_FLAGS", "")

    def find_gpu(environ):
        raise InterruptedError(environ["XLA_FLAGS"])

    monkeypatch.setattr(imports, "find_gpu", find_gpu)
    with pytest.raises(InterruptedError) as said:
        train.run("CookingMeat", set=changes)
    assert (SCRATCH_IN_PLACE in str(said.value)) == kept


def test_what_a_run_file_says_is_read_without_jax():
    assert "jax" not in imported("from ig2mj.learn.run_files import run_table; run_table('CookingMeat')")
