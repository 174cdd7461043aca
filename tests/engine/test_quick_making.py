"""What an engine's making leaves out changes no number and no name: sizes counted with arrays, hashes shared."""

from __future__ import annotations

import mujoco
import pytest
import warp as wp
from mujoco.mjx.third_party.mujoco_warp._src import io
from warp._src import context

from ig2mj.engine.warp import ahead, kernels, patches
from ig2mj.engine.warp.engine import WarpEngine
from ig2mj.engine.warp.hashing import shared_hashes
from ig2mj.engine.warp.patches import pins
from ig2mj.process import prepare_warp

fits = pytest.mark.skipif(bool(pins.obstacles()), reason=f"our kernels do not fit: {pins.obstacles()}")

ARMS = """<mujoco><worldbody><geom type="plane" size="5 5 1" {floor}/>
<body pos="0 0 .5"><freejoint/><geom size=".1" {free}/>
 <body name="left"><joint axis="1 0 0"/><geom size=".1" {side}/>
  <body><joint axis="0 1 0"/><geom size=".1" {side}/></body></body>
 <body name="right"><joint type="ball"/><body><geom name="tip" size=".1" {side}/></body></body></body>
<body pos="2 0 .5"><joint type="slide"/><geom name="box" type="box" size=".1 .1 .1" {box}/><geom size=".1"/></body>
<body pos="3 0 .5"><geom name="post" size=".1"/></body></worldbody><contact>{pairs}</contact></mujoco>"""

NOTHING = 'contype="0" conaffinity="0"'
MODELS = {
    "all": {},
    "nothing touches": {"floor": NOTHING, "free": NOTHING, "side": NOTHING, "box": NOTHING},
    "only with the floor": {name: 'contype="0"' for name in ("free", "side", "box")},
    "one arm with itself": {"floor": NOTHING, "box": NOTHING, "free": NOTHING, "side": 'contype="2" conaffinity="2"'},
    "pairs": {
        "free": NOTHING,
        "side": NOTHING,
        "pairs": '<pair geom1="tip" geom2="box"/><pair geom1="post" geom2="tip"/>',
    },
}


@fits
@pytest.mark.parametrize("name", MODELS)
def test_entries_of_a_contact_are_upstreams(name):
    from ig2mj.engine.warp.patches.contact_nnz import max_contact_nnz

    given = dict.fromkeys(("floor", "free", "side", "box", "pairs"), "") | MODELS[name]
    model = mujoco.MjModel.from_xml_string(ARMS.format(**given))
    assert max_contact_nnz(model) == io._calculate_max_contact_nnz(model)


@fits
def test_entries_of_a_homes_contacts_are_upstreams(tiny_home):
    from ig2mj.engine.warp.patches.contact_nnz import max_contact_nnz

    own = io._calculate_max_contact_nnz(tiny_home.model)
    assert max_contact_nnz(tiny_home.model) == own > 6
    with patches.counted_quickly(True):
        assert io._calculate_max_contact_nnz(tiny_home.model) == own


@fits
def test_changed_sources_are_noticed(monkeypatch):
    module = "third_party.mujoco_warp._src.io"
    assert pins.fingerprint(module, "_body_pair_nnz") == pins.PINS[module]["_body_pair_nnz"]
    monkeypatch.setattr(io, "_body_pair_nnz", lambda model, one, other: 0)
    assert pins.fingerprint(module, "_body_pair_nnz") != pins.PINS[module]["_body_pair_nnz"]


def test_names_in_the_cache_are_the_same_with_shared_hashes(tiny_home):
    launches = ahead.launches_on_gpu(WarpEngine(tiny_home, 2))
    kernels.modules_of(launches)
    modules = {kernel.module: size for kernel, size in launches}

    def hashed() -> list[bytes]:
        options = [module.resolve_options(wp.config, block_dim=size) for module, size in modules.items()]
        both = zip(modules, options, strict=True)
        return [context.ModuleHasher(module._get_live_kernels(), option).get_hash() for module, option in both]

    alone = hashed()
    with shared_hashes():
        assert hashed() == alone and len({*alone}) > 40


SCALED = """
@wp.func
def scaled(x: {type}):
    return {factor} * x
@wp.kernel(module="unique")
def scale_{number}(x: wp.array(dtype=float)):
    x[0] = scaled(x[0])
"""


@pytest.fixture
def made(tmp_path):
    """Makes kernels that call one function, which gets another overload each time; hashes of their modules."""
    prepare_warp()
    wp.init()

    def make(folder: str) -> list[bytes]:
        names: dict = {"__name__": f"ig2mj_test_{folder}", "wp": wp}
        found = []
        for number, kind in enumerate(("float", "int", "wp.vec3")):
            file = tmp_path / f"{folder}_{number}.py"
            file.write_text(SCALED.format(type=kind, factor=kind if kind == "wp.vec3" else f"{kind}(2)", number=0))
            exec(compile(file.read_text(), file, "exec"), names)
            found.append(names["scale_0"].module.get_module_hash(256))
        return found

    return make


def test_functions_with_another_overload_are_hashed_anew(made):
    original, alone = context.ModuleHasher.hash_function, made("alone")
    with shared_hashes():
        assert made("shared") == alone
        assert context.ModuleHasher.hash_function is not original
    assert len({*alone}) == 3 and context.ModuleHasher.hash_function is original


def test_other_versions_of_warp_hash_as_they_do(monkeypatch):
    monkeypatch.setattr(wp.config, "version", "1.19.0")
    before = context.ModuleHasher.hash_function
    with shared_hashes():
        assert context.ModuleHasher.hash_function is before
