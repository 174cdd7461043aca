"""`ig2mj calibrate` for one home, without a terminal's tables: a case of `suite.py`.

    python -m benchmarks.harness.calibrate_home HOME --out DIR [--worlds N] [--rounds N]

Writes DIR/<home>/engine_profile.json and prints it with the seconds it took.
"""

from __future__ import annotations

import argparse
import json
import pathlib
import time

import msgspec

import ig2mj
from ig2mj.agents.floating_hand import FloatingHand
from ig2mj.calibration.measuring import calibrate
from ig2mj.calibration.reach import find_reach
from ig2mj.engine.warp.profile import save_profile


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("home")
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--worlds", type=int, default=0)
    parser.add_argument("--rounds", type=int, default=6)
    args = parser.parse_args()
    start = time.time()
    reach = find_reach(ig2mj.load_scene(args.home))
    scene = ig2mj.load_scene(args.home, [FloatingHand(pos=reach.start)])
    found = time.time() - start
    profile = calibrate(scene, reach, num_worlds=args.worlds, rounds=args.rounds)
    folder = args.out / scene.folder.name
    folder.mkdir(parents=True, exist_ok=True)
    save_profile(profile, folder)
    seconds = {"reach_s": round(found, 1), "all_s": round(time.time() - start, 1)}
    print(json.dumps({"scene": scene.name, **seconds, **msgspec.to_builtins(profile)}), flush=True)


if __name__ == "__main__":
    main()
