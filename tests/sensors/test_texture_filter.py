"""Textures of the ray caster's pictures are averaged over what a pixel covers."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from ig2mj.sensors.texture_filter import DISTANCE, averaged, fit_textures, texels_per_metre

MJCF = """
<mujoco>
  <asset>
    <texture name="checks" type="2d" builtin="checker" width="64" height="32" rgb1="1 1 1" rgb2="0 0 0"/>
    <material name="once" texture="checks"/>
    <material name="twice" texture="checks" texrepeat="{repeat} {repeat}"/>
    <mesh name="square" vertex="0 0 0  1 0 0  1 1 0  0 1 0  0 0 -1" texcoord="0 0  0.5 0  0.5 0.5  0 0.5  0 0"
          face="0 1 2  0 2 3  0 1 4  1 2 4  2 3 4  3 0 4"/>
  </asset>
  <worldbody>
    <geom type="{kind}" mesh="square" size="1 1 1" material="twice"/>
  </worldbody>
</mujoco>
"""


def model_with(repeat=2, kind="mesh"):
    words = MJCF.format(repeat=repeat, kind=kind)
    return mujoco.MjModel.from_xml_string(words if kind == "mesh" else words.replace('mesh="square" size', "size"))


def test_repeated_twice_a_texture_is_twice_as_fine():
    (once,), (twice,) = (texels_per_metre(model_with(n)).values() for n in (1, 2))
    assert twice == pytest.approx(2 * once)
    assert 1 < once < np.sqrt(64 * 32) * 0.5, "half of the texture lies on a metre, and less on the other faces"


def test_a_fine_texture_becomes_even_and_a_coarse_one_stays():
    near, far = model_with(), model_with()
    fit_textures(near, 1e-5)
    np.testing.assert_array_equal(near.tex_data, model_with().tex_data)
    fit_textures(far, 64 / DISTANCE)
    np.testing.assert_allclose(far.tex_data, near.tex_data.mean(), atol=1)


def test_textures_that_no_mesh_lays_out_stay():
    model = model_with(kind="box")
    fit_textures(model, 64.0)
    np.testing.assert_array_equal(model.tex_data, model_with(kind="box").tex_data)


@pytest.mark.parametrize(("width", "shares"), [(1.0, (0, 1, 0)), (2.0, (0.25, 0.5, 0.25)), (3.0, (1 / 3,) * 3)])
def test_a_texel_is_shared_over_the_width_and_the_other_side(width, shares):
    texels = np.zeros((5, 6, 1), np.float32)
    texels[0, 2] = 1.0
    found = averaged(texels, width)
    np.testing.assert_allclose(found[[-1, 0, 1], 2, 0], np.array(shares) * shares[1], atol=1e-6)
    assert found.sum() == pytest.approx(1.0)
