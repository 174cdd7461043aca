"""Things that BEHAVIOR-1K names and iGibson does not have (`ig2mj.knowledge.further`)."""

from __future__ import annotations

import math

from ..shapes import materials
from ..shapes.bricks import ball, block, box, frustum, hull, prism, rod, soft_box, tube
from ..shapes.materials import Material
from ..shapes.turned import cylinder, lathe
from .clothes import folded_garment
from .cloths import folded
from .entry import Entry
from .model import ObjectBuilder


def look(b: ObjectBuilder, colours: tuple, kind: str = "plastic", shine: float = 0.3) -> Material:
    """A flat colour of some, by model."""
    return materials.plain(b.pick(colours), kind, shine)


def slab_of(b: ObjectBuilder, *, colours: tuple, kind: str = "paper", accents: tuple = (), soft: float = 0.0) -> None:
    """A flat thing: a letter, a board, a box; `accents`: colours of a field on it."""
    x, y, z = b.size
    b.add(soft_box(x, y, z, soft * z) if soft else box(x, y, z), look(b, colours, kind))
    if accents:
        b.add(block((0.5 * x, 0.5 * y, 0.0008), (0.08 * x, 0.05 * y, z)).visual_only(), look(b, accents, kind))


def disc_of(b: ObjectBuilder, *, colours: tuple, kind: str = "metal", hole: bool = False) -> None:
    """A coin, a wheel or a disc lying flat."""
    x, _, z = b.size
    b.add(cylinder(x / 2, z, 20), look(b, colours, kind, 0.6))
    b.add(
        cylinder((0.12 if hole else 0.38) * x, 0.0006, 16).visual_only().at(z=z),
        look(b, (*colours[1:], "dark_grey"), kind),
    )


def lump(b: ObjectBuilder, *, colours: tuple, kind: str = "stone", crown: tuple = ()) -> None:
    """A stone, a shell, a bulb: a ball somewhat flat below; `crown`: colours of a tip."""
    x, y, z = b.size
    top = 0.8 * z if crown else z
    b.add(ball(x, y, top, 12), look(b, colours, kind))
    if crown:
        b.add(rod((0, 0, 0.9 * top), (0, 0, z), 0.1 * x, 6).visual_only(), look(b, crown, kind))


def cone_of_scales(b: ObjectBuilder) -> None:
    """A pine cone standing on its base."""
    x, _, z = b.size
    r, brown = x / 2, look(b, ("brown", (0.36, 0.24, 0.16)), "organic")
    b.add(lathe([(0.6 * r, 0), (r, 0.25 * z), (0.85 * r, 0.6 * z), (0.3 * r, z)], 10), brown)
    for k in range(14):
        a, h = 2.4 * k, 0.1 + 0.8 * k / 14
        wide = r * (1.02 - 0.7 * abs(h - 0.25))
        at = (wide * math.cos(a), wide * math.sin(a), h * z - 0.04 * z)
        b.add(ball(0.34 * r, 0.34 * r, 0.1 * z, 4).visual_only().at(*at), brown)


def staff(
    b: ObjectBuilder, *, colours: tuple, kind: str = "wood", ends: tuple[float, float] = (0.5, 1.0), tip: tuple = ()
) -> None:
    """A long round thing lying along x: a bat, a cigarette; `ends`: radii at both ends, relative to the thickest;
    `tip`: colours of the last seventh."""
    x, _, z = b.size
    r = z / 2
    whole = lathe([(ends[0] * r, 0), (ends[0] * r, 0.3 * x), (max(ends) * r, 0.75 * x), (ends[1] * r, x)], 14)
    b.add(whole.at(z=-x / 2).turned("y", 90).at(z=r), look(b, colours, kind))
    if tip:
        b.add(rod((0.36 * x, 0, r), (x / 2, 0, r), 1.03 * r, 12).visual_only(), look(b, tip, kind))


def log(b: ObjectBuilder) -> None:
    """A split log lying along x."""
    x, y, z = b.size
    section = [(-y / 2, 0), (y / 2, 0), (0.3 * y, 0.7 * z), (0, z), (-0.3 * y, 0.7 * z)]
    points = [(s * x / 2, u, v) for s in (-1, 1) for u, v in section]
    b.add(hull(points), look(b, ((0.46, 0.33, 0.22), (0.58, 0.44, 0.30)), "wood"))


def bent_club(b: ObjectBuilder, *, colours: tuple, head: tuple = ("steel", "dark_grey")) -> None:
    """A golf club or a fishing rod lying along x, with a head or a reel at one end."""
    x, y, z = b.size
    r = 0.18 * z
    b.add(rod((-x / 2, 0, r), (0.46 * x, 0, r), r, 8), look(b, colours, "metal"))
    b.add(
        rod((-x / 2, 0, 1.3 * r), (-0.3 * x, 0, 1.3 * r), 1.3 * r, 8).visual_only(),
        look(b, ("black", "brown"), "rubber"),
    )
    b.add(soft_box(0.1 * x, y, z, 0.3 * z).at(0.45 * x), look(b, head, "metal"))


def ring_of(b: ObjectBuilder, *, colours: tuple, kind: str = "leather", buckle: bool = True) -> None:
    """A belt, a collar, a chain, a roll of wire: a closed band lying flat; four pieces collide."""
    x, y, z = b.size
    look_, thick = look(b, colours, kind), 0.5 * z
    points = [
        ((x / 2 - thick) * math.cos(a), (y / 2 - thick) * math.sin(a), thick)
        for a in (k * math.pi / 8 for k in range(16))
    ]
    b.add(tube(points, thick, 8, hulls=0, closed=True), look_)
    for k in range(8):
        (p, q) = (points[2 * k], points[(2 * k + 2) % 16])
        b.add(rod(p, q, thick, 6).collision_only(), look_)
    if buckle:
        b.add(box(1.6 * z, 1.6 * z, z).visual_only().at(x / 2 - thick), look(b, ("gold", "silver"), "metal"))


def knife_block(b: ObjectBuilder) -> None:
    """A wooden block with handles of knives."""
    x, y, z = b.size
    b.add(frustum((x, y), (0.7 * x, y), 0.72 * z, 0.1 * x), look(b, ("oak", "walnut"), "wood"))
    for k in range(4):
        at = (0.1 * x, (k - 1.5) * 0.22 * y, 0.72 * z)
        b.add(rod(at, (at[0] + 0.06 * x, at[1], z), 0.035 * x, 6).visual_only(), look(b, ("black", "dark_grey")))
    b.add(block((0.5 * x, 0.9 * y, 0.28 * z), (0.12 * x, 0, 0.86 * z)).collision_only(), look(b, ("black",)))


def glove(b: ObjectBuilder) -> None:
    """A baseball glove lying on its back: a palm, a thumb and fingers."""
    x, y, z = b.size
    hide = look(b, ("brown", "tan", (0.55, 0.32, 0.18)), "leather")
    b.add(soft_box(0.6 * x, 0.8 * y, 0.8 * z, 0.3 * z).at(-0.2 * x, 0.05 * y), hide)
    for k in range(4):
        b.add(ball(0.5 * x, 0.2 * y, 0.9 * z, 8).at(0.25 * x, (k - 1.0) * 0.2 * y), hide)
    b.add(ball(0.45 * x, 0.2 * y, 0.9 * z, 8).at(-0.05 * x, -0.4 * y), hide)


def boot(b: ObjectBuilder, *, blade: bool = False) -> None:
    """A rubber boot, or an ice skate with a blade; its toe towards +x."""
    x, y, z = b.size
    low = 0.14 * z if blade else 0.0
    skin = look(b, ("white", "black") if blade else ("green", "yellow", "navy"), "rubber")
    b.add(soft_box(x, y, 0.3 * z, 0.1 * z).at(0, 0, low), skin)
    b.add(frustum((0.46 * x, 0.9 * y), (0.5 * x, y), z - 0.25 * z - low).at(-0.24 * x, 0, 0.25 * z + low), skin)
    if blade:
        b.add(box(0.95 * x, 0.3 * y, low), materials.plain("steel", "metal"))


def ski(b: ObjectBuilder) -> None:
    """A ski lying along x with its tip bent up."""
    x, y, z = b.size
    lacquer = look(b, ("red", "blue", "yellow", "teal"))
    b.add(box(0.9 * x, y, 0.2 * z).at(-0.05 * x), lacquer)
    b.add(
        hull(
            [(0.4 * x, s * y / 2, h) for s in (-1, 1) for h in (0, 0.2 * z)]
            + [(x / 2, s * 0.2 * y, h) for s in (-1, 1) for h in (0.8 * z, z)]
        ),
        lacquer,
    )
    b.add(box(0.12 * x, 0.8 * y, 0.5 * z).at(-0.1 * x, 0, 0.2 * z), look(b, ("black",)))


def pallet(b: ObjectBuilder) -> None:
    """A pallet: boards on three runners."""
    x, y, z = b.size
    pine = look(b, ("pine", "tan"), "wood")
    for k in (-1, 0, 1):
        b.add(box(x, 0.08 * y, 0.8 * z).at(0, 0.44 * k * y), pine)
    for k in range(6):
        b.add(box(0.12 * x, y, 0.2 * z).visual_only().at((k - 2.5) * 0.175 * x, 0, 0.8 * z), pine)
    b.add(block((x, y, 0.2 * z), (0, 0, 0.9 * z)).collision_only(), pine)


def shears(b: ObjectBuilder) -> None:
    """Pruning shears, closed, lying along x."""
    x, y, z = b.size
    for s in (-1, 1):
        b.add(
            rod((-x / 2, s * 0.42 * y, z / 2), (0.05 * x, s * 0.05 * y, z / 2), 0.45 * z, 8), look(b, ("red", "green"))
        )
    b.add(
        hull(
            [(0.05 * x, s * 0.2 * y, h * z) for s in (-1, 1) for h in (0.3, 0.7)]
            + [(x / 2, 0, h * z) for h in (0.35, 0.65)]
        ),
        materials.plain("steel", "metal"),
    )


def garment_folded(b: ObjectBuilder, *, kind: str | None = None) -> None:
    folded_garment(b, kind=kind, layers=2)


def tie(b: ObjectBuilder) -> None:
    """A necktie lying along x."""
    x, y, z = b.size
    cloth = look(b, ("navy", "dark_red", "teal", "purple"), "fabric")
    points = [(-x / 2, -0.2 * y), (0.35 * x, -0.5 * y), (x / 2, 0), (0.35 * x, 0.5 * y), (-x / 2, 0.2 * y)]
    b.add(prism(points, z), cloth)


def pipe(b: ObjectBuilder) -> None:
    """A pipe for smoking, lying along x: a stem and a bowl."""
    x, y, z = b.size
    wood = look(b, ("walnut", (0.24, 0.30, 0.34)), "wood", 0.6)
    b.add(rod((-0.3 * x, 0, 0.3 * z), (x / 2, 0, 0.5 * z), 0.2 * y, 8), wood)
    b.add(lathe([(0.3 * y, 0), (0.5 * y, 0.3 * z), (0.45 * y, z)], 12).at(-x / 2 + 0.5 * y), wood)


COINS = {"colours": ("silver", "steel")}
CATEGORIES = [
    Entry(
        "letter", slab_of, (0.110, 0.220, 0.003), 0.02, 2, options={"colours": ("white", "cream"), "accents": ("grey",)}
    ),
    Entry(
        "postcard",
        slab_of,
        (0.105, 0.148, 0.002),
        0.006,
        2,
        options={"colours": ("white", "cream"), "accents": ("sky", "green")},
    ),
    Entry(
        "jigsaw_puzzle",
        slab_of,
        (0.270, 0.190, 0.050),
        0.40,
        2,
        options={"colours": ("blue", "green"), "accents": ("yellow", "pink")},
    ),
    Entry(
        "pizza_box",
        slab_of,
        (0.330, 0.330, 0.045),
        0.20,
        2,
        options={"colours": ("cardboard", "white"), "accents": ("red", "green")},
    ),
    Entry(
        "emery_paper", slab_of, (0.280, 0.230, 0.002), 0.02, 2, options={"colours": ((0.46, 0.34, 0.26), "dark_grey")}
    ),
    Entry("penny", disc_of, (0.019, 0.019, 0.0016), 0.0025, 2, uniform=True, options={"colours": ("copper", "brown")}),
    Entry("nickel", disc_of, (0.021, 0.021, 0.0020), 0.005, 2, uniform=True, options=COINS),
    Entry("quarter", disc_of, (0.024, 0.024, 0.0018), 0.0057, 2, uniform=True, options=COINS),
    Entry(
        "videodisk",
        disc_of,
        (0.120, 0.120, 0.0022),
        0.016,
        2,
        uniform=True,
        options={"colours": ("silver", "sky"), "hole": True},
    ),
    Entry(
        "skateboard_wheel",
        disc_of,
        (0.054, 0.054, 0.034),
        0.09,
        2,
        uniform=True,
        options={"colours": ("white", "orange"), "kind": "rubber", "hole": True},
    ),
    Entry("conch", lump, (0.150, 0.100, 0.090), 0.40, 2, options={"colours": ((0.94, 0.80, 0.68), "cream")}),
    Entry("geode", lump, (0.120, 0.100, 0.080), 0.80, 2, options={"colours": ("grey", "brown")}),
    Entry("jade", lump, (0.050, 0.036, 0.022), 0.06, 2, options={"colours": ("green", "mint")}),
    Entry(
        "daffodil_bulb",
        lump,
        (0.046, 0.046, 0.060),
        0.05,
        2,
        options={"colours": ((0.62, 0.44, 0.26), "brown"), "kind": "organic", "crown": ("lime", "leaf")},
    ),
    Entry("loofa", lump, (0.130, 0.120, 0.095), 0.04, 2, options={"colours": ("pink", "sky"), "kind": "fabric"}),
    Entry(
        "whiskey_stone",
        slab_of,
        (0.022, 0.022, 0.022),
        0.03,
        2,
        options={"colours": ("grey", "dark_grey"), "kind": "stone", "soft": 0.12},
    ),
    Entry(
        "cork",
        staff,
        (0.044, 0.023, 0.023),
        0.004,
        2,
        options={"colours": ((0.72, 0.56, 0.38), "tan"), "ends": (0.95, 1.0)},
    ),
    Entry(
        "cigarette",
        staff,
        (0.084, 0.008, 0.008),
        0.001,
        2,
        options={"colours": ("white", "cream"), "kind": "paper", "ends": (1.0, 1.0), "tip": ("orange", "tan")},
    ),
    Entry("bat", staff, (0.820, 0.066, 0.066), 0.90, 2, options={"colours": ("oak", "ash"), "ends": (0.45, 0.95)}),
    Entry("pinecone", cone_of_scales, (0.070, 0.070, 0.095), 0.04, 2, uniform=True),
    Entry("firewood", log, (0.360, 0.110, 0.100), 1.50, 2),
    Entry("golf_club", bent_club, (1.000, 0.110, 0.050), 0.40, 2, options={"colours": ("chrome", "dark_grey")}),
    Entry("fishing_rod", bent_club, (1.500, 0.080, 0.050), 0.30, 2, options={"colours": ("black", "dark_red")}),
    Entry("belt", ring_of, (0.140, 0.140, 0.034), 0.18, 2, options={"colours": ("brown", "black")}),
    Entry("dog_collar", ring_of, (0.130, 0.130, 0.024), 0.08, 2, options={"colours": ("red", "blue")}),
    Entry(
        "bicycle_chain",
        ring_of,
        (0.260, 0.180, 0.014),
        0.28,
        2,
        options={"colours": ("steel", "dark_grey"), "kind": "metal", "buckle": False},
    ),
    Entry(
        "copper_wire",
        ring_of,
        (0.120, 0.120, 0.018),
        0.10,
        2,
        options={"colours": ("copper", (0.62, 0.36, 0.22)), "kind": "metal", "buckle": False},
    ),
    Entry(
        "bobby_pin",
        staff,
        (0.050, 0.004, 0.004),
        0.001,
        2,
        options={"colours": ("black", "gold"), "kind": "metal", "ends": (1.0, 0.8)},
    ),
    Entry("knife_block", knife_block, (0.170, 0.110, 0.260), 1.60, 2, rest="upright"),
    Entry("baseball_glove", glove, (0.290, 0.240, 0.090), 0.55, 2),
    Entry("rubber_boot", boot, (0.300, 0.110, 0.320), 0.90, 2, rest="standing"),
    Entry("ice_skate", boot, (0.300, 0.100, 0.290), 1.00, 2),
    Entry("ski", ski, (1.600, 0.090, 0.100), 2.40, 2),
    Entry("pallet", pallet, (0.800, 0.600, 0.120), 9.0, 2),
    Entry("pruner", shears, (0.210, 0.070, 0.022), 0.24, 2),
    Entry("jacket", garment_folded, (0.330, 0.280, 0.080), 0.90, 2, options={"kind": "plain"}),
    Entry("skirt", garment_folded, (0.300, 0.260, 0.040), 0.25, 2),
    Entry("quilt", folded, (0.420, 0.360, 0.140), 1.80, 2, options={"layers": 3}),
    Entry("necktie", tie, (0.720, 0.085, 0.008), 0.07, 2),
    Entry("pipe", pipe, (0.140, 0.036, 0.046), 0.06, 2),
    Entry(
        "place_mat",
        slab_of,
        (0.300, 0.400, 0.004),
        0.08,
        2,
        options={"colours": ("teal", "beige"), "kind": "fabric", "accents": ("cream", "rose")},
    ),
]
