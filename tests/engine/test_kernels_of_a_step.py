"""The kernels noted beforehand are all that a step launches."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
import warp as wp
from kernel_loading import load_kernels_of
from mujoco.mjx.third_party import mujoco_warp
from mujoco.mjx.third_party.mujoco_warp._src import island

from ig2mj.engine.warp import kernels, patches
from ig2mj.engine.warp.engine import WarpEngine
from ig2mj.engine.warp.patches import pins
from ig2mj.engine.warp.patches.scope import ScopedReplacement
from ig2mj.engine.warp.profile import EngineProfile
from ig2mj.scene.scene import load_scene

pytestmark = pytest.mark.skipif(bool(pins.obstacles()), reason=f"our kernels do not fit: {pins.obstacles()}")

SCENE = """<mujoco><option timestep="0.00833333" integrator="implicitfast"><flag sleep="enable"/></option>
<worldbody><geom type="plane" size="5 5 1"/><body pos="0 0 .04"><freejoint/><geom type="box" size=".04 .04 .04"/></body>
<body pos="0 0 .12"><freejoint/><geom type="cylinder" size=".04 .04"/></body>
<body pos=".5 0 .1"><joint name="x" type="slide" axis="1 0 0"/><geom type="sphere" size=".03"/></body></worldbody>
<actuator><position joint="x" kp="300" kv="30"/></actuator></mujoco>"""


def test_nothing_is_launched_while_kernels_are_noted():
    count = wp.zeros(1, dtype=int)
    noted = kernels.launches_of(lambda: wp.launch(_count, dim=4, inputs=[count], block_dim=64))
    assert [(kernel.key, size) for kernel, size in noted] == [("_count", 64)]
    assert count.numpy()[0] == 0


def test_what_is_launched_for_nothing_is_not_noted():
    count = wp.zeros(1, dtype=int)
    assert not kernels.launches_of(lambda: wp.launch(_count, dim=(3, 0), inputs=[count]))


def test_both_branches_and_the_body_of_a_loop_are_noted(kernel_device):
    count = wp.zeros(1, dtype=int)

    def launch(dim: int) -> None:
        wp.launch(_count, dim=1, inputs=[count], block_dim=dim)

    def act() -> None:
        wp.capture_if(count, on_true=lambda: launch(1), on_false=lambda: launch(2))
        wp.capture_while(count, while_body=launch, dim=3)

    assert [size for _, size in kernels.launches_of(act)] == [1, 2, 3]


@wp.kernel
def _count(count: wp.array(dtype=int)):  # pyright: ignore[reportInvalidTypeForm]
    wp.atomic_add(count, 0, 1)


def test_islands_are_compiled_without_derivatives():
    modules = wp.get_module(island.__name__), island._island_dsu.module
    assert patches.fit()
    assert all(module.execs or not module.options["enable_backward"] for module in modules)


@pytest.mark.slow
def test_a_step_launches_no_other_kernels(kernel_device):
    model = mujoco.MjModel.from_xml_string(SCENE)
    profile = EngineProfile(awake_dofs=13, constraints=100, contacts=40, convex_contacts=20)
    noted = {kernel.key for kernel, _ in kernels.launches_of_step(model, profile, own=True)}
    launched = set()
    put = mujoco_warp.put_model(model)
    data = mujoco_warp.make_data(model, nworld=2, naconmax=80, naccdmax=40, njmax=100, nvmax=13)
    with patches.engine_kernels():
        really, really_tiled = wp.launch, wp.launch_tiled

        def launch(kernel, dim, *args, **kwargs):
            if np.prod(dim) > 0:  # Warp loads nothing for the others
                launched.add(patches.launched(kernel, dim).key)
            return really(kernel, dim, *args, **kwargs)

        def launch_tiled(kernel, *, dim, **kwargs):
            launched.add(patches.launched(kernel, dim, tiled=True).key)
            return really_tiled(kernel, dim=dim, **kwargs)

        watched = ScopedReplacement()
        watched.add({(wp, "launch"): launch, (wp, "launch_tiled"): launch_tiled})
        load_kernels_of(lambda: mujoco_warp.step(put, data))
        with watched.entered():
            mujoco_warp.step(put, data)
    assert len(launched) > 40
    assert launched <= noted


@pytest.mark.slow
def test_an_engine_loads_the_kernels_of_its_scene_and_its_first_step_no_others(monkeypatch):
    """The very modules: what is compiled depends on settings of the model and on sizes of buffers."""
    loaded, really = [], wp.Module.load

    def load(module, *args, **kwargs):
        before = len(module.execs)
        result = really(module, *args, **kwargs)
        if len(module.execs) > before:
            loaded.append(module.name)
        return result

    monkeypatch.setattr(wp.Module, "load", load)
    engine = WarpEngine(load_scene("small_home"), 2)
    assert kernels.load(engine.launches(), workers=2) > 40
    loaded.clear()
    engine.step(engine.reset())
    assert not loaded
