"""One household: what stands on disk, compiled and as tables."""

from ig2mj.process.public_names import offer_modules
from ig2mj.scene.manifest import Manifest, ObjectEntry, load_manifest, save_manifest
from ig2mj.scene.rooms import Rooms
from ig2mj.scene.scene import Scene, load_scene
from ig2mj.scene.tables import LinkKind, PieceKind, SceneTables

__all__ = [
    "LinkKind",
    "Manifest",
    "ObjectEntry",
    "PieceKind",
    "Rooms",
    "Scene",
    "SceneTables",
    "load_manifest",
    "load_scene",
    "save_manifest",
]

offer_modules(__name__)
