"""LeRobot's own loader reads what `ig2mj demos export --to lerobot` wrote, and PyTorch learns from it."""

from __future__ import annotations

import json

import numpy as np
import pytest
import torch
from ig2mj_command import ig2mj, run
from lerobot.datasets.lerobot_dataset import LeRobotDataset

TASK = "GraspingBook"


@pytest.fixture(scope="module")
def filmed(tmp_path_factory):
    """Two short episodes with pictures."""
    folder = tmp_path_factory.mktemp("lerobot")
    rollout = ("rollout", TASK, "--agent", "expert", "--engine", "native", "--worlds", 1, "--pool-size", 2)
    ig2mj(*rollout, "--episodes", 2, "--record", folder / "runs.h5")
    names = "proprioception,privileged_state,rgb"
    ig2mj("demos", "export", folder / "runs.h5", "--to", "lerobot", "--out", folder / "set", "--obs", names)
    return folder / "set"


def test_lerobots_loader_reads_every_step_and_its_pictures(filmed):
    info = json.loads((filmed / "meta/info.json").read_text())
    data = LeRobotDataset("ig2mj/test", root=filmed, video_backend="pyav")  # torchcodec wants the system's FFmpeg
    assert (data.num_episodes, data.num_frames, data.fps) == (2, info["total_frames"], 10)
    assert data.meta.camera_keys == ["observation.images.rgb"]
    lengths = [data.meta.episodes[k]["length"] for k in range(2)]
    for index in (0, lengths[0] - 1, lengths[0], data.num_frames - 1):
        item = data[index]
        assert item["index"] == index and item["episode_index"] == int(index >= lengths[0])
        picture = item["observation.images.rgb"]
        assert picture.shape == (3, *info["features"]["observation.images.rgb"]["shape"][:2])
        assert picture.dtype == torch.float32 and 0.05 < picture.mean() < 0.95 and picture.std() > 0.02
        assert torch.isfinite(item["observation.state"]).all()
        assert item["action"].shape == tuple(info["features"]["action"]["shape"])
        assert item["task"] == data.meta.tasks.iloc[0].name and item["task"]
    assert bool(data[data.num_frames - 1]["next.success"]) and not bool(data[0]["next.done"])
    assert set(data.meta.stats["action"]) >= {"min", "max", "mean", "std", "count"}


def test_windows_of_actions_stay_in_their_episode(filmed):
    """Policies such as ACT ask for the next steps' actions."""
    data = LeRobotDataset(
        "ig2mj/test", root=filmed, video_backend="pyav", delta_timestamps={"action": [k / 10 for k in range(8)]}
    )
    last = data.meta.episodes[0]["length"] - 1
    item = data[last]
    assert item["action"].shape[0] == 8 and item["action_is_pad"].tolist() == [False] + [True] * 7
    assert torch.equal(data[0]["action"][1], data[1]["action"][0])


def test_a_policy_that_pytorch_clones_is_as_good_as_ours(tmp_path):
    """On the demonstrations that ship; both are played on the same held-out start states."""
    ig2mj("demos", "export", TASK, "--to", "lerobot", "--out", tmp_path / "set")
    columns = LeRobotDataset("ig2mj/test", root=tmp_path / "set").hf_dataset.with_format("torch")
    seen = torch.cat([columns["observation.state"][:], columns["observation.environment_state"][:]], 1).float()
    action = columns["action"][:].float()
    mean, std = seen.mean(0), seen.std(0) + 1e-3
    torch.manual_seed(0)
    torch.set_num_threads(1)  # small layers; on a busy machine threads only wait for each other
    layers = [torch.nn.Linear(seen.shape[1], 256), torch.nn.ReLU(), torch.nn.Linear(256, 256), torch.nn.ReLU()]
    network = torch.nn.Sequential(*layers, torch.nn.Linear(256, action.shape[1]), torch.nn.Tanh())
    adam = torch.optim.Adam(network.parameters(), 1e-3)
    for _ in range(6000):
        rows = torch.randint(len(seen), (256,))
        loss = (network((seen[rows] - mean) / std) - action[rows]).square().mean()
        adam.zero_grad()
        loss.backward()
        adam.step()
    layers = [layer for layer in network if isinstance(layer, torch.nn.Linear)]
    arrays = {"mean": mean, "std": std}
    for k, layer in enumerate(layers):
        arrays |= {f"w{k}": layer.weight.T, f"b{k}": layer.bias}
    np.savez(tmp_path / "policy.npz", **{name: array.detach().numpy() for name, array in arrays.items()})
    found = json.loads(run("tests/interop/support/play_policy.py", TASK, tmp_path / "policy.npz").splitlines()[-1])
    ours = int(run("examples/imitate.py", TASK).split("; ")[-1].split()[0])
    print(f"{TASK}: of 32 held-out episodes {found['success']} succeed with PyTorch's policy and {ours} with ours")
    assert found["episodes"] == 32
    assert found["success"] >= ours - 4, (found, ours)
