"""Kernels with a guard do nothing where it holds; kernels of few threads do what one thread for each row did."""

from __future__ import annotations

# Warp's kernels are not Python, whatever they look like, so nothing may check them:
# pyright: reportArgumentType=false, reportInvalidTypeForm=false, reportIndexIssue=false, reportGeneralTypeIssues=false
# pyright: reportAssignmentType=false, reportOperatorIssue=false
import numpy as np
import warp as wp

from ig2mj.engine.warp.patches.guarded import guarded, strided

WORLDS, ROWS = 3, 11


@wp.kernel(enable_backward=False)
def _sums(count: wp.array(dtype=int), limit: float, value: wp.array2d(dtype=float), total: wp.array2d(dtype=float)):
    world, row, part = wp.tid()
    if row >= count[world]:
        return
    sum = float(0.0)  # noqa: UP018
    for k in range(row + 1):
        if value[world, k] > limit:
            return
        sum += value[world, k]
    total[world, row] = sum + float(part)


def _arguments():
    value = np.random.default_rng(0).random((WORLDS, ROWS)).astype(np.float32)
    count = np.array([ROWS, 0, 5], np.int32)
    return [wp.array(count, dtype=int), 0.9, wp.array(value, dtype=float)]


def _run(kernel: wp.Kernel, dim: tuple[int, ...], more: list | None = None) -> np.ndarray:
    total = wp.full((WORLDS, ROWS), -1.0, dtype=float)
    wp.launch(kernel, dim=dim, inputs=[*(more or []), *_arguments()], outputs=[total])
    return total.numpy()


def test_few_threads_do_what_a_thread_for_each_row_did_and_leave_loops_where_it_returned(kernel_device):
    expected = _run(_sums, (WORLDS, ROWS, 1))
    assert (expected[0] >= 0).any() and (expected[0] < 0).any(), "some rows end early"
    few = strided(_sums, "row", "count[world]", 4, "ig2mj_test_strided")
    assert np.array_equal(_run(few, (WORLDS, 4)), expected)


def test_a_guarded_kernel_does_nothing_where_the_guard_holds(kernel_device):
    awake = wp.array(np.array([1, 1, 0], np.int32), dtype=int)
    with_guard = guarded(_sums, "awake[world] == 0", {"awake": wp.array(dtype=int)}, {}, module="ig2mj_test_guarded")
    found, expected = _run(with_guard, (WORLDS, ROWS, 1), [awake]), _run(_sums, (WORLDS, ROWS, 1))
    assert np.array_equal(found[:2], expected[:2]) and (found[2] == -1.0).all() and (expected[2] >= 0).any()
