"""The tiny dataset and what it converts to, shared by the converter's tests."""

from __future__ import annotations

import os
import pathlib

import mujoco
import pytest


@pytest.fixture(scope="session", autouse=True)
def own_cache(tmp_path_factory: pytest.TempPathFactory):
    """Keeps the user's cache of decompositions out of the tests."""
    before = os.environ.get("IG2MJ_CACHE_DIR")
    os.environ["IG2MJ_CACHE_DIR"] = str(tmp_path_factory.mktemp("cache"))
    yield
    if before is None:
        del os.environ["IG2MJ_CACHE_DIR"]
    else:
        os.environ["IG2MJ_CACHE_DIR"] = before


@pytest.fixture(scope="session")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> pathlib.Path:
    """Root of the tiny dataset. Not to be changed: tests that break something write their own."""
    from tiny_dataset import write_dataset

    return write_dataset(tmp_path_factory.mktemp("datasets") / "tiny")


class Converted:
    """A converted scene: folder, manifest entries by name, model, and data in the start state."""

    def __init__(self, folder: pathlib.Path, main_file: str = "scene.xml"):
        from ig2mj.scene.manifest import load_manifest

        self.folder, self.manifest = folder, load_manifest(folder)
        self.entries = {entry.name: entry for entry in self.manifest.objects}
        self.model = mujoco.MjModel.from_xml_path(str(folder / main_file))
        self.data = mujoco.MjData(self.model)
        mujoco.mj_resetDataKeyframe(self.model, self.data, self.model.key("initial").id)
        mujoco.mj_forward(self.model, self.data)

    def geoms(self, body: str, group: int | None = None) -> list[int]:
        """Geoms of one body."""
        owner = self.model.body(body).id
        found = [g for g in range(self.model.ngeom) if self.model.geom_bodyid[g] == owner]
        return [g for g in found if group is None or self.model.geom_group[g] == group]


@pytest.fixture(scope="session")
def convert(dataset, tmp_path_factory: pytest.TempPathFactory):
    """Converts a scene of the tiny dataset: `convert(urdf=None, **options) -> Converted`."""
    from ig2mj_converters.base.options import ConvertOptions
    from ig2mj_converters.convert_scene import convert_scene
    from tiny_house import SCENE

    def run(urdf=None, root: pathlib.Path = dataset, **options) -> Converted:
        out = tmp_path_factory.mktemp("out") / "scene"
        convert_scene(root, SCENE, out, urdf=urdf, options=ConvertOptions(report=False, **options))
        return Converted(out)

    return run


@pytest.fixture(scope="session")
def house(convert) -> Converted:
    """The tiny house, as its default scene file has it."""
    return convert()


@pytest.fixture(scope="session")
def task_house(convert, dataset) -> Converted:
    """The cached BEHAVIOR scene of the tiny house: the apple is sliced."""
    from tiny_house import SCENE, TASK_FILE

    return convert(urdf=dataset / "scenes" / SCENE / "urdf" / f"{TASK_FILE}.urdf")
