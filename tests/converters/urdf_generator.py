"""A seeded generator of URDFs that combines whatever real files do: `write_random_urdf(folder, seed)`.

Trees of up to nine links with all kinds of joints; followers; inertials that are there, missing, dummies or without
mass; primitives, some of no size; meshes as OBJ (with colours of vertices, materials and textures that exist or do not)
and as STL, scaled and mirrored; colours defined anywhere in the file, per link, with three numbers, or not at all;
`package://` paths with percent signs; byte-order marks; namespaces; elements of other tools.
"""

from __future__ import annotations

import pathlib
import urllib.parse

import numpy as np
import trimesh
from PIL import Image

JOINTS = ("revolute", "prismatic", "continuous", "fixed")
PACKAGE = "robot_description"
COLOURS = ("red", "grey", "left to others")
"""Names of materials. The last one is defined nowhere."""


def write_random_urdf(folder: pathlib.Path, seed: int) -> pathlib.Path:
    """Writes a package with a URDF and its meshes; returns the URDF."""
    package = folder / PACKAGE
    for inner in ("urdf", "meshes"):
        (package / inner).mkdir(parents=True, exist_ok=True)
    (package / "package.xml").write_text(f"<package><name>{PACKAGE}</name></package>", encoding="utf-8")
    return _Writer(package, np.random.default_rng(seed), seed).write()


class _Writer:
    def __init__(self, package: pathlib.Path, rng: np.random.Generator, seed: int):
        self._package, self._rng, self._seed = package, rng, seed
        self._meshes = 0
        self._inertials = rng.choice(["all", "some", "none", "massless"], p=[0.4, 0.4, 0.1, 0.1])

    def write(self) -> pathlib.Path:
        rng = self._rng
        count = int(rng.integers(1, 10))
        links = [self._link(k) for k in range(count)]
        joints = [self._joint(k) for k in range(1, count)]
        body = [*links, *joints, *self._materials(), *self._of_other_tools()]
        rng.shuffle(body)  # elements may come in any order; links keep theirs, since the first one is the base
        order = iter(links)
        body = [next(order) if element in links else element for element in body]
        namespace = ' xmlns="http://www.ros.org/urdf"' if self._chance(0.2) else ""
        prefix = ' xmlns:xacro="http://www.ros.org/wiki/xacro"' if self._chance(0.3) else ""
        text = f'<?xml version="1.0"?>\n<robot name="robot {self._seed}"{namespace}{prefix}>{"".join(body)}</robot>\n'
        file = self._package / "urdf" / f"r{self._seed}.urdf"
        file.write_text(text, encoding="utf-8-sig" if self._chance(0.2) else "utf-8")
        return file

    def _chance(self, share: float) -> bool:
        return bool(self._rng.random() < share)

    def _numbers(self, low: float, high: float, count: int = 3) -> str:
        return " ".join(f"{v:.6g}" for v in self._rng.uniform(low, high, count))

    def _origin(self, reach: float = 0.3) -> str:
        if self._chance(0.15):
            return ""
        rpy = f' rpy="{self._numbers(-3, 3)}"' if self._chance(0.7) else ""
        return f'<origin xyz="{self._numbers(-reach, reach)}"{rpy}/>'

    def _link(self, number: int) -> str:
        shapes = ""
        for _ in range(int(self._rng.integers(0, 3))):
            geometry, origin = self._geometry(), self._origin(0.1)
            if self._chance(0.8):
                shapes += f"<collision>{origin}<geometry>{geometry}</geometry></collision>"
            if self._chance(0.8):
                shapes += f"<visual>{origin}<geometry>{geometry}</geometry>{self._look()}</visual>"
        return f'<link name="l{number}">{self._inertial()}{shapes}</link>'

    def _inertial(self) -> str:
        if self._inertials == "none" or (self._inertials == "some" and self._chance(0.5)):
            return ""
        mass = (
            0.0
            if self._inertials == "massless"
            else float(self._rng.choice([0.0, 1e-5, 0.3, 2.0], p=[0.1, 0.1, 0.5, 0.3]))
        )
        moments = (
            {"ixx": 0.002, "iyy": 0.002, "izz": 0.002} if self._chance(0.7) else {"ixx": 5.0, "iyy": 5.0, "izz": 5.0}
        )
        if self._chance(0.1):
            moments = {}
        tensor = " ".join(f'{name}="{value * mass:g}"' for name, value in moments.items())
        inertia = f'<inertia {tensor} ixy="0" ixz="0" iyz="0"/>' if moments else ""
        return f'<inertial>{self._origin(0.05)}<mass value="{mass:g}"/>{inertia}</inertial>'

    def _geometry(self) -> str:
        kind = self._rng.choice(["box", "cylinder", "sphere", "capsule", "mesh"], p=[0.25, 0.15, 0.1, 0.1, 0.4])
        nothing = self._chance(0.08)
        size = 0.0 if nothing else float(self._rng.uniform(0.02, 0.15))
        if kind == "box":
            return f'<box size="{size:.6g} {self._numbers(0.02, 0.2, 2)}"/>'
        if kind == "sphere":
            return f'<sphere radius="{size:.6g}"/>'
        if kind in ("cylinder", "capsule"):
            return f'<{kind} radius="{size:.6g}" length="{self._numbers(0.02, 0.3, 1)}"/>'
        return self._mesh()

    def _mesh(self) -> str:
        self._meshes += 1
        shape = self._rng.integers(3)
        mesh = (
            trimesh.creation.box((0.1, 0.2, 0.05)) if shape == 0
            else trimesh.creation.icosphere(subdivisions=1, radius=0.08) if shape == 1
            else trimesh.creation.cylinder(0.05, 0.2, sections=12)
        )  # fmt: skip
        stem = f"mesh {self._meshes} 50%"
        if self._chance(0.4):
            file = self._package / "meshes" / f"{stem}.stl"
            mesh.export(file)
        else:
            file = self._package / "meshes" / f"{stem}.obj"
            self._write_obj(file, mesh)
        name = file.name if self._chance(0.3) else urllib.parse.quote(file.name)
        named = f"package://{urllib.parse.quote(PACKAGE)}/meshes/{urllib.parse.quote(file.name)}"
        if self._chance(0.4):
            named = f"../meshes/{name}" if "%20" not in name else f"../meshes/{file.name}"
        scale = self._rng.choice(["", ' scale="0.5 0.5 0.5"', ' scale="1 -1 1"', ' scale="1 1.5 0.8"'])
        return f'<mesh filename="{named}"{scale}/>'

    def _write_obj(self, file: pathlib.Path, mesh: trimesh.Trimesh) -> None:
        """With colours of vertices, or a material that may be missing and whose texture may be."""
        kind, lines = self._rng.integers(3), []
        stem = file.stem.replace(" ", "_").replace("%", "")
        if kind == 1:
            lines += [f"mtllib {stem}.mtl", "usemtl skin"]
            if self._chance(0.7):
                (file.parent / f"{stem}.mtl").write_text(f"newmtl skin\nKd 0.2 0.4 0.6\nmap_Kd {stem}.png\n")
            if self._chance(0.6):
                Image.new("RGB", (4, 4), (200, 30, 60)).save(file.parent / f"{stem}.png")
        for x, y, z in mesh.vertices:
            lines.append(f"v {x:.6g} {y:.6g} {z:.6g}" + (" 0.9 0.5 0.1" if kind == 2 else ""))
        lines += [f"vt {u:.6g} {v:.6g}" for u, v, _ in np.abs(mesh.vertices)]
        lines += ["f " + " ".join(f"{i + 1}/{i + 1}" for i in face) for face in mesh.faces]
        text = "\n".join(lines) + "\n"
        file.write_text(text, encoding="utf-8-sig" if self._chance(0.2) else "utf-8")

    def _look(self) -> str:
        kind = self._rng.integers(5)
        if kind == 0:
            return ""
        if kind == 1:
            numbers = self._numbers(0, 1, int(self._rng.choice([3, 4])))
            return f'<material name="own"><color rgba="{numbers}"/></material>'
        if kind == 2:
            return '<material name="painted"><texture filename="../meshes/none.png"/></material>'
        return f'<material name="{self._rng.choice(COLOURS)}"/>'

    def _materials(self) -> list[str]:
        made = ['<material name="red"><color rgba="1 0 0 1"/></material>']
        if self._chance(0.5):
            made.append('<material name="grey"><color rgba="0.5 0.5 0.5"/></material>')
        return made

    def _of_other_tools(self) -> list[str]:
        made = (
            ['<transmission name="t"><type>simple</type><joint name="j1"/></transmission>'] if self._chance(0.3) else []
        )
        return [*made, '<gazebo reference="l0"><material>Gazebo/Red</material></gazebo>'] if self._chance(0.3) else made

    def _joint(self, number: int) -> str:
        rng = self._rng
        kind = str(rng.choice(JOINTS, p=[0.4, 0.25, 0.15, 0.2]))
        parent = int(rng.integers(number))
        inside = self._origin()
        if kind != "fixed" and self._chance(0.9):
            inside += f'<axis xyz="{self._numbers(0.1, 2)}"/>'
        if kind in ("revolute", "prismatic") or self._chance(0.3):
            low, high = sorted(rng.uniform(-1, 1, 2))
            high = low if self._chance(0.05) else high
            inside += f'<limit lower="{low:.6g}" upper="{high:.6g}" effort="{rng.choice([0, 10, 1e30])}" velocity="1"/>'
        if self._chance(0.2):
            inside += '<dynamics damping="0.1" friction="0.2"/>'
        if kind != "fixed" and number > 2 and self._chance(0.3):
            inside += (
                f'<mimic joint="j{int(rng.integers(1, number))}" multiplier="{rng.uniform(-2, 2):.4g}" offset="0.1"/>'
            )
        return (
            f'<joint name="j{number}" type="{kind}"><parent link="l{parent}"/><child link="l{number}"/>{inside}</joint>'
        )
