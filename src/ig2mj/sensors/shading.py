"""Light as OpenGL limits it, in MJX-Warp's ray caster.

What falls on a surface is limited first, all of it together, and then a texture takes its share. Upstream multiplies
first, so that under two bright lights textures are up to a fifth too bright. Its kernel is used with the lines changed
that say so.
"""

# pyright: reportPrivateUsage=false

from __future__ import annotations

import inspect
import types
from collections.abc import Callable, Sequence
from typing import Any

import warp as wp
from mujoco.mjx.third_party.mujoco_warp._src import render

from ig2mj.engine.warp.patches.sources import defined

LIGHT = (
    (
        "    base_color = wp.vec3(color[0], color[1], color[2])\n",
        "    most = wp.vec3(1.0, 1.0, 1.0)\n    shine = wp.vec3(0.0)\n",
    ),
    ("          base_color = wp.cw_mul(base_color, tex_color)\n", "          most = tex_color\n"),
)
"""Lines of upstream's kernel, and what follows them in ours."""

SHINE = (
    (
        "wp.cw_mul(base_color, diff_rgb) + spec_rgb\n",
        "wp.cw_mul(base_color, diff_rgb)\n      shine = shine + spec_rgb\n",
    ),
    ("wp.cw_mul(base_color, hl_diff) + hl_spec\n", "wp.cw_mul(base_color, hl_diff)\n      shine = shine + hl_spec\n"),
    ("wp.min(result, wp.vec3(1.0, 1.0, 1.0))\n", "wp.min(wp.min(result, most) + shine, wp.vec3(1.0, 1.0, 1.0))\n"),
)
"""Parts of its lines, and what stands in their place: highlights are not limited by a texture."""

KNOWN_SHADOWS = ("        use_shadows,\n", '        wp.static(rc_static["use_shadows"]),\n')
"""Whether shadows are cast is compiled into the kernel. Otherwise it has the code of a shadow ray for every light."""

REGISTERS: int | None = 80
"""The most registers of a thread of the kernel, in CUDA. With fewer, a multiprocessor holds more threads, which hide
each other's reads of the trees, but each moves more of its values to memory. None: as many as the compiler chooses."""

_DECORATOR = 'module_options={"fast_math": rc.use_fast_math})'

_AT_CAMERA = '    if wp.static(rc_static["headlight_active"]):\n      cam_pos = ray_origin_world\n'

_FALLS = 'max(*rc_static["headlight_diffuse"], *rc_static["headlight_specular"]) > 0.0'

NO_HEADLIGHT = ((_AT_CAMERA, _AT_CAMERA.replace("])", f"] and {_FALLS})", 1)),)
"""A light at the camera that is black by its own colours is not computed."""

FOV_PER_WORLD = (
    (
        "      ray_dir_local_cam = ray[ray_base + rayid]\n",
        "      wide = cam_fovy[worldid % cam_fovy.shape[0], mujoco_cam_id]\n"
        "      ray_dir_local_cam = ray[ray_base + rayid]\n"
        "      ray_dir_local_cam = wp.normalize(\n"
        "        wp.vec3(wide * ray_dir_local_cam[0], wide * ray_dir_local_cam[1], ray_dir_local_cam[2])\n"
        "      )\n",
    ),
)
"""Rays spread by each world's factor, which takes the place of the field of view in the model's fields."""


def lights_per_world(camera_light: int) -> list[tuple[str, str]]:
    """The light at the camera in each world's colour, which is that of this light; it must be inactive."""
    colour = f"light_diffuse[worldid % light_diffuse.shape[0], {camera_light}]"
    return [
        (f'wp.static(rc_static["{name}"])' + end, f'wp.cw_mul(wp.static(rc_static["{name}"]), {colour})' + end)
        for name, end in (("headlight_ambient", ")\n"), ("headlight_diffuse", ",\n"), ("headlight_specular", ",\n"))
    ]


def limit_light(
    context: Any,
    lights: int,
    make_cast_ray: Callable[..., wp.Function] = render._make_cast_ray,
    changes: Sequence[tuple[str, str]] = (),
) -> None:
    """Lets a render context of MuJoCo Warp shade as OpenGL does, once all else in it is as it stays.

    Args:
      lights: of the render model.
      make_cast_ray: makes the function that finds what a ray hits, from what upstream's takes; left out, upstream's.
      changes: further parts of the kernel's text, and what stands in their place.
    """
    build = render._build_megakernel
    text = inspect.getsource(build)
    for old, new in (*((line, line + more) for line, more in LIGHT), *SHINE, *NO_HEADLIGHT, *changes):
        assert text.count(old) == 1, f"MuJoCo Warp's kernel has changed: {old}"
        text = text.replace(old, new)
    assert text.count(KNOWN_SHADOWS[0]) == 2, "MuJoCo Warp's kernel has changed: shadows"
    text = text.replace(*KNOWN_SHADOWS)
    if REGISTERS is not None:
        assert text.count(_DECORATOR) == 1, "MuJoCo Warp's kernel has changed: its options"
        text = text.replace(_DECORATOR, f"{_DECORATOR[:-1]}, cuda_max_registers={REGISTERS})")
    own = defined(build.__name__, text, {**build.__globals__, "_make_cast_ray": make_cast_ray})
    context._megakernel = own(types.SimpleNamespace(nlight=lights), context)
