"""Runs jobs on a Ray cluster (`pip install "ig2mj[cluster]"`).

Before the first job, one task per node reports the versions and a digest of the files there; a node that differs is
named in the error. Jobs of a node that dies are retried on another.
"""

from __future__ import annotations

import contextlib
import functools
import os
import pathlib
import socket
import sys
import urllib.parse
from typing import Any

from ig2mj.cluster.jobs import Job, JobResult, JobSet, import_function, run_job
from ig2mj.cluster.versions import difference, versions
from ig2mj.errors import ClusterError

REACH = 10.0
"""Timeout in seconds for a connection to the address."""

ASK = 180.0
"""Timeout in seconds for a node's report: its first import may read a gigabyte from a network disk."""

AHEAD = 2
"""Jobs in flight per processor, so that a processor never waits for its next job."""


class RayNodes:
    """All nodes of a cluster."""

    def __init__(self, job_set: JobSet, address: str):
        """Connects, and checks every node.

        Raises:
          ClusterError: no cluster at the address, or a node has other versions or files. ModuleNotFoundError: no Ray.
        """
        import ray

        self._ray, self._job_set = ray, job_set
        self._mine = not ray.is_initialized()
        self._quiet = contextlib.ExitStack()
        if self._mine:
            _connect(ray, address)
            # Ray prints node events on standard output, which is for a command's result
            self._quiet.enter_context(contextlib.redirect_stdout(sys.stderr))
        try:
            nodes = _alive(ray)
            self._shared = {name: ray.put(content) for name, content in job_set.shared.items()}
            self._ask(nodes)
            self._resources: dict[str, Any] = {"num_gpus": 1, "num_cpus": 1} if job_set.gpu else {"num_cpus": 1}
            if not self.width:
                what = "a GPU" if job_set.gpu else "a processor for work"
                raise ClusterError(f"no node of the cluster at {address} has {what}")
        except BaseException:
            self.close(now=True)
            raise
        self._task = ray.remote(_task).options(max_retries=0, **self._resources)
        self._busy: dict[Any, Job] = {}

    @property
    def width(self) -> int:
        """Follows the size of the cluster."""
        with contextlib.suppress(Exception):  # Ray may not answer while a node leaves
            there = self._ray.cluster_resources()
            self._width = AHEAD * int(there.get("GPU" if self._job_set.gpu else "CPU", 0))
        return self._width

    _width = 0
    _busy: dict[Any, Job] = {}  # noqa: RUF012  until there is a task

    @property
    def running(self) -> int:
        """Number of submitted jobs without a result."""
        return len(self._busy)

    def submit(self, job: Job) -> None:
        """Submits a job; Ray chooses the node."""
        keys = list(self._shared)
        ref = self._task.remote(
            self._job_set.function, self._job_set.gpu, job.name, dict(job.arguments), keys, *self._shared.values()
        )
        self._busy[ref] = job

    def wait(self) -> list[JobResult]:
        """Waits for at least one result."""
        done, _ = self._ray.wait(list(self._busy), num_returns=1, timeout=None)
        answers = []
        for ref in done:
            job = self._busy.pop(ref)
            try:
                result, error, kind, again, all_fail = self._ray.get(ref)
                answers.append(JobResult(job.name, result, error, kind, again, all_fail))
            except self._ray.exceptions.RayError as e:
                answers.append(JobResult(job.name, error=_line(e), again=True))
        return answers

    def _ask(self, nodes: list[dict[str, Any]]) -> None:
        """Compares every node with this process. Raises ClusterError."""
        from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

        check = self._job_set.check and (self._job_set.check[0], dict(self._job_set.check[1]))
        own, files = versions(), digest_seen(check)
        if not nodes:
            raise ClusterError("the cluster has no node that is alive")
        asked = {}
        for node in nodes:
            on = NodeAffinitySchedulingStrategy(node["NodeID"], soft=False)
            asked[node["NodeID"]] = self._ray.remote(_about).options(
                num_cpus=0, max_retries=1, scheduling_strategy=on
            ).remote(check)  # fmt: skip
        for node in nodes:
            name = f"node {node['NodeManagerHostname']} ({node['NodeManagerAddress']}, {node['NodeID'][:8]})"
            try:
                theirs, seen, error = self._ray.get(asked[node["NodeID"]], timeout=ASK)
            except self._ray.exceptions.GetTimeoutError:
                raise ClusterError(f"{name} has not answered within {ASK:g} s") from None
            except self._ray.exceptions.RayError as e:
                missing = "No module named" in str(e)
                raise ClusterError(f"{name} has no ig2mj of this version" if missing else f"{name}: {_line(e)}") from e
            if other := difference(own, theirs):
                raise ClusterError(f"{name} has {other}")
            if error:
                raise ClusterError(f"{name}: {error}")
            if seen != files:
                raise ClusterError(f"{name} has other files than this machine ({check and check[1]})")

    def close(self, now: bool) -> None:
        """Leaves the cluster. `now`: abort jobs in flight."""
        if now:
            for ref in self._busy:
                with contextlib.suppress(Exception):
                    self._ray.cancel(ref, force=True)
        if self._mine:
            self._ray.shutdown()
        self._quiet.close()


def _task(
    function: str, gpu: bool, name: str, arguments: dict[str, Any], keys: list[str], *shared: bytes
) -> tuple[bytes, str, str, bool, bool]:
    """Runs a job, on a node."""
    if not gpu:
        _leave_gpus_alone()
    answer = run_job(function, Job(name, arguments), dict(zip(keys, shared, strict=True)))
    return answer.result, answer.error, answer.kind, answer.again, answer.all_fail


@functools.cache
def _leave_gpus_alone() -> None:
    from ig2mj.process import use_processor_only

    use_processor_only()


def digest_seen(check: tuple[str, dict[str, Any]] | None) -> str:
    """Result of `JobSet.check` on this machine; "" without one."""
    return "" if check is None else str(import_function(check[0])(**check[1]))


def _about(check: tuple[str, dict[str, Any]] | None) -> tuple[dict[str, str], str, str]:
    """Versions, result of the check, and its error, on a node."""
    try:
        return versions(), digest_seen(check), ""
    except Exception as e:
        return versions(), "", " ".join(str(e).split()) or type(e).__name__


TOKEN = "a cluster that asks for tokens needs RAY_AUTH_MODE=token, and its token in ~/.ray/auth_token"


def check_address(address: str) -> None:
    """Checks that the address of a cluster accepts connections; for "auto", the address that Ray has recorded, if any.

    Raises:
      ClusterError: it does not. ModuleNotFoundError: no Ray.
    """
    import ray  # noqa: F401

    requested, what = address, "there is no answer"
    if address == "auto":  # Ray waits for minutes for a cluster that ended without removing its record
        requested = _recorded()
        if not requested:
            return
        what = f"there is no answer at {requested}, where this machine's last cluster was (`ray start` begins one)"
    parsed = urllib.parse.urlsplit(requested if "://" in requested else f"//{requested}")
    try:
        host, port = parsed.hostname, parsed.port
    except ValueError:
        host = port = None
    if not host or not port:
        raise ClusterError(f"--cluster {address}: an address is HOST:PORT (or ray://HOST:PORT), or auto")
    try:
        socket.create_connection((host, port), REACH).close()
    except OSError as e:
        raise ClusterError(f"--cluster {address}: {what} ({e.strerror or e})") from e


def _recorded() -> str:
    """The address that "auto" means to Ray: that of the environment, or of the last `ray start`; "" without one."""
    folder = pathlib.Path(os.environ.get("RAY_TMPDIR") or "/tmp")
    try:
        return os.environ.get("RAY_ADDRESS") or (folder / "ray" / "ray_current_cluster").read_text().strip()
    except OSError:
        return ""


def _connect(ray: Any, address: str) -> None:
    """Raises ClusterError."""
    check_address(address)
    try:
        ray.init(address=address, namespace="ig2mj", logging_level="ERROR", log_to_driver=False)
    except ConnectionError as e:
        why = "this machine belongs to no cluster (`ray start`)" if address == "auto" else f"{_line(e)} ({TOKEN})"
        raise ClusterError(f"--cluster {address}: {why}") from e
    except RuntimeError as e:  # another version of Ray or Python
        raise ClusterError(f"--cluster {address}: {_line(e)}") from e
    except getattr(ray.exceptions, "AuthenticationError", ()) as e:
        raise ClusterError(f"--cluster {address}: there is no token here ({TOKEN})") from e


def _alive(ray: Any) -> list[dict[str, Any]]:
    return [node for node in ray.nodes() if node["Alive"]]


def _line(error: BaseException) -> str:
    """The start of one of Ray's errors, on one line."""
    text = " ".join(str(error).split()) or type(error).__name__
    return text if len(text) < 200 else f"{text[:200]} ..."
