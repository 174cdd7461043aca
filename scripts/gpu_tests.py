"""All tests that need a GPU, a process for each file, several side by side; goes on where an earlier call stopped.

    python scripts/gpu_tests.py [FILE ...] [--minutes N] [--jobs N] [--out FOLDER] [--again failed|all] [PYTEST_OPTION]

`make test-gpu` runs it with the interpreter of `.venv`; `make test-gpu SETUP=no PYTHON=python3` with that one, and
installs nothing. Tests that have ended are noted in the folder and not run again, as long as `src` and `tests` are
what they were. At the end, and when `--minutes` are over, a summary names each file's tests and seconds, and the sum
over all calls. Exit status: 0 where all tests have passed or were skipped, 1 where one failed, 3 where some are left.

XLA splits its code into modules that are compiled side by side, and tries no variants of kernels: tests run programs a
few times only. Compiled programs and kernels are kept in the folder and in Warp's cache.
"""

from __future__ import annotations

import argparse
import collections
import concurrent.futures
import hashlib
import json
import os
import pathlib
import re
import signal
import subprocess
import sys
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[1]

FLAGS = "--xla_gpu_enable_llvm_module_compilation_parallelism=true --xla_gpu_autotune_level=0"

OUTCOME = re.compile(r"^(tests/\S+::.*?) (PASSED|FAILED|ERROR|SKIPPED|XFAIL|XPASS)\b", re.MULTILINE)
"""A line of `pytest -v`."""

GRACE = 20.0
"""Seconds between SIGINT and SIGKILL."""

NOTHING_SELECTED = 5
"""pytest's exit status."""


class Parts:
    """What ended so far, in a file of the folder: outcomes by test, seconds by file."""

    def __init__(self, folder: pathlib.Path, again: str | None):
        folder.mkdir(parents=True, exist_ok=True)
        self._file, self._lock = folder / "results.json", threading.Lock()
        of_code = digest()
        self.kept = {"code": of_code, "outcomes": {}, "seconds": {}, "calls_s": []}
        if self._file.exists() and again != "all":
            kept = json.loads(self._file.read_text(encoding="utf-8"))
            if kept.get("code") == of_code:
                self.kept = kept
            else:
                print("src or tests have changed since the last call: all tests run again", file=sys.stderr)
        if again == "failed":
            passed = {test: word for test, word in self.outcomes.items() if word not in ("FAILED", "ERROR")}
            self.kept["outcomes"] = passed

    @property
    def outcomes(self) -> dict[str, str]:
        return self.kept["outcomes"]

    def add(self, file: str, text: str, seconds: float) -> None:
        """What a process printed about a file."""
        with self._lock:
            self.outcomes.update(OUTCOME.findall(text))
            self.kept["seconds"][file] = round(self.kept["seconds"].get(file, 0.0) + seconds, 1)
            self.save()

    def save(self) -> None:
        new = self._file.with_suffix(".new")
        new.write_text(json.dumps(self.kept, indent=1), encoding="utf-8")
        new.replace(self._file)


def digest() -> str:
    """Of the files that tests depend on."""
    found = hashlib.sha256()
    for folder in ("src", "tests"):
        for file in sorted((ROOT / folder).rglob("*.py")):
            found.update(str(file.relative_to(ROOT)).encode() + file.read_bytes())
    return found.hexdigest()[:16]


def files() -> list[str]:
    """Test files that have tests for a GPU, those that took longest at first."""
    texts = {file: file.read_text(encoding="utf-8") for file in sorted((ROOT / "tests").rglob("test_*.py"))}
    return [str(f.relative_to(ROOT)) for f, text in texts.items() if "mark.gpu" in text or "kernel_device" in text]


def run_file(file: str, parts: Parts, until: float, args: argparse.Namespace) -> bool:
    """Runs what is left of a file; whether all of it has ended. `until`: of `time.monotonic`."""
    done = [test for test in parts.outcomes if test.startswith(f"{file}::")]
    log = args.out / f"{pathlib.PurePath(file).stem}.txt"
    words = [sys.executable, "-m", "pytest", "-m", "gpu", file, "-v", "--tb=short", "--durations=5"]
    words += ["--timeout", "1800"]
    words += ["-W", "default::DeprecationWarning", "-o", f"cache_dir={args.out / 'cache'}"]
    words += [*(f"--deselect={test}" for test in done), *args.pytest]
    flags = os.environ.get("XLA_FLAGS", "")
    env = {
        **os.environ,
        "JAX_PLATFORMS": "cuda,cpu",
        "XLA_PYTHON_CLIENT_PREALLOCATE": "false",
        "XLA_FLAGS": f"{FLAGS} {flags}".strip(),
    }
    env.pop("XLA_PYTHON_CLIENT_MEM_FRACTION", None)
    began = time.monotonic()
    if began >= until:
        return False
    with log.open("w", encoding="utf-8") as said:
        process = subprocess.Popen(words, cwd=ROOT, env=env, stdout=said, stderr=said)
        try:
            process.wait(until - began)
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGINT)
            try:
                process.wait(GRACE)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
    parts.add(file, log.read_text(encoding="utf-8", errors="replace"), time.monotonic() - began)
    print(f"{file}: {(log.read_text(errors='replace').strip().splitlines() or ['?'])[-1].strip('= ')}", flush=True)
    return process.returncode in (0, 1, NOTHING_SELECTED)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=60.0, help="time limit of this call")
    parser.add_argument("--jobs", type=int, default=max(1, min(8, len(os.sched_getaffinity(0)) // 2)))
    parser.add_argument("--out", type=pathlib.Path, default=ROOT / "out" / "gpu-tests")
    parser.add_argument("--again", choices=("failed", "all"), help="run these again")
    args, rest = parser.parse_known_args()
    chosen, args.pytest = ([word for word in rest if word.endswith(".py") is end] for end in (True, False))
    args.out = args.out.resolve()
    began, parts = time.monotonic(), Parts(args.out, args.again)
    until = began + 60 * args.minutes
    seconds = parts.kept["seconds"]
    order = sorted(chosen or files(), key=lambda file: -seconds.get(file, 1e9))
    with concurrent.futures.ThreadPoolExecutor(args.jobs) as pool:
        ended = list(pool.map(lambda file: run_file(file, parts, until, args), order))
    parts.kept["calls_s"].append(round(time.monotonic() - began, 1))
    parts.save()
    return summary(parts, [file for file, whole in zip(order, ended, strict=True) if not whole])


def summary(parts: Parts, left: list[str]) -> int:
    """Prints what ended; the exit status."""
    by_file: dict[str, collections.Counter[str]] = collections.defaultdict(collections.Counter)
    for test, word in parts.outcomes.items():
        by_file[test.split("::")[0]][word] += 1
    for file in sorted(by_file):
        counts = ", ".join(f"{n} {word.lower()}" for word, n in sorted(by_file[file].items()))
        print(f"{parts.kept['seconds'].get(file, 0.0):7.1f} s  {file}: {counts}")
    failed = sorted(test for test, word in parts.outcomes.items() if word in ("FAILED", "ERROR"))
    for test in failed:
        print(f"FAILED {test}")
    for file in left:
        print(f"not ended: {file} (the same command goes on)")
    total = collections.Counter(parts.outcomes.values())
    calls = parts.kept["calls_s"]
    print(f"{dict(total)} in {sum(calls):.0f} s ({len(calls)} calls)")
    return 1 if failed else 3 if left else 0


if __name__ == "__main__":
    sys.exit(main())
