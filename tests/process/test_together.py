"""Requests of a block are carried out together."""

from __future__ import annotations

import threading

import pytest

from ig2mj.process.together import Together


class Asked:
    cancelled = False

    def cancel(self) -> None:
        self.cancelled = True


def test_requests_of_a_block_are_carried_out_at_its_end_and_without_one_at_once():
    done, together = [], Together()
    together.add(done.append, "alone")
    with together.block():
        together.add(done.append, "first")
        with together.block():
            together.add(done.append, "second")
        assert done == [["alone"]] and together.active
        other = threading.Thread(target=together.add, args=(done.append, "of another thread"))
        other.start()
        other.join()
    assert done == [["alone"], ["of another thread"], ["first", "second"]] and not together.active


def test_what_is_needed_before_the_end_is_carried_out_then_and_once():
    done, together = [], Together()
    together.flush()
    with together.block():
        together.add(done.append, "first")
        together.flush()
        assert done == [["first"]]
        together.add(done.append, "second")
    assert done == [["first"], ["second"]]


def test_a_block_that_raises_cancels_its_requests():
    done, asked, together = [], Asked(), Together()
    with pytest.raises(ZeroDivisionError), together.block():
        together.add(done.append, asked)
        _ = 1 // 0
    assert asked.cancelled and not done and not together.active
