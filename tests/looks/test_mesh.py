"""Triangles that homes are decorated with."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ig2mj.looks import mesh


def rows(part, face):
    """Corners of a face, rounded to tenths of a millimetre, in one order."""
    return tuple(sorted(map(tuple, np.round(part.vertices[part.faces[face]], 4))))


@pytest.mark.parametrize("seed", range(4))
def test_of_two_triangles_with_the_same_corners_the_first_is_shown(seed):
    rng = np.random.default_rng(seed)
    front = mesh.joined(mesh.box(rng.uniform(-50, 50, 3), rng.uniform(0.1, 30, 3)) for _ in range(5))
    front = dataclasses.replace(front, vertices=np.round(front.vertices, 4))
    back = dataclasses.replace(front, vertices=front.vertices + 1e-6, faces=front.faces[:, ::-1])
    part = mesh.joined([front, back, mesh.sheet((0, 0, 0), (3, 0, 0), (0, 0, 2), (0, 0, 1, 1), step=0.5)])
    shown = mesh._one_sided(part)
    count = len(front.faces)
    assert np.array_equal(shown.faces, np.concatenate([part.faces[:count], part.faces[2 * count :]]))
    assert len({rows(shown, k) for k in range(len(shown.faces))}) == len(shown.faces)


@pytest.mark.parametrize("without", ["", "+z", "-x +y"])
def test_a_box_has_the_sides_that_are_asked_for_and_looks_outwards(without):
    made = mesh.box((1.0, -2.0, 0.5), (0.2, 0.4, 0.6), without)
    sides = 6 - len(without.split())
    assert made.faces.shape == (2 * sides, 3) and made.vertices.shape == (4 * sides, 3)
    outward = (made.vertices - [1.0, -2.0, 0.5]) / [0.1, 0.2, 0.3]
    assert np.allclose((outward * made.normals).sum(axis=1), 1.0)
    a, b, c = np.moveaxis(made.vertices[made.faces], 1, 0)
    turned = np.cross(b - a, c - a)
    assert ((turned * made.normals[made.faces[:, 0]]).sum(axis=1) > 0).all()
    seen = {"+-"[int(n.sum() < 0)] + "xyz"[int(np.abs(n).argmax())] for n in made.normals}
    assert seen == {f"{s}{a}" for s in "+-" for a in "xyz"} - set(without.split())
