"""Small things: what lies on what, and what is kept in what, by room. Fills a home up to its number of things."""

from __future__ import annotations

from collections.abc import Iterator

from ..catalogue import catalogue
from ..things import Thing
from .kit import HomeInProgress, RoomKit

FOOD = ("apple", "orange", "lemon", "tomato", "banana", "pear")
CLOTHES = ("t-shirt", "sock", "sweater", "jeans", "underwear", "scarf", "pajamas")
BOOKS = ("hardback", "hardback", "notebook", "magazine")
TOOLS = ("hammer", "screwdriver", "drill", "saw", "tape", "paint", "scraper", "carton")
TOYS = ("toy", "board_game", "ball", "video_game", "hardback")

IN = {
    "fridge": (
        "milk", "juice", "butter", "cheese", "yogurt", "egg", "lettuce", "beer", "catsup", "jam",
        "water", "steak",
    ),
    "top_cabinet": ("mug", "glass", "plate", "bowl", "cup", "salt", "sugar_jar", "cereal"),
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
        "saucepan", "frying_pan", "bowl", "plate", "canned_food", "pasta", "colander", "lid",
    ),
    ("kitchen", "sink"): ("detergent", "rag", "bucket"),
    ("bathroom", "sink"): ("shampoo", "soap", "bath_towel", "hand_towel"),
    ("bathroom", "shelf"): ("bath_towel", "hand_towel", "shampoo"),
    ("bedroom", "bottom_cabinet"): CLOTHES,
    ("closet", "bottom_cabinet"): CLOTHES,
    ("utility_room", "bottom_cabinet"): ("detergent", "rag", "hand_towel", "sheet"),
    ("closet", "shelf"): (*CLOTHES, "hat", "duffel_bag", "gym_shoe"),
    ("bedroom", "shelf"): (*BOOKS, "candle", "hat", "alarm"),
    ("childs_room", "shelf"): TOYS,
    ("playroom", "shelf"): TOYS,
    ("pantry_room", "shelf"): (
        "canned_food", "flour", "olive_oil", "cereal", "oatmeal", "pasta", "jam", "potato",
        "wine_bottle",
    ),
    ("garage", "shelf"): TOOLS,
    ("storage_room", "shelf"): (*TOOLS, "bucket", "basket", "package"),
    ("utility_room", "shelf"): ("detergent", "bucket", "scrub_brush", "rag", "bath_towel"),
    ("dining_room", "shelf"): ("bowl", "plate", "carafe", "candle", "wine_bottle", "platter"),
    ("exercise_room", "shelf"): ("hand_towel", "water", "gym_shoe", "ball"),
    ("home_office", "shelf"): (*BOOKS, "folder", "folder", "router"),
}  # fmt: skip

ON = {
    "bottom_cabinet": (
        "toaster", "kettle", "chopping_board", "coffee_maker", "bowl", "carving_knife", *FOOD,
        "mug",
    ),
    "countertop": ("chopping_board", "carving_knife", "toaster", *FOOD),
    "breakfast_table": (
        "plate", "bowl", "mug", "glass", "dinner_napkin", "tablefork", "table_knife", "carafe", "apple",
        "candle",
    ),
    "coffee_table": ("magazine", "hardback", "mug", "candle", "video_game", "glass"),
    "console_table": ("candle", "hardback", "pot_plant", "watch"),
    "desk": ("notebook", "pen", "mug", "calculator", "laptop", "pencil", "sticky_note", "table_lamp", "document"),
    "stand": ("alarm", "hardback", "watch", "mug", "lotion"),
    "sofa": ("pillow", "magazine"),
    "bed": ("pillow", "hardback", "pajamas", "laptop"),
    "sink": ("soap", "cup", "scrub_brush"),
    "stove": ("saucepan", "kettle", "frying_pan"),
    "bench": ("gym_shoe", "duffel_bag", "hat"),
    "shelf": ("basket", "pot_plant", "candle"),
    "washer": ("detergent", "basket"),
    "dryer": ("hand_towel", "basket"),
    "gaming_table": ("board_game", "toy"),
    "stool": ("hardback", "hand_towel"),
    "armchair": ("pillow",),
    "towel_rack": (),
}  # fmt: skip

ON_ROOM = {
    ("bedroom", "bottom_cabinet"): ("perfume", "hat", "jewel", "table_lamp", "hairbrush", "candle"),
    ("utility_room", "bottom_cabinet"): ("iron", "detergent", "basket"),
    ("bathroom", "sink"): ("soap", "toothbrush", "toothpaste", "cup", "lotion"),
    ("closet", "bottom_cabinet"): ("hat", "watch", "scarf"),
    ("childs_room", "desk"): ("pencil", "notebook", "toy", "hardback", "table_lamp"),
}  # fmt: skip

HOLLOW = {"bowl": FOOD, "basket": ("t-shirt", "toy", "hand_towel"), "frying_pan": ("egg",)}
"""What holds other things, and those things."""
MOST = {
    "fridge": 7,
    "shelf": 7,
    "bottom_cabinet": 5,
    "top_cabinet": 4,
    "breakfast_table": 6,
    "desk": 5,
    "coffee_table": 3,
}
"""Small things per host; every other host has at most two."""
GENEROUS = ("shelf", "fridge", "breakfast_table", "desk")
"""Hosts that get two things in a turn."""


def fill(home: HomeInProgress) -> Iterator[Thing]:
    """Puts small things, one per host in turn, so that all rooms get some, until nothing fits any more."""
    kits = {room.name: RoomKit(home, room) for room in home.plan.rooms}
    held: dict[str, int] = {}
    hosts = list(home.things.things.values())
    hosts += [host for host in hosts if host.category in GENEROUS]
    home.rng.shuffle(hosts)
    known = catalogue()
    idle = 0
    while idle < 2 and hosts:
        put_any = False
        for host in list(hosts):
            if held.get(host.name, 0) >= MOST.get(host.category, 2):
                hosts.remove(host)
                continue
            thing = _one_more(kits[host.rooms[0]], host, held.get(host.name, 0), known)
            if thing is None:
                continue
            held[host.name] = held.get(host.name, 0) + 1
            if thing.category in HOLLOW:
                hosts.append(thing)
            put_any = True
            yield thing
        idle = 0 if put_any else idle + 1


def _one_more(kit: RoomKit, host: Thing, number: int, known) -> Thing | None:
    kind, category, rng = kit.room.kind, host.category, kit.rng
    kept = IN_ROOM.get((kind, category), BOOKS if category == "shelf" else IN.get(category, ()))
    lies = ON_ROOM.get((kind, category), ON.get(category, ()))
    if category in HOLLOW:
        thing = kit.on(host, rng.choice(HOLLOW[category]), at="middle", tries=4)
        return thing
    inside = bool(kept) and (not lies or category in ("fridge", "shelf") or number % 2 == 1)
    for turn in (inside, not inside):
        choices = [c for c in (kept if turn else lies) if c in known]
        if not choices:
            continue
        chosen = choices[number % len(choices)] if category == "breakfast_table" else rng.choice(choices)
        thing = kit.inside(host, chosen, tries=8) if turn else kit.on(host, chosen, tries=10)
        if thing is not None:
            return thing
    return None
