"""A home with our hand, written for a process that has Genesis and not ig2mj.

    python -m benchmarks.peers.genesis_export OUT HOME [HOME ...]

OUT/<home>/ gets `scene.xml`, the collision meshes, and `home.json`: the settled pose of every joint, what the hand can
reach (`ig2mj.calibration.reach`), and masses and places of the bodies, by which the other process checks what it read.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import json
import pathlib
import shutil
import sys
from typing import Any

import mujoco
import numpy as np

import ig2mj
from ig2mj.agents.floating_hand import add_floating_hand
from ig2mj.calibration.reach import find_reach
from ig2mj.engine.native.settle import settle
from ig2mj.sampling.perturbation import loose_objects
from ig2mj.scene.scene import Scene

JOINT_SIZE = {0: 7, 1: 4, 2: 1, 3: 1}
"""Numbers in qpos by MuJoCo's type of joint: free, ball, slide, hinge."""


def export(home: str, out: pathlib.Path) -> None:
    """Writes one home.

    Args:
      home: name of a shipped home, or a folder. out: folder to write; its name is the home's from then on.
    """
    bare = ig2mj.load_scene(home)
    settled = settle(bare)
    reach = find_reach(bare, settled)
    scene = ig2mj.load_scene(home, [functools.partial(add_floating_hand, pos=tuple(reach.start))])
    out.mkdir(parents=True, exist_ok=True)
    _write_xml(scene, out)
    model, tables = scene.model, scene.tables
    data = mujoco.MjData(model)
    poses = {}
    for joint in map(bare.model.joint, range(bare.model.njnt)):
        size = JOINT_SIZE[int(joint.type[0])]
        start, here = int(joint.qposadr[0]), int(model.joint(joint.name).qposadr[0])
        data.qpos[here : here + size] = settled.qpos[start : start + size]
        poses[joint.name] = _plain(data.qpos[here : here + size])
    mujoco.mj_forward(model, data)
    moving = [b for b in map(model.body, range(1, model.nbody)) if b.name and model.body_weldid[b.id]]
    name_of = [model.body(int(root)).name for root in tables.object_root]
    written = {
        "home": out.name,
        "objects": tables.num_objects,
        "collision_geoms": int(np.count_nonzero(model.geom_contype | model.geom_conaffinity)),
        "contacts_at_rest": int((data.contact.dist < 0).sum()),
        "dofs": model.nv,
        "poses": poses,
        "loose": [name_of[i] for i in loose_objects(tables)],
        "in_reach": [name_of[i] for i in reach.objects],
        "hand_joints": [model.joint(int(joint)).name for joint, _ in model.actuator_trnid],
        "mass": {b.name: float(b.mass[0]) for b in moving},
        "centre_of_mass": {b.name: _plain(data.xipos[b.id]) for b in moving},
        "reach": {f.name: _plain(getattr(reach, f.name)) for f in dataclasses.fields(reach)},
    }
    (out / "home.json").write_text(json.dumps(written))
    print(
        f"{out}: {tables.num_objects} objects, {model.nv} degrees of freedom, {len(reach.objects)} in reach", flush=True
    )


def _write_xml(scene: Scene, out: pathlib.Path) -> None:
    """The scene with the hand, and the meshes of geoms that collide."""
    spec = scene.spec()
    for key in list(spec.keys):
        spec.delete(key)  # of another model, without the hand
    solid = {g.meshname for g in spec.geoms if g.type == mujoco.mjtGeom.mjGEOM_MESH and (g.contype or g.conaffinity)}
    source = pathlib.Path(scene.folder) / spec.meshdir
    for mesh in spec.meshes:
        if mesh.file and (mesh.name or pathlib.Path(mesh.file).stem) in solid:
            (out / "meshes" / mesh.file).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source / mesh.file, out / "meshes" / mesh.file)
    text = spec.to_xml()
    if spec.meshdir:
        text = text.replace(f'meshdir="{spec.meshdir}"', 'meshdir="meshes"')
    (out / "scene.xml").write_text(text)


def _plain(value: Any) -> Any:
    """Numbers and lists, for JSON."""
    return np.asarray(value).tolist()


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("homes", nargs="+")
    args = parser.parse_args()
    for home in args.homes:
        folder = pathlib.Path(home)
        export(home, args.out / (folder.name if folder.is_dir() else home))
    sys.stdout.flush()


if __name__ == "__main__":
    main()
