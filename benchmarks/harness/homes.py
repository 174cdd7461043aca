"""The homes that benchmarks run on: shipped ones, any converted folder, or scenes of a dataset converted here."""

from __future__ import annotations

import dataclasses
import functools
import pathlib

import ig2mj
from benchmarks.harness.idle_robot import add_idle_robot, free_place
from benchmarks.harness.paths import WORK
from ig2mj.scene.paths import SHIPPED_HOMES
from ig2mj.scene.scene import Scene

"""What is built for benchmarks and used again the next time; not under version control."""

Place = tuple[tuple[float, float, float], float]
"""Position [3] (m) and yaw (rad)."""


@dataclasses.dataclass(frozen=True)
class Home:
    """A converted home, and the dataset it was converted from where that is at hand."""

    name: str
    folder: pathlib.Path
    dataset: pathlib.Path | None = None

    def load(self, place: Place | None = None) -> Scene:
        """The scene, with an idle robot where `place` says."""
        if place is None:
            return ig2mj.load_scene(self.folder)
        return ig2mj.load_scene(self.folder, [functools.partial(add_idle_robot, pos=place[0], yaw=place[1])])

    def robot_place(self) -> Place:
        """Where an idle robot stands in no one's way."""
        return free_place(self.load())


def made_homes(sizes: tuple[int, ...] | None = None, work: pathlib.Path = WORK) -> list[Home]:
    """The homes of `made_dataset`, converted. `sizes`: numbers of objects; None: all that it makes."""
    from benchmarks.harness.made_dataset import SIZES, scene_name, write_dataset

    root, sizes = work / "dataset", sizes or SIZES
    write_dataset(root, sizes)
    return [convert(root, scene_name(size), work) for size in sizes]


def convert(dataset: pathlib.Path, scene: str, work: pathlib.Path = WORK) -> Home:
    """Converts a scene of a dataset root into the working folder."""
    from ig2mj_converters.base.options import ConvertOptions
    from ig2mj_converters.convert_scene import convert_scene

    folder = work / "converted" / scene
    convert_scene(dataset, scene, folder, options=ConvertOptions(report=False))
    return Home(scene, folder, dataset)


def shipped_homes() -> list[Home]:
    """Homes that come with the project, by name."""
    return [Home(f.parent.name, f.parent) for f in sorted(SHIPPED_HOMES.glob("*/manifest.json"))]


def named_homes(names: list[str]) -> list[Home]:
    """Homes by folder, or by bare name where they are shipped."""
    shipped = {home.name: home for home in shipped_homes()}
    return [shipped.get(name) or Home(pathlib.Path(name).name, pathlib.Path(name)) for name in names]
