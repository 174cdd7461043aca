"""`load_scene`: one household, read from disk, checked, compiled. A `Scene` never changes during a run."""

from __future__ import annotations

import copy
import dataclasses
import os
import pathlib
from collections.abc import Callable, Sequence

import mujoco

from ig2mj.errors import InputError, UnknownNameError
from ig2mj.scene.build_tables import build_tables
from ig2mj.scene.manifest import AgentEntry, Manifest, ObjectEntry, load_manifest
from ig2mj.scene.rooms import Rooms, load_rooms
from ig2mj.scene.tables import SceneTables

MODEL_FILES, MANIFEST_FILE = ("scene.xml", "object.xml"), "manifest.json"

SHIPPED_HOMES = pathlib.Path(__file__).resolve().parents[3] / "scenes_mjcf"
"""Homes that come with a checkout of the project; `load_scene` finds them by their bare names."""

AddAgent = Callable[[mujoco.MjSpec], AgentEntry]
"""Adds an agent's bodies to a scene that is not compiled yet, and says what it added (see `ig2mj.agents`)."""


@dataclasses.dataclass(frozen=True, eq=False)
class Scene:
    """A household.

    Attributes:
      folder: where it was read from.
      manifest: everything about it that MJCF cannot say; lists the agents that were added, too.
      model: the compiled model. Engines that must change a model change a copy.
      tables: its constants as arrays.
      rooms: room maps, or None.
      agents: what was added when it was loaded.
    """

    folder: pathlib.Path
    manifest: Manifest
    model: mujoco.MjModel
    tables: SceneTables
    rooms: Rooms | None = None
    agents: tuple[AddAgent, ...] = ()

    @property
    def name(self) -> str:
        return self.manifest.name

    @property
    def object_names(self) -> tuple[str, ...]:
        return self.tables.object_names

    def object_index(self, name: str) -> int:
        """Place of the object on the O axis. Raises UnknownNameError, with near matches."""
        try:
            return self.object_names.index(name)
        except ValueError:
            raise UnknownNameError("object", name, self.object_names) from None

    def object(self, name: str) -> ObjectEntry:
        """The manifest's entry of an object. Raises UnknownNameError."""
        return self.manifest.objects[self.object_index(name)]

    def spec(self) -> mujoco.MjSpec:
        """The scene with its agents, read again, to be changed and compiled; ids are those of `model`."""
        spec = read_spec(_model_file(self.folder))
        for add in self.agents:
            add(spec)
        return spec

    def __repr__(self) -> str:
        return f"Scene('{self.name}', {len(self.object_names)} objects, {self.folder})"


def load_scene(path: str | os.PathLike, agents: Sequence[AddAgent] = ()) -> Scene:
    """Loads a converted scene.

    Args:
      path: its folder, its scene.xml or its manifest.json, or the bare name of a home that ships with the project.
      agents: agents to compile into it, e.g. `functools.partial(add_floating_hand, pos=(0, 0, 1))`.

    Raises:
      InputError: a file is missing or is no valid MJCF.
      ManifestError: the manifest is broken, or does not belong to the scene.xml.
    """
    file = _model_file(pathlib.Path(path))
    folder = file.parent
    manifest = load_manifest(folder / MANIFEST_FILE)
    if agents:
        spec = read_spec(file)
        manifest = copy.copy(manifest)
        manifest.agents = [*manifest.agents, *(add(spec) for add in agents)]
        model = _compile(spec, file)
    else:
        model = _compile(None, file)
    rooms = load_rooms(folder / manifest.rooms.file) if manifest.rooms.file else None
    tables = build_tables(model, manifest, rooms, folder / MANIFEST_FILE)
    return Scene(folder, manifest, model, tables, rooms, tuple(agents))


def read_spec(file: pathlib.Path) -> mujoco.MjSpec:
    """Parses a scene.xml. Raises InputError."""
    try:
        return mujoco.MjSpec.from_file(str(file))
    except (ValueError, OSError) as e:
        raise _not_mjcf(file, e) from e


def _compile(spec: mujoco.MjSpec | None, file: pathlib.Path) -> mujoco.MjModel:
    try:
        return mujoco.MjModel.from_xml_path(str(file)) if spec is None else spec.compile()
    except (ValueError, OSError) as e:
        raise _not_mjcf(file, e) from e


def _not_mjcf(file: pathlib.Path, e: Exception) -> InputError:
    return InputError(file, f"MuJoCo cannot load it: {e}", mend="convert the scene again")


def _model_file(path: pathlib.Path) -> pathlib.Path:
    """The MJCF file that `path` means: itself, the one in that folder, or the one of the shipped home of that name."""
    mend = "give the folder that `ig2mj convert` wrote"
    if not path.exists() and len(path.parts) == 1 and (SHIPPED_HOMES / path).is_dir():
        path = SHIPPED_HOMES / path
    if path.is_dir():
        folder = path
    elif path.is_file():
        folder = path.parent
        if path.name in MODEL_FILES:
            return path
    else:
        shipped = sorted(p.parent.name for p in SHIPPED_HOMES.glob(f"*/{MANIFEST_FILE}"))
        homes = f", or one of {', '.join(shipped)}" if shipped and len(path.parts) == 1 else ""
        raise InputError(path, "there is no such scene", mend=mend + homes)
    for name in MODEL_FILES:
        if (folder / name).is_file():
            return folder / name
    raise InputError(folder, f"holds no {MODEL_FILES[0]}", mend=mend)
