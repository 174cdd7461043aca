"""Boxes and OBJ files for the converter's tests."""

from __future__ import annotations

import pathlib

import trimesh

Piece = tuple[str, trimesh.Trimesh]


def box(size, centre=(0.0, 0.0, 0.0)) -> trimesh.Trimesh:
    """An axis-aligned box by full edge lengths and centre."""
    return trimesh.creation.box(size, transform=trimesh.transformations.translation_matrix(centre))


def write_obj(file: pathlib.Path, pieces: list[Piece]) -> None:
    """An OBJ with one `o` group per named piece; an empty name writes no group line."""
    file.parent.mkdir(parents=True, exist_ok=True)
    lines, start = [], 1
    for name, mesh in pieces:
        if name:
            lines.append(f"o {name}")
        lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in mesh.vertices]
        lines += [f"f {a + start} {b + start} {c + start}" for a, b, c in mesh.faces]
        start += len(mesh.vertices)
    file.write_text("\n".join(lines) + "\n")


def groups(*meshes: trimesh.Trimesh) -> list[Piece]:
    """Pieces named convex_0, convex_1, ... as iGibson's collision files have them."""
    return [(f"convex_{i}", mesh) for i, mesh in enumerate(meshes)]


def number_text(values) -> str:
    """Numbers as URDF attributes have them."""
    return " ".join(f"{float(v):.6f}" for v in values)
