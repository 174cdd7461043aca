"""Which process of how many: read from the variables that scripts, Slurm and Kubernetes set."""

from __future__ import annotations

import pytest

from ig2mj.cluster.process_topology import ProcessTopology, find_topology, first_host
from ig2mj.errors import ClusterError

SLURM = {
    "SLURM_JOB_ID": "4097",
    "SLURM_STEP_NODELIST": "gpu[011-014],other2",
    "SLURM_NTASKS": "8",
    "SLURM_PROCID": "5",
    "SLURM_LOCALID": "1",
    "SLURM_STEP_TASKS_PER_NODE": "2(x4)",
}


def test_alone_where_nothing_says_otherwise():
    assert find_topology({}) is None
    assert find_topology({**SLURM, "SLURM_NTASKS": "1"}) is None, "one task of Slurm is alone, too"


def test_jaxs_variables():
    given = {"JAX_COORDINATOR_ADDRESS": "node7:1234", "JAX_NUM_PROCESSES": "4", "JAX_PROCESS_ID": "2"}
    assert find_topology(given) == ProcessTopology("node7", 1234, 2, 4)
    assert find_topology({**given, "JAX_COORDINATOR_ADDRESS": "[::1]:99"}) == ProcessTopology("::1", 99, 2, 4)


def test_an_indexed_job_of_kubernetes():
    given = {"JAX_COORDINATOR_ADDRESS": "train-0.train:1234", "JAX_NUM_PROCESSES": "3", "JOB_COMPLETION_INDEX": "1"}
    assert find_topology(given) == ProcessTopology("train-0.train", 1234, 1, 3)


def test_slurms_variables():
    assert find_topology(SLURM) == ProcessTopology("gpu011", 61440 + 1, 5, 8)
    seen = {**SLURM, "CUDA_VISIBLE_DEVICES": "0,1"}
    assert find_topology(seen) == ProcessTopology("gpu011", 61441, 5, 8, (1,)), "two tasks on two visible GPUs"
    assert find_topology({**SLURM, "CUDA_VISIBLE_DEVICES": "0"}).local_devices is None, "Slurm gave each task its own"


@pytest.mark.parametrize(
    ("nodes", "first"),
    [("n1", "n1"), ("n1,n2", "n1"), ("n[3-5]", "n3"), ("a[01,04-06],b", "a01"), ("a-b[7],c", "a-b7")],
)
def test_the_first_host_of_slurms_lists(nodes, first):
    assert first_host(nodes) == first


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"JAX_COORDINATOR_ADDRESS": "node7"}, "HOST:PORT"),
        ({"JAX_PROCESS_ID": "4"}, "process 4 of 4"),
        ({"JAX_PROCESS_ID": "two"}, "JAX_PROCESS_ID is 'two'"),
        ({"JAX_NUM_PROCESSES": None}, "JAX_NUM_PROCESSES is not set"),
        ({"JAX_PROCESS_ID": None}, "JOB_COMPLETION_INDEX is not set"),
    ],
)
def test_bad_variables_are_named(changes, said):
    given = {"JAX_COORDINATOR_ADDRESS": "node7:1234", "JAX_NUM_PROCESSES": "4", "JAX_PROCESS_ID": "2", **changes}
    with pytest.raises(ClusterError, match=said):
        find_topology({name: value for name, value in given.items() if value is not None})
