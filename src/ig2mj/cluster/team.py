"""`Team`: the processes of one training run, on one host or on several, and the messages between them.

Process 0 listens at the coordinator's address. The others connect, and all compare versions before JAX is initialized.
The connections stay open for heartbeats, for barriers, and for the message that a process has died, which ends all
others with one line that names it. JAX's own watchdog takes minutes and ends processes without a readable message.

Messages are lines of JSON. What the processes compute goes over JAX's own network, never over this one.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import socket
import sys
import threading
import time
import traceback
from collections.abc import Iterator
from typing import Any

from ig2mj.cluster.process_topology import ProcessTopology
from ig2mj.cluster.versions import versions
from ig2mj.errors import ClusterError, Ig2mjError

BEAT = 3.0
"""Seconds between two heartbeats of a process."""

SILENCE = 40.0
"""Seconds without a heartbeat after which a process counts as dead; a closed connection counts at once."""

GRACE = 5.0
"""Seconds that a process with an error of its own waits to hear whether another one's death is the reason."""

PATIENCE = 300.0
"""Seconds that processes wait for one another at the start."""

THE_END = "the end"
"""The last barrier: a process that has reached it may end."""


class Team:
    """The processes of a run. Attributes: rank: of this one, from 0 on. count: how many there are."""

    def __init__(self, rank: int = 0, count: int = 1):
        """A team of one, unless `join` makes it larger."""
        self.rank, self.count = rank, count
        self.names = {0: _name(0, os.getpid(), socket.gethostname())}
        self._links: dict[int, _Link] = {}
        self._came: dict[str, set[int]] = {}
        self._past: dict[str, queue.SimpleQueue[Any]] = {}
        self._lock = threading.Lock()
        self._ending = False
        self._turn = 0

    @property
    def first(self) -> bool:
        """Whether this process is the one that writes files and reports."""
        return self.rank == 0

    @classmethod
    def join(cls, place: ProcessTopology | None, patience: float = PATIENCE) -> Team:
        """Waits for all processes, and initializes `jax.distributed`; to be called before JAX is first used.

        Args:
          place: topology of this process (`process_topology.find_topology`); None: there is no other process.

        Raises:
          ClusterError: a process is missing, cannot be reached, or has other versions.
        """
        if place is None or place.count == 1:
            return cls()
        team = cls(place.rank, place.count)
        own = {"rank": place.rank, "count": place.count, "pid": os.getpid(), "host": socket.gethostname(), **versions()}
        team.names[place.rank] = _name(place.rank, own["pid"], own["host"])
        port = team._gather(place, own, patience) if place.rank == 0 else team._connect(place, own, patience)
        for link in team._links.values():
            threading.Thread(target=team._listen, args=(link,), name="ig2mj-team", daemon=True).start()
        threading.Thread(target=team._beat, name="ig2mj-beat", daemon=True).start()
        import jax

        jax.distributed.initialize(
            f"{place.host}:{port}",
            place.count,
            place.rank,
            place.local_devices,
            cluster_detection_method="deactivate",
            initialization_timeout=int(patience),
            shutdown_timeout_seconds=10,
        )
        jax.devices()
        team.barrier("devices")
        from jax.experimental.multihost_utils import sync_global_devices

        sync_global_devices("ig2mj")  # connects them now: later on one may be minutes ahead, and gloo waits for 30 s
        return team

    # Waiting for each other.

    def barrier(self, name: str, value: Any = None) -> Any:
        """Returns in every process once all have come to the barrier of this name: the value that process 0 gave.

        A name is used once. `value`: for JSON.
        """
        if self.count == 1:
            return value
        answer = self._queue(name)
        if self.first:
            self._arrived(0, name)
            answer.get()
            for link in self._links.values():
                link.send(past=name, value=value)
            return value
        self._links[0].send(at=name)
        return answer.get()

    @contextlib.contextmanager
    def turns(self) -> Iterator[None]:
        """Process 0 does what is inside first; the others wait, and find what it left in caches.

        All processes must call this equally often.
        """
        name, self._turn = f"turn {self._turn}", self._turn + 1
        if not self.first:
            self.barrier(name)
        yield
        if self.first:
            self.barrier(name)

    @contextlib.contextmanager
    def together(self) -> Iterator[None]:
        """An error inside ends all processes of the team, each with one line; at the end all leave together."""
        try:
            yield
        except BaseException as e:
            if self.count == 1:
                raise
            time.sleep(GRACE)  # if another one's death is the reason, the line about it ends this process here
            line = " ".join(str(e).split()) or type(e).__name__
            self._tell(f"{self.names[self.rank]} failed: {line}")
            if not isinstance(e, Ig2mjError):
                traceback.print_exc()
            _leave(line, 2 if isinstance(e, Ig2mjError) else 1)
        if self.count > 1:
            self.barrier(THE_END)
            with self._lock:
                self._ending = True
            import jax

            jax.distributed.shutdown()
            for link in self._links.values():
                link.close()

    # Coming together.

    def _gather(self, place: ProcessTopology, own: dict[str, Any], patience: float) -> int:
        """Process 0 takes in the others; the port of JAX's coordinator."""
        until = time.monotonic() + patience
        try:
            server = socket.create_server(("", place.port), backlog=place.count)
        except OSError as e:
            raise ClusterError(f"process 0 cannot listen at port {place.port}: {e.strerror or e}") from e
        with server:
            server.settimeout(1.0)
            while len(self._links) < place.count - 1:
                try:
                    link = _Link(server.accept()[0])
                except TimeoutError:
                    if time.monotonic() > until:
                        lacking = sorted(set(range(1, place.count)) - set(self._links))
                        few = ", ".join(map(str, lacking[:8])) + (" ..." if len(lacking) > 8 else "")
                        reason = f"processes {few} of {place.count} have not come within {patience:g} s"
                        self._refuse(reason)
                        raise ClusterError(reason) from None
                    continue
                hello = link.receive(10.0)
                if hello is None or "rank" not in hello:
                    link.close()  # somebody else, at the wrong port
                    continue
                reason = self._wrong(own, hello)
                if reason:
                    self._refuse(reason, link)
                    raise ClusterError(reason)
                link.rank = hello["rank"]
                self._links[link.rank] = link
                self.names[link.rank] = _name(link.rank, hello["pid"], hello["host"])
        with socket.create_server(("", 0)) as free:
            port = int(free.getsockname()[1])
        for link in self._links.values():
            link.send(go=port, names=self.names)
        return port

    def _wrong(self, own: dict[str, Any], hello: dict[str, Any]) -> str | None:
        who = _name(hello["rank"], hello.get("pid", 0), hello.get("host", "?"))
        if hello["rank"] in self._links or not 0 < hello["rank"] < self.count:
            return f"{who} has the number of another process, or one beyond {self.count - 1}"
        for what in ("count", *versions()):
            if hello.get(what) != own[what]:
                return f"{who} has {what} {hello.get(what)}, and process 0 has {own[what]}"
        return None

    def _refuse(self, reason: str, *more: _Link) -> None:
        for link in (*self._links.values(), *more):
            with contextlib.suppress(OSError):
                link.send(refused=reason)

    def _connect(self, place: ProcessTopology, own: dict[str, Any], patience: float) -> int:
        """The others come to process 0; the port of JAX's coordinator."""
        until, why = time.monotonic() + patience, "there is no answer"
        while time.monotonic() < until:
            try:
                link = _Link(socket.create_connection((place.host, place.port), timeout=5.0))
                link.send(**own)
            except OSError as e:
                why = e.strerror or str(e)
                time.sleep(0.2)
                continue
            answer = link.receive(until - time.monotonic())
            if answer is None:
                why = "it closed the connection"
                time.sleep(0.2)
                continue
            if "refused" in answer:
                raise ClusterError(answer["refused"])
            self._links[0], link.rank = link, 0
            self.names |= {int(rank): name for rank, name in answer["names"].items()}
            return answer["go"]
        raise ClusterError(f"process 0 cannot be reached at {place.host}:{place.port}: {why}")

    # Staying together.

    def _listen(self, link: _Link) -> None:
        """Reads what one process says until it leaves."""
        while True:
            message = link.receive(SILENCE)
            if message is None:
                with self._lock:
                    if self._ending or link.rank in self._came.get(THE_END, ()):
                        return
                self._end(f"{self.names.get(link.rank, link.rank)} died")
                return
            if "at" in message:
                self._arrived(link.rank, message["at"])
            elif "past" in message:
                if message["past"] == THE_END:
                    with self._lock:
                        self._ending = True
                self._queue(message["past"]).put(message["value"])
            elif "ended" in message:
                self._end(message["ended"])

    def _beat(self) -> None:
        while not self._ending:
            for link in list(self._links.values()):
                with contextlib.suppress(OSError):
                    link.send(beat=1)
            time.sleep(BEAT)

    def _arrived(self, rank: int, name: str) -> None:
        with self._lock:
            came = self._came.setdefault(name, set())
            came.add(rank)
            complete = len(came) == self.count
        if complete:
            self._queue(name).put(None)

    def _queue(self, name: str) -> queue.SimpleQueue[Any]:
        with self._lock:
            return self._past.setdefault(name, queue.SimpleQueue())

    def _end(self, line: str) -> None:
        """Tells the others why the run is over, and ends this process."""
        if self._tell(line):
            _leave(f"training stopped: {line}", 1)

    def _tell(self, line: str) -> bool:
        """Tells the others why the run is over; False where it was over already."""
        with self._lock:
            if self._ending:
                return False
            self._ending = True
        for link in self._links.values():
            with contextlib.suppress(OSError):
                link.send(ended=line)
        return True


class _Link:
    """One end of a connection: lines of JSON."""

    def __init__(self, connection: socket.socket):
        self.rank = -1
        self._connection, self._read, self._lock = connection, b"", threading.Lock()
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def send(self, **message: Any) -> None:
        """Raises OSError."""
        with self._lock:
            self._connection.sendall(json.dumps(message).encode() + b"\n")

    def receive(self, seconds: float) -> dict[str, Any] | None:
        """The next line; None where the other end is gone, or silent for so long."""
        until = time.monotonic() + seconds
        while b"\n" not in self._read:
            try:
                self._connection.settimeout(max(until - time.monotonic(), 0.01))
                more = self._connection.recv(65536)
            except OSError:
                return None
            if not more or len(self._read) > 1_000_000:
                return None
            self._read += more
        line, self._read = self._read.split(b"\n", 1)
        try:
            found = json.loads(line)
        except ValueError:
            return None
        return found if isinstance(found, dict) else None

    def close(self) -> None:
        with contextlib.suppress(OSError):
            self._connection.close()


def _leave(line: str, status: int) -> None:
    """Ends this process at once: its main thread may wait in a collective program for a process that is no more."""
    sys.stdout.flush()
    print(f"error: {line}", file=sys.stderr, flush=True)
    os._exit(status)


def _name(rank: int, pid: int, host: str) -> str:
    return f"process {rank} (pid {pid} on {host})"
