"""All tests that need a GPU, a process for each file, several side by side; goes on where an earlier call stopped.

    python scripts/gpu_tests.py [FILE ...] [--minutes N] [--jobs N] [--out FOLDER] [--again failed|all] [PYTEST_OPTION]

`make test-gpu` runs it with the interpreter of `.venv`; `make test-gpu SETUP=no PYTHON=python3` with that one, and
installs nothing. A test is noted in the folder as soon as it ends, and not run again as long as the code is what it
was. `results.json` there has each test's outcome and seconds while tests still run, whatever ends this process. A test
that ends its process has failed, and the file's next tests run in another. When `--minutes` are over, or at a signal,
the tests that still run are stopped. Then a summary follows. Exit status: 0 where all tests have passed or were
skipped, 1 where one failed, 3 where some are left.

What takes longest comes first; some tests have a process of their own. All processes share one cache of compiled
programs, which is in the folder, and Warp's cache of kernels. XLA tries no variants of kernels, since tests run
programs a few times only.
"""

from __future__ import annotations

import argparse
import collections
import dataclasses
import hashlib
import json
import os
import pathlib
import platform
import re
import signal
import subprocess
import sys
import time
from typing import Any

import test_journal

ROOT = pathlib.Path(__file__).resolve().parents[1]

FLAGS = ("--xla_gpu_enable_llvm_module_compilation_parallelism=true", "--xla_gpu_autotune_level=0")
"""Options of XLA that shorten compilation. XLA ends a process at one that it does not know, so each is tried first."""

LONGEST_FIRST = (
    "tests/envs/test_navigation_on_a_gpu.py",
    "tests/engine/test_warp_kernels.py",
    "tests/worlds/test_batches_on_a_gpu.py",
    "tests/docs/test_code_blocks.py::test_the_python_of_a_page_runs_on_a_gpu[docs/guide/learning.md]",
    "tests/engine/test_solver_loop.py",
    "tests/tasks/custom/test_custom_tasks_on_warp.py",
    "tests/docs/test_code_blocks.py",
    "tests/envs/test_array_faces.py",
    "tests/envs/test_navigation_on_a_gpu.py::test_fetch_reaches_and_rearranges_on_warp",
    "tests/engine/test_engines_come_and_go.py",
    "tests/sensors/test_lasers_on_a_gpu.py",
    "tests/sensors/test_lasers_on_a_gpu.py::test_lasers_of_a_batch_are_those_of_the_native_engine[Fetch]",
    "tests/engine/test_convex_kernels.py",
    "tests/engine/test_resting.py",
    "tests/engine/test_bench_on_a_gpu.py",
    "tests/engine/test_kernels_of_a_step.py",
)
"""What compiles for over a minute on an H100, the longest first; other files are short, or new. Tests in this list get
a process of their own, since they share nothing that takes long with others of their files."""

MOST_JOBS = 12
"""Processes side by side. Each takes some GB of the GPU's memory and of the machine's."""

TEST_SECONDS = 1200
"""Limit of a test, with the compilation of its programs and kernels, which others may have to end first."""

GRACE = 10.0
"""Seconds between SIGINT and SIGKILL."""

SAVE_SECONDS = 2.0
"""Between two writings of results.json."""

FAILED = ("failed", "crashed")


class Results:
    """What ended so far: the journal of the present code, and results.json, which is made of it."""

    def __init__(self, folder: pathlib.Path, again: str | None):
        folder.mkdir(parents=True, exist_ok=True)
        self.code = digest()
        self.journal = folder / f"journal-{self.code}.jsonl"
        self._file = folder / "results.json"
        self._about = {"code": self.code, "commit": said_by("git", "rev-parse", "HEAD"), "device": gpu()}
        self._calls = self._read().get("calls_s", [])
        self._began = time.monotonic()
        if again == "all":
            self.journal.unlink(missing_ok=True)
        if again == "failed":
            kept = [line for line in self.ended().values() if line["outcome"] not in FAILED]
            self.journal.write_text("".join(json.dumps(line) + "\n" for line in kept), encoding="utf-8")
        if not self.journal.exists():
            self._calls = []

    def _read(self) -> dict[str, Any]:
        if not self._file.exists():
            return {}
        found = json.loads(self._file.read_text(encoding="utf-8"))
        if found["code"] != self.code:
            print("the code has changed since the last call: all tests run again", file=sys.stderr)
            return {}
        return found

    def ended(self) -> dict[str, dict[str, Any]]:
        return test_journal.ended(self.journal)

    def begun(self, process: int) -> list[str]:
        """Tests that this process has begun and that have no outcome."""
        return [test for test, line in test_journal.read(self.journal).items() if line.get("process") == process]

    def failed(self) -> list[str]:
        return sorted(test for test, line in self.ended().items() if line["outcome"] in FAILED)

    def calls(self) -> list[float]:
        """Seconds of each call, this one included."""
        return [*self._calls, round(time.monotonic() - self._began, 1)]

    def save(self, left: list[str]) -> None:
        tests = {test: {k: line[k] for k in ("outcome", "seconds")} for test, line in sorted(self.ended().items())}
        counts = dict(collections.Counter(of_test["outcome"] for of_test in tests.values()))
        text = {**self._about, "counts": counts, "calls_s": self.calls(), "left": left, "tests": tests}
        new = self._file.with_suffix(".new")
        new.write_text(json.dumps(text, indent=1), encoding="utf-8")
        new.replace(self._file)


@dataclasses.dataclass
class Running:
    """A process of pytest for what is left of a part."""

    part: str
    log: pathlib.Path
    process: subprocess.Popen


def said_by(*command: str) -> str:
    """The first line that a command prints; nothing where it fails."""
    try:
        done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=20)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return next(iter(done.stdout.splitlines()), "").strip() if done.returncode == 0 else ""


def gpu() -> str:
    return said_by("nvidia-smi", "--query-gpu=name", "--format=csv,noheader") or platform.machine()


def digest() -> str:
    """Of the files that tests depend on."""
    found = hashlib.sha256()
    for folder, kind in (("src", "*.py"), ("tests", "*.py"), ("docs", "*.md")):
        for file in sorted((ROOT / folder).rglob(kind)):
            found.update(str(file.relative_to(ROOT)).encode() + file.read_bytes())
    return found.hexdigest()[:16]


def parts(chosen: list[str]) -> list[str]:
    """Files, and tests of theirs that run on their own, those that take longest first."""
    places = {part: place for place, part in enumerate(LONGEST_FIRST)}
    found = chosen + [part for part in LONGEST_FIRST if "::" in part and part.split("::")[0] in chosen]
    return sorted(found, key=lambda part: places.get(part, len(places)))


def files() -> list[str]:
    """Test files that have tests for a GPU."""
    texts = {file: file.read_text(encoding="utf-8") for file in sorted((ROOT / "tests").rglob("test_*.py"))}
    return [str(f.relative_to(ROOT)) for f, text in texts.items() if "mark.gpu" in text or "kernel_device" in text]


def known_flags(flags: tuple[str, ...] = FLAGS) -> list[str]:
    """Those of XLA's options that this version of it knows."""
    program = [sys.executable, "-c", "import jax; jax.devices()"]

    def try_out(flag: str) -> subprocess.Popen:
        env = {**os.environ, "XLA_FLAGS": flag, "JAX_PLATFORMS": "cpu"}
        return subprocess.Popen(program, env=env, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    tried = [(flag, try_out(flag)) for flag in flags]
    return [flag for flag, process in tried if process.wait() == 0]


def environment(journal: pathlib.Path) -> dict[str, str]:
    env = {
        **os.environ,
        test_journal.VARIABLE: str(journal),
        "JAX_PLATFORMS": "cuda,cpu",
        "PYTHONPATH": os.pathsep.join([str(ROOT / "scripts"), *filter(None, [os.environ.get("PYTHONPATH")])]),
        "PYTHONUNBUFFERED": "1",
        "XLA_PYTHON_CLIENT_PREALLOCATE": "false",
        "XLA_FLAGS": " ".join([*known_flags(), *os.environ.get("XLA_FLAGS", "").split()]),
    }
    env.pop("XLA_PYTHON_CLIENT_MEM_FRACTION", None)
    return env


def start(part: str, out: pathlib.Path, env: dict[str, str], options: list[str]) -> Running:
    log = out / f"{re.sub('[^a-zA-Z0-9]+', '_', part.removeprefix('tests/'))[:100]}.txt"
    words = [sys.executable, "-X", "faulthandler", "-m", "pytest", "-p", "test_journal", "-m", "gpu", part, "-v"]
    words += [f"--deselect={other}" for other in LONGEST_FIRST if other.startswith(f"{part}::")]
    words += ["--tb=short", "--durations=5", f"--timeout={TEST_SECONDS}", "-W", "default::DeprecationWarning"]
    words += ["-o", f"cache_dir={out / 'cache'}", *options]
    with log.open("a", encoding="utf-8") as said:
        return Running(part, log, subprocess.Popen(words, cwd=ROOT, env=env, stdout=said, stderr=said))


def end(running: Running, results: Results) -> bool:
    """Notes what a process did not say itself; whether all of its part has ended."""
    status = running.process.returncode
    said = running.log.read_text(encoding="utf-8", errors="replace").strip().splitlines()
    print(f"{running.part}: {said[-1].strip('= ') if said else 'no output'}", flush=True)
    crashed = results.begun(running.process.pid)
    for test in crashed:
        test_journal.note(results.journal, test=test, outcome="crashed", seconds=0.0, log=running.log.name)
    if crashed:
        return False
    if status not in (0, 1, 5):  # passed, failed, and nothing was left
        test = f"{running.part}::pytest ended with status {status}"
        test_journal.note(results.journal, test=test, outcome="crashed", seconds=0.0, log=running.log.name)
    return True


def run_all(waiting: list[str], results: Results, until: float, args: argparse.Namespace) -> list[str]:
    """Runs parts; those that have not ended by `until` (of `time.monotonic`) or at a signal."""
    stopped: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, frame: stopped.append(number))
    env, running, saved = environment(results.journal), [], 0.0
    while (waiting or running) and time.monotonic() < until and not stopped:
        while waiting and len(running) < args.jobs:
            running.append(start(waiting.pop(0), args.out, env, args.pytest))
        for one in [one for one in running if one.process.poll() is not None]:
            running.remove(one)
            if not end(one, results):
                waiting.insert(0, one.part)
        if time.monotonic() > saved + SAVE_SECONDS:
            results.save([one.part for one in running] + waiting)
            saved = time.monotonic()
        time.sleep(0.1)
    for one in running:
        one.process.send_signal(signal.SIGINT)
    killed_at = time.monotonic() + GRACE
    for one in running:
        try:
            one.process.wait(max(0.0, killed_at - time.monotonic()))
        except subprocess.TimeoutExpired:
            one.process.kill()
            one.process.wait()
    return [one.part for one in running] + waiting


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    cores = len(os.sched_getaffinity(0))
    parser.add_argument("--minutes", type=float, default=60.0, help="time limit of this call")
    parser.add_argument("--jobs", type=int, default=max(1, min(MOST_JOBS, cores * 3 // 4)), help="processes")
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "out" / "gpu-tests")
    parser.add_argument("--again", choices=("failed", "all"), help="run these again")
    args, rest = parser.parse_known_args()
    chosen, args.pytest = ([word for word in rest if word.endswith(".py") is end] for end in (True, False))
    args.out = args.out.resolve()
    until = time.monotonic() + 60 * args.minutes
    results = Results(args.out, args.again)
    left = run_all(parts(chosen or files()), results, until, args)
    results.save(left)
    return summary(results, left)


def summary(results: Results, left: list[str]) -> int:
    """Prints what ended; the exit status."""
    by_file: dict[str, list[dict[str, Any]]] = collections.defaultdict(list)
    for test, line in results.ended().items():
        by_file[test.split("::")[0]].append(line)
    for file, lines in sorted(by_file.items()):
        counts = collections.Counter(line["outcome"] for line in lines)
        text = ", ".join(f"{n} {outcome}" for outcome, n in sorted(counts.items()))
        print(f"{sum(line['seconds'] for line in lines):7.1f} s  {file}: {text}")
    for test in results.failed():
        print(f"FAILED {test}")
    for part in left:
        print(f"not ended: {part} (the same command goes on)")
    total = collections.Counter(line["outcome"] for lines in by_file.values() for line in lines)
    calls = results.calls()
    print(f"{dict(total)} in {sum(calls):.0f} s ({len(calls)} calls)")
    return 1 if results.failed() else 3 if left else 0


if __name__ == "__main__":
    sys.exit(main())
