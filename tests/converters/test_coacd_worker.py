"""Convex decomposition may hang, crash or be repeated: the converter goes on, and does no work twice."""

import pathlib
import resource
import subprocess
import sys
import time

import numpy as np
import pytest
import trimesh
from ig2mj_converters.base.cache_folder import ENVIRONMENT
from ig2mj_converters.base.description import Mesh, Shape
from ig2mj_converters.hulls import coacd_process
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


def wait_for(condition, seconds=20):
    """What the condition returns once it is true, or after so many seconds."""
    end = time.monotonic() + seconds
    while not (found := condition()) and time.monotonic() < end:
        time.sleep(0.05)
    return found


def alive(process):
    try:
        return "(zombie)" not in pathlib.Path(f"/proc/{process}/status").read_text()
    except FileNotFoundError:
        return False


def use_worker(monkeypatch, code):
    monkeypatch.setattr(coacd_process, "COMMAND", (sys.executable, "-c", code))


@pytest.mark.slow
def test_a_hanging_worker_is_stopped_and_one_hull_stands_in(monkeypatch):
    use_worker(monkeypatch, "while True: pass")
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    result = decompose_link([bowl()], HullOptions(time_limit=0.8))
    assert resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before < 5  # three tries of one second
    assert result.method == "fallback" and result.after == 1
    assert any("took longer than 1 s of processor time" in w for w in result.warnings)
    assert any("a single hull" in w for w in result.warnings)


def test_a_worker_that_sleeps_for_ever_is_stopped_too(monkeypatch):
    use_worker(monkeypatch, "import time; time.sleep(60)")
    monkeypatch.setattr(coacd_process, "ASLEEP_FACTOR", 0.0)
    monkeypatch.setattr(coacd_process, "ASLEEP_GRACE", 0.5)
    result = decompose_link([bowl()], HullOptions(cache=False))
    assert result.stopped and sum("did not end" in w for w in result.warnings) == 3


def test_a_busy_machine_does_not_shorten_the_time_limit(monkeypatch, tmp_path):
    """The limit is processor time: a worker that mostly waits for the processor may take longer by the clock."""
    slow = "import sys, time, numpy; time.sleep(1.5); numpy.savez(sys.argv[2], count=1, piece_0=numpy.eye(4, 3))"
    use_worker(monkeypatch, slow)
    pieces = coacd_process.run_coacd(np.zeros((3, 3)), np.zeros((1, 3), int), {}, cpu_limit=1)
    assert len(pieces) == 1


def test_coacd_ends_when_the_converter_is_killed(tmp_path):
    """The worker notices the end of its standard input, whatever ended the process at the other end."""
    out = tmp_path / "pid"
    code = f"import os, time; open({str(out)!r}, 'w').write(str(os.getpid())); time.sleep(60)"
    hang = f"import threading; from ig2mj_converters.hulls import coacd_process as c; threading.Thread(target=c._end_with_parent, daemon=True).start(); {code}"  # noqa: E501
    parent = (
        "import sys, numpy; from ig2mj_converters.hulls import coacd_process as c;"
        f"c.COMMAND = (sys.executable, '-c', {hang!r});"
        "c.run_coacd(numpy.zeros((3, 3)), numpy.zeros((1, 3), int), {}, cpu_limit=60)"
    )
    process = subprocess.Popen([sys.executable, "-c", parent])
    child = int(wait_for(lambda: out.read_text() if out.exists() else ""))
    process.kill()
    process.wait()
    assert wait_for(lambda: not alive(child))


@pytest.mark.slow
@pytest.mark.parametrize("mishap", ["while True: pass", "import os; os.abort()"])
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
    cube = 0.05 * np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (-1, 0)], float)

    def picky(vertices, faces, parameters, *, cpu_limit, threads):
        tried.append(parameters["threshold"])
        if len(tried) == 1:
            raise coacd_process.DecompositionError("crashed (signal 11)")
        return [cube]

    monkeypatch.setattr(coacd_process, "run_coacd", picky)
    result = decompose_link([bowl()], HullOptions(cache=False))
    assert tried == [0.05, 0.1] and result.method == "coacd" and len(result.warnings) == 1


def test_an_exception_in_the_worker_is_told_in_one_line(monkeypatch):
    use_worker(monkeypatch, "raise RuntimeError('no luck')")
    with pytest.raises(coacd_process.DecompositionError, match="no luck"):
        coacd_process.run_coacd(np.zeros((3, 3)), np.zeros((1, 3), int), {}, cpu_limit=30)


@pytest.mark.slow
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


@pytest.mark.slow
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
