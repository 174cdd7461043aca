"""Checkpoints that cannot be read are skipped for the one before, and what others still write stays."""

from __future__ import annotations

import json
import os
import time

import numpy as np
import pytest

pytest.importorskip("orbax.checkpoint")

from ig2mj.files.heartbeat import DEAD, identity
from ig2mj.learn.checkpoints import SIGN, Checkpoints

DEPENDS = {"task": "reach"}
TREE = {"weights": np.arange(6.0, dtype=np.float32).reshape(2, 3), "step": np.int32(3)}


@pytest.fixture
def kept(tmp_path):
    """Two checkpoints, 1 and 2."""
    checkpoints = Checkpoints(tmp_path)
    for number in (1, 2):
        checkpoints.save(number, TREE, {"depends": DEPENDS, "iteration": number})
    return checkpoints


@pytest.mark.parametrize("text", ["{}", "[]", "null", "", '{"depends": 3}', "\ud800", "[" * 5000, '{"depends": null}'])
def test_a_broken_meta_file_costs_its_own_checkpoint(kept, text, capsys):
    (kept.folder / "2" / "meta.json").write_bytes(text.encode("utf-8", "surrogatepass"))
    found = kept.newest(TREE, DEPENDS)
    assert found is not None and found[1]["iteration"] == 1
    np.testing.assert_array_equal(found[0]["weights"], TREE["weights"])
    assert "the checkpoint before it is taken" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["²", "٣", "03", "9" * 5000, "-1", "1e3"])
def test_folders_whose_names_are_no_numbers_are_none_of_a_run(kept, name):
    if len(name) < 200:
        (kept.folder / name).mkdir()
    assert kept.numbers() == [1, 2]
    found = kept.newest(TREE, DEPENDS)
    assert found is not None and found[1]["iteration"] == 2


def test_arrays_of_other_shapes_and_types_are_not_unpacked(kept, capsys):
    """64 KB of a checkpoint can claim any amount of memory."""
    for number, weights in ((3, np.zeros((3000, 3000), np.float32)), (4, np.zeros((2, 3), np.complex64))):
        kept.save(number, TREE | {"weights": weights}, {"depends": DEPENDS, "iteration": number})
    found = kept.newest(TREE, DEPENDS)
    assert found is not None and found[1]["iteration"] == 2
    said = capsys.readouterr().err
    assert "float32[3000, 3000], and float32[2, 3] is expected" in said and "complex64" in said


def test_what_another_machine_still_writes_stays_until_it_is_silent(kept):
    foreign = json.dumps({"boot": "another", "namespace": "pid:[1]", "process": 1, "started": "5"})
    folders = {name: kept.folder / name for name in (".3.foreign.part", ".4.ended.part")}
    for name, folder in folders.items():
        folder.mkdir()
        ended = json.dumps(identity() | {"process": 4194305})  # no process of Linux has this number
        (folder / SIGN).write_text(foreign if "foreign" in name else ended)
    kept.save(5, TREE, {"depends": DEPENDS})
    assert [folder.exists() for folder in folders.values()] == [True, False]
    os.utime(folders[".3.foreign.part"] / SIGN, (time.time() - DEAD - 5,) * 2)
    kept.save(6, TREE, {"depends": DEPENDS})
    assert sorted(f.name for f in kept.folder.iterdir()) == ["2", "5", "6"]
