"""Cloth in thousands of worlds: position-based dynamics (XPBD), one block of threads per cloth.

    python -m benchmarks.speed.cloth solver                    100, 225, 400 vertices x 1,024, 4,096, 16,384 worlds
    python -m benchmarks.speed.cloth parts                     the same step with parts of the solver left out
    python -m benchmarks.speed.cloth flex                      a 225-vertex flex of MuJoCo Warp for comparison
    python -m benchmarks.speed.cloth images                    the ray caster with and without refitting moving vertices

A cloth of n x n vertices falls onto a table and a sphere (`benchmarks.harness.cloth_solver`). Nothing of ig2mj is used:
this program measures whether thousands of homes can simulate cloth.
"""

# Warp's kernels are not Python, so nothing may check them:
# pyright: reportIndexIssue=false, reportAttributeAccessIssue=false, reportArgumentType=false, reportCallIssue=false
# pyright: reportOperatorIssue=false, reportInvalidTypeForm=false, reportGeneralTypeIssues=false
# pyright: reportReturnType=false, reportAssignmentType=false

from __future__ import annotations

import argparse
import pathlib
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import warp as wp

from benchmarks.harness import results
from benchmarks.harness.cloth_solver import (
    BENDING,
    CONTROL_STEP,
    DENSITY,
    GRAVITY,
    SHEAR,
    SIZE,
    SUBSTEPS,
    THICKNESS,
    THREADS,
    Cloth,
    Sheets,
    box,
    make_cloth,
    prism,
    push_bodies,
    sphere,
)

SETTLE_STEPS, CALL_STEPS, CALLS = 45, 30, 5

PARTS = ("shear", "bending", "contacts", "thickness")

TABLE, BALL, MUG = box((0.4, 0.4, 0.02)), sphere(0.1), prism(0.04, 0.05, 22)


def table_scene(cloth: Cloth, worlds: int, seed: int = 0, **options: Any) -> Sheets:
    """A cloth above a table with a ball and a mug, at another place in each world. z = 0 is the table's top."""
    draw = np.random.default_rng(seed)
    angle, shift = draw.uniform(0, 2 * np.pi, worlds), draw.uniform(-0.08, 0.08, (worlds, 2))
    flat = cloth.vertices - cloth.vertices.mean(0)
    turn = np.stack([np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)], -1).reshape(worlds, 2, 2)
    start = np.zeros((worlds, len(flat), 3))
    start[..., :2] = np.einsum("wij,vj->wvi", turn, flat[:, :2]) + shift[:, None]
    start[..., 2] = 0.25 + draw.uniform(0, 1e-3, start.shape[:2])
    at = np.tile
    pieces = [(TABLE, at([0.0, 0.0, -0.02], (worlds, 1))), (BALL, at([0.0, 0.0, 0.1], (worlds, 1))),
              (MUG, at([0.2, 0.0, 0.05], (worlds, 1)))]  # fmt: skip
    return Sheets(cloth, start, pieces, **options)


def timed(step: Callable[[], Any], calls: int = CALLS, steps: int = CALL_STEPS) -> list[float]:
    """Seconds of a step in each of several calls; on a GPU a call is one CUDA graph."""
    device = wp.get_device()
    if device.is_cuda:
        step()
        with wp.ScopedCapture() as capture:
            for _ in range(steps):
                step()
        graph = capture.graph
        run: Callable[[], Any] = lambda: wp.capture_launch(graph)  # noqa: E731
    else:
        run = lambda: [step() for _ in range(steps)]  # noqa: E731
    run()
    wp.synchronize()
    found = []
    for _ in range(calls):
        began = time.perf_counter()
        run()
        wp.synchronize()
        found.append((time.perf_counter() - began) / steps)
    return found


def solver_row(n: int, worlds: int, without: str = "", coupled: bool = False) -> dict[str, Any]:
    """Control steps a second of n x n vertices; `without`: one of `PARTS`, left out."""
    cloth = make_cloth(
        n, n, shear=None if without == "shear" else SHEAR, bending=None if without == "bending" else BENDING
    )
    options = {"use_contacts": without != "contacts", "thickness": 0.0 if without == "thickness" else THICKNESS}
    sheets = table_scene(cloth, worlds, **options)
    before = wp.get_mempool_used_mem_current(sheets.device) if sheets.device.is_cuda else 0
    for _ in range(SETTLE_STEPS if without != "contacts" else 1):
        sheets.step()
    wp.synchronize()
    force = wp.zeros((worlds, 4), dtype=wp.spatial_vector)
    body = wp.array([-1, 1, 2], dtype=int)
    offset = wp.zeros(3, dtype=wp.vec3)
    weight = 2.0 * float(cloth.mass.sum()) * -GRAVITY

    def both() -> None:
        sheets.step()
        if coupled:
            force.zero_()
            inputs = [sheets.piece_impulse, body, offset, sheets.num_pieces, CONTROL_STEP, weight]
            wp.launch(push_bodies, (worlds, sheets.num_pieces), inputs, [force])

    seconds = timed(both)
    median = float(np.median(seconds))
    pos = sheets.positions
    return {
        "case": "solver", "vertices": n * n, "elements": len(cloth.elements), "colours": len(cloth.colours) - 1,
        "worlds": worlds, "substeps": SUBSTEPS, "threads": THREADS, "without": without, "two_way": coupled,
        "control_steps_per_s": round(worlds / median),
        "range": [round(worlds / max(seconds)), round(worlds / min(seconds))],
        "ms_per_control_step": round(1e3 * median, 4),
        "touching_vertices": round(float(sheets.touches.numpy().mean()), 1),
        "worlds_touching": round(float((sheets.touches.numpy() > 0).mean()), 4),
        "kinetic_energy_J": float(sheets.kinetic_energy.mean()),
        "finite": bool(np.isfinite(pos).all()),
        "kB_per_world": round(sheets.bytes_per_world() / 1e3, 2),
        "pool_MB": round(before / 1e6, 1),
    }  # fmt: skip


FLEX = """
<mujoco>
  <option timestep="{timestep}" solver="CG" iterations="50" tolerance="1e-6"/>
  <size memory="64M"/>
  <visual><global offwidth="128" offheight="128"/></visual>
  <worldbody>
    <light pos="0 0 2"/>
    <camera name="eye" pos="0 -0.9 0.7" xyaxes="1 0 0 0 0.6 0.8" fovy="50"/>
    <geom type="box" size="0.4 0.4 0.02" pos="0 0 -0.02" rgba="0.5 0.4 0.3 1"/>
    <geom type="sphere" size="0.1" pos="0 0 0.1" rgba="0.3 0.3 0.8 1"/>
    <flexcomp name="cloth" type="grid" count="{n} {n} 1" spacing="{gap} {gap} {gap}" pos="0 0 0.25" radius="0.004"
              mass="{mass}" dim="2" rgba="0.8 0.2 0.2 1">
      <edge equality="true" damping="0.01"/>
      <contact contype="{contact}" conaffinity="{contact}" selfcollide="none" solref="0.01"/>
    </flexcomp>
  </worldbody>
</mujoco>
"""


def _flex_model(n: int, contact: int) -> Any:
    import mujoco

    text = FLEX.format(timestep=1 / 240, n=n, gap=SIZE / (n - 1), mass=DENSITY * SIZE**2, contact=contact)
    return mujoco.MjModel.from_xml_string(text)


def flex_row(n: int, worlds: int) -> dict[str, Any]:
    """The same cloth as a flex of MuJoCo Warp: 8 steps of 1/240 s a control step, nothing may sleep."""
    import mujoco
    import mujoco.mjx.third_party.mujoco_warp as mjw

    model = _flex_model(n, 1)
    data = mujoco.MjData(model)
    most_contacts = most_rows = 0
    for _ in range(8 * SETTLE_STEPS):
        mujoco.mj_step(model, data)
        most_contacts, most_rows = max(most_contacts, data.ncon), max(most_rows, data.nefc)
    m = mjw.put_model(model)
    d = mjw.put_data(model, data, nworld=worlds, nconmax=2 * most_contacts + 64, njmax=int(1.3 * most_rows) + 256)

    def step() -> None:
        for _ in range(8):
            mjw.step(m, d)

    seconds = timed(step, calls=3, steps=4)
    median = float(np.median(seconds))
    return {
        "case": "flex", "vertices": n * n, "worlds": worlds, "steps": 8, "timestep": 1 / 240,
        "control_steps_per_s": round(worlds / median),
        "range": [round(worlds / max(seconds)), round(worlds / min(seconds))],
        "ms_per_control_step": round(1e3 * median, 3),
        "contacts_native": most_contacts, "rows_native": most_rows,
        "finite": bool(np.isfinite(d.qpos.numpy()).all()),
        "MB_per_world": round(wp.get_mempool_used_mem_high(wp.get_device()) / worlds / 1e6, 3)
        if wp.get_device().is_cuda else 0.0,
    }  # fmt: skip


def images_row(n: int, worlds: int, size: int = 128) -> dict[str, Any]:
    """Images a second of MuJoCo Warp's ray caster over the same cloths: as they are, and after each is refitted."""
    import mujoco
    import mujoco.mjx.third_party.mujoco_warp as mjw

    model = _flex_model(n, 0)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    m = mjw.put_model(model)
    d = mjw.put_data(model, data, nworld=worlds)
    mjw.forward(m, d)
    context = mjw.create_render_context(
        model, nworld=worlds, cam_res=(size, size), render_rgb=[True], render_depth=[True]
    )
    sheets = table_scene(make_cloth(n, n), worlds)
    for _ in range(SETTLE_STEPS):
        sheets.step()
    moved = sheets.pos.reshape((worlds, n * n))

    def draw(refit: bool) -> Callable[[], None]:
        def step() -> None:
            if refit:
                wp.copy(d.flexvert_xpos, moved)
                mjw.refit_bvh(m, d, context)
            mjw.render(m, d, context)

        return step

    mjw.refit_bvh(m, d, context)
    with_refit, without = timed(draw(True), steps=5), timed(draw(False), steps=5)
    return {
        "case": "images", "vertices": n * n, "worlds": worlds, "pixels": [size, size],
        "images_per_s": round(worlds / float(np.median(without))),
        "images_per_s_refit": round(worlds / float(np.median(with_refit))),
        "ms_refit": round(1e3 * float(np.median(with_refit) - np.median(without)), 3),
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("what", choices=["solver", "parts", "flex", "images"])
    parser.add_argument("--grid", type=int, nargs="+", help="vertices along an edge")
    parser.add_argument("--worlds", type=int, nargs="+")
    parser.add_argument("--rows", type=pathlib.Path, help="rows are added to this file, as JSON lines")
    args = parser.parse_args()
    wp.config.quiet = True
    defaults = {
        "solver": ((10, 15, 20), (1024, 4096, 16384)),
        "parts": ((15,), (4096,)),
        "flex": ((15,), (256, 1024, 4096)),
        "images": ((15,), (1024, 4096)),
    }
    grids, worlds = args.grid or defaults[args.what][0], args.worlds or defaults[args.what][1]
    about = {**results.provenance(), "device": wp.get_device().name, "warp": wp.__version__}
    for n in grids:
        for count in worlds:
            if args.what == "solver":
                rows: list[dict] = [solver_row(n, count), solver_row(n, count, coupled=True)]
            elif args.what == "parts":
                rows = [solver_row(n, count, without) for without in ("", *PARTS)]
            else:
                rows = [(flex_row if args.what == "flex" else images_row)(n, count)]
            for row in rows:
                results.keep_row(row | about, args.rows)


if __name__ == "__main__":
    main()
