"""robomimic's own dataset reads what `ig2mj demos export --to robomimic` wrote."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
import robomimic.utils.obs_utils as obs_utils
from ig2mj_command import ig2mj
from robomimic.utils.dataset import SequenceDataset

TASK, NAMES = "GraspingBook", ("privileged_state", "proprioception")


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    file = tmp_path_factory.mktemp("robomimic") / "robomimic.h5"
    ig2mj("demos", "export", TASK, "--to", "robomimic", "--out", file)
    return file


def test_robomimics_dataset_has_every_step_with_what_comes_next(exported):
    obs_utils.initialize_obs_utils_with_obs_specs(
        [{"obs": {"low_dim": list(NAMES), "rgb": [], "depth": [], "scan": []}}]
    )
    with h5py.File(exported) as opened:
        total = int(opened["data"].attrs["total"])
        first = {name: np.asarray(opened[f"data/demo_0/{name}"]) for name in ("actions", "dones")}
        after = np.asarray(opened["data/demo_0/next_obs/privileged_state"])
    data = SequenceDataset(
        str(exported),
        obs_keys=NAMES,
        dataset_keys=("actions", "rewards", "dones"),
        seq_length=3,
        load_next_obs=True,
        hdf5_cache_mode=None,
    )
    assert len(data) == total and data.n_demos == 32
    item = data[0]
    assert np.array_equal(item["actions"], first["actions"][:3]) and item["dones"].shape[0] == 3
    assert np.array_equal(item["next_obs"]["privileged_state"], after[:3])
    assert item["obs"]["proprioception"].shape[0] == 3 and np.isfinite(item["obs"]["proprioception"]).all()
