"""A converted home as PyBullet would have been given it by iGibson: rewritten URDFs in a folder, and where each goes.

The geometry is read from the dataset again and scaled as iGibson scales it;
every convex group becomes one `o` group of an OBJ, of which Bullet makes one hull each. Fixed joints are merged, masses
come from the category's density, friction is Bullet's 0.5 per body. Start poses are the converted home's, so that both
engines begin alike. Halves parked outside the house are left out, which can only make PyBullet faster.

Nothing here imports PyBullet: `pybullet_worker.py` loads what is written.
"""

from __future__ import annotations

import pathlib
import shutil
from collections.abc import Sequence
from xml.sax.saxutils import quoteattr

import msgspec
import mujoco
import numpy as np
from ig2mj_converters.base.description import PackedImage
from ig2mj_converters.base.options import ConvertOptions
from ig2mj_converters.bodies.assembly import Assembly, BodyPlan, VisualPart
from ig2mj_converters.bodies.joint_limits import joint_range, unit_axis
from ig2mj_converters.bodies.joint_rules import FRICTION, FRICTION_BY_CATEGORY
from ig2mj_converters.hulls.pieces import HullOptions
from ig2mj_converters.model_task import build_model, decompose_model
from ig2mj_converters.reading.dataset import Dataset
from scipy.spatial.transform import Rotation

from benchmarks.peers.bullet_description import BulletBody, BulletCamera, BulletScene
from ig2mj.scene.manifest import ObjectEntry
from ig2mj.scene.scene import Scene

BUILDING = ("walls", "floors", "ceilings")
SCENE_FILE = "bullet_scene.json"


def write_bullet_scene(
    scene: Scene,
    dataset_root: pathlib.Path,
    folder: pathlib.Path,
    camera: BulletCamera,
    extra: Sequence[BulletBody] = (),
) -> BulletScene:
    """Writes the URDFs and meshes of a converted home, and `bullet_scene.json`, into `folder`.

    Args:
      scene: converted from the dataset.
      dataset_root: the dataset it was converted from.
      extra: bodies in addition to the home's, a robot's; their files are in `folder` already.

    Raises:
      InputError: a model is not in the dataset, or broken.
    """
    dataset = Dataset(dataset_root)
    folder.mkdir(parents=True, exist_ok=True)
    data = mujoco.MjData(scene.model)
    if scene.model.nkey:
        mujoco.mj_resetDataKeyframe(scene.model, data, 0)
    mujoco.mj_kinematics(scene.model, data)
    assemblies: dict[tuple, Assembly] = {}
    bodies: list[BulletBody] = []
    for entry in scene.manifest.objects:
        if entry.parked:
            continue
        key = (entry.category, entry.model, entry.scale)
        if key not in assemblies:
            assemblies[key] = _assembly(scene, dataset, entry)
        bodies += _write_object(folder, entry, assemblies[key], scene.model, data)
    result = BulletScene(scene.name, [*bodies, *extra], camera)
    (folder / SCENE_FILE).write_bytes(msgspec.json.format(msgspec.json.encode(result), indent=1))
    return result


def _assembly(scene: Scene, dataset: Dataset, entry: ObjectEntry) -> Assembly:
    """The object's bodies with the collision pieces, masses and visuals that the conversion gave it."""
    building = entry.category in BUILDING
    read = dataset.building(scene.name, entry.category, entry.model) if building else None
    model = read or dataset.model(entry.category, entry.model)
    given = scene.manifest.source.get("options", {})
    budget = {name: given[name] for name in ("seed", "max_hulls", "max_hull_vertices") if name in given}
    hulls = HullOptions.of(ConvertOptions(**budget), building=building)
    density = None if building else dataset.density(entry.category)
    found = decompose_model(model, hulls)
    return build_model(
        model, found, np.array(entry.scale), density, hulls, False,
        igibson_visuals=True, masses="object" if building else "dataset",
    ).assembly  # fmt: skip


def _write_object(
    folder: pathlib.Path, entry: ObjectEntry, assembly: Assembly, model: mujoco.MjModel, data: mujoco.MjData
) -> list[BulletBody]:
    """One URDF without and one with visuals for each root body of the object."""
    bodies = []
    roots = [k for k in assembly.roots if assembly.bodies[k].collisions or assembly.bodies[k].visuals]
    for root in roots:
        members = _tree(assembly, root)
        name = _names(entry, assembly)[root]
        for with_visuals in (False, True):
            text = _urdf(folder, name, entry, assembly, members, with_visuals)
            (folder / f"{name}{'_visual' * with_visuals}.urdf").write_text(text)
        at = data.body(name)
        joints = {
            joint.name: float(data.joint(f"{entry.name}_{joint.name}").qpos[0])
            for k in members[1:]
            if (joint := assembly.bodies[k].joint) is not None
        }
        bodies.append(
            BulletBody(
                name=name,
                object=entry.name,
                urdf=f"{name}.urdf",
                urdf_with_visuals=f"{name}_visual.urdf",
                pos=_three(at.xpos),
                quat=_xyzw(at.xquat),
                fixed=entry.fixed and root == 0,
                joints=joints,
                motor_force=FRICTION_BY_CATEGORY.get(entry.category, FRICTION),
            )
        )
    return bodies


def _names(entry: ObjectEntry, assembly: Assembly) -> list[str]:
    """MJCF names of the assembly's bodies: the manifest lists the roots', the others follow the naming rule."""
    roots = dict(zip(assembly.roots, entry.bodies, strict=True))
    return [roots.get(k, f"{entry.name}_{body.name}") for k, body in enumerate(assembly.bodies)]


def _tree(assembly: Assembly, root: int) -> list[int]:
    """Indices of the bodies that hang on a root, the root first."""
    members = [root]
    for index, body in enumerate(assembly.bodies):
        if body.parent in members:
            members.append(index)
    return members


def _urdf(
    folder: pathlib.Path, name: str, entry: ObjectEntry, assembly: Assembly, members: list[int], visuals: bool
) -> str:
    names = _names(entry, assembly)
    lines = [f"<robot name={quoteattr(name)}>"]
    for index in members:
        lines += _link(folder, names[index], assembly.bodies[index], entry.category, visuals)
    for index in members[1:]:
        body = assembly.bodies[index]
        joint, parent = body.joint, body.parent
        assert joint is not None and parent is not None
        limits = joint_range(joint)
        kind = joint.type if limits is not None else "continuous"
        x, y, z = unit_axis(joint)
        lines += [
            f"<joint name={quoteattr(joint.name)} type={quoteattr(kind)}>{_origin(body.pose)}",
            f"<parent link={quoteattr(names[parent])}/><child link={quoteattr(names[index])}/>",
            f'<axis xyz="{x:.9g} {y:.9g} {z:.9g}"/>',
        ]
        if limits is not None:
            lines.append(f'<limit lower="{limits[0]:.9g}" upper="{limits[1]:.9g}" effort="1000" velocity="1000"/>')
        lines.append("</joint>")
    return "\n".join([*lines, "</robot>\n"])


def _link(folder: pathlib.Path, name: str, body: BodyPlan, category: str, visuals: bool) -> list[str]:
    inertial = body.inertial
    i = inertial.inertia
    lines = [
        f"<link name={quoteattr(name)}><inertial>{_origin(inertial.pose)}<mass value='{inertial.mass:.9g}'/>"
        f'<inertia ixx="{i[0, 0]:.9g}" ixy="{i[0, 1]:.9g}" ixz="{i[0, 2]:.9g}" iyy="{i[1, 1]:.9g}" '
        f'iyz="{i[1, 2]:.9g}" izz="{i[2, 2]:.9g}"/></inertial>'
    ]
    ceiling = category == "ceilings"  # the converted home gives ceilings no collision geometry
    file = f"{name}_collision.obj"
    if body.collisions:
        write_obj(folder / file, [(piece.vertices, piece.faces) for piece in body.collisions])
    if body.collisions and not ceiling:
        lines.append(f"<collision><geometry><mesh filename={quoteattr(file)}/></geometry></collision>")
    if visuals and not ceiling:  # seen from inside a ceiling hides nothing; the converted home hides it
        lines += [_visual(folder, f"{name}_visual_{k}", part) for k, part in enumerate(body.visuals)]
        if body.hulls_as_visuals and body.collisions:
            lines.append(f"<visual><geometry><mesh filename={quoteattr(file)}/></geometry></visual>")
    return [*lines, "</link>"]


def _visual(folder: pathlib.Path, name: str, part: VisualPart) -> str:
    if part.kind == "mesh":
        assert part.vertices is not None and part.faces is not None
        material = None
        if part.texture is not None:
            assert not isinstance(part.texture, PackedImage), "datasets in iGibson's layout have image files"
            picture = pathlib.Path(part.texture)
            kept = f"{picture.parent.parent.name}_{picture.name}"
            if not (folder / kept).exists():
                shutil.copyfile(picture, folder / kept)
            material = f"{name}.mtl"
            (folder / material).write_text(f"newmtl skin\nKd 1 1 1\nmap_Kd {kept}\n")
        write_obj(folder / f"{name}.obj", [(part.vertices, part.faces)], uv=part.uv, material=material)
        shape = f"<mesh filename={quoteattr(f'{name}.obj')}/>"
    elif part.kind == "box":
        shape = '<box size="{:.9g} {:.9g} {:.9g}"/>'.format(*part.size)
    elif part.kind == "sphere":
        shape = f'<sphere radius="{part.size[0]:.9g}"/>'
    else:
        shape = f'<{part.kind} radius="{part.size[0]:.9g}" length="{part.size[1]:.9g}"/>'
    colour = ""
    if part.rgba is not None and part.texture is None:
        rgba = " ".join(f"{v:.4g}" for v in part.rgba)
        colour = f'<material name={quoteattr(name)}><color rgba="{rgba}"/></material>'
    return f"<visual>{_origin(part.pose)}<geometry>{shape}</geometry>{colour}</visual>"


def write_obj(
    file: pathlib.Path,
    groups: list[tuple[np.ndarray, np.ndarray]],
    uv: np.ndarray | None = None,
    material: str | None = None,
) -> None:
    """Writes an OBJ with one `o` group per (vertices [n, 3], faces [m, 3]); Bullet makes one hull of each.

    Args:
      uv: [n, 2] per vertex of a single group. material: an .mtl file next to it, with a material "skin".
    """
    lines = [] if material is None else [f"mtllib {material}"]
    start = 1
    for k, (vertices, faces) in enumerate(groups):
        lines.append(f"o convex_{k}")
        lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices]
        if uv is not None:
            lines += [f"vt {u:.6g} {v:.6g}" for u, v in uv]
        if material is not None:
            lines.append("usemtl skin")
        for face in np.asarray(faces) + start:
            lines.append("f " + " ".join(f"{v}/{v}" if uv is not None else f"{v}" for v in face))
        start += len(vertices)
    file.write_text("\n".join(lines) + "\n")


def _origin(pose: np.ndarray) -> str:
    x, y, z = pose[:3, 3]
    r, p, w = Rotation.from_matrix(pose[:3, :3]).as_euler("xyz")
    return f'<origin xyz="{x:.9g} {y:.9g} {z:.9g}" rpy="{r:.9g} {p:.9g} {w:.9g}"/>'


def _three(values: np.ndarray) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in values)
    return x, y, z


def _xyzw(quat: np.ndarray) -> tuple[float, float, float, float]:
    w, x, y, z = (float(v) for v in quat)
    return x, y, z, w
