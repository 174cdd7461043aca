"""Runs a function in a process of its own, under limits of processor time and memory, and measures what it took.

    outcome = run_limited(read_scene, folder)       # a function of a module, and arguments that can be pickled
    outcome.check(InputError, "scene.xml.*height field")

A server process imports the function's module once and forks for each call, so that a call costs a few milliseconds
and what it takes is measured against a process that has everything imported. Linux only.
"""

from __future__ import annotations

import atexit
import contextlib
import dataclasses
import os
import pathlib
import pickle
import re
import resource
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Callable
from typing import Any

SECONDS = 20
"""Processor time that a reader may take for the worst of inputs."""
MEMORY = 2**30
"""Bytes of resident memory that a reader may take above what the process has at the start."""


@dataclasses.dataclass
class Outcome:
    """What a call came to.

    Attributes:
      value: what the function returned, or None.
      error: what it raised, or None; an exception that cannot be pickled comes as a RuntimeError of its text.
      trace: the error's traceback, as text.
      killed: the name of the signal that ended the process (SIGXCPU: processor time, SIGKILL: time), or "".
      seconds: processor time. memory: resident bytes at the peak above those at the start.
    """

    value: Any = None
    error: BaseException | None = None
    trace: str = ""
    killed: str = ""
    seconds: float = 0.0
    memory: int = 0

    def check(self, error: type[BaseException] | None = None, match: str = "") -> Outcome:
        """Asserts that the call kept the limits and raised this error, or none, with a message that `match` finds."""
        spent = f"{self.seconds:.1f} s, {self.memory / 2**20:.0f} MiB"
        assert not self.killed, f"ended by {self.killed} after {spent}"
        assert self.memory <= MEMORY, f"took {spent}"
        if error is None:
            assert self.error is None, self.trace
        else:
            assert self.error is not None, f"no {error.__name__}; returned {self.value!r:.200}"
            assert isinstance(self.error, error), self.trace
            assert re.search(match, str(self.error)), f"'{match}' is not in: {self.error}"
            assert "\n" not in str(self.error), "the message has several lines"
        return self


def run_limited(
    function: Callable[..., Any], *args: Any, seconds: int = SECONDS, memory: int = MEMORY, **kwargs: Any
) -> Outcome:
    """Calls a function of a module under limits. Nested functions and lambdas cannot be sent."""
    return _server().call((function.__module__, function.__qualname__), args, kwargs, seconds, memory)


class _Server:
    """The process that forks for each call."""

    def __init__(self):
        paths = os.pathsep.join(p for p in (str(pathlib.Path(__file__).parent), *sys.path) if p)
        environment = os.environ | {"PYTHONPATH": paths, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        self.process = subprocess.Popen(
            [sys.executable, "-c", "import limits; limits.serve()"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=environment,
        )
        atexit.register(self.stop)

    def call(self, name: tuple[str, str], args: tuple, kwargs: dict, seconds: int, memory: int) -> Outcome:
        stdin, stdout = self.process.stdin, self.process.stdout
        assert stdin is not None and stdout is not None
        module = sys.modules[name[0]]
        request = (name, getattr(module, "__file__", None), pickle.dumps((args, kwargs)), seconds, memory)
        pickle.dump(request, stdin)
        stdin.flush()
        return pickle.load(stdout)

    def stop(self) -> None:
        with contextlib.suppress(OSError):
            self.process.communicate()


_servers: list[_Server] = []


def _server() -> _Server:
    if not _servers or _servers[-1].process.poll() is not None:
        _servers.append(_Server())
    return _servers[-1]


def serve() -> None:
    """The server's loop: requests on standard input, outcomes on standard output."""
    requests = sys.stdin.buffer
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what readers print is not an answer
    while True:
        try:
            name, file, packed, seconds, memory = pickle.load(requests)
        except EOFError:
            return
        try:
            function = _find(name, file)
            args, kwargs = pickle.loads(packed)
        except Exception as e:
            outcome = Outcome(error=RuntimeError(f"{name[1]} cannot be called: {e}"), trace=traceback.format_exc())
        else:
            outcome = _forked(function, args, kwargs, seconds, memory)
        pickle.dump(outcome, answers)
        answers.flush()


def _find(name: tuple[str, str], file: str | None) -> Callable[..., Any]:
    """The function, out of a module that pytest may have imported under a name of its own."""
    import importlib
    import importlib.util

    if name[0] not in sys.modules:
        try:
            importlib.import_module(name[0])
        except ModuleNotFoundError:
            spec = importlib.util.spec_from_file_location(name[0], str(file))
            assert spec is not None and spec.loader is not None
            sys.modules[name[0]] = module = importlib.util.module_from_spec(spec)
            spec.loader.exec_module(module)
    found: Any = sys.modules[name[0]]
    for part in name[1].split("."):
        found = getattr(found, part)
    return found


def _forked(function: Callable[..., Any], args: tuple, kwargs: dict, seconds: int, memory: int) -> Outcome:
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        _answer(writing, function, args, kwargs, seconds, memory)
    os.close(writing)
    with os.fdopen(reading, "rb") as pipe:
        raw = pipe.read()
    _, status, usage = os.wait4(child, 0)
    outcome, start = pickle.loads(raw) if raw else (Outcome(), 0)
    if os.WIFSIGNALED(status):
        outcome.killed = signal.Signals(os.WTERMSIG(status)).name
    elif not raw:
        outcome.killed = f"exit status {os.waitstatus_to_exitcode(status)}"
    outcome.seconds = usage.ru_utime + usage.ru_stime
    outcome.memory = max(usage.ru_maxrss * 1024 - start, 0) if start else 0
    return outcome


def _answer(pipe: int, function: Callable[..., Any], args: tuple, kwargs: dict, seconds: int, memory: int) -> None:
    """In the forked process: limits, the call, its outcome. Does not return."""
    start = _resident()
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.alarm(6 * seconds)  # what sleeps takes no processor time
    room = _address_space() + 2 * memory  # address space is not all used: the measured peak is what counts
    resource.setrlimit(resource.RLIMIT_AS, (room, room))
    outcome = Outcome()
    began = time.process_time()
    try:
        outcome.value = function(*args, **kwargs)
    except BaseException as e:
        outcome.error, outcome.trace = e, traceback.format_exc()[-3000:]
    outcome.seconds = time.process_time() - began
    try:
        raw = pickle.dumps((outcome, start))
        pickle.loads(raw)  # some exceptions can be written and not read
    except Exception:
        kind = type(outcome.error).__name__ if outcome.error is not None else type(outcome.value).__name__
        plain = None if outcome.error is None else RuntimeError(f"{kind}: {outcome.error}")
        raw = pickle.dumps((dataclasses.replace(outcome, value=None, error=plain), start))
    with os.fdopen(pipe, "wb") as out:
        out.write(raw)
    os._exit(0)


def _resident() -> int:
    return _statm(1)


def _address_space() -> int:
    return _statm(0)


def _statm(field: int) -> int:
    return int(pathlib.Path("/proc/self/statm").read_text().split()[field]) * resource.getpagesize()
