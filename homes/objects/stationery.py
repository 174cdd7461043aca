"""Papers, newspapers, pens, notes."""

from __future__ import annotations

from ..shapes import materials, textures
from ..shapes.bricks import Solid, block, box, decal, lathe, soft_box
from .entry import Entry
from .model import ObjectBuilder


def sheets(b: ObjectBuilder, *, rows: int = 14, colour: str = "paper") -> None:
    """A thin stack of printed paper."""
    x, y, z = b.size
    b.add(box(x, y, z), materials.plain(colour, "paper"))
    page = materials.picture("page", textures.paper(b.rng, rows, materials.colour(colour), head=b.rng.random() < 0.7))
    b.add(decal(0.98 * y, 0.98 * x, "z").at(z=z + 0.0003), page)


def newspaper(b: ObjectBuilder) -> None:
    """A folded newspaper: a headline, a photograph, columns."""
    x, y, z = b.size
    paper = (0.86, 0.85, 0.80)
    b.add(soft_box(x, y, z, 0.49 * z), materials.plain(paper, "paper"))

    def front(draw) -> None:
        draw.rectangle([6, 4, 90, 14], fill=(30, 30, 32))
        draw.rectangle([6, 22, 50, 52], fill=(120, 120, 120))
        textures.print_lines(draw, (54, 22, 90, 122), 26, (110, 110, 112), b.rng)
        textures.print_lines(draw, (6, 58, 50, 122), 16, (110, 110, 112), b.rng)

    b.add(
        decal(0.98 * y, 0.97 * x, "z").at(z=z + 0.0004),
        materials.picture("front", textures.custom(front, (96, 128), paper)),
    )


def magazine(b: ObjectBuilder) -> None:
    x, y, z = b.size
    ground = b.pick(("rose", "teal", "yellow", "navy"))
    b.add(box(x, y, z), materials.plain("paper", "paper"))
    rgb = materials.tint(ground, b.rng)
    b.add(
        decal(y, x, "z").at(z=z + 0.0003),
        materials.picture("cover", textures.label(rgb, materials.tint("orange", b.rng), b.rng)),
    )


def notes(b: ObjectBuilder) -> None:
    """A pad of sticky notes."""
    x, y, z = b.size
    colour = b.pick(("yellow", "pink", "sky", "lime"))
    b.add(box(x, y, z), materials.plain(colour, "paper"))
    b.add(
        box(0.9 * x, 0.9 * y, 0.0004).visual_only().turned("y", 1.5).at(0.05 * x, 0, z),
        materials.plain(materials.tint(colour, b.rng, 0.12), "paper"),
    )


def pen(b: ObjectBuilder, *, kind: str = "pen") -> None:
    """A pen, pencil or highlighter lying along x; its tip at +x."""
    x, _, z = b.size
    r = z / 2
    colour = b.pick(
        ("blue", "red", "black", "green") if kind != "highlighter" else ("yellow", "lime", "pink", "orange")
    )
    body = materials.plain(colour if kind != "pencil" else b.pick(("yellow", "red", "green", "navy")))

    def along(solid: Solid) -> Solid:
        return solid.at(z=-x / 2).turned("y", 90).at(z=r)

    if kind == "pencil":
        b.add(along(lathe([(r, 0.08 * x), (r, 0.88 * x)], 6)), body)
        b.add(along(lathe([(r, 0.88 * x), (0.3 * r, 0.97 * x), (0, x)], 8)), materials.plain("birch", "wood"))
        b.add(along(lathe([(0.95 * r, 0), (0.95 * r, 0.08 * x)], 10)), materials.plain("pink", "rubber"))
        b.add(along(lathe([(0.32 * r, 0.965 * x), (0, x)], 6)).visual_only(), materials.plain("black"))
    elif kind == "pen":
        b.add(
            along(
                lathe(
                    [
                        (0.9 * r, 0),
                        (r, 0.05 * x),
                        (r, 0.6 * x),
                        (0.9 * r, 0.86 * x),
                        (0.25 * r, 0.98 * x),
                        (0.1 * r, x),
                    ],
                    12,
                )
            ),
            body,
        )
        b.add(block((0.3 * x, 0.3 * r, 0.2 * r), (-0.32 * x, 0, 2 * r)).visual_only(), materials.metal("silver"))
        b.add(along(lathe([(0.2 * r, 0.97 * x), (0.1 * r, x)], 6)).visual_only(), materials.metal("gold"))
    else:
        b.add(along(lathe([(r, 0), (r, 0.62 * x)], 12)), body)
        b.add(along(lathe([(0.95 * r, 0.62 * x), (0.85 * r, 0.98 * x), (0.6 * r, x)], 12)), materials.plain("black"))
        b.add(block((0.3 * x, 0.4 * r, 0.3 * r), (0.25 * x, 0, 2 * r)).visual_only(), materials.plain("black"))


CATEGORIES = [
    Entry("document", sheets, (0.297, 0.210, 0.003), 0.05, 3),
    Entry("newspaper", newspaper, (0.380, 0.280, 0.012), 0.18, 3),
    Entry("magazine", magazine, (0.275, 0.210, 0.006), 0.25, 4),
    Entry("sticky_note", notes, (0.076, 0.076, 0.012), 0.05, 4),
    Entry("pen", pen, (0.145, 0.011, 0.011), 0.012, 4),
    Entry("pencil", pen, (0.175, 0.008, 0.008), 0.006, 4, options={"kind": "pencil"}),
    Entry("highlighter", pen, (0.130, 0.017, 0.017), 0.018, 4, options={"kind": "highlighter"}),
]
