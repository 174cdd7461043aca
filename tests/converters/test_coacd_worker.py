"""Convex decomposition may hang, crash or be repeated: the converter goes on, and does no work twice."""

import sys
import time

import numpy as np
import pytest
import trimesh
from ig2mj_converters.base.cache_folder import ENVIRONMENT
from ig2mj_converters.base.description import Mesh, Shape
from ig2mj_converters.hulls import workers
from ig2mj_converters.hulls.link_hulls import HullOptions, decompose_link


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv(ENVIRONMENT, str(tmp_path / "cache"))
    return tmp_path / "cache"


def bowl():
    """A thick half shell, open at the top: not convex, not made of boxes."""
    outer = trimesh.creation.icosphere(2, 0.2)
    shell = outer.difference(trimesh.creation.icosphere(2, 0.17)).slice_plane([0, 0, 0], [0, 0, -1], cap=True)
    return Shape("mesh", meshes=[Mesh(np.asarray(shell.vertices), np.asarray(shell.faces))])


def use_worker(monkeypatch, code):
    monkeypatch.setattr(workers, "COMMAND", (sys.executable, "-c", code))


def test_a_hanging_worker_is_stopped_and_one_hull_stands_in(monkeypatch):
    use_worker(monkeypatch, "import time; time.sleep(60)")
    started = time.monotonic()
    result = decompose_link([bowl()], HullOptions(time_limit=0.8))
    assert time.monotonic() - started < 10
    assert result.method == "fallback" and result.after == 1
    assert any("took longer" in w for w in result.warnings)
    assert any("one hull" in w for w in result.warnings)


@pytest.mark.parametrize("mishap", ["import time; time.sleep(60)", "import os; os.abort()"])
def test_what_time_or_a_signal_made_worse_is_tried_again_next_time(mishap, monkeypatch, own_cache):
    with monkeypatch.context() as patch:
        use_worker(patch, mishap)
        assert decompose_link([bowl()], HullOptions(time_limit=0.8, coacd_threshold=0.4)).stopped
    assert not list(own_cache.rglob("*.npz"))
    again = decompose_link([bowl()], HullOptions(coacd_threshold=0.4))
    assert "coacd" in again.method and not again.stopped
    assert decompose_link([bowl()], HullOptions(coacd_threshold=0.4)).cached


def test_a_decomposition_that_fails_by_itself_is_remembered(monkeypatch):
    use_worker(monkeypatch, "raise RuntimeError('no luck')")
    assert decompose_link([bowl()], HullOptions()).method == "fallback"
    assert decompose_link([bowl()], HullOptions()).cached


def test_a_crashing_worker_is_tried_coarser_and_then_one_hull_stands_in(monkeypatch):
    use_worker(monkeypatch, "import os; os.abort()")
    result = decompose_link([bowl()], HullOptions())
    assert result.method == "fallback" and result.after == 1
    assert sum("crashed (signal 6)" in w for w in result.warnings) == 3


def test_coarser_settings_are_used_when_the_finest_fail(monkeypatch):
    tried = []
    cube = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)

    def picky(vertices, faces, parameters, *, time_limit, threads):
        tried.append(parameters["threshold"])
        if len(tried) == 1:
            raise workers.WorkerError("crashed (signal 11)")
        return [cube]

    monkeypatch.setattr(workers, "run_coacd", picky)
    result = decompose_link([bowl()], HullOptions(cache=False))
    assert tried == [0.05, 0.1] and result.method == "coacd" and len(result.warnings) == 1


def test_an_exception_in_the_worker_is_told_in_one_line(monkeypatch):
    use_worker(monkeypatch, "raise RuntimeError('no luck')")
    with pytest.raises(workers.WorkerError, match="no luck"):
        workers.run_coacd(np.zeros((3, 3)), np.zeros((1, 3), int), {}, time_limit=30)


def test_a_second_conversion_is_ten_times_faster_and_equal():
    options = HullOptions(coacd_threshold=0.2)
    started = time.perf_counter()
    first = decompose_link([bowl()], options)
    cold = time.perf_counter() - started
    started = time.perf_counter()
    second = decompose_link([bowl()], options)
    warm = time.perf_counter() - started
    assert "coacd" in first.method and not first.cached and second.cached
    assert warm * 10 < cold
    assert second.warnings == first.warnings and second.before == first.before and second.method == first.method
    for a, b in zip(first.pieces, second.pieces, strict=True):
        assert (a.kind, a.size, a.source, a.volume) == (b.kind, b.size, b.source, b.volume)
        np.testing.assert_array_equal(a.vertices, b.vertices)
        np.testing.assert_array_equal(a.faces, b.faces)
        np.testing.assert_array_equal(a.pose, b.pose)


def test_decomposition_is_the_same_on_any_number_of_threads():
    results = [decompose_link([bowl()], HullOptions(cache=False, coacd_threshold=0.4, threads=t)) for t in (1, 2)]
    assert results[0].after == results[1].after
    for a, b in zip(results[0].pieces, results[1].pieces, strict=True):
        np.testing.assert_array_equal(a.vertices, b.vertices)


def box_shape(size=1.0):
    mesh = trimesh.creation.box((size, size, size))
    return Shape("mesh", meshes=[Mesh(np.asarray(mesh.vertices), np.asarray(mesh.faces))])


@pytest.mark.parametrize(
    "damage", [lambda f: f.write_bytes(b"not a zip"), lambda f: f.write_bytes(f.read_bytes()[:90])]
)
def test_a_corrupt_cache_entry_is_ignored_and_replaced(own_cache, damage):
    decompose_link([box_shape()])
    (entry,) = own_cache.rglob("*.npz")
    damage(entry)
    assert not decompose_link([box_shape()]).cached
    assert decompose_link([box_shape()]).cached


def test_other_content_or_other_rules_are_other_entries():
    decompose_link([box_shape()])
    assert not decompose_link([box_shape(1.1)]).cached
    assert not decompose_link([box_shape()], HullOptions(max_hulls=3)).cached
    assert decompose_link([box_shape()], HullOptions(threads=2)).cached


def test_without_cache_nothing_is_written(own_cache):
    decompose_link([box_shape()], HullOptions(cache=False))
    assert not own_cache.exists()


def test_a_cache_that_cannot_be_written_is_no_error(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("in the way")
    monkeypatch.setenv(ENVIRONMENT, str(tmp_path / "file"))
    assert decompose_link([box_shape()]).after == 1
