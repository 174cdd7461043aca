"""Microseconds of an image by the ray caster, by parts and by variants, and how far a variant's images differ.

    python -m benchmarks.speed.rays [--task NAME] [--worlds 1024] [--looks day] [--rows FILE] [--variants NAME ...]

One GPU. Start states of a task's home; the robot's eye, 128 x 128, RGB and depth, once a call, from the same worlds
each time. Variants are timed in turns, `--rounds` times, next to the ray caster as it is (`base`). The calls of a round
follow each other without waiting, as in a training: what the host does for a call is not counted unless the GPU waits
for it.

- `slots`, `poses`, `refit`, `depth`: parts of `base`: which particles are shown; that and where everything is; that
  and the boxes of what moves; images without colour.
- `leaf_N`, `bins_N`: triangles in a leaf of the trees of merged meshes; bins along an axis when they are made.
- `block_N`: threads of a block; a tile of 64 rays is one or several of them.
- `registers_N`: the most registers of a thread; 0: as many as the compiler chooses.
- `size_N`: images of other sizes. `cameras_N`: the eye and N - 1 of the robot's other cameras.
- `cameras_3+registers_0`: both at once.

`differs`: share of pixels that differ from `base` by more than 1 of 255 in a channel; `most`: the largest difference.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import pathlib
import statistics
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import jax
import numpy as np
from mujoco import mjx

import ig2mj
from benchmarks.harness.kernel_times import profiled
from benchmarks.harness.results import keep_row, machine
from benchmarks.speed.batch import device
from ig2mj.scene.scene import LOOKS
from ig2mj.sensors import shading, triangle_trees
from ig2mj.sensors.batch_camera import BatchCamera
from ig2mj.sensors.particle_slots import fill_slots
from ig2mj.worlds.draw import Draw

VARIANTS = (
    *("base", "slots", "poses", "refit", "depth", "leaf_2", "leaf_7", "bins_16"),
    *("block_32", "block_128", "block_256", "size_64", "size_224", "cameras_3"),
    *("registers_0", "registers_64", "registers_80", "registers_96", "registers_128"),
)

PARTS = ("slots", "poses", "refit")
"""Variants that make no image."""


def number_in(variant: str, name: str, otherwise: int) -> int:
    """N of the variant's part `name_N`; `otherwise` where it has no such part."""
    return next(
        (int(part.removeprefix(f"{name}_")) for part in variant.split("+") if part.startswith(f"{name}_")), otherwise
    )


@contextlib.contextmanager
def built(variant: str) -> Iterator[None]:
    """Trees of merged meshes and the kernel are built as the variant says."""
    before = triangle_trees.LEAF, triangle_trees.BINS, shading.REGISTERS
    triangle_trees.LEAF = number_in(variant, "leaf", before[0])
    triangle_trees.BINS = number_in(variant, "bins", before[1])
    shading.REGISTERS = number_in(variant, "registers", before[2] or 0) or None
    try:
        yield
    finally:
        triangle_trees.LEAF, triangle_trees.BINS, shading.REGISTERS = before


def camera_of(env: Any, variant: str, looks: str) -> BatchCamera:
    """The camera of a variant."""
    scene = env.core.engine.scene
    model, tables = scene.model, scene.tables
    eye = model.camera(int(tables.agent_camera[0])).name
    own = [model.camera(k).name for k in range(model.ncam) if tables.body_agent[model.cam_bodyid[k]] == 0]
    count = number_in(variant, "cameras", 1)
    names = [eye, *(name for name in own if name != eye)][:count]
    if len(names) < count:
        raise SystemExit(f"error: the robot has {len(names)} cameras, not {count}")
    size = number_in(variant, "size", 128)
    shape = {"width": size, "height": size, "rgb": "depth" not in variant.split("+"), "depth": True}
    with built(variant):
        camera = BatchCamera(env.core.engine, env.core.rules.model, names, looks=looks, **shape)
    if block := number_in(variant, "block", 0):
        impl = camera._model._impl
        blocks = dataclasses.replace(impl.block_dim, render=block)
        camera._model = camera._model.replace(_impl=impl.replace(block_dim=blocks))
    return camera


def program_of(camera: BatchCamera, variant: str, world: Any) -> Callable[[], Any]:
    """One call of the variant, compiled, which does not wait for its end; its arguments stay on the device."""
    if variant in PARTS:

        def part(physics: Any, view: Any, states: Any) -> Any:
            slots = fill_slots(camera.model, states, view, camera.slots)
            if variant == "slots":
                return slots
            moved = camera._moved(physics, slots, {}, None, Draw())
            if variant == "poses":
                return moved.geom_xpos, moved.geom_xmat, moved.cam_xpos, moved.cam_xmat
            return jax.vmap(lambda d: mjx.refit_bvh(camera._model, d, camera._handle)._impl._jax_token)(moved)

        act = jax.jit(part)
    else:
        act = jax.jit(lambda physics, view, states: (lambda i: (i.rgb, i.depth))(camera(physics, view, states)))
    return lambda: act(world.physics, world.view, world.states)


def compared(images: Any, base: Any) -> dict[str, float]:
    """How far colours are from those of `base`; nothing where they are of another shape."""
    if images is None or images[0] is None or base is None or np.shape(images[0]) != np.shape(base[0]):
        return {}
    apart = np.abs(np.asarray(images[0], np.int16) - np.asarray(base[0], np.int16)).max(-1)
    return {"differs": round(float((apart > 1).mean()), 7), "most": int(apart.max())}


def main(argv: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--task", default="CookingMeat")
    parser.add_argument("--worlds", type=int, default=1024)
    parser.add_argument("--looks", choices=LOOKS, default="day")
    parser.add_argument("--variants", nargs="*", default=VARIANTS)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--calls", type=int, default=10, help="calls of a variant in a round")
    parser.add_argument("--rows", type=pathlib.Path, help="file for the rows; default: they are printed")
    parser.add_argument("--kernels", type=int, default=0, help="also print so many of each variant's longest kernels")
    args = parser.parse_args(argv)
    env = ig2mj.make(args.task, worlds=args.worlds, engine="warp")
    world = env.reset(0).batch.world
    programs, images = dict[str, Callable[[], Any]](), dict[str, Any]()
    for variant in dict.fromkeys(("base", *args.variants)):
        try:
            program = program_of(camera_of(env, variant, args.looks), variant, world)
            images[variant] = jax.tree.map(np.asarray, program()) if variant not in PARTS else (program(), None)[1]
        except Exception as failure:
            print(f"{variant}: {type(failure).__name__}: {str(failure).splitlines()[0][:200]}", flush=True)
            continue
        programs[variant] = program
        jax.block_until_ready(program())
    spent: dict[str, list[float]] = {variant: [] for variant in programs}
    for _ in range(args.rounds):
        for variant, program in programs.items():
            began = time.perf_counter()
            for _ in range(args.calls - 1):
                program()
            jax.block_until_ready(program())
            spent[variant].append((time.perf_counter() - began) / args.calls)
    for variant, seconds in spent.items():
        count = args.worlds * number_in(variant, "cameras", 1)
        row = {
            "benchmark": "rays",
            "variant": variant,
            "looks": args.looks,
            "home": env.task.home,
            "worlds": args.worlds,
            "us_per_image": round(1e6 * statistics.median(seconds) / count, 3),
            "ms_per_call": [round(1e3 * s, 3) for s in seconds],
            **compared(images.get(variant), images["base"]),
        }
        keep_row(row | device() | machine(-1), args.rows)
    for variant, program in programs.items() if args.kernels else ():
        print(f"{variant}:", flush=True)
        profiled(lambda program=program: [program() for _ in range(args.calls)], args.calls, args.kernels, unit="call")


if __name__ == "__main__":
    main()
