"""MuJoCo Warp's functions are replaced for our engines only; everybody else in the process gets the originals."""

from __future__ import annotations

import threading
import types

import jax
import mujoco
import numpy as np
import pytest
import warp as wp
from mujoco import mjx
from mujoco.mjx.third_party.mujoco_warp._src import collision_driver, forward, passive, solver

import ig2mj
from ig2mj.agents import Humanoid
from ig2mj.agents.grasping import Grasping
from ig2mj.engine.warp import patches
from ig2mj.engine.warp.engine import WarpEngine
from ig2mj.engine.warp.patches import pins
from ig2mj.engine.warp.patches.replacements import KERNELS, original
from ig2mj.engine.warp.patches.scope import ScopedReplacement
from ig2mj.errors import EngineError

fits = pytest.mark.skipif(bool(pins.mismatches()), reason=f"our kernels do not fit: {pins.mismatches()}")

BALL = """<mujoco><option timestep="0.00833333"><flag sleep="enable"/></option><worldbody>
<geom type="box" size="2 2 .1" pos="0 0 -.1"/><body pos="0 0 .049"><freejoint/><geom size=".05"/></body>
</worldbody></mujoco>"""


@pytest.fixture
def library() -> types.ModuleType:
    """A module with a function that others call, and one that calls it."""
    module = types.ModuleType("library")
    exec("def part(x):\n    return ('theirs', x)\ndef whole(x):\n    return part(x)", module.__dict__)
    return module


@pytest.fixture
def replacement(library) -> ScopedReplacement:
    both = ScopedReplacement()
    both.add({(library, "part"): lambda x: ("ours", both.original(library, "part")(x)[1])})
    return both


def test_outside_all_blocks_the_library_is_as_it_came(library, replacement):
    part = library.part
    with replacement.entered(), replacement.entered(False), replacement.entered():
        assert library.part is not part and library.whole(1) == ("ours", 1)
    assert library.part is part and library.whole(1) == ("theirs", 1)


def test_blocks_within_blocks_choose_for_themselves(library, replacement):
    with replacement.entered():
        with replacement.entered(False):
            assert library.whole(1) == ("theirs", 1)
        assert library.whole(1) == ("ours", 1)
        with pytest.raises(ZeroDivisionError), replacement.entered():
            _ = 1 / 0
    assert library.whole(1) == ("theirs", 1)


def test_another_thread_gets_the_originals_meanwhile(library, replacement):
    seen = []
    with replacement.entered():
        thread = threading.Thread(target=lambda: seen.append(library.whole(1)))
        thread.start()
        thread.join()
        assert library.whole(1) == ("ours", 1)
    assert seen == [("theirs", 1)]


def test_many_threads_enter_and_leave_at_a_time(library, replacement):
    part, wrong, ready = library.part, [], threading.Barrier(8)

    def run(ours: bool) -> None:
        ready.wait()
        for _ in range(300):
            with replacement.entered(ours):
                if library.whole(1) != ("ours" if ours else "theirs", 1):
                    wrong.append(ours)

    threads = [threading.Thread(target=run, args=(k % 2 == 0,)) for k in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong and library.part is part


def test_what_somebody_else_puts_over_ours_stays_and_works(library, replacement):
    with replacement.entered():
        below = library.part
        library.part = lambda x: ("third", below(x))
    assert library.whole(1) == ("third", ("theirs", 1))
    with replacement.entered():
        assert library.whole(1) == ("third", ("ours", 1))


def test_what_is_added_inside_a_block_takes_part_in_the_next(library):
    late = ScopedReplacement()
    with late.entered(False):
        late.add({(library, "part"): lambda x: ("ours", x)})
        with late.entered():
            assert library.whole(1) == ("ours", 1)
    assert library.whole(1) == ("theirs", 1)


# MuJoCo Warp.


class Calls:
    """Counts which of two functions of MuJoCo Warp run: `collision` and our stand-in for it."""

    def __init__(self, monkeypatch):
        from ig2mj.engine.warp.patches import collision

        self.ours, self.theirs = 0, 0
        own, upstream = collision.collision, collision_driver.collision

        def count_own(*args, **kwargs):
            self.ours += 1
            return own(*args, **kwargs)

        def count_upstream(*args, **kwargs):
            self.theirs += 1
            return upstream(*args, **kwargs)

        assert patches.fit()
        monkeypatch.setitem(KERNELS._own, (collision_driver, "collision"), count_own)
        monkeypatch.setattr(collision_driver, "collision", count_upstream)

    def during(self, act) -> tuple[int, int]:
        """(ours, theirs) while `act` runs; ours calls theirs as well."""
        self.ours = self.theirs = 0
        act()
        return self.ours, self.theirs


@pytest.fixture
def calls(monkeypatch) -> Calls:
    return Calls(monkeypatch)


def run(engine: WarpEngine) -> None:
    jax.block_until_ready(jax.jit(engine.step)(engine.reset())[0].data.qpos)


def run_mjx() -> np.ndarray:
    """One step by MJX itself, as another user of it in this process writes it."""
    model = mujoco.MjModel.from_xml_string(BALL)
    put = mjx.put_model(model, impl="warp")
    data = mjx.put_data(model, mujoco.MjData(model), impl="warp", naconmax=16, naccdmax=16, njmax=32, nvmax=6)
    batch = jax.vmap(lambda z: data.replace(qvel=data.qvel.at[2].set(z)))(np.zeros(2, np.float32))
    return np.asarray(jax.jit(jax.vmap(lambda d: mjx.step(put, d)))(batch).qpos)


@fits
@pytest.mark.slow
def test_engines_get_ours_and_a_user_of_mjx_in_the_same_process_the_originals(tiny_home, calls):
    engine = WarpEngine(tiny_home, 1, substeps=1)
    ours, theirs = calls.during(lambda: run(engine))
    assert ours > 0 and theirs == ours
    ours, theirs = calls.during(run_mjx)
    assert ours == 0 and theirs > 0
    ours, theirs = calls.during(lambda: run(engine))
    assert ours > 0


@fits
@pytest.mark.slow
def test_an_engine_made_with_upstreams_functions_keeps_them_and_others_keep_ours(tiny_home, calls):
    before = WarpEngine(tiny_home, 1, substeps=1)
    with patches.upstream_kernels():
        upstream = WarpEngine(tiny_home, 1, substeps=1)
        assert calls.during(lambda: run(upstream))[0] == 0
        assert calls.during(lambda: run(before))[0] > 0
    assert not upstream.own_kernels and before.own_kernels
    assert WarpEngine(tiny_home, 1, substeps=1).own_kernels
    with patches.awake_kernels():
        assert calls.during(lambda: run(upstream))[0] == 0


@fits
def test_direct_calls_get_ours_inside_the_block_only():
    places = ((solver, "_cholesky_factorize_solve"), (passive, "passive"), (forward, "_advance"))
    before = [getattr(*place) for place in places]
    with patches.awake_kernels():
        assert KERNELS.active and [original(*place) for place in places] == before
        with patches.upstream_kernels():
            assert not KERNELS.active
        assert KERNELS.active
    assert not KERNELS.active and [getattr(*place) for place in places] == before


@pytest.fixture
def unfit(monkeypatch):
    """Another version is installed, and nobody has been warned yet."""
    monkeypatch.setattr(patches, "_warned", False)
    pins.mismatches.cache_clear()
    yield monkeypatch
    pins.mismatches.cache_clear()


def test_with_another_version_engines_run_upstreams_functions_and_one_warning_says_so(unfit, tiny_home):
    unfit.setattr(pins, "VERSION", "0.0.1")
    pins.mismatches.cache_clear()
    with pytest.warns(UserWarning, match=r"own, slower kernels run: mujoco-mjx [\d.]+ is not 0.0.1") as told:
        engines = [WarpEngine(tiny_home, 1, substeps=1) for _ in range(2)]
    assert len(told) == 1
    assert not any(engine.own_kernels for engine in engines)
    with patches.awake_kernels():
        assert not KERNELS.active


def test_with_another_version_grasping_by_constraints_is_refused_when_worlds_are_made(unfit, tiny_home_folder):
    """Nothing is compiled, and no step is taken before the refusal; hands that hold by friction alone are fine."""
    unfit.setattr(pins, "VERSION", "0.0.1")
    unfit.setattr(patches, "_warned", True)
    pins.mismatches.cache_clear()
    scene = ig2mj.load_scene(tiny_home_folder, agents=[Humanoid(pos=(0.3, 0.6, 0.6))])
    engine = WarpEngine(scene, 1, substeps=1)
    reason = r"engine 'warp' cannot: .* mujoco-mjx [\d.]+ is not 0\.0\.1 \(take engine='native' or grasping="
    for grasping in ("assisted", "sticky", Grasping(scene, "mitten", "can")):
        with pytest.raises(EngineError, match=reason):
            ig2mj.Worlds(scene, 1, engine, grasping=grasping)
        with pytest.raises(EngineError, match=reason):
            ig2mj.Simulation(scene, engine, grasping=grasping)
    assert ig2mj.Worlds(scene, 1, engine).core.grasping is None
    assert ig2mj.Worlds(scene, 1, "native", grasping="sticky").core.grasping is not None


@fits
@pytest.mark.parametrize("name", ["smooth_solve_compact", "_BLOCK_CHOLESKY_DIM", "_gather_M_sparse"])
def test_a_function_or_constant_that_changed_is_named(unfit, name):
    module = "third_party.mujoco_warp._src.solver"
    unfit.setattr(solver, name, ig2mj.load_scene)
    assert pins.mismatches() == (f"{module}.{name} has changed",)
    unfit.delattr(solver, name)
    pins.mismatches.cache_clear()
    assert pins.mismatches() == (f"{module}.{name} has changed",)
    assert f'"{name}": "missing"' in pins.renewed()


@fits
def test_every_replaced_function_is_pinned():
    assert patches.fit() and KERNELS._own
    for module, name in KERNELS._own:
        if module is wp:
            continue  # of its public interface
        assert name in pins.PINS[module.__name__.removeprefix("mujoco.mjx.")]
