"""Policies and demonstrations of strangers: what cannot be learned from or played is refused when it is read."""

from __future__ import annotations

import dataclasses
import json
import pathlib
import re

import h5py
import numpy as np
import pytest
from hostile_readers import demonstrations, policies
from limits import run_limited

from ig2mj.demos.collection import FAILED, join_recordings
from ig2mj.errors import InputError
from ig2mj.learn.demos import about, load_demos
from ig2mj.learn.perception import Perception
from ig2mj.learn.policies import Policy
from ig2mj.learn.shipped import CHECKOUT


@pytest.fixture
def demos(tmp_path):
    """A small file of demonstrations."""
    demonstrations(tmp_path)
    return tmp_path / "demos.h5"


def read_demos(file: pathlib.Path) -> None:
    load_demos(file, Perception(about(file)[1]))


def replaced(file: pathlib.Path, name: str, value) -> None:
    with h5py.File(file, "a") as opened:
        del opened[name]
        opened[name] = value


def test_rewards_out_of_another_file_are_not_read(demos, tmp_path):
    with h5py.File(tmp_path / "secret.h5", "w") as secret:
        secret["reward"] = np.ones(4, np.float32)
    raw = tmp_path / "secret.raw"
    raw.write_bytes(np.ones(4, np.float32).tobytes())
    replaced(demos, "steps/reward/total", h5py.ExternalLink(str(tmp_path / "secret.h5"), "/reward"))
    with pytest.raises(InputError, match="steps/reward/total: is missing, or no array of this file"):
        read_demos(demos)
    with h5py.File(demos, "a") as opened:
        del opened["steps/reward/total"]
        opened.create_dataset("steps/reward/total", (4,), "f4", external=[(str(raw), 0, 16)])
    with pytest.raises(InputError, match="steps/reward/total: lies in another file"):
        read_demos(demos)


def test_a_few_bytes_that_claim_gigabytes_are_refused(demos):
    """One row of four megabytes that the index names for every frame of 60 runs."""
    replaced(demos, "obs/proprioception", np.zeros((1, 2**18), np.float32))
    with h5py.File(demos, "a") as opened:
        opened.attrs["spaces"] = json.dumps({"proprioception": [[2**18], "float32"]})
        opened["index"][:, -1] = 0
        column = json.loads(opened.attrs["columns"]).index("obs/proprioception")
        opened["index"][:, column] = 0
        for k in range(2, 60):
            opened[f"run_{k:06d}"] = opened["run_000000"]
    assert demos.stat().st_size < 2**21
    run_limited(read_demos, demos).check(InputError, "claims arrays of .* bytes .*UNPACKED_RATIO")


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("steps/action", np.full((4, 2), np.nan, np.float32), "holds numbers that are not finite"),
        ("steps/reward/total", np.full(4, np.inf, np.float32), "holds numbers that are not finite"),
        ("obs/proprioception", np.full((5, 3), np.nan, np.float32), "holds numbers that are not finite"),
        ("steps/action", np.zeros((4, 3), np.float32), r"is float32\[3\], must be float32\[2\]"),
        ("steps/label", np.zeros((4, 3), np.float32), r"is float32\[3\], must be float32\[2\]"),
        ("obs/proprioception", np.zeros((5, 4), np.float32), r"is float32\[4\], must be float32\[3\]"),
        ("steps/truncated", np.zeros(4), r"is float64\[\], must be bool\[\]"),
        ("steps/action", np.array([[b"a", b"b"]] * 4), "is of type"),
    ],
)
def test_numbers_that_cannot_be_learned_from_are_refused(demos, name, value, says):
    replaced(demos, name, value)
    with pytest.raises(InputError, match=f"{name}: {says}"):
        read_demos(demos)


@pytest.mark.parametrize(
    ("name", "change", "says"),
    [
        ("weights/mean/bias", lambda a: np.full_like(a, np.nan), "holds numbers that are not finite"),
        ("mean", lambda a: np.full_like(a, np.inf), "holds numbers that are not finite"),
        ("deviation", lambda a: 0 * a, "must be as long as its mean, and positive"),
        ("deviation", lambda a: a[:-1], "must be as long as its mean, and positive"),
        ("weights/mean/bias", lambda a: a.astype(str), "is of type <U"),
    ],
)
def test_policies_with_numbers_that_cannot_be_played_are_refused(tmp_path, name, change, says):
    file = changed_policy(tmp_path, name, change)
    with pytest.raises(InputError, match=f"{re.escape(name)}: {says}"):
        Policy.load(file)


def test_weights_that_do_not_fit_the_card_are_named(tmp_path):
    reader = policies(tmp_path)
    file = changed_policy(tmp_path, "weights/mean/kernel", lambda a: a[:-1])
    with pytest.raises(InputError, match="its arrays do not fit its card"):
        reader.read(file.read_bytes())


@pytest.mark.parametrize("task", ["activity/own.bddl", "ig2mj/activity/own.bddl-v0", "../own.bddl"])
def test_a_policy_does_not_name_a_file_as_its_task(tmp_path, task):
    def renamed(card):
        text = json.loads(card.tobytes())
        text["depends"]["task"] = task
        return np.frombuffer(json.dumps(text).encode(), np.uint8)

    with pytest.raises(InputError, match=r"card\.json: depends\.task: .* is the path of a file"):
        Policy.load(changed_policy(tmp_path, "card.json", renamed))


def test_parts_of_demonstrations_are_joined_only_from_their_own_content(demos, tmp_path):
    with h5py.File(demos, "a") as opened:
        opened.attrs[FAILED] = 2
    good = demos.read_bytes()
    assert join_recordings([good, good], tmp_path / "whole.h5") == (4, 4)
    whole = load_demos(tmp_path / "whole.h5", Perception(about(tmp_path / "whole.h5")[1]))
    assert whole.action.shape == (16, 2) and int(whole.terminated.sum()) == 4
    replaced(demos, "steps/action", h5py.ExternalLink("secret.h5", "/a"))
    with pytest.raises(InputError, match="steps/action: is missing, or no array of this file"):
        join_recordings([demos.read_bytes()], tmp_path / "whole.h5")
    with pytest.raises(InputError, match="is not an HDF5 file"):
        join_recordings([good[:500]], tmp_path / "whole.h5")


def changed_policy(folder: pathlib.Path, name: str, change) -> pathlib.Path:
    file = folder / "changed.npz"
    file.write_bytes(policies(folder).valid)
    with np.load(file) as archive:
        arrays = dict(archive)
    np.savez(file, **(arrays | {name: change(arrays[name])}))
    return file


@pytest.mark.parametrize("net", [{"net": "places"}, {"net": "paper"}, {"net": "glimpses", "objects": 0}])
def test_a_policy_with_an_encoder_of_version_0_1_names_the_version_that_reads_it(net, tmp_path):
    policy = Policy.load(CHECKOUT / "CookingMeat.npz")
    card = {**policy.card, "net": {**policy.card["net"], **net}}
    dataclasses.replace(policy, card=card).save(tmp_path / "old.npz")
    with pytest.raises(InputError, match=r"ig2mj 0\.1\.0 reads it"):
        Policy.load(tmp_path / "old.npz")
