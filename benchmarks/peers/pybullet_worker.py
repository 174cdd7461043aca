"""A process that steps one home in PyBullet, with iGibson's settings, and answers one JSON line for each it is given.

    python -m benchmarks.peers.pybullet_worker FOLDER [tiny|egl]

FOLDER was written by `pybullet_scene.write_bullet_scene`. With a renderer, PyBullet's own software one or its OpenGL
one, the visuals are loaded too; without, they are not, as in iGibson. Requests: {"do": "steps", "count": n, "size":
pixels of a picture after each step, 0 none}, {"do": "poses"}, {"do": "moving"}, {"do": "picture", "size": pixels}. A
process of its own, because a driver that fails may take the process with it, and because PyBullet prints what it likes.

iGibson's settings: gravity 9.8, 1/120 s, four physics steps
in a step, 100 solver iterations, sleeping, deterministic pairs, no file caching, no collision between bases that are
both fixed, velocity motors for joint friction. Shadows are off, as in iGibson's benchmark.
"""

from __future__ import annotations

import importlib.util
import json
import os
import pathlib
import sys
import time

import pybullet as p  # pyright: ignore[reportMissingImports]

TIMESTEP, SUBSTEPS, SOLVER_ITERATIONS = 1 / 120, 4, 100
NEAR, FAR = 0.05, 100.0
"""Metres: clipping planes of the camera."""

MOVING_STEPS = 30
"""Steps over which a sleeping body must keep every bit of its pose."""


class Home:
    """The loaded scene."""

    def __init__(self, folder: pathlib.Path, renderer: str | None):
        p.connect(p.DIRECT)
        self._renderer = p.ER_TINY_RENDERER
        if renderer == "egl":
            self._renderer = _start_egl()  # before anything is loaded: it does not see what was there before it
        self.description = json.loads((folder / "bullet_scene.json").read_text())
        p.setAdditionalSearchPath(str(folder))
        p.setGravity(0, 0, -9.8)
        p.setTimeStep(TIMESTEP)
        p.setPhysicsEngineParameter(
            numSolverIterations=SOLVER_ITERATIONS, deterministicOverlappingPairs=1, enableFileCaching=0
        )
        p.setPhysicsEngineParameter(collisionFilterMode=0)
        self.bodies: list[int] = []
        for body in self.description["bodies"]:
            self.bodies.append(self._load(body, folder, renderer is not None))
        fixed = [b for b, d in zip(self.bodies, self.description["bodies"], strict=True) if d["fixed"]]
        for k, one in enumerate(fixed):
            for other in fixed[k + 1 :]:
                p.setCollisionFilterPair(one, other, -1, -1, 0)
        camera = self.description["camera"]
        self._view = p.computeViewMatrix(camera["eye"], camera["target"], [0, 0, 1])
        self._projection = p.computeProjectionMatrixFOV(camera["fovy"], 1.0, NEAR, FAR)

    def _load(self, body: dict, folder: pathlib.Path, visuals: bool) -> int:
        flags = p.URDF_ENABLE_SLEEPING if body["sleeps"] else 0
        file = body["urdf_with_visuals"] if visuals else body["urdf"]
        number = p.loadURDF(
            str(folder / file), body["pos"], body["quat"], useFixedBase=bool(body["fixed"]), flags=flags
        )
        for joint in range(p.getNumJoints(number)):
            info = p.getJointInfo(number, joint)
            if info[2] not in (p.JOINT_REVOLUTE, p.JOINT_PRISMATIC):
                continue
            p.resetJointState(number, joint, body["joints"].get(info[1].decode(), 0.0), 0.0)
            p.setJointMotorControl2(number, joint, p.VELOCITY_CONTROL, targetVelocity=0.0, force=body["motor_force"])
        return number

    def steps(self, count: int, size: int = 0) -> dict:
        """Takes `count` steps of four physics steps, with a picture after each; seconds by wall and by this process."""
        wall, cpu = time.perf_counter(), time.process_time()
        for _ in range(count):
            for _ in range(SUBSTEPS):
                p.stepSimulation()
            if size:
                self._take(size)
        return {"wall": time.perf_counter() - wall, "cpu": time.process_time() - cpu}

    def _take(self, size: int) -> tuple:
        """A picture of `size` pixels square: (width, height, RGBA, depth, segmentation); both come in one go."""
        flags = p.ER_NO_SEGMENTATION_MASK
        return p.getCameraImage(
            size, size, self._view, self._projection, shadow=0, renderer=self._renderer, flags=flags
        )

    def picture(self, size: int) -> list:
        """RGB of one picture as nested lists, to look at."""
        return self._take(size)[2].reshape(size, size, 4)[:, :, :3].tolist()

    def poses(self) -> dict:
        """Base link frame (position, quaternion x-y-z-w) and joint positions of every body."""
        return {d["name"]: self._pose(b) for b, d in zip(self.bodies, self.description["bodies"], strict=True)}

    def _pose(self, body: int) -> dict:
        dynamics = p.getDynamicsInfo(body, -1)
        pos, quat = p.multiplyTransforms(
            *p.getBasePositionAndOrientation(body), *p.invertTransform(dynamics[3], dynamics[4])
        )
        joints = {
            p.getJointInfo(body, k)[1].decode(): p.getJointState(body, k)[0]
            for k in range(p.getNumJoints(body))
            if p.getJointInfo(body, k)[2] in (p.JOINT_REVOLUTE, p.JOINT_PRISMATIC)
        }
        return {"pos": pos, "quat": quat, "joints": joints}

    def moving(self) -> list[str]:
        """Bodies that are awake: something about their pose changes within a second, if only the last bit."""
        before = self.poses()
        self.steps(MOVING_STEPS)
        after = self.poses()
        return [name for name, pose in after.items() if pose != before[name]]


def _start_egl() -> int:
    """PyBullet's OpenGL renderer without a display."""
    spec = importlib.util.find_spec("eglRenderer")
    if spec is None or spec.origin is None:
        raise SystemExit("this PyBullet comes without its EGL renderer")
    if p.loadPlugin(spec.origin, "_eglRendererPlugin") < 0:
        raise SystemExit("PyBullet's EGL renderer does not start")
    return p.ER_BULLET_HARDWARE_OPENGL


def main() -> None:
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # PyBullet writes a line per picture to standard output
    home = Home(pathlib.Path(sys.argv[1]), *(sys.argv[2:] or [None]))
    answers.write(json.dumps({"ready": len(home.bodies), "pybullet": p.getAPIVersion()}) + "\n")
    for line in sys.stdin:
        request = json.loads(line)
        what = request.pop("do")
        try:
            answer = getattr(home, what)(**request)
        except (RuntimeError, p.error) as e:
            answer = {"error": str(e)}
        answers.write(json.dumps(answer) + "\n")


if __name__ == "__main__":
    main()
