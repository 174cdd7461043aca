"""Generated objects do what they are for, in C MuJoCo after conversion (issue 5, "Done means"). Slow."""

from __future__ import annotations

import pathlib

import mujoco
import numpy as np
import pytest
from ig2mj_converters.convert_object import convert_object
from ig2mj_converters.options import ConvertOptions
from ig2mj_homes.dataset import build_dataset

from ig2mj.scene.manifest import Manifest, load_manifest

pytestmark = pytest.mark.slow

SECONDS = 120  # steps in one second


class Converted:
    """One converted object, with things added to its world, stepped from rest."""

    def __init__(
        self, folder: pathlib.Path, *, fixed: bool = False, balls: list[tuple[list[float], float]] | None = None
    ):
        self.manifest: Manifest = load_manifest(folder)
        self.name = self.manifest.objects[0].name
        spec = mujoco.MjSpec.from_file(str(folder / "object.xml"))
        if fixed:
            for joint in list(spec.joints):
                if joint.type == mujoco.mjtJoint.mjJNT_FREE:
                    spec.delete(joint)
            for key in list(spec.keys):
                spec.delete(key)
        for k, (place, radius) in enumerate(balls or []):
            body = spec.worldbody.add_body(name=f"ball_{k}", pos=place)
            body.add_freejoint()
            body.add_geom(size=[radius, 0, 0], mass=0.05, friction=[0.25, 0.005, 0.0001], condim=6)
            for key in list(spec.keys):
                spec.delete(key)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)

    def joint(self, k: int) -> tuple[int, int]:
        """(position address, velocity address) of the object's k-th openable joint."""
        index = self.model.joint(self.manifest.objects[0].openable[k].joint).id
        return int(self.model.jnt_qposadr[index]), int(self.model.jnt_dofadr[index])

    def run(self, seconds: float, push: dict[int, float] | None = None) -> None:
        for _ in range(round(seconds * SECONDS)):
            self.data.qfrc_applied[:] = 0
            for dof, force in (push or {}).items():
                self.data.qfrc_applied[dof] = force
            mujoco.mj_step(self.model, self.data)


@pytest.fixture(scope="module")
def convert(tmp_path_factory: pytest.TempPathFactory):
    root = tmp_path_factory.mktemp("objects")
    done: dict[tuple[str, int], pathlib.Path] = {}

    def make(category: str, index: int = 0) -> pathlib.Path:
        if (category, index) not in done:
            if not (root / "objects" / category).exists():
                build_dataset(root, only=[category], jobs=1)
            model = next(
                m for m in (root / "objects" / category).iterdir() if m.name.endswith(f"{category}_{index:02d}")
            )
            out = root / "converted" / f"{category}_{index}"
            convert_object(model / f"{model.name}.urdf", category, out, options=ConvertOptions())
            done[category, index] = out
        return done[category, index]

    return make


@pytest.mark.parametrize("category", ["bowl", "mug", "trash_can", "basket", "frying_pan", "jar"])
def test_a_vessel_holds_a_ball(convert, category: str):
    folder = convert(category)
    box = load_manifest(folder).objects[0].bounding_box
    radius = 0.16 * min(box[0], box[1])
    empty = Converted(folder, fixed=True)
    body = empty.model.body(empty.name).id
    low = empty.data.xpos[body].copy()
    centre = low + np.array(empty.manifest.objects[0].base_link_offset)
    inside = centre[:2]
    if category == "basket":  # its handle arches over the middle
        inside = centre[:2] + np.array([0.22 * box[0], 0])
    if category == "frying_pan":  # its handle lies along +x, the pan around -x
        inside = centre[:2] - [box[0] / 2 - box[1] / 2, 0]
    top = centre[2] + box[2] / 2
    drop = Converted(folder, fixed=True, balls=[([inside[0], inside[1], top + radius + 0.01], radius)])
    if category == "jar":  # its lid is opened first
        qpos, _ = drop.joint(0)
        drop.data.qpos[qpos] = 1.9
    drop.run(3.0)
    ball = drop.data.xpos[drop.model.body("ball_0").id]
    assert np.linalg.norm(ball[:2] - inside) < 0.5 * min(box[0], box[1])
    assert centre[2] - box[2] / 2 < ball[2] - radius + 1e-3
    assert ball[2] - radius < top - 0.2 * box[2], "the ball lies inside, not on the rim"


def test_a_drawer_opens_under_20_newtons_carries_a_ball_and_stays(convert):
    folder = convert("desk")
    still = Converted(folder, fixed=True)
    name = still.manifest.objects[0].openable[0].joint
    body = still.model.jnt_bodyid[still.model.joint(name).id]
    place = still.data.xipos[body] + [-0.05, 0, 0.02]
    desk = Converted(folder, fixed=True, balls=[(list(place), 0.02)])
    desk.run(1.0)
    qpos, dof = desk.joint(0)
    upper = desk.manifest.objects[0].openable[0].open
    desk.run(4.0, {dof: 20.0})
    assert desk.data.qpos[qpos] > 0.97 * upper
    desk.run(1.0)
    assert desk.data.qpos[qpos] > 0.95 * upper, "it stays where it is left"
    drawer = desk.data.xpos[body]
    ball = desk.data.xpos[desk.model.body("ball_0").id]
    assert ball[0] > place[0] + 0.5 * upper, "the ball came along"
    assert abs(ball[1] - drawer[1]) < 0.25 and ball[2] > drawer[2] - 0.2


@pytest.mark.parametrize(
    "category",
    ["bottom_cabinet", "dishwasher", "fridge", "jar", "laptop", "microwave", "oven", "top_cabinet", "washer"],
)
def test_every_openable_joint_opens_under_5_newton_metres_or_20_newtons_and_stays(convert, category: str):
    moving = Converted(convert(category), fixed=True)
    entry = moving.manifest.objects[0]
    kinds = {joint.name: joint.type for joint in entry.joints}
    push, goals = {}, {}
    for openable in entry.openable:
        index = moving.model.joint(openable.joint).id
        push[int(moving.model.jnt_dofadr[index])] = 5.0 if kinds[openable.joint] == "hinge" else 20.0
        goals[int(moving.model.jnt_qposadr[index])] = openable.open
    if category == "jar":  # its lid weighs a few grams: a gentler hand
        push = dict.fromkeys(push, 0.5)
    moving.run(4.0, push)
    moving.run(1.0)
    for qpos, upper in goals.items():
        assert moving.data.qpos[qpos] > 0.93 * upper


def test_a_closed_fridge_stays_closed_when_bumped_gently(convert):
    fridge = Converted(convert("fridge"), fixed=True)
    qpos, dof = fridge.joint(0)
    fridge.run(0.5)
    fridge.run(0.1, {dof: 1.5})
    fridge.run(0.5)
    entry = fridge.manifest.objects[0].openable[0]
    assert fridge.data.qpos[qpos] < entry.closed + 0.05 * (entry.open - entry.closed)


def test_halves_of_an_apple_lie_still(convert):
    folder = convert("apple")
    apple = Converted(folder)
    apple.run(1.0)
    before = apple.data.xpos[apple.model.body(apple.name).id].copy()
    apple.run(1.0)
    after = apple.data.xpos[apple.model.body(apple.name).id]
    assert np.linalg.norm(after - before) < 0.02
