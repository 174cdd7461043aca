"""The cloth prototype's physics: a catenary, a bent strip, a slope, rest, and momentum that goes into a body."""

from __future__ import annotations

import math

import numpy as np
import pytest
import warp as wp
from scipy import optimize

from benchmarks.harness.cloth_solver import CONTROL_STEP, GRAVITY, Sheets, box, make_cloth, sphere
from benchmarks.speed import cloth


def settle(sheets: Sheets, seconds: float) -> None:
    for _ in range(round(seconds / CONTROL_STEP)):
        sheets.step()


def test_no_two_elements_of_a_colour_share_a_vertex():
    sheet = make_cloth(6, 7)
    for first, last in zip(sheet.colours[:-1], sheet.colours[1:], strict=True):
        used = sheet.elements[first:last, :3].ravel()
        used = used[used >= 0]
        assert len(used) == len(set(used))
    assert len(sheet.elements) == 6 * 6 + 5 * 7 + 2 * 5 * 6 + 6 * 5 + 4 * 7


def test_a_strip_between_two_points_hangs_as_a_catenary():
    columns, span = 15, 0.4
    sheet = make_cloth(2, columns, width=0.5, height=0.02, shear=1e-6, bending=None)
    start = sheet.vertices.copy()
    start[:, 0] *= span / 0.5
    pinned = np.array([0, columns - 1, columns, 2 * columns - 1])
    sheets = Sheets(sheet, start[None], [], pinned=pinned, thickness=0.0, damping=2.0, substeps=20, device="cpu")
    settle(sheets, 6.0)
    # length = 2 a sinh(span / 2a), sag = a (cosh(span / 2a) - 1)
    a = optimize.brentq(lambda a: 2 * a * math.sinh(span / (2 * a)) - 0.5, 0.05, 5.0)
    sag = a * (math.cosh(span / (2 * a)) - 1)
    found = -sheets.positions[0, :, 2].min()
    assert found == pytest.approx(sag, rel=0.03)
    middle = sheets.positions[0, :columns]
    assert middle[:, 2] == pytest.approx(a * np.cosh((middle[:, 0] - span / 2) / a) - a - sag, abs=0.006)


def elastica(stiffness: float, load: float, length: float) -> np.ndarray:
    """Where a clamped strip ends under its weight: stiffness theta'' = -load (length - s) cos theta."""
    from scipy.integrate import cumulative_trapezoid, solve_bvp

    s = np.linspace(0, length, 200)
    slope = solve_bvp(
        lambda s, y: np.stack([y[1], -load / stiffness * (length - s) * np.cos(y[0])]),
        lambda y0, y1: np.array([y0[0], y1[1]]),
        s,
        np.zeros((2, 200)),
    ).sol(s)[0]
    along = cumulative_trapezoid(np.stack([np.cos(slope), np.sin(slope)]), s, initial=0)
    return along[:, -1]


@pytest.mark.parametrize("stiffness", [0.005, 0.02])
def test_a_clamped_strip_bends_as_an_elastica_does_under_its_weight(stiffness):
    columns, length, width = 9, 0.28, 0.04
    gap = length / (columns - 1)
    sheet = make_cloth(2, columns, width=length, height=width, bending=stiffness)
    pinned = np.array([0, 1, columns, columns + 1])
    options = {"pinned": pinned, "thickness": 0.0, "damping": 3.0, "substeps": 40, "device": "cpu"}
    sheets = Sheets(sheet, sheet.vertices[None], [], **options)
    settle(sheets, 5.0)
    end = elastica(stiffness, cloth.DENSITY * -GRAVITY, length - gap / 2)  # the first hinge is that of a whole gap
    found = sheets.positions[0, [columns - 1, 2 * columns - 1]].mean(0) - [gap / 2, 0, 0]
    assert found[[0, 2]] == pytest.approx(end * [1, -1], abs=0.05 * length)


@pytest.mark.parametrize(("degrees", "slides"), [(18, False), (26, True)])
def test_a_cloth_slides_where_the_slope_is_steeper_than_its_friction(degrees, slides):
    angle = math.radians(degrees)  # friction 0.4 holds up to 21.8 degrees
    sheet = make_cloth(5, 5, width=0.1, height=0.1)
    turn = np.array([[math.cos(angle), 0, -math.sin(angle)], [0, 1, 0], [math.sin(angle), 0, math.cos(angle)]])
    up = turn @ [0, 0, 1]
    start = sheet.vertices @ turn.T + up * cloth.THICKNESS / 2
    sheets = Sheets(sheet, start[None], [(box((2, 2, 0.02)), (-up * 0.02)[None])], device="cpu")
    half = -angle / 2  # a rotation about y that lifts the x axis
    sheets.piece_quat = wp.array([[0.0, math.sin(half), 0.0, math.cos(half)]], dtype=wp.quat, device="cpu")
    sheets._inputs[14] = sheets.piece_quat
    settle(sheets, 1.0)
    moved = np.linalg.norm(sheets.positions[0].mean(0) - start.mean(0))
    assert (moved > 0.1) if slides else (moved < 0.004)


def test_energy_does_not_grow_at_rest_and_nothing_goes_through_the_table():
    sheets = cloth.table_scene(make_cloth(10, 10), 2, device="cpu")
    settle(sheets, 4.0)
    assert (sheets.touches.numpy() > 10).all()
    rest = sheets.kinetic_energy + sheets.potential_energy
    most = 0.0
    for _ in range(60):
        sheets.step()
        most = max(most, float((sheets.kinetic_energy + sheets.potential_energy - rest).max()))
    assert most < 1e-3 * rest.max()
    assert sheets.kinetic_energy.max() < 1e-4
    over = sheets.positions
    on_table = (np.abs(over[..., :2]) < 0.38).all(-1)
    assert over[on_table][:, 2].min() > -1e-3
    assert np.linalg.norm(over - [0, 0, 0.1], axis=-1).min() > 0.1 - 1e-3


def test_momentum_that_the_cloth_loses_is_the_bodys():
    sheet = make_cloth(7, 7, width=0.2, height=0.2)
    mass, speed = float(sheet.mass.sum()), np.array([0.0, 0.0, -1.0])
    start = sheet.vertices - sheet.vertices.mean(0) + [0, 0, 0.12]
    sheets = Sheets(sheet, start[None], [(sphere(0.1), np.zeros((1, 3)))], gravity=0.0, damping=0.0, device="cpu")
    sheets.vel.assign(np.tile(speed, (49, 1)))
    weight, at, velocity = 0.05, np.zeros(3), np.zeros(3)
    for _ in range(20):
        sheets.step()
        velocity = velocity + sheets.piece_impulse.numpy()[:3] / weight
        at = at + velocity * CONTROL_STEP
        sheets.piece_pos.assign(at[None])
        sheets.piece_vel.assign(velocity[None])
    total = (sheet.mass[:, None] * sheets.vel.numpy()).sum(0) + weight * velocity
    assert velocity[2] < -0.1, "the sphere was pushed"
    assert total == pytest.approx(mass * speed, abs=0.02 * mass)


def test_thickness_keeps_two_layers_apart():
    sheet = make_cloth(4, 8, width=0.14, height=0.06, shear=1e-5, bending=None)
    start = sheet.vertices.copy()
    fold = start[:, 0] > 0.07
    start[fold, 0] = 0.14 - start[fold, 0]
    start[fold, 2] = 0.012
    sheets = Sheets(sheet, start[None], [(box((1, 1, 0.02)), np.array([[0, 0, -0.02 - cloth.THICKNESS / 2]]))],
                    device="cpu")  # fmt: skip
    settle(sheets, 1.0)
    over = sheets.positions[0]
    upper, lower = over[fold], over[~fold]
    apart = np.linalg.norm(upper[:, None] - lower[None], axis=-1)
    rows, columns = np.divmod(np.arange(32), 8)
    far = np.maximum(abs(rows[fold][:, None] - rows[~fold]), abs(columns[fold][:, None] - columns[~fold])) > 1
    assert apart[far].min() > 0.6 * cloth.THICKNESS
