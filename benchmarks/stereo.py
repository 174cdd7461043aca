"""How fast a home is drawn for both eyes of a headset, 1296 x 1440 pixels each, with OpenGL and no display.

    MUJOCO_GL=egl python benchmarks/stereo.py --home birch --seconds 10

Every frame has new poses of all bodies and another direction of the head, is finished before the next one is begun, and
stays on the card, as with a headset. Prints one line of JSON.
"""

from __future__ import annotations

import argparse
import json
import math
import time

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

import ig2mj
from ig2mj.agents import Humanoid
from ig2mj.process.settings import used_gl
from ig2mj.vr.frames import Pose
from ig2mj.vr.stereo import HEIGHT, SAMPLES, WIDTH, StereoPictures, eyes_of


def measure(home: str, seconds: float, width: int = WIDTH, height: int = HEIGHT, samples: int = SAMPLES) -> dict:
    """Frames a second of a home with the humanoid at its middle.

    Args:
      seconds: of measuring, after three frames to warm up. samples: of each pixel.
    """
    from OpenGL import GL

    scene = ig2mj.load_scene(home, agents=[Humanoid()])
    data = scene.start_data()
    mujoco.mj_forward(scene.model, data)
    poses = np.concatenate([data.xpos, data.xquat], axis=1)
    pictures = StereoPictures(scene, width, height, samples)
    card = GL.glGetString(GL.GL_RENDERER).decode()

    def frame(number: int) -> None:
        turn = Rotation.from_euler("z", 0.05 * number) * Rotation.from_euler("y", 0.3 * math.sin(0.1 * number))
        pictures.draw(poses, eyes_of(Pose.of((0.0, 0.0, 1.6), turn)))
        pictures.finish()

    for number in range(3):
        frame(number)
    took, processor, start = [], time.process_time(), time.perf_counter()
    while time.perf_counter() - start < seconds or len(took) < 3:
        begun = time.perf_counter()
        frame(len(took))
        took.append(time.perf_counter() - begun)
    processor = time.process_time() - processor
    seen = float(pictures.read().std())
    pictures.close()
    milliseconds = 1000 * np.array(took)
    return {
        "benchmark": "stereo",
        "home": home,
        "geoms": int((scene.model.geom_group < 3).sum()),
        "pixels_of_each_eye": [width, height],
        "samples": samples,
        "gl": used_gl(),
        "renderer": card,
        "frames": len(took),
        "frames_per_s": round(len(took) / (milliseconds.sum() / 1000), 1),
        "ms_median": round(float(np.median(milliseconds)), 2),
        "ms_p99": round(float(np.percentile(milliseconds, 99)), 2),
        "processor_ms_per_frame": round(1000 * processor / len(took), 2),
        "deviation_of_pixels": round(seen, 1),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--home", default="birch")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--size", type=int, nargs=2, default=(WIDTH, HEIGHT))
    parser.add_argument("--samples", type=int, default=SAMPLES)
    given = parser.parse_args()
    print(json.dumps(measure(given.home, given.seconds, *given.size, given.samples)))


if __name__ == "__main__":
    main()
