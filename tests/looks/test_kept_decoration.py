"""Decoration that is kept on disk is what would be made."""

import dataclasses

import numpy as np
import pytest

from ig2mj.looks import kept_decoration
from ig2mj.looks.home_plan import read_plan
from ig2mj.looks.kept_decoration import FOLDER, decoration_of
from ig2mj.looks.light import DAY
from ig2mj.looks.materials import Material
from ig2mj.looks.mesh import quad
from ig2mj.looks.visual import Visual
from ig2mj.scene.scene import load_scene


@pytest.fixture
def folder(monkeypatch, tmp_path):
    monkeypatch.setenv("IG2MJ_CACHE_DIR", str(tmp_path))
    return tmp_path / FOLDER


def made(count=2):
    square = quad([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])
    image = np.linspace(0, 1, 24).reshape(2, 4, 3)
    return [(Material(f"m{k}", image if k % 2 else None, specular=0.1), square) for k in range(count)]


def never(*_):
    raise AssertionError("it is made again")


def same(one, other):
    for (a, first), (b, second) in zip(one, other, strict=True):
        assert vars(a) | {"image": None} == vars(b) | {"image": None}
        np.testing.assert_array_equal(a.image, b.image)
        for name in ("vertices", "normals", "uv", "faces"):
            np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
            assert getattr(first, name).dtype == getattr(second, name).dtype


def test_a_home_looks_the_same_to_the_byte_when_its_decoration_is_read(folder, monkeypatch):
    scene = load_scene("small_home")
    first = Visual(scene, "day").model
    assert len(list(folder.glob("*.npz"))) == 1
    monkeypatch.setattr("ig2mj.looks.visual._decoration", never)
    again = Visual(scene, "day").model
    sizes = [name for name in dir(first) if isinstance(getattr(first, name), np.ndarray)]
    assert {"tex_data", "mesh_vert", "mesh_face", "mat_rgba", "geom_matid"} <= set(sizes)
    for name in sizes:
        assert getattr(first, name).tobytes() == getattr(again, name).tobytes(), name


def test_it_is_made_again_where_what_it_depends_on_differs(folder):
    plan = read_plan(load_scene("small_home"))
    same(decoration_of(made, plan, DAY), decoration_of(never, plan, DAY))
    solid = dataclasses.replace(plan.solids[0], low=plan.solids[0].low + 0.001)
    others = [
        (dataclasses.replace(plan, solids=(solid, *plan.solids[1:])), DAY),
        (plan, dataclasses.replace(DAY, sun=False)),
    ]
    for depends in others:
        assert len(decoration_of(lambda: made(3), *depends)) == 3


@pytest.mark.parametrize("change", ["cut", "counts", "materials"])
def test_a_broken_file_is_replaced(folder, change):
    decoration_of(made, 1)
    (file,) = folder.glob("*.npz")
    content = file.read_bytes()
    if change == "cut":
        file.write_bytes(content[: len(content) // 2])
    else:
        with np.load(file) as opened:
            arrays = dict(opened)
        arrays |= {"numbers": arrays["numbers"] + 1} if change == "counts" else {"materials": np.array("[1, 2]")}
        np.savez(file, **arrays)
    same(decoration_of(made, 1), decoration_of(never, 1))


def test_a_cache_that_cannot_be_written_is_none(monkeypatch, tmp_path):
    file = tmp_path / "file"
    file.write_text("")
    monkeypatch.setenv("IG2MJ_CACHE_DIR", str(file))
    assert len(decoration_of(made, 1)) == len(decoration_of(lambda: made(2), 1)) == 2


def test_the_files_written_last_are_kept(folder, monkeypatch):
    monkeypatch.setattr(kept_decoration, "KEPT", 2)
    for k in range(4):
        decoration_of(made, k)
    assert len(list(folder.glob("*.npz"))) == 2
