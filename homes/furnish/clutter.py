"""Small objects: what lies on what, and what is kept in what, by room. Fills a home up to its number of objects."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

from ..objects.catalogue import catalogue
from .kit import RoomKit
from .placed import Placed
from .room import HomeInProgress
from .table_setting import lay_table

FOOD = ("apple", "orange", "lemon", "tomato", "banana", "pear")
CLOTHES = ("t-shirt", "sock", "sweater", "jeans", "underwear", "scarf", "pajamas")
BOOKS = ("hardback", "hardback", "notebook", "magazine")
TOOLS = ("hammer", "screwdriver", "drill", "saw", "tape", "paint", "scraper", "carton")
TOYS = ("toy", "board_game", "ball", "video_game", "hardback")

IN = {
    "fridge": (
        "milk", "juice", "butter", "cheese", "yogurt", "egg", "lettuce", "beer", "catsup", "jam",
        "water", "steak", "mayonnaise", "wine_bottle", "pop", "salad",
    ),
    "top_cabinet": ("mug", "glass", "plate", "bowl", "cup", "salt", "sugar_jar", "cereal", "jar"),
    "dishwasher": ("plate", "bowl", "mug"),
    "washer": ("t-shirt", "sock"),
    "dryer": ("sweater", "hand_towel"),
    "microwave": ("bowl",),
    "oven": ("casserole",),
    "stove": ("casserole", "lasagna"),
    "chest": ("toy", "sheet", "ball"),
    "stand": ("hardback", "notebook", "medicine"),
    "desk": ("notebook", "pen", "tape", "scissors"),
    "console_table": ("magazine", "folder"),
    "coffee_table": ("magazine", "hardback"),
}  # fmt: skip
"""Host -> what is kept in it (on its inner shelves and in its drawers), in rooms that `IN_ROOM` does not name."""

IN_ROOM = {
    ("kitchen", "bottom_cabinet"): (
        "saucepan", "frying_pan", "bowl", "plate", "canned_food", "pasta", "colander", "lid", "jar",
    ),
    ("kitchen", "sink"): ("detergent", "rag", "bucket"),
    ("kitchen", "shelf"): ("jar", "teapot", "canned_food", "cereal", "bowl", "sugar_jar", "pasta", "oatmeal"),
    ("bathroom", "sink"): ("shampoo", "soap", "bath_towel", "hand_towel"),
    ("bathroom", "shelf"): ("bath_towel", "hand_towel", "shampoo"),
    ("bedroom", "bottom_cabinet"): CLOTHES,
    ("closet", "bottom_cabinet"): CLOTHES,
    ("utility_room", "bottom_cabinet"): ("detergent", "rag", "hand_towel", "sheet"),
    ("closet", "shelf"): (*CLOTHES, "hat", "shoulder_bag", "sandal", "hat"),
    ("corridor", "shelf"): ("gym_shoe", "sandal", "hat", "scarf", "umbrella", "basket"),
    ("bedroom", "shelf"): (*BOOKS, "candle", "hat", "alarm"),
    ("childs_room", "shelf"): TOYS,
    ("playroom", "shelf"): TOYS,
    ("pantry_room", "shelf"): (
        "canned_food", "flour", "olive_oil", "cereal", "oatmeal", "pasta", "jam", "potato",
        "wine_bottle", "jar", "jar", "paper_towel",
    ),
    ("garage", "shelf"): TOOLS,
    ("storage_room", "shelf"): (*TOOLS, "bucket", "basket", "package"),
    ("utility_room", "shelf"): ("detergent", "bucket", "scrub_brush", "rag", "bath_towel", "paper_towel"),
    ("dining_room", "shelf"): ("bowl", "plate", "carafe", "candle", "wine_bottle", "platter"),
    ("exercise_room", "shelf"): ("hand_towel", "water", "gym_shoe", "ball"),
    ("home_office", "shelf"): (*BOOKS, "folder", "folder", "router"),
    ("dining_room", "bottom_cabinet"): ("plate", "bowl", "glass", "platter", "carafe"),
}  # fmt: skip

ON = {
    "bottom_cabinet": (
        "toaster", "kettle", "chopping_board", "coffee_maker", "bowl", "carving_knife", "paper_towel_holder",
        "dish_rack", "jar", "blender", "pepper_grinder", "olive_oil", "mug", "bowl", "tray",
    ),
    "countertop": ("bowl", "chopping_board", "carving_knife", "paper_towel", "jar", "teapot", *FOOD[:3]),
    "breakfast_table": ("dinner_napkin", "carafe", "salt", "candle", "mug"),
    "pedestal_table": ("mug", "pot_plant", "glass"),
    "coffee_table": ("magazine", "hardback", "mug", "candle", "bowl", "glass", "tray", "newspaper"),
    "console_table": ("pot_plant", "table_lamp", "hardback", "candle", "bowl", "watch"),
    "desk": ("notebook", "pen", "mug", "calculator", "laptop", "pencil", "sticky_note", "table_lamp", "document"),
    "stand": ("alarm", "hardback", "watch", "mug", "lotion"),
    "sofa": ("pillow", "pillow", "magazine"),
    "bed": ("pajamas", "hardback", "laptop"),
    "sink": ("soap", "cup", "scrub_brush"),
    "stove": ("saucepan", "kettle", "frying_pan"),
    "bench": ("backpack", "duffel_bag", "hat", "shoulder_bag"),
    "piano": ("hardback", "table_lamp", "candle"),
    "speaker_system": (),
    "shelf": ("basket", "pot_plant", "candle"),
    "washer": ("detergent", "basket"),
    "dryer": ("hand_towel", "basket"),
    "gaming_table": ("board_game", "toy"),
    "chest": ("toy", "ball"),
    "stool": ("hardback", "hand_towel"),
    "armchair": ("pillow",),
    "towel_rack": (),
}  # fmt: skip

ON_ROOM = {
    ("bedroom", "bottom_cabinet"): ("perfume", "hat", "necklace", "table_lamp", "hairbrush", "candle", "folderal"),
    ("utility_room", "bottom_cabinet"): ("iron", "detergent", "basket", "paper_towel"),
    ("dining_room", "bottom_cabinet"): ("carafe", "platter", "candle", "wine_bottle", "pot_plant", "bowl"),
    ("dining_room", "console_table"): ("candle", "bowl", "wine_bottle", "pot_plant", "carafe"),
    ("childs_room", "carpet"): TOYS[:3],
    ("playroom", "carpet"): TOYS[:3],
    ("home_office", "console_table"): ("folder", "document", "hardback", "pot_plant"),
    ("bathroom", "sink"): ("soap", "toothbrush", "toothpaste", "cup", "lotion", "hairbrush", "cologne"),
    ("closet", "bottom_cabinet"): ("hat", "watch", "scarf"),
    ("childs_room", "desk"): ("pencil", "notebook", "toy", "hardback", "table_lamp"),
}  # fmt: skip

HOLLOW = {"bowl": FOOD, "basket": ("t-shirt", "toy", "hand_towel"), "frying_pan": ("egg",), "tray": ("mug", "glass")}
"""What holds other things, and those objects."""
PILES = ("hardback", "magazine", "notebook", "board_game", "folder")
"""What is laid on the last object of its kind; at most PILE of them."""
PILE = 3
PILED = 0.6  # how often
MOST = {
    "fridge": 7,
    "shelf": 9,
    "bottom_cabinet": 6,
    "countertop": 5,
    "top_cabinet": 4,
    "breakfast_table": 13,
    "desk": 6,
    "coffee_table": 4,
    "console_table": 3,
    "bed": 1,
    "carpet": 4,
    "bowl": 3,
}
"""Small objects per host; every other host has at most two."""
GENEROUS = ("shelf", "fridge", "breakfast_table", "desk")
"""Hosts that get two things in a turn."""
AT_ONCE = 5
"""Objects on a dining table before any other host gets one: a bowl and the plates."""
CARELESS = 8.0  # degrees by which what lies on furniture is off its lines
ANY_WAY = ("toy", "ball", "sock", "t-shirt", "apple", "orange", "lemon", "tomato", "banana", "pear", "pen", "pencil")
"""What lies at any angle."""


def fill(home: HomeInProgress) -> Iterator[Placed]:
    """Puts small objects, one per host in turn, so that all rooms get some, until nothing more fits."""
    kits = {room.name: RoomKit(home, room) for room in home.plan.rooms}
    held: dict[str, int] = {}
    piles: dict[str, list[Placed]] = {}
    hosts = [host for host in home.things.things.values() if host.host is None or host.category in HOLLOW]
    tables = {host.name: lay_table(kits[host.rooms[0]], host) for host in hosts if host.category == "breakfast_table"}
    hosts += [host for host in hosts if host.category in GENEROUS]
    home.rng.shuffle(hosts)
    known = catalogue()
    if home.roomy:
        for table, pieces in tables.items():
            for thing in itertools.islice(pieces, AT_ONCE):
                held[table] = held.get(table, 0) + 1
                if thing.category in HOLLOW:
                    hosts.append(thing)
                yield thing
    idle = 0
    while idle < 2 and hosts:
        put_any = False
        for host in list(hosts):
            if held.get(host.name, 0) >= MOST.get(host.category, 2):
                hosts.remove(host)
                continue
            kit, pile = kits[host.rooms[0]], piles.setdefault(host.name, [])
            thing = next(tables[host.name], None) if host.name in tables else None
            thing = thing or _one_more(kit, host, held.get(host.name, 0), pile, known)
            if thing is None:
                continue
            held[host.name] = held.get(host.name, 0) + 1
            if thing.category in HOLLOW:
                hosts.append(thing)
            put_any = True
            yield thing
        idle = 0 if put_any else idle + 1


def _one_more(kit: RoomKit, host: Placed, number: int, pile: list[Placed], known) -> Placed | None:
    """pile: what lies in the host's latest pile, the lowest first; it is kept up to date."""
    kind, category, rng = kit.room.kind, host.category, kit.rng
    kept = IN_ROOM.get((kind, category), BOOKS if category == "shelf" else IN.get(category, ()))
    lies = ON_ROOM.get((kind, category), ON.get(category, ()))
    if category in HOLLOW:
        return kit.on(host, rng.choice(HOLLOW[category]), at="middle", tries=4)
    inside = bool(kept) and (not lies or category in ("fridge", "shelf") or number % 2 == 1)
    for turn in (inside, not inside):
        choices = [c for c in (kept if turn else lies) if c in known]
        if not choices:
            continue
        chosen = rng.choice(choices)
        if pile and pile[0].category == chosen and len(pile) < PILE and rng.random() < PILED:
            thing = kit.on(pile[-1], chosen, at="middle", degrees=rng.uniform(-CARELESS, CARELESS))
            if thing is not None:
                pile.append(thing)
                return thing
        put, tries = (kit.inside, 4) if turn else (kit.on, 5)
        for straight in (rng.choice((0.0, 180.0)), rng.choice((90.0, 270.0))):
            degrees = None if chosen in ANY_WAY else straight + rng.uniform(-CARELESS, CARELESS)
            thing = put(host, chosen, tries=tries, degrees=degrees)
            if thing is not None:
                if chosen in PILES:
                    pile[:] = [thing]
                return thing
    return None
