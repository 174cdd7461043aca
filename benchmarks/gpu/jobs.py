"""Runs jobs side by side on a machine with several GPUs, each on cards and processors of its own, after others.

    python benchmarks/gpu/jobs.py JOBS [--out out/gpu] [--seconds 1500]

A line of JOBS is `CARDS CORES AFTER NAME COMMAND...`; "-" stands for any or none, and lines that begin with "#" are
left out. CARDS becomes CUDA_VISIBLE_DEVICES, CORES is a list for `taskset`. AFTER joins with "+" what must be so before
the job begins: the name of a job that has ended (however it ended), or `file:FOLDER/PATTERN`, a file that exists. The
command is Bash's; it finds its folder in $OUT (`--out`/NAME), and what it says is in `log` there. When a job ends, what
it has left running is ended with it. `state.json` and `jobs.log` in `--out` say what runs, what ended and when.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import json
import os
import pathlib
import signal
import subprocess
import time


@dataclasses.dataclass(frozen=True)
class Job:
    """A line of the file."""

    cards: str
    cores: str
    after: tuple[str, ...]
    name: str
    command: str

    @staticmethod
    def read(line: str) -> Job:
        """Raises ValueError where a line has fewer than five words."""
        cards, cores, after, name, command = line.split(None, 4)
        return Job(cards, cores, () if after == "-" else tuple(after.split("+")), name, command)


def read_jobs(text: str) -> list[Job]:
    """The jobs of a file.

    Raises:
      ValueError: a line is too short, a name comes twice, or a job waits for one that does not exist.
    """
    jobs = []
    for number, line in enumerate(text.splitlines(), 1):
        if line.strip() and not line.lstrip().startswith("#"):
            try:
                jobs.append(Job.read(line))
            except ValueError:
                raise ValueError(f"line {number}: CARDS CORES AFTER NAME COMMAND are wanted: {line[:80]}") from None
    names = [job.name for job in jobs]
    for job in jobs:
        if names.count(job.name) > 1:
            raise ValueError(f"two jobs are called {job.name}")
        for word in job.after:
            if not word.startswith("file:") and word not in names:
                raise ValueError(f"{job.name} waits for {word}, which is no job's name")
    return jobs


def may_begin(job: Job, ended: dict[str, int]) -> bool:
    """Whether all that the job waits for is so."""
    return all(exists(word[5:]) if word.startswith("file:") else word in ended for word in job.after)


def exists(pattern: str) -> bool:
    """Whether a folder holds a file whose name fits; "~" stands for the user's folder."""
    path = pathlib.Path(pattern).expanduser()
    return any(path.parent.glob(path.name))


def start(job: Job, out: pathlib.Path) -> subprocess.Popen[bytes]:
    """Starts a job in a session of its own, by which all its processes are found."""
    folder = out / job.name
    folder.mkdir(parents=True, exist_ok=True)
    env = {**os.environ, "OUT": str(folder.resolve())}
    if job.cards != "-":
        env["CUDA_VISIBLE_DEVICES"] = job.cards
    words = ["bash", "-c", job.command] if job.cores == "-" else ["taskset", "-c", job.cores, "bash", "-c", job.command]
    with (folder / "log").open("ab") as log:
        return subprocess.Popen(
            words, env=env, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT, start_new_session=True
        )


def end_session(session: int) -> None:
    """Ends every process of a session (Linux: the sixth field of /proc/PID/stat)."""
    for stat in pathlib.Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):  # it has ended meanwhile
            if int(stat.read_text().rpartition(")")[2].split()[3]) == session:
                os.kill(int(stat.parent.name), signal.SIGKILL)


def run(jobs: list[Job], out: pathlib.Path, seconds: float, wait: float = 0.3) -> dict[str, int]:
    """Runs all jobs; the exit statuses of those that ended within `seconds`. The rest is ended or never begun."""
    out.mkdir(parents=True, exist_ok=True)
    began, waiting = time.monotonic(), list(jobs)
    running: dict[str, tuple[subprocess.Popen[bytes], float]] = {}
    ended: dict[str, int] = {}
    with (out / "jobs.log").open("a", buffering=1) as log:

        def note(words: str) -> None:
            print(f"{time.monotonic() - began:7.1f} {words}", file=log)
            state = {"running": list(running), "ended": ended, "waiting": [job.name for job in waiting]}
            (out / "state.json.new").write_text(json.dumps(state))
            (out / "state.json.new").replace(out / "state.json")

        while (waiting or running) and time.monotonic() - began < seconds:
            for name, (process, since) in list(running.items()):
                if process.poll() is not None:
                    end_session(process.pid)
                    del running[name]
                    ended[name] = process.returncode
                    note(f"{name} ended with {process.returncode} after {time.monotonic() - since:.1f} s")
            for job in [job for job in waiting if may_begin(job, ended)]:
                waiting.remove(job)
                running[job.name] = start(job, out), time.monotonic()
                note(f"{job.name} began")
            time.sleep(wait)
        left = [*running, *(job.name for job in waiting)]
        for process, _ in running.values():
            end_session(process.pid)
            process.wait()
        running.clear()
        waiting.clear()
        note(f"time was up: {', '.join(left)}" if left else "all ended")
    return ended


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("jobs", type=pathlib.Path)
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("out/gpu"))
    parser.add_argument("--seconds", type=float, default=1500.0, help="for everything")
    args = parser.parse_args()
    try:
        jobs = read_jobs(args.jobs.read_text())
    except (OSError, ValueError) as problem:
        raise SystemExit(f"error: {args.jobs}: {problem}") from None
    ended = run(jobs, args.out, args.seconds)
    failed = [name for name in (job.name for job in jobs) if ended.get(name) != 0]
    raise SystemExit(f"not well: {', '.join(failed)}; see {args.out}/jobs.log" if failed else 0)


if __name__ == "__main__":
    main()
