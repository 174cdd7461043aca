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
from ig2mj.engine.warp.patches import pins, table
from ig2mj.engine.warp.patches.replacements import KERNELS, original
from ig2mj.engine.warp.patches.scope import ScopedReplacement
from ig2mj.errors import EngineError, UnknownNameError

fits = pytest.mark.skipif(bool(pins.obstacles()), reason=f"our kernels do not fit: {pins.obstacles()}")

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


def test_with_another_version_hands_hold_by_constraints_all_the_same(unfit, tiny_home_folder):
    """Nothing is compiled; `tests/engine/test_without_patches.py` takes steps."""
    unfit.setattr(pins, "VERSION", "0.0.1")
    unfit.setattr(patches, "_warned", True)
    pins.mismatches.cache_clear()
    scene = ig2mj.load_scene(tiny_home_folder, agents=[Humanoid(pos=(0.3, 0.6, 0.6))])
    engine = WarpEngine(scene, 1, substeps=1)
    assert not engine.own_kernels and not engine.cannot_ignore
    for grasping in ("assisted", "sticky", Grasping(scene, "mitten", "can")):
        assert ig2mj.Worlds(scene, 1, engine, grasping=grasping).core.grasping is not None


@fits
def test_all_that_changed_is_listed_after_the_version(unfit):
    unfit.setattr(pins, "VERSION", "0.0.1")
    unfit.setattr(solver, "smooth_solve_compact", ig2mj.load_scene)
    unfit.delattr(solver, "_gather_M_sparse")
    pins.mismatches.cache_clear()
    module = "third_party.mujoco_warp._src.solver"
    version, *others = pins.mismatches()
    assert version.endswith("is not 0.0.1")
    assert others == [f"{module}.smooth_solve_compact has changed", f"{module}._gather_M_sparse is missing"]


@fits
def test_kernels_run_in_spite_of_the_pins_on_request(unfit, recwarn):
    unfit.setattr(pins, "VERSION", "0.0.1")
    unfit.setenv(pins.TRY, "1")
    pins.mismatches.cache_clear()
    assert pins.mismatches() and not pins.obstacles()
    assert patches.fit() and not len(recwarn)


@fits
@pytest.mark.parametrize("name", ["smooth_solve_compact", "_BLOCK_CHOLESKY_DIM", "_gather_M_sparse"])
def test_a_function_or_constant_that_changed_is_named(unfit, name):
    module = "third_party.mujoco_warp._src.solver"
    unfit.setattr(solver, name, ig2mj.load_scene)
    assert pins.mismatches() == (f"{module}.{name} has changed",)
    unfit.delattr(solver, name)
    pins.mismatches.cache_clear()
    assert pins.mismatches() == (f"{module}.{name} is missing",)
    assert f'"{name}": "missing"' in pins.renewed()


@fits
def test_every_replaced_function_is_pinned():
    assert patches.fit() and KERNELS._own
    for module, name in KERNELS._own:
        if module is wp:
            continue  # of its public interface
        assert name in pins.PINS[module.__name__.removeprefix("mujoco.mjx.")]


@pytest.fixture
def variable(monkeypatch):
    """Sets `IG2MJ_PATCHES` and gives the groups that run then."""

    def chosen(value: str) -> frozenset[str]:
        monkeypatch.setenv(table.VARIABLE, value)
        table.chosen.cache_clear()
        return table.chosen()

    yield chosen
    monkeypatch.delenv(table.VARIABLE, raising=False)
    table.chosen.cache_clear()


def test_a_variable_leaves_groups_of_patches_out(variable):
    everything = set(table.GROUPS)
    assert variable("") == variable("all") == everything
    assert variable("none") == set()
    assert variable("-solver_loop, -gravity") == everything - {"solver_loop", "gravity"}
    assert variable("contacts,graphs") == {"contacts", "graphs"}


def test_a_wrong_name_of_a_group_is_answered_with_the_near_ones(variable):
    with pytest.raises(UnknownNameError, match="'solver_lop'; near matches: solver_loop"):
        variable("-solver_lop")
    with pytest.raises(EngineError, match="a minus sign before all names, or before none"):
        variable("contacts,-graphs")


@fits
def test_of_a_group_that_is_left_out_nothing_is_replaced(variable):
    from ig2mj.engine.warp.patches import places

    variable("all")
    everything = set(places.own())
    variable("none")
    assert not places.own() and not places.substitutes() and not patches.for_new_engines()
    missing = set()
    for group in table.GROUPS:
        variable(f"-{group}")
        missing |= everything - set(places.own())
    shared = {(module, name) for _, functions in places.SHARED for module, name in functions}
    assert missing == everything - shared, "what several groups share stays until none of them runs"


def test_the_modules_of_each_group_exist():
    modules = [name for group in table.GROUPS.values() for name in group.modules]
    assert len(modules) == len(set(modules))
    assert all(group.lines > 10 for group in table.GROUPS.values())
