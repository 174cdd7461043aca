"""Books, notebooks, papers."""

from __future__ import annotations

from ..shapes import materials, textures
from ..shapes.bricks import block, box, decal
from .entry import Entry
from .model import ObjectBuilder

COVERS = ("dark_red", "navy", "dark_green", "brown", "purple", "teal", "orange", "black", "rose", "gold")


def hardback(b: ObjectBuilder) -> None:
    """A book lying on its back cover: two boards, a spine and the block of pages; collides as one box."""
    x, y, z = b.size
    rgb = materials.tint(b.pick(COVERS), b.rng)
    cloth = materials.plain(rgb, "paper")
    board = 0.003
    b.add(box(x, y, z).collision_only(), cloth)
    for low in (0.0, z - board):
        b.add(box(x, y, board).visual_only().at(z=low), cloth)
    b.add(block((x, board, z), (0, -y / 2 + board / 2, z / 2)).visual_only(), cloth)
    b.add(
        box(x - 0.008, y - 0.008, z - 2 * board).visual_only().at(0, -0.002, board), materials.plain("paper", "paper")
    )
    front = materials.picture("cover", textures.cover(rgb, b.rng))
    b.add(decal(y, x, "z").at(0, 0, z + 0.0003), front)


def notebook(b: ObjectBuilder) -> None:
    """A soft notebook with an elastic band or a ring binding."""
    x, y, z = b.size
    rgb = materials.tint(b.pick(("black", "red", "blue", "green", "pink")), b.rng)
    b.add(box(x, y, z), materials.plain("paper", "paper"))
    b.add(box(x, y, 0.0006).visual_only().at(z=z), materials.plain(rgb, "paper"))
    b.add(block((x, 0.006, z + 0.0012), (0, y * 0.38, z / 2)).visual_only(), materials.plain("black"))


CATEGORIES = [
    Entry("hardback", hardback, (0.235, 0.160, 0.030), 0.55, 10, vary=0.15),
    Entry("notebook", notebook, (0.210, 0.148, 0.013), 0.26, 4, extra=4, wide=True),
]
