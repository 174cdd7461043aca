"""A `Simulation` records its control steps, and comes to the same bytes when they are taken again."""

from __future__ import annotations

import subprocess
import sys

import h5py
import numpy as np
import pytest

import ig2mj
from ig2mj.agents import Humanoid
from ig2mj.demos import Recording
from ig2mj.errors import EngineError, InputError

FACING_TABLE = {"pos": (0.3, 0.62, 0.62), "quat": (np.sqrt(0.5), 0, 0, -np.sqrt(0.5))}


def facing_the_table(folder):
    return ig2mj.Simulation(ig2mj.load_scene(folder, agents=[Humanoid(**FACING_TABLE)]), grasping="assisted")


@pytest.fixture(scope="module")
def recorded(tiny_home_folder, tmp_path_factory):
    """Two runs: a robot that acts, and, after something was moved by hand, steps with the last controls."""
    file = tmp_path_factory.mktemp("simulation") / "run.h5"
    simulation, rng = facing_the_table(tiny_home_folder), np.random.default_rng(0)
    simulation.step(count=3)  # not recorded
    with simulation.record(file):
        with pytest.raises(EngineError, match="recorded"):
            simulation.record(file)
        for _ in range(4):
            simulation.robots.act(rng.uniform(-0.5, 0.5, 28))
        simulation.set_state("toggled_on", "stove", True)
        simulation.step(count=5)
    simulation.step()
    return file


def test_frames_are_control_steps_and_changes_by_hand_begin_runs(recorded):
    with Recording(recorded) as recording:
        assert [run.frames for run in recording.runs] == [13, 6]
        on = recording.runs[1].all_rows("frames/states/toggled_on")
        assert on[0].sum() == 1 and not recording.runs[0].all_rows("frames/states/toggled_on").any()
        time = recording.runs[0].all_rows("frames/physics/time")
        assert np.diff(time) == pytest.approx(1 / 30)


def test_the_same_bytes_come_out_again(recorded, tiny_home_folder):
    done = facing_the_table(tiny_home_folder).replay(recorded)
    assert (done.runs, done.frames, done.differences, done.warnings) == (2, 19, [], [])


def test_the_first_difference_is_named(recorded, tiny_home_folder, tmp_path):
    copy = tmp_path / "copy.h5"
    copy.write_bytes(recorded.read_bytes())
    with h5py.File(copy, "a") as opened:
        opened["frames/states/temperature"][:] += np.float32(1e-3)  # pyright: ignore[reportIndexIssue]
    simulation = facing_the_table(tiny_home_folder)
    found = simulation.replay(copy).differences
    assert [d.run for d in found] == ["run_000000", "run_000001"]
    assert {d.field for d in found} <= {"states/temperature", "states/max_temperature"}
    assert found[0].owner in simulation.scene.object_names


def test_what_cannot_come_out_the_same_is_refused(recorded, tiny_home, tiny_home_folder):
    with pytest.raises(InputError, match="cannot be replayed: model_hash was") as refused:
        ig2mj.Simulation(tiny_home).replay(recorded)
    assert "\n" not in str(refused.value)


FRESH = """
import sys
import numpy as np
import ig2mj
from ig2mj.agents import Humanoid

agents = [Humanoid(pos=(0.3, 0.62, 0.62), quat=(np.sqrt(0.5), 0, 0, -np.sqrt(0.5)))]
done = ig2mj.Simulation(ig2mj.load_scene(sys.argv[1], agents=agents), grasping="assisted").replay(sys.argv[2])
print(done.frames, done.differences)
"""


@pytest.mark.slow
def test_a_fresh_process_comes_to_the_same_bytes(recorded, tiny_home_folder):
    command = [sys.executable, "-c", FRESH, str(tiny_home_folder), str(recorded)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.stdout.split(maxsplit=1) == ["19", "[]\n"], done.stderr
