"""Generated objects do what they are for, in C MuJoCo after conversion. Slow."""

from __future__ import annotations

import pathlib

import mujoco
import numpy as np
import pytest
from ig2mj_converters.base.options import ConvertOptions
from ig2mj_converters.convert_object import convert_object
from ig2mj_homes.dataset.root import build_dataset
from ig2mj_homes.objects.catalogue import build_model, catalogue, find
from ig2mj_homes.objects.opening_strength import open_joint

from ig2mj.scene.manifest import Manifest, load_manifest

pytestmark = pytest.mark.slow

SECONDS = 120  # steps in one second
OPENABLE = [name for name, entry in catalogue().items() if any(j.openable for j in build_model(entry, 0).joints)]


class Converted:
    """One converted object, with objects added to its world, stepped from rest."""

    def __init__(
        self,
        folder: pathlib.Path,
        *,
        fixed: bool = False,
        balls: list[tuple[list[float], float]] | None = None,
        inside: tuple[pathlib.Path, list[float]] | None = None,
    ):
        """balls: place, radius. inside: another converted object, loose, and its place; its body is named "book"."""
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
        if inside is not None:
            other = mujoco.MjSpec.from_file(str(inside[0] / "object.xml"))
            for made in (spec, other):
                for key in list(made.keys):
                    made.delete(key)
            body = next(b for b in other.worldbody.bodies if b.name)
            body.name = "book"
            spec.worldbody.add_frame(pos=inside[1]).attach_body(body, "in-", "")
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)

    def joint(self, k: int) -> tuple[int, int]:
        """(position address, velocity address) of the object's k-th openable joint."""
        index = self.model.joint(self.manifest.objects[0].openable[k].joint).id
        return int(self.model.jnt_qposadr[index]), int(self.model.jnt_dofadr[index])

    def place(self, body: str) -> np.ndarray:
        name = next(self.model.body(k).name for k in range(self.model.nbody) if self.model.body(k).name.endswith(body))
        return self.data.xpos[self.model.body(name).id].copy()

    def place_in(self, joint: str, body: str) -> np.ndarray:
        """Place of a body relative to the one that a joint moves."""
        return self.place(body) - self.data.xpos[self.model.jnt_bodyid[self.model.joint(joint).id]]

    def box_of(self, joint: str) -> np.ndarray:
        """[2, 3] world box of the boxes (along the axes; a round knob is none) of the body that a joint moves."""
        body = self.model.jnt_bodyid[self.model.joint(joint).id]
        boxes = (self.model.geom_group == 3) & (self.model.geom_type == mujoco.mjtGeom.mjGEOM_BOX)
        geoms = np.flatnonzero((self.model.geom_bodyid == body) & boxes)
        middle, half = self.data.geom_xpos[geoms], self.model.geom_size[geoms]
        return np.array([(middle - half).min(0), (middle + half).max(0)])

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


@pytest.mark.parametrize("index", range(find("bowl").count))
def test_every_bowl_holds_a_ball(convert, index: int):
    folder = convert("bowl", index)
    size = load_manifest(folder).objects[0].bounding_box
    empty = Converted(folder, fixed=True)
    low = empty.data.xpos[empty.model.body(empty.name).id] + empty.manifest.objects[0].base_link_offset
    bottom, radius = low[2] - size[2] / 2, 0.15 * min(size[:2])
    bowl = Converted(folder, fixed=True, balls=[([*low[:2], bottom + size[2] + radius], radius)])
    bowl.data.qvel[:2] = 0.1  # the ball comes in at an angle
    bowl.run(3.0)
    ball = bowl.data.xpos[bowl.model.body("ball_0").id]
    assert np.linalg.norm(ball[:2] - low[:2]) < 0.3 * min(size[:2])
    assert bottom < ball[2] - radius < bottom + 0.6 * size[2]


@pytest.mark.parametrize("category", ["desk", "stand", "bottom_cabinet"])
def test_a_drawer_holds_a_book_while_it_is_pulled_out_and_pushed_in(convert, category: str):
    """A real book of ours; 20 N pull the drawer out to its end and push it back, and the book lies in it still."""
    index = next(k for k in range(9) if any("drawer" in j.name for j in build_model(find(category), k).joints))
    folder, book = convert(category, index), convert("hardback")
    empty = Converted(folder, fixed=True)
    openable = next(o for o in empty.manifest.objects[0].openable if "drawer" in o.joint)
    number = [o.joint for o in empty.manifest.objects[0].openable].index(openable.joint)
    low, high = empty.box_of(openable.joint)
    desk = Converted(folder, fixed=True, inside=(book, [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2] + 0.03]))
    desk.run(1.0)
    qpos, dof = desk.joint(number)
    start = desk.place_in(openable.joint, "book")
    for force, goal in ((20.0, openable.open), (-20.0, openable.closed)):
        desk.run(2.0, {dof: force})
        assert desk.data.qpos[qpos] == pytest.approx(goal, abs=0.02 * openable.open)
        moved = desk.place_in(openable.joint, "book") - start
        assert abs(moved[2]) < 0.01, "it lies on the drawer's floor"
        (x, y, _), (low, high) = desk.place("book"), desk.box_of(openable.joint)
        assert low[0] < x < high[0] and low[1] < y < high[1]


@pytest.mark.parametrize("category", OPENABLE)
def test_every_joint_of_every_model_opens_under_5_newton_metres_or_20_newtons_and_stays(convert, category: str):
    """Open and half open; loose objects are held by their base."""
    for index in range(find(category).count):
        moving = Converted(convert(category, index), fixed=True)
        for openable in moving.manifest.objects[0].openable:
            result = open_joint(moving.model, openable.joint, openable.closed, openable.open)
            assert result.works, (index, result)


@pytest.mark.parametrize("index", range(find("fridge").count))
def test_a_closed_fridge_stays_closed_when_bumped_gently(convert, index: int):
    """0.3 N s outwards at each door's free edge, as of 0.6 kg at 0.5 m/s."""
    fridge = Converted(convert("fridge", index), fixed=True)
    assert fridge.manifest.objects[0].openable
    for number, openable in enumerate(fridge.manifest.objects[0].openable):
        mujoco.mj_resetData(fridge.model, fridge.data)
        qpos, dof = fridge.joint(number)
        width = float(np.ptp(fridge.box_of(openable.joint), axis=0)[1])
        fridge.run(1 / SECONDS, {dof: 0.3 * SECONDS * (width if "door" in openable.joint else 1.0)})
        fridge.run(1.0)
        moved = (fridge.data.qpos[qpos] - openable.closed) / (openable.open - openable.closed)
        assert 0 <= moved < 0.05, "from 5 % of its range on it counts as open"


def test_halves_of_an_apple_lie_still(convert):
    folder = convert("apple")
    apple = Converted(folder)
    apple.run(1.0)
    before = apple.data.xpos[apple.model.body(apple.name).id].copy()
    apple.run(1.0)
    after = apple.data.xpos[apple.model.body(apple.name).id]
    assert np.linalg.norm(after - before) < 0.02
