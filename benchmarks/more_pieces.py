"""What more collision pieces cost: a home against the same home with every piece of a movable body cut in two.

    python benchmarks/more_pieces.py [--home birch] [--out FOLDER] [--seconds 1.5]

The doubled home is written to FOLDER (default out/benchmarks/more_pieces/HOME), so that other benchmarks can take it as
--scene; its shapes fill the same space. Measured here: C MuJoCo on one core, processor time of a physics step with the
whole home asleep, and with all loose objects thrown about (a random push of 0.5 m/s every half second).
"""

from __future__ import annotations

import dataclasses
import pathlib
import shutil
import time

import manifold3d
import mujoco
import numpy as np
import tyro

from ig2mj.scene.paths import SHIPPED_HOMES

WORK = pathlib.Path(__file__).resolve().parents[1] / "out" / "benchmarks" / "more_pieces"
PUSH = 0.5
"""m/s and rad/s."""


@dataclasses.dataclass
class Args:
    """What to measure."""

    home: str = "birch"
    out: pathlib.Path | None = None
    seconds: float = 1.5
    """Simulated time with everything thrown about."""


def write_doubled(source: pathlib.Path, out: pathlib.Path) -> int:
    """The home with every box, cylinder and hull of its objects in two halves; how many pieces were cut."""
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    for name in ("manifest.json", "rooms.npz"):
        if (source / name).exists():
            shutil.copy(source / name, out)
    spec = mujoco.MjSpec.from_file(str(source / "scene.xml"))
    model = spec.compile()
    spec.meshdir, spec.texturedir = (str((source / folder).resolve()) for folder in (spec.meshdir, spec.texturedir))
    (out / "halves").mkdir()
    cut = 0
    for geom in list(spec.geoms):
        number = model.geom(geom.name).id if geom.name else -1
        if number < 0 or "/collision_" not in geom.name or model.geom_bodyid[number] == 0:
            continue
        cut += _halve(spec, geom, model, number, out)
    (out / "scene.xml").write_text(spec.to_xml())
    return cut


def _halve(spec: mujoco.MjSpec, geom: mujoco.MjsGeom, model: mujoco.MjModel, number: int, out: pathlib.Path) -> bool:
    kind, size = mujoco.mjtGeom(int(model.geom_type[number])), model.geom_size[number].copy()
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, np.asarray(geom.quat, dtype=float))
    if kind in (mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_CYLINDER):
        axis = int(size.argmax()) if kind == mujoco.mjtGeom.mjGEOM_BOX else 2
        along = 1 if kind == mujoco.mjtGeom.mjGEOM_CYLINDER else axis
        size[along] /= 2
        shift = rotation.reshape(3, 3)[:, axis] * size[along]
        other = _copy(spec, geom)
        geom.size, other.size = size, size
        geom.pos, other.pos = np.asarray(geom.pos) - shift, np.asarray(geom.pos) + shift
        return True
    if kind != mujoco.mjtGeom.mjGEOM_MESH:
        return False
    points = _points(spec, geom)
    middle, axis = points.mean(axis=0), int(np.ptp(points, axis=0).argmax())
    solid = manifold3d.Manifold.hull_points(points)
    x, y, z = np.eye(3)[axis]
    halves = solid.split_by_plane((float(x), float(y), float(z)), float(middle[axis]))
    other = _copy(spec, geom)
    for half, target, letter in zip(halves, (geom, other), "ab", strict=True):
        mesh = half.to_mesh64()
        name = f"{geom.meshname}_{geom.name.replace('/', '_')}_{letter}"
        file = out / "halves" / f"{name}.obj"
        lines = [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in np.asarray(mesh.vert_properties)[:, :3]]
        lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in np.asarray(mesh.tri_verts)]
        file.write_text("\n".join(lines) + "\n")
        added = spec.add_mesh(name=name, file=str(file.resolve()))
        added.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
        target.meshname = name
    return True


def _points(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> np.ndarray:
    file = pathlib.Path(spec.meshdir, spec.mesh(geom.meshname).file)
    return np.array([line.split()[1:4] for line in file.read_text().splitlines() if line.startswith("v ")], dtype=float)


def _copy(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> mujoco.MjsGeom:
    other = geom.parent.add_geom(spec.find_default("collision"))
    for field in ("type", "pos", "quat", "size", "friction", "condim", "rgba", "meshname"):
        setattr(other, field, getattr(geom, field))
    other.name = f"{geom.name}_half"
    return other


def measure(folder: pathlib.Path, seconds: float) -> tuple[int, float, float]:
    """(collision geoms, microseconds of a step asleep, of a step awake), processor time, least of three runs."""
    model = mujoco.MjModel.from_xml_path(str(folder / "scene.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_step(model, data, round(4.0 / model.opt.timestep))
    settled = data.qpos.copy()
    asleep = min(_steps(model, data, 240) for _ in range(3))
    free = np.flatnonzero(model.jnt_type == int(mujoco.mjtJoint.mjJNT_FREE))
    starts = model.jnt_dofadr[free]
    awake = []
    for _ in range(3):
        mujoco.mj_resetDataKeyframe(model, data, 0)
        data.qpos[:] = settled
        rng, used, count = np.random.default_rng(0), 0.0, 0
        for _ in range(max(1, round(seconds / 0.5))):
            for start in starts:
                data.qvel[start : start + 6] = rng.uniform(-PUSH, PUSH, 6)
            steps = round(0.5 / model.opt.timestep)
            used, count = used + _steps(model, data, steps) * steps, count + steps
        awake.append(used / count)
    return int(np.count_nonzero(model.geom_contype)), asleep * 1e6, min(awake) * 1e6


def _steps(model: mujoco.MjModel, data: mujoco.MjData, count: int) -> float:
    """Processor seconds of a step."""
    started = time.process_time()
    mujoco.mj_step(model, data, count)
    return (time.process_time() - started) / count


def main(args: Args) -> None:
    """Writes the doubled home and prints both homes' figures."""
    source = SHIPPED_HOMES / args.home
    out = args.out or WORK / args.home
    cut = write_doubled(source, out)
    print(f"{args.home}: {cut} pieces cut in two, {out}")
    for name, folder in (("as it is", source), ("doubled", out)):
        geoms, asleep, awake = measure(folder, args.seconds)
        print(f"{name}: {geoms} collision geoms, {asleep:.0f} us a step asleep, {awake:.0f} us thrown about")


if __name__ == "__main__":
    main(tyro.cli(Args))
