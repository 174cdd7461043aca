"""The MJCF model under construction: options, default classes, and the stores that all objects share."""

from __future__ import annotations

import pathlib
import xml.etree.ElementTree as ElementTree

import mujoco

from ig2mj.errors import InputError, without_lines

from ..base.naming import NamePool
from .mesh_store import MeshStore
from .textures import TextureStore

#: Names of the folders next to scene.xml.
MESH_FOLDER, TEXTURE_FOLDER = "meshes", "textures"
#: Geom groups: the viewer shows 0 to 2 and hides the others until their number is pressed.
VISUAL_GROUP, COLLISION_GROUP, HIDDEN_GROUP = 0, 3, 4
#: Sliding friction: Bullet multiplies 0.5 by 0.5, MuJoCo takes the larger. The other two
#: are MuJoCo's own defaults (m).
FRICTION = (0.25, 0.005, 0.0001)
#: Rolling friction (m) of recognised cylinders and spheres. Bullet has none, but puts to sleep whatever rolls slower
#: than 0.8 m/s; without any, a can would roll on for ever here.
ROLLING_FRICTION = 0.001
#: Contacts are listed from this distance on, without force: how `touching` sees what Bullet's margins let it see (m).
GAP = 0.003
TIMESTEP = 1 / 120
GRAVITY = (0.0, 0.0, -9.8)


class ModelBuilder:
    """An `MjSpec` with iGibson's physics options, default classes "collision" and "visual", and shared assets.

    Attributes:
      spec: the model. folder: the output folder, which gets `meshes/` and `textures/`.
      assets: folder, relative to `folder`, that gets them instead.
      category_colours: untextured visuals get their category's colour instead of the source's.
      meshes, textures: stores of assets. body_names, joint_names: give each name once.
      warnings: object name -> lines, "" for the whole model.
    """

    def __init__(self, name: str, folder: pathlib.Path, *, category_colours: bool = False, assets: str = "."):
        self.category_colours = category_colours
        self.spec, self.folder = mujoco.MjSpec(), folder
        self.spec.modelname = name
        self.spec.modelfiledir = str(folder)
        meshes, textures = (pathlib.PurePosixPath(assets, part) for part in (MESH_FOLDER, TEXTURE_FOLDER))
        self.spec.meshdir, self.spec.texturedir = str(meshes), str(textures)
        self.spec.compiler.degree = False
        self.meshes = MeshStore(self.spec, folder / meshes)
        self.textures = TextureStore(self.spec, folder / textures)
        self.body_names, self.joint_names = NamePool(), NamePool()
        self.body_names.take("world")
        self.warnings: dict[str, list[str]] = {}
        _set_options(self.spec.option)
        self.collision_class = self.spec.add_default("collision", self.spec.default)
        self.visual_class = self.spec.add_default("visual", self.spec.default)
        _set_classes(self.collision_class.geom, self.visual_class.geom)

    def files_outside(self) -> list[str]:
        """Meshes and textures that were not written into `folder`, relative to it."""
        if pathlib.PurePosixPath(self.spec.meshdir) == pathlib.PurePosixPath(MESH_FOLDER):
            return []
        meshes = [f"{self.spec.meshdir}/{name}" for name in self.meshes.files]
        return meshes + [f"{self.spec.texturedir}/{name}" for name in self.textures.files]

    def warn(self, owner: str, text: str) -> None:
        """Notes a warning about an object, or about the whole model for owner ''."""
        self.warnings.setdefault(owner, []).append(text)


def write_model(spec: mujoco.MjSpec, file: pathlib.Path, *, exact: bool = False) -> mujoco.MjModel:
    """Compiles the model, writes it, and returns what MuJoCo loads from the written file.

    exact: with ten digits where bodies and joints are, instead of MuJoCo's six: along a robot's chain of links those
      add up to micrometres.

    Raises:
      InputError: MuJoCo refuses the model.
    """
    try:
        spec.compile()
        text = spec.to_xml()
        file.write_text(_with_more_digits(text, spec) if exact else text, encoding="utf-8")
        return mujoco.MjModel.from_xml_path(str(file))
    except (ValueError, mujoco.FatalError) as e:
        raise InputError(spec.modelname, f"does not compile: {without_lines(e)}") from e


def _with_more_digits(text: str, spec: mujoco.MjSpec) -> str:
    root = ElementTree.fromstring(text)
    for tag, attributes, find in (("body", ("pos", "quat"), spec.body), ("joint", ("axis",), spec.joint)):
        for element in root.iterfind(f".//worldbody//{tag}"):
            for attribute in attributes:
                if attribute in element.attrib:
                    values = getattr(find(element.get("name", "")), attribute)
                    element.set(attribute, " ".join(f"{float(v):.10g}" for v in values))
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _set_options(option) -> None:
    """Physics that household objects survive at 1/120 s, with sleeping allowed.

    Newton with up to 50 iterations reaches its tolerance in fewer than 10 on a home; implicitfast takes joint damping
    implicitly; the rest are MuJoCo's defaults, which MJX-Warp shares.
    """
    option.timestep = TIMESTEP
    option.gravity = GRAVITY
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL
    option.iterations = 50
    option.ls_iterations = 20
    option.enableflags |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)


def _set_classes(collision, visual) -> None:
    collision.group = COLLISION_GROUP
    collision.friction = FRICTION
    collision.gap = GAP
    collision.margin = 0.0
    collision.condim = 3
    visual.group = VISUAL_GROUP
    visual.contype, visual.conaffinity = 0, 0
    visual.density = 0.0
