"""Which cleaning tools have a part that cleans at their surface: what is inside of them touches nothing."""

from __future__ import annotations

import numpy as np

from ig2mj.geometry.poses import matrices_on_host
from ig2mj.scene.tables import PieceKind, SceneTables

COVER = 0.001
"""m of another piece of a tool over all of its cleaning area, from which on that touches nothing."""


def is_hidden(tables: SceneTables, link: int) -> bool:
    """Whether a link's box is inside another convex piece of its body.

    Args:
      link: of a cleaning area; negative: the whole tool cleans.
    """
    if link < 0 or not (tables.link_half[link] > 0).all():
        return False
    signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
    frame = matrices_on_host(np.asarray(tables.link_quat[[link]], float))[0]
    corners = tables.link_pos[link] + (signs * tables.link_half[link]) @ frame.T
    others = (tables.piece_body == tables.link_body[link]) & (tables.piece_geom != tables.link_geom[link])
    return any(_within(tables, int(k), corners) for k in np.flatnonzero(others))


def _within(tables: SceneTables, piece: int, points: np.ndarray) -> bool:
    """Whether points of a body's frame, m, are `COVER` below a piece's surface; round ones count as their boxes."""
    turn = matrices_on_host(np.asarray(tables.piece_quat[[piece]], float))[0]
    local = (points - tables.piece_pos[piece]) @ turn
    if tables.piece_kind[piece] == PieceKind.POLYHEDRON:
        planes = tables.piece_planes[piece]
        away = local @ planes[:, :3].T - planes[:, 3]
    else:
        vertices = tables.piece_vertices[piece]
        away = np.maximum(local - vertices.max(0), vertices.min(0) - local)
    return bool((away < -COVER).all())
