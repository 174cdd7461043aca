"""Where bodies on a slab come to rest."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from ig2mj.scene.resting import DECIMALS, rest

LYING = [0.0, 0.0, 0.05, 1.0, 0.0, 0.0, 0.0]
ON_ITS_EDGE = [1.0, 0.0, 0.068, 0.9659, 0.2588, 0.0, 0.0]


def world(geom: str) -> tuple[ElementTree.Element, ElementTree.Element, list[ElementTree.Element]]:
    """MJCF of a slab and two bodies with one geom each; the slab; the bodies."""
    bodies = "".join(f'<body name="{name}"><freejoint/>{geom}</body>' for name in ("one", "two"))
    slab = '<body name="slab"><geom type="box" size="3 3 0.1" pos="0 0 -0.1"/></body>'
    root = ElementTree.fromstring(
        f'<mujoco><option timestep="0.008333"/><asset><mesh name="gone" file="/nowhere/gone.obj"/></asset>'
        f"<worldbody>{slab}{bodies}</worldbody></mujoco>"
    )
    slab_body, *rest_of_them = root.iter("body")
    return root, slab_body, rest_of_them


def test_what_would_tip_over_lies_and_what_lies_keeps_its_pose():
    found = rest(*world('<geom type="box" size="0.05 0.05 0.05"/>'), LYING + ON_ITS_EDGE)
    assert found[:7].tolist() == LYING
    assert found[9] == pytest.approx(0.05, abs=1e-3)
    assert abs(found[10]) == pytest.approx(1.0, abs=1e-3) or abs(found[11]) == pytest.approx(2**-0.5, abs=1e-3)
    assert np.array_equal(found[7:], np.round(found[7:], DECIMALS))


def test_what_is_only_seen_is_left_out_and_what_cannot_be_read_stays_where_it_is():
    seen = '<geom type="box" size="0.05 0.05 0.05"/><geom class="visual" type="mesh" mesh="gone" material="gone"/>'
    assert rest(*world(seen), LYING + ON_ITS_EDGE)[9] != ON_ITS_EDGE[2]
    assert rest(*world('<geom type="mesh" mesh="gone"/>'), LYING + ON_ITS_EDGE).tolist() == LYING + ON_ITS_EDGE
