"""`Visual`: the model of a scene as it is seen, and data of it at the poses of a world.

Axes: G geoms of the scene, E geoms that are added.
"""

from __future__ import annotations

import dataclasses
import weakref

import mujoco
import numpy as np
from jaxtyping import Int

from ig2mj.errors import EngineError
from ig2mj.looks.costume import Followers, costumes_of, names_of
from ig2mj.looks.furnishing import add_furnishing
from ig2mj.looks.home_plan import HomePlan, read_plan
from ig2mj.looks.interior import TRIM, add_interior
from ig2mj.looks.kept_decoration import Decoration, decoration_of
from ig2mj.looks.light import DAY, NIGHT, Light, set_light
from ig2mj.looks.materials import Material, texels
from ig2mj.looks.mesh import Builder, Triangles
from ig2mj.looks.outside import add_outside
from ig2mj.looks.state_looks import add_lamps, add_tinted_materials, lamp_lights
from ig2mj.scene.geom_groups import VISIBLE_GROUPS
from ig2mj.scene.scene import PLAIN, Scene, check_looks

DECOR = "ig2mj/decoration"
"""Name of the body that has all decoration of a home."""

COSTUMES = "ig2mj/costumes"
"""Name of the body that has what robots wear. Its geoms are drawn on the robots' bodies."""

OUTSIDE = "outside_"
"""How names of materials of the garden and the sky begin."""

FARTHEST = 120.0
"""m that is seen: beyond the sky of a home."""

LIGHTS: dict[str, Light] = {"day": DAY, "night": NIGHT}

PARTS = {"wall": "walls", "floor": "floors", "ceiling": "ceilings"}
"""How names of materials begin -> category of the object of which they are a part; the rest is of no object."""

_FROM_WORLD = (
    "xpos",
    "xquat",
    "xmat",
    "xipos",
    "ximat",
    "cam_xpos",
    "cam_xmat",
    "site_xpos",
    "site_xmat",
    "subtree_com",
)


class Visual:
    """The model of a scene as it is seen, and data of it at the poses of a world.

    Attributes:
      model: the scene's model and what is added; the scene's own where the looks are plain.
      owner: object of each geom, -1 for none. lamps: numbers of lights of lamps.
    """

    def __init__(self, scene: Scene, looks: str):
        """Builds the decoration of a home. Raises UnknownNameError: there are no such looks."""
        check_looks(looks)
        self.scene_name, self.looks = scene.name, looks
        self._plain = scene.model.geom_rgba.copy(), scene.model.geom_matid.copy()
        self.light: Light | None = LIGHTS.get(looks)
        self.model = scene.model if looks == PLAIN else _compiled(scene, looks)
        self._base = self.model.geom_rgba.copy(), self.model.geom_matid.copy()
        self.followers, self.lamps = Followers(scene, self.model), lamp_lights(self.model)
        owners = visual_owners(scene, self.model, self.model.ngeom)
        self.owner: Int[np.ndarray, "G"] = np.concatenate([scene.tables.geom_object, owners])
        self._data: mujoco.MjData | None = None

    def data(self, model: mujoco.MjModel, data: mujoco.MjData) -> mujoco.MjData:
        """Data of `self.model` with the poses of `data`, which is of the scene's model; the next call changes it.

        Colours that the world's model has of its own are taken, too.
        """
        if self.looks == PLAIN:
            return data
        mine = self._data
        if mine is None:
            mine = self._data = mujoco.MjData(self.model)
            mujoco.mj_forward(self.model, mine)
        mine.qpos[:], mine.time = data.qpos, data.time
        for name in _FROM_WORLD:
            of_world = getattr(data, name)
            getattr(mine, name)[: len(of_world)] = of_world
        mine.geom_xpos[: model.ngeom], mine.geom_xmat[: model.ngeom] = data.geom_xpos, data.geom_xmat
        if len(self.followers):
            pos, axes = self.followers.poses(data.xpos[None], data.xmat.reshape(1, -1, 3, 3))
            mine.geom_xpos[self.followers.geoms] = pos[0]
            mine.geom_xmat[self.followers.geoms] = axes[0].reshape(-1, 9)
        for light in self.lamps:
            body = self.model.light_bodyid[light]
            turned = data.xmat[body].reshape(3, 3) @ self.model.light_pos[light]
            mine.light_xpos[light] = data.xpos[body] + turned
        (rgba, material), (base_rgba, base_material) = self._plain, self._base
        changed = np.flatnonzero((model.geom_rgba != rgba).any(axis=1) | (model.geom_matid != material))
        self.model.geom_rgba[:], self.model.geom_matid[:] = base_rgba, base_material
        self.model.geom_rgba[changed], self.model.geom_matid[changed] = (
            model.geom_rgba[changed],
            model.geom_matid[changed],
        )
        return mine


_VISUALS: weakref.WeakKeyDictionary[Scene, dict[str, Visual]] = weakref.WeakKeyDictionary()


def visual_of(scene: Scene, looks: str | None = None) -> Visual:
    """How a scene is seen; made once for each. looks: of `LOOKS`; None: the scene's own. Raises UnknownNameError."""
    looks = looks or scene.looks
    of_scene = _VISUALS.setdefault(scene, {})
    if looks not in of_scene:
        of_scene[looks] = Visual(scene, looks)
    return of_scene[looks]


def decorate(spec: mujoco.MjSpec, scene: Scene, looks: str, fine: bool = True) -> None:
    """Adds the decoration of a home to its spec, which is not compiled yet, behind all that it has.

    Args:
      fine: see `mesh.Builder`.
    """
    if looks == PLAIN:
        return
    light = LIGHTS[looks]
    set_light(spec, light)
    _dress(spec, scene)
    add_tinted_materials(spec, scene)
    add_lamps(spec, scene)
    plan = read_plan(scene)
    if plan is None:
        return
    body, night = spec.worldbody.add_body(name=DECOR), looks == "night"
    for material, mesh in decoration_of(lambda: _decoration(plan, light, night, fine), plan, light, night, fine):
        _add(spec, body, material, mesh)
    for entry in scene.manifest.objects:
        if entry.category == "walls":
            for geom in (g for name in entry.bodies for g in spec.body(name).geoms if g.group == 0 and not g.material):
                geom.rgba = [*TRIM, 1.0]


def _decoration(plan: HomePlan, light: Light, night: bool, fine: bool) -> Decoration:
    """What is added to a home and around it."""
    build, garden = Builder(fine), Builder(fine)
    add_interior(build, plan, light)
    add_furnishing(build, plan, light)
    add_outside(garden, plan, light, night)
    outside = ((dataclasses.replace(m, name=f"{OUTSIDE}{m.name}"), mesh) for m, mesh in garden.meshes())
    return [*build.meshes(), *outside]


def _dress(spec: mujoco.MjSpec, scene: Scene) -> None:
    """Adds the costumes of robots; where their parts are is `Followers`' to say."""
    costumes = costumes_of(scene)
    if not costumes:
        return
    body = spec.worldbody.add_body(name=COSTUMES)
    for number, costume in enumerate(costumes):
        parts = [(names_of("on", number, name), build) for name, build in costume.parts.items()]
        for k, arm in enumerate(costume.arms):
            parts += [(names_of("upper", number, str(k)), arm.upper), (names_of("fore", number, str(k)), arm.fore)]
        for prefix, build in parts:
            for material, mesh in build.meshes():
                _add(spec, body, dataclasses.replace(material, name=f"{prefix}/{material.name}"), mesh)
        for name in costume.hidden:
            for geom in spec.body(name).geoms:
                if geom.group in VISIBLE_GROUPS:
                    geom.rgba, geom.material = [0.0, 0.0, 0.0, 0.0], ""


def _add(spec: mujoco.MjSpec, body: mujoco.MjsBody, material: Material, mesh: Triangles) -> None:
    name = f"ig2mj/{material.name}"
    values = dict(name=name, rgba=material.rgba, specular=material.specular, shininess=material.shininess)
    made = spec.add_material(**values, emission=material.emission)
    if (image := texels(material.image)) is not None:
        texture = spec.add_texture(
            name=name,
            type=mujoco.mjtTexture.mjTEXTURE_2D,
            colorspace=mujoco.mjtColorSpace.mjCOLORSPACE_LINEAR,
            width=image.shape[1],
            height=image.shape[0],
            nchannel=3,
        )
        texture.data = image.tobytes()
        made.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
    asset = spec.add_mesh(name=name, inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
    asset.uservert, asset.userface = mesh.vertices.ravel(), mesh.faces.ravel()
    asset.usernormal, asset.userfacenormal = mesh.normals.ravel(), mesh.faces.ravel()
    asset.usertexcoord, asset.userfacetexcoord = mesh.uv.ravel(), mesh.faces.ravel()
    body.add_geom(
        name=name,
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname=name,
        material=name,
        contype=0,
        conaffinity=0,
        mass=0.0,
        group=0,
    )


def _compiled(scene: Scene, looks: str) -> mujoco.MjModel:
    spec, known = scene.spec(), scene.model
    spec.stat.extent, spec.stat.center = known.stat.extent, known.stat.center
    spec.visual.map.zfar = FARTHEST / float(known.stat.extent)
    decorate(spec, scene, looks)
    model = spec.compile()
    same = model.ngeom >= known.ngeom and model.nq == known.nq and model.ncam == known.ncam
    if not same or (model.geom_bodyid[: known.ngeom] != known.geom_bodyid).any():
        raise EngineError(f"scene '{scene.name}' in {scene.folder} changed since it was loaded (load it again)")
    return model


def visual_owners(scene: Scene, model: mujoco.MjModel, count: int) -> Int[np.ndarray, "E"]:
    """Objects of the geoms that were added to the scene's, up to number `count` of the model."""
    of_category = {entry.category: k for k, entry in enumerate(scene.manifest.objects)}
    owners = []
    for geom in range(scene.model.ngeom, count):
        part = model.geom(geom).name.removeprefix("ig2mj/").partition("_")[0]
        owners.append(of_category.get(PARTS.get(part, ""), -1))
    return np.array(owners, np.int32)
