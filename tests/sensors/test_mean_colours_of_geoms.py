"""The colour that stands for a textured geom where textures are not drawn."""

from __future__ import annotations

import mujoco
import numpy as np

from ig2mj.sensors.render_model import mean_colours

MJCF = """
<mujoco>
  <asset>
    <texture name="checks" type="2d" builtin="checker" width="64" height="64" rgb1="1 0 0" rgb2="0 0 1"/>
    <material name="checked" texture="checks" rgba="1 1 0.5 0.8"/>
    <material name="plain" rgba="0.1 0.2 0.3 1"/>
  </asset>
  <worldbody>
    <geom name="own" size="0.1" rgba="0.4 0.5 0.6 0.7"/>
    <geom name="of_material" size="0.1" material="plain"/>
    <geom name="textured" size="0.1" material="checked"/>
  </worldbody>
</mujoco>
"""


def test_a_texture_counts_by_its_mean_times_the_materials_colour():
    model = mujoco.MjModel.from_xml_string(MJCF)
    found = mean_colours(model, np.array([2, 0, 1]))
    np.testing.assert_allclose(found[0], [0.5, 0.0, 0.25, 0.8], atol=0.01)
    np.testing.assert_allclose(found[1:], [[0.4, 0.5, 0.6, 0.7], [0.1, 0.2, 0.3, 1.0]], rtol=1e-6)
    assert mean_colours(model, np.zeros(0, int)).shape == (0, 4)
