"""A dataset root in iGibson's layout with homes of Table A.7's sizes, made of the project's own objects.

    python -m benchmarks.harness.made_dataset FOLDER

Both engines are given the same URDF source. The home of 20 is the table's: a fridge, a coffee table and a countertop,
with fifteen cracker boxes on the latter, five by three as in iGibson's script. Those
of 60 and 120 are one large room with furniture that opens, chairs, and household objects on the furniture that has a
top. Counts include floor and walls.
"""

from __future__ import annotations

import dataclasses
import pathlib
import shutil
import sys

import numpy as np
from ig2mj_converters.reading.dataset import Dataset
from ig2mj_homes.dataset.root import build_dataset

SIZES = (20, 60, 120)

TABLE_A7 = ("countertop", "coffee_table", "fridge", "cracker_box")

TOPS = ("countertop", "breakfast_table", "coffee_table", "desk", "console_table")
"""Furniture that carries objects."""
FURNITURE = (
    "countertop", "fridge", "bottom_cabinet", "breakfast_table", "stove", "coffee_table", "shelf", "dishwasher",
    "desk", "sofa", "console_table", "washer", "top_cabinet", "stand", "bed",
)  # fmt: skip
STANDING = ("straight_chair", "trash_can", "stool", "pot_plant")
THINGS = (
    "cracker_box", "bowl", "mug", "hardback", "plate", "jar", "canned_food", "laptop", "frying_pan", "kettle",
    "notebook", "saucepan", "cereal", "teapot", "candle", "soap", "toaster", "milk", "table_lamp", "coffee_cup",
)  # fmt: skip

PITCH = 2.6
"""Metres from one piece of furniture to the next: doors open freely."""
AIR = 0.002
"""Metres left under everything, as in iGibson's scenes."""
RIM, GAP = 0.02, 0.03
"""Metres: from the edge of a top, and between the objects on it."""
WALL_HEIGHT, WALL_THICKNESS = 2.5, 0.2


@dataclasses.dataclass
class Item:
    """An object of a scene: pos is the middle of its bounding box [3] (m), yaw in rad."""

    name: str
    category: str
    model: str
    pos: np.ndarray
    fixed: bool
    yaw: float = 0.0


def scene_name(size: int) -> str:
    return f"a7_{size}"


def write_dataset(root: pathlib.Path, sizes: tuple[int, ...] = SIZES) -> Dataset:
    """Writes the objects, if they are not there yet, and one scene per size. The same bytes every time."""
    note = root / ".objects_written"
    there = set(note.read_text().split()) if note.exists() else set()
    expected = set(TABLE_A7 if set(sizes) <= {20} else (*TABLE_A7, *FURNITURE, *STANDING, *THINGS))
    if not expected <= there:
        build_dataset(root, only=sorted(expected | there), jobs=1)
        note.write_text("\n".join(sorted(expected | there)))
    dataset = Dataset(root)
    for size in sizes:
        _write_scene(dataset, scene_name(size), _table_a7(dataset) if size == 20 else _one_room(dataset, size))
    return dataset


class _Models:
    """Gives out a category's models in turn, and numbers its objects."""

    def __init__(self, dataset: Dataset):
        self._dataset, self._count = dataset, {}

    def next(self, category: str) -> tuple[str, str, np.ndarray]:
        """(name of the object, model, size of its box [3])."""
        number = self._count.get(category, 0)
        self._count[category] = number + 1
        models = self._dataset.models(category)
        model = models[number % len(models)]
        size = self._dataset.model(category, model).metadata.bbox_size
        assert size is not None
        return f"{category}_{number}", model, size

    def standing(
        self, category: str, x: float, y: float, on: float = 0.0, fixed: bool = True, yaw: float = 0.0
    ) -> Item:
        """An object that stands on the height `on`."""
        name, model, size = self.next(category)
        return Item(name, category, model, np.array([x, y, on + AIR + size[2] / 2]), fixed, yaw)


def _table_a7(dataset: Dataset) -> list[Item]:
    models = _Models(dataset)
    items = [models.standing(c, k * PITCH, 0.0) for k, c in enumerate(TABLE_A7[:3])]
    top = 2 * items[0].pos[2] - AIR
    for i in range(5):
        for j in range(3):
            items.append(models.standing("cracker_box", 0.1 * (i - 2), 0.3 * (j - 1), on=top, fixed=False))
    return items


def _one_room(dataset: Dataset, size: int) -> list[Item]:
    """Furniture in rows, a quarter of all; a tenth stands on the floor between; the rest on the tops."""
    models = _Models(dataset)
    furniture, standing = size // 4, size // 10
    columns = int(np.ceil(np.sqrt(furniture)))
    spots = [(PITCH * (k % columns), PITCH * (k // columns)) for k in range(furniture)]
    items = [models.standing(FURNITURE[k % len(FURNITURE)], x, y) for k, (x, y) in enumerate(spots)]
    tops = [item for item in items if item.category in TOPS]
    for k in range(standing):
        x, y = spots[k]
        items.append(
            models.standing(STANDING[k % len(STANDING)], x + PITCH / 2, y + PITCH / 2, fixed=False, yaw=0.3 * k)
        )
    free = [_Top(top, *dataset_size(dataset, top)) for top in tops]
    for k in range(size - 2 - len(items)):  # floor and walls are two
        category = THINGS[k % len(THINGS)]
        name, model, box = models.next(category)
        tried = (free[(k + turn) % len(free)].place(box) for turn in range(len(free)))
        place = next((at for at in tried if at is not None), None)
        if place is None:
            raise ValueError(f"a home of {size} objects: {name} finds no room on the furniture")
        items.append(Item(name, category, model, place, False))
    return items


def dataset_size(dataset: Dataset, item: Item) -> tuple[float, float]:
    """Depth and width (m) of an object's box."""
    size = dataset.model(item.category, item.model).metadata.bbox_size
    assert size is not None
    return float(size[0]), float(size[1])


class _Top:
    """The top of a piece of furniture, filled row by row."""

    def __init__(self, item: Item, depth: float, width: float):
        self._middle = item.pos
        self._half = np.array([depth, width]) / 2 - RIM
        self._x, self._y = -self._half
        self._row = 0.0

    def place(self, box: np.ndarray) -> np.ndarray | None:
        """Middle of a box of this size [3] on the next free spot, or None where it does not fit."""
        x, y, row = self._x, self._y, self._row
        if y + box[1] > self._half[1]:
            x, y, row = x + row + GAP, -self._half[1], 0.0
        if x + box[0] > self._half[0] or y + box[1] > self._half[1]:
            return None
        at = np.array([x + box[0] / 2, y + box[1] / 2])
        self._x, self._y, self._row = x, y + box[1] + GAP, max(row, box[0])
        height = 2 * (self._middle[2] - AIR) + 2 * AIR + box[2] / 2
        return np.array([*(self._middle[:2] + at), height])


def _write_scene(dataset: Dataset, name: str, items: list[Item]) -> None:
    folder = dataset.root / "scenes" / name
    shutil.rmtree(folder, ignore_errors=True)
    for sub in ("urdf", "shape/collision", "shape/visual"):
        (folder / sub).mkdir(parents=True)
    places = np.array([item.pos[:2] for item in items])
    low, high = places.min(axis=0) - PITCH, places.max(axis=0) + PITCH
    middle, half = (low + high) / 2, (high - low) / 2
    floor = [(np.array([*middle, -0.1]), np.array([*half, 0.1]))]
    walls = []
    for axis in (0, 1):
        for side in (-1.0, 1.0):
            centre, extent = np.array([*middle, WALL_HEIGHT / 2]), np.array([*half, WALL_HEIGHT / 2])
            centre[axis] += side * (half[axis] + WALL_THICKNESS / 2)
            extent[axis] = WALL_THICKNESS / 2
            walls.append((centre, extent))
    lines = ['<robot name="igibson_scene">', '<link name="world"/>']
    for category, boxes in (("floors", floor), ("walls", walls)):
        _write_building(folder, name, category, boxes)
        lines.append(f'<link category="{category}" model="{name}" name="{category}"/>')
        lines.append(_joint(f"fix_to_world_{category}", "fixed", category, np.zeros(3), 0.0))
    for item in items:
        lines.append(f'<link category="{item.category}" model="{item.model}" name="{item.name}"/>')
        lines.append(_joint(f"j_{item.name}", "fixed" if item.fixed else "floating", item.name, item.pos, item.yaw))
    (folder / "urdf" / f"{name}_best.urdf").write_text("\n".join([*lines, "</robot>\n"]))


def _joint(name: str, kind: str, child: str, pos: np.ndarray, yaw: float) -> str:
    at = " ".join(f"{v:.6f}" for v in pos)
    return (
        f'<joint name="{name}" type="{kind}"><origin rpy="0 0 {yaw:.6f}" xyz="{at}"/>'
        f'<child link="{child}"/><parent link="world"/></joint>'
    )


def _write_building(
    folder: pathlib.Path, scene: str, category: str, boxes: list[tuple[np.ndarray, np.ndarray]]
) -> None:
    """URDF and meshes of floor or walls: one box per OBJ."""
    shapes = []
    for k, (centre, half) in enumerate(boxes):
        text = _box_obj(centre, half)
        for kind, end in (("collision", "cm"), ("visual", "vm")):
            file = f"shape/{kind}/{category}_{k}_{end}.obj"
            (folder / file).write_text(text)
            shapes.append(f'<{kind}><geometry><mesh filename="{file}"/></geometry></{kind}>')
    inertial = '<inertial><mass value="10000"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    (folder / "urdf" / f"{scene}_{category}.urdf").write_text(
        f'<robot name="{scene}_{category}"><link name="base_link">{inertial}{"".join(shapes)}</link></robot>\n'
    )


def _box_obj(centre: np.ndarray, half: np.ndarray) -> str:
    corners = [centre + half * np.array([x, y, z]) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    faces = [(1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)]
    lines = ["o convex_0", *(f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in corners)]
    lines += [f"f {a} {b} {c}\nf {a} {c} {d}" for a, b, c, d in faces]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    if len(sys.argv) != 2:
        raise SystemExit("usage: made_dataset.py FOLDER")
    write_dataset(pathlib.Path(sys.argv[1]))
