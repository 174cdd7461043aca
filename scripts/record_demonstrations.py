"""Records the demonstrations that ship, in demonstrations/: `make demonstrations`.

32 successful episodes of each activity's expert, with noise on every action and occasional disturbances of five random
steps, from which the expert recovers; labels are the expert's undisturbed actions. The files are compact: steps, first
and last frames. Each file is replayed by action before it is kept.

    python scripts/record_demonstrations.py [ACTIVITY ...]
"""

from __future__ import annotations

import pathlib
import sys
import tempfile

import ig2mj
from ig2mj.demos import Recording, Replayer
from ig2mj.demos.collection import FAILED, collect
from ig2mj.envs.experts import expert_of
from ig2mj.tasks.activities import ACTIVITIES

EPISODES, WORLDS, ROWS, SEED = 32, 4, 40, 14
NOISE, DISTURBED = 0.1, 0.02
"""Standard deviation of the noise; probability per step of a disturbance."""

FOLDER = pathlib.Path(__file__).resolve().parents[1] / "demonstrations"


def main() -> None:
    FOLDER.mkdir(exist_ok=True)
    for task in sys.argv[1:] or ACTIVITIES:
        with tempfile.TemporaryDirectory(dir=FOLDER) as scratch:
            file = pathlib.Path(scratch) / "runs.h5"
            env = ig2mj.make(task, robot="humanoid", worlds=WORLDS, engine="native", pool_size=ROWS)
            options = {"seed": SEED, "noise": NOISE, "disturbed": DISTURBED, "observations": False}
            collect(env, expert_of(env), file, EPISODES, **options)
            with Recording(file) as recording:
                done = Replayer(recording)(check=True)
                assert not done.differences, str(done.differences[0])
                failed = recording.value(FAILED, int)
            file.replace(FOLDER / f"{task}.h5")
        size = (FOLDER / f"{task}.h5").stat().st_size / 1e6
        print(f"{task}: {done.runs} runs, {failed} failed, {done.frames} frames, {size:.2f} MB", flush=True)


if __name__ == "__main__":
    main()
