"""A robot's MJCF, Menagerie style, as `ig2mj convert robot` writes robots: `object.xml`, `meshes/`, `robot.json`.

The file is compiled, and the robot is written from the compiled model: MuJoCo itself resolves classes, frames and
folders. What is not the robot's is left out: floors, lights, free objects, targets. What is kept:

- Bodies, with those that are fixed to each other made one; joints; masses; visual and collision geoms with their
  friction. Meshes are written as OBJ, in the colours of their materials and with images that their coordinates place.
- Equalities: of joints, of tendons that are sums of joints, connections and welds between bodies. Linkages of grippers
  stay closed.
- Limits of actuators, as limits of motors. Joints without an actuator are passive where the file has actuators.
  Several joints on the tendon of one actuator become one that leads and others that follow.
- Sites and cameras, as links that a layout can name; the keyframe "home", else the first, as positions at the start.

A free joint of the base is dropped: the layout says whether it drives. So are two slides and a hinge by which some
files move a base over the floor: the base is then omnidirectional.
"""

from __future__ import annotations

import json
import os
import pathlib
import time
from collections.abc import Sequence
from typing import Any

import mujoco
import numpy as np

from ig2mj.errors import InputError, without_lines
from ig2mj.scene.manifest import FORMAT_VERSION, Manifest, save_manifest
from ig2mj.scene.mjcf_files import read_mjcf

from .base.naming import file_slug
from .base.options import ConvertOptions
from .base.outcome import ConversionOutcome
from .base.output import MARK, replaced_folder
from .bodies.mjcf_robot import KINDS, MjcfRobot, MovingLink, is_endless, pose_of
from .bodies.robot_description import FORMAT_VERSION as ROBOT_VERSION
from .bodies.robot_description import ROBOT_FILE
from .hulls.convex import reduce_vertices, solid_hull
from .mjcf.model_builder import ModelBuilder, write_model
from .mjcf.robot_looks import colour_of, image_of, textured_mesh
from .mjcf.robot_ties import add_ties
from .reading.mjcf_grippers import Mounting, assembled

LEAST_MASS, LEAST_INERTIA = 1e-3, 1e-7
"""kg and kg m2 of a link that moves and weighs nothing, which MuJoCo refuses."""

THINNEST = 1e-3
"""m: flat collision meshes are thickened to this."""


def convert_mjcf_robot(
    file: str | os.PathLike,
    out: str | os.PathLike,
    *,
    name: str | None = None,
    options: ConvertOptions | None = None,
    grippers: Sequence[Mounting] = (),
) -> ConversionOutcome:
    """Converts a robot's MJCF.

    Args:
      file: of the robot, or a scene that includes it. out: folder for the result, replaced when everything went well.
      name: of the robot, default the model's. grippers: other files that are mounted on it.

    Raises:
      InputError: MuJoCo cannot load the file, it names files outside of its folder, or there is no robot in it.
      UnknownNameError: there is nothing of that name to mount a gripper on.
    """
    path, start = pathlib.Path(file), time.perf_counter()
    options = options or ConvertOptions()
    options.progress(0, 2, f"reading {path.name}")
    if not path.is_file():
        raise InputError(path, "is not a file", element="--mjcf", fix="name a robot's MJCF")
    roots = [] if options.mesh_root is None else [pathlib.Path(options.mesh_root)]
    root = read_mjcf(path, roots)
    try:
        model = assembled(path, grippers, roots) if grippers else mujoco.MjModel.from_xml_path(str(path))
        robot = MjcfRobot(model, path)
    except (ValueError, OSError, mujoco.FatalError) as e:
        raise InputError(path, f"MuJoCo cannot load it: {without_lines(e)}", fix="name a file that MuJoCo opens") from e
    title = root.get("model", "")
    called = name or file_slug(path.stem if title in ("", "MuJoCo Model") or title.endswith(" scene") else title)
    options.progress(1, 2, f"writing {called}")
    with replaced_folder(out) as folder:
        _write(robot, called, folder, options)
        (folder / ROBOT_FILE).write_text(json.dumps(_described(robot, called), indent=1), encoding="utf-8")
        source = {"kind": "robot", "file": path.name}
        save_manifest(Manifest(format_version=FORMAT_VERSION, name=called, objects=[], source=source), folder / MARK)
    options.progress(2, 2, called)
    seconds = {"all": time.perf_counter() - start}
    return ConversionOutcome(1, [], [], len(robot.warnings), seconds, first_warnings=robot.warnings[:5])


def _described(robot: MjcfRobot, name: str) -> dict[str, Any]:
    """The content of `robot.json`."""
    model, followers = robot.model, {f.joint: f.leader for f in robot.followers}
    joints = []
    for number, link in robot.joints.items():
        kind = KINDS[mujoco.mjtJoint(int(model.jnt_type[number]))]
        if kind == "revolute" and not model.jnt_limited[number]:
            kind = "continuous"
        leader = followers.get(number)
        joints.append(
            {
                "name": robot.joint_name(number),
                "type": kind,
                "parent": robot.links[link].above,
                "child": link,
                "effort": robot.actuated.get(number, 0.0),
                "velocity": 0.0,
                "mimics": None if leader is None else robot.joint_name(leader),
                "passive": bool(robot.actuated) and number not in robot.actuated and leader is None,
            }
        )
    frames = {
        frame: {"on": on, "pos": pose[:3, 3].round(9).tolist(), "axes": pose[:3, :3].round(9).tolist()}
        for frame, (on, pose) in robot.frames().items()
    }
    described = {"format_version": ROBOT_VERSION, "name": name, "base": robot.base, "joints": joints, "frames": frames}
    return described | {"start": robot.start(), "omnidirectional": robot.omnidirectional}


def _write(robot: MjcfRobot, name: str, folder: pathlib.Path, options: ConvertOptions) -> None:
    """Writes `object.xml` and `meshes/`."""
    builder = ModelBuilder(name, folder)
    bodies: dict[str, mujoco.MjsBody] = {}
    for link in robot.links.values():
        parent = builder.spec.worldbody if link.above is None else bodies[link.above]
        called = name if link.above is None else f"{name}_{link.name}"
        quat = np.zeros(4)
        mujoco.mju_mat2Quat(quat, link.pose[:3, :3].ravel())
        body = parent.add_body(name=called, pos=link.pose[:3, 3], quat=quat)
        bodies[link.name] = body
        if link.above is None:
            body.add_freejoint(name=f"{name}/free")
        else:
            _add_joint(robot, link, body, f"{name}_{robot.joint_name(link.joint)}")
        _set_inertia(robot, link, body)
        _add_geoms(robot, link, body, builder, options)
    bodies[robot.base].pos = [0.0, 0.0, max(-_lowest(builder, bodies[robot.base]), 0.0)]
    add_ties(robot, name, bodies, builder.spec)
    write_model(builder.spec, folder / "object.xml", exact=True)


def _lowest(builder: ModelBuilder, base: mujoco.MjsBody) -> float:
    """m: lowest point of the base's collision geometry below its frame."""
    model = builder.spec.compile()
    body, low = model.body(base.name).id, 0.0
    for geom in np.flatnonzero((model.geom_bodyid == body) & (model.geom_contype > 0)):
        pose = pose_of(model.geom_pos[geom], model.geom_quat[geom])
        centre, half = model.geom_aabb[geom, :3], model.geom_aabb[geom, 3:]
        low = min(low, float((pose[:3, 3] + pose[:3, :3] @ centre)[2] - np.abs(pose[2, :3]) @ half))
    return low


def _add_joint(robot: MjcfRobot, link: MovingLink, body: mujoco.MjsBody, name: str) -> None:
    model, j = robot.model, link.joint
    dof = int(model.jnt_dofadr[j])
    added = body.add_joint(
        name=name,
        type=mujoco.mjtJoint(int(model.jnt_type[j])),
        axis=model.jnt_axis[j],
        ref=float(model.qpos0[model.jnt_qposadr[j]]),
        armature=float(model.dof_armature[dof]),
        frictionloss=float(model.dof_frictionloss[dof]),
        springref=float(model.qpos_spring[model.jnt_qposadr[j]]),
    )
    added.damping[0] = float(model.dof_damping[dof]) if np.size(added.damping) else 0.0
    added.stiffness[0] = float(model.jnt_stiffness[j])
    if model.jnt_limited[j]:
        added.limited, added.range = mujoco.mjtLimited.mjLIMITED_TRUE, model.jnt_range[j]


def _set_inertia(robot: MjcfRobot, link: MovingLink, body: mujoco.MjsBody) -> None:
    mass, centre, inertia = robot.inertia(link)
    inertia = inertia + LEAST_INERTIA * np.eye(3)
    body.explicitinertial = True
    body.mass, body.ipos = max(mass, LEAST_MASS), centre
    body.fullinertia = [*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]]


def _add_geoms(
    robot: MjcfRobot, link: MovingLink, body: mujoco.MjsBody, builder: ModelBuilder, options: ConvertOptions
) -> None:
    model, counts = robot.model, {"collision": 0, "visual": 0}
    own = [g for g in range(model.ngeom) if model.geom_bodyid[g] in link.parts and not is_endless(model, g)]
    colliding = [g for g in own if model.geom_contype[g] or model.geom_conaffinity[g]]
    drawn = [g for g in own if g not in colliding and model.geom_group[g] <= 2 and colour_of(model, g)[3] > 0]
    for kind, geoms in (("collision", colliding), ("visual", drawn or colliding)):
        for geom in geoms:
            of_class = builder.collision_class if kind == "collision" else builder.visual_class
            pose = link.parts[int(model.geom_bodyid[geom])] @ pose_of(model.geom_pos[geom], model.geom_quat[geom])
            quat = np.zeros(4)
            mujoco.mju_mat2Quat(quat, pose[:3, :3].ravel())
            shape: dict[str, Any] = {"type": mujoco.mjtGeom(int(model.geom_type[geom])), "size": model.geom_size[geom]}
            image = None if kind == "collision" else image_of(robot, geom)
            if model.geom_dataid[geom] >= 0 and shape["type"] == mujoco.mjtGeom.mjGEOM_MESH:
                mesh = _mesh(robot, geom, f"{body.name}_{kind}", builder, kind, image is not None, options)
                if mesh is None:
                    continue
                shape = {"type": mujoco.mjtGeom.mjGEOM_MESH, "meshname": mesh}
            added = body.add_geom(
                of_class, name=f"{body.name}/{kind}_{counts[kind]}", pos=pose[:3, 3], quat=quat, mass=0.0, **shape
            )
            counts[kind] += 1
            added.rgba = colour_of(model, geom)
            if image is not None and (material := builder.textures.material(image)) is not None:
                added.material = material
            if kind == "collision":
                added.friction, added.condim = model.geom_friction[geom], int(model.geom_condim[geom])
                added.solref, added.solimp = model.geom_solref[geom], model.geom_solimp[geom]


def _mesh(
    robot: MjcfRobot, geom: int, label: str, builder: ModelBuilder, kind: str, textured: bool, options: ConvertOptions
) -> str | None:
    """The asset of a geom's mesh; of one that collides its convex hull. None: it is flat."""
    model, mesh = robot.model, int(robot.model.geom_dataid[geom])
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    vertices = np.array(model.mesh_vert[first : first + count], float)
    if kind == "collision":
        hull, problem = solid_hull(vertices, THINNEST)
        if hull is None:
            robot.warnings.append(f"mesh '{model.mesh(mesh).name}' {problem}: it does not collide")
            return None
        hull = reduce_vertices(hull, options.max_hull_vertices)
        return builder.meshes.add(hull.vertices, hull.faces, label)
    if textured:
        vertices, faces, coordinates = textured_mesh(model, mesh)
        return builder.meshes.add(vertices, faces, label, uv=coordinates, surface=True)
    begin, number = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    return builder.meshes.add(vertices, np.array(model.mesh_face[begin : begin + number]), label, surface=True)
