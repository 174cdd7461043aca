"""`find_topology`: rank and number of the processes of a distributed run, from environment variables.

| started by | variables |
|---|---|
| by hand, a script | `JAX_COORDINATOR_ADDRESS` (host:port of process 0), `JAX_NUM_PROCESSES`, `JAX_PROCESS_ID` |
| Kubernetes (an indexed Job) | the first two, and `JOB_COMPLETION_INDEX`, which Kubernetes sets |
| Slurm (`srun`) | its own: `SLURM_JOB_ID`, `SLURM_STEP_NODELIST`, `SLURM_NTASKS`, `SLURM_PROCID`, `SLURM_LOCALID` |
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping

from ig2mj.errors import ClusterError

FIRST_PORT, PORTS = 61440, 4096
"""Range of ports that Slurm job numbers map to, the same as JAX's."""


@dataclasses.dataclass(frozen=True)
class ProcessTopology:
    """One process of a distributed run.

    Attributes:
      host, port: address at which process 0 listens. rank, count: index of this process, number of processes.
      local_devices: indices of this process's devices; None: all visible ones.
    """

    host: str
    port: int
    rank: int
    count: int
    local_devices: tuple[int, ...] | None = None


def find_topology(environ: Mapping[str, str]) -> ProcessTopology | None:
    """The topology that the environment variables describe (see the module); None for a single process.

    Raises:
      ClusterError: a variable is missing or malformed.
    """
    if "JAX_COORDINATOR_ADDRESS" in environ:
        host, port = _address(environ["JAX_COORDINATOR_ADDRESS"])
        index = "JAX_PROCESS_ID" if "JAX_PROCESS_ID" in environ else "JOB_COMPLETION_INDEX"
        return _checked(ProcessTopology(host, port, _number(environ, index), _number(environ, "JAX_NUM_PROCESSES")))
    if "SLURM_STEP_NODELIST" in environ and int(environ.get("SLURM_NTASKS", "1")) > 1:
        job = _number(environ, "SLURM_JOB_ID")
        place = ProcessTopology(
            first_host(environ["SLURM_STEP_NODELIST"]),
            FIRST_PORT + job % PORTS,
            _number(environ, "SLURM_PROCID"),
            _number(environ, "SLURM_NTASKS"),
            _own_devices(environ),
        )
        return _checked(place)
    return None


def first_host(nodes: str) -> str:
    """The first host of a Slurm list: "node[001-004,007],gpu2" is node001."""
    found = re.match(r"([^,\[]+)(?:\[([^,\-\]]+))?", nodes)
    if found is None:
        raise ClusterError(f"SLURM_STEP_NODELIST is '{nodes}', and names no host")
    return found[1] + (found[2] or "")


def _own_devices(environ: Mapping[str, str]) -> tuple[int, ...] | None:
    """Where several tasks of a host all see its GPUs, each uses the one of its local index."""
    if "JAX_LOCAL_DEVICE_IDS" in environ:
        return None  # JAX reads it
    local = _number(environ, "SLURM_LOCALID") if "SLURM_LOCALID" in environ else 0
    per_node = re.match(r"\d+", environ.get("SLURM_STEP_TASKS_PER_NODE", environ.get("SLURM_TASKS_PER_NODE", "1")))
    tasks = int(per_node[0]) if per_node else 1
    visible = [d for d in environ.get("CUDA_VISIBLE_DEVICES", "").split(",") if d]
    return (local,) if tasks > 1 and len(visible) >= tasks else None


def _checked(place: ProcessTopology) -> ProcessTopology:
    if not 0 <= place.rank < place.count:
        raise ClusterError(f"this is process {place.rank} of {place.count}: they are numbered from 0 on")
    return place


def _address(text: str) -> tuple[str, int]:
    host, sign, port = text.rpartition(":")
    if not sign or not host or not port.isdigit():
        raise ClusterError(f"JAX_COORDINATOR_ADDRESS is '{text}', and must be HOST:PORT of process 0")
    return host.strip("[]"), int(port)


def _number(environ: Mapping[str, str], name: str) -> int:
    text = environ.get(name)
    if text is None:
        raise ClusterError(f"{name} is not set: the processes of a run need a number each, and their count")
    if not text.isdigit():
        raise ClusterError(f"{name} is '{text}', and must be a whole number")
    return int(text)
