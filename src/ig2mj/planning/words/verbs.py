"""`VERBS`: what can be asked, by the words for it. A verb's kind says what follows it, and which primitive it means."""

from __future__ import annotations

CARRY, GET, PUT = "carry", "get", "put"
"""Kinds of verbs that move an object: with or without a place, without one, with one."""

_WORDS = {
    PUT: "put|place|set|lay|leave|drop|move|stow|store|return|hide|load|arrange|stand|stick|insert|put down|set down",
    CARRY: "take|take out|bring|carry|collect|gather|deliver|transfer|remove|fetch|find",
    GET: "get|grab|grasp|pick up|pick|hold|lift|lift up|bring me|get me|fetch me|give me|hand me|pass me|take hold of",
    "navigate_to": "go|go over|go to|walk|walk over|drive|navigate|head|head over|come|approach",
    "release": "release|let go of|let go",
    "open": "open|open up",
    "close": "close|shut",
    "turn": "turn|switch",
    "toggle_on": "turn on|switch on|start|run|activate",
    "toggle_off": "turn off|switch off|stop|deactivate",
    "wipe": "dust|dust off|wipe|wipe down|wipe off",
    "scrub": "scrub|wash|wash up|scour",
    "clean": "clean|clean up",
    "soak": "soak|wet|rinse|moisten|dampen",
    "fill": "fill|fill up",
    "pour": "pour|pour out|tip|spill",
    "spray": "spray|mist",
    "mix": "mix|stir|whisk|blend",
    "attach": "attach|screw|mount|fasten|hang|hang up",
    "slice": "slice|cut|cut up|chop|chop up|halve",
    "cook": "cook|fry|bake|roast|boil|grill",
    "freeze": "freeze",
    "push": "push|shove|slide",
    "make": "make sure|make",
    "want": "i want|i would like|i need|i'd like",
}

VERBS: dict[tuple[str, ...], str] = {
    tuple(words.split()): kind for kind, verbs in _WORDS.items() for words in verbs.split("|")
}
"""Words of a verb -> its kind."""

LONGEST = max(map(len, VERBS))

ADJECTIVES = {
    "open": "open",
    "closed": "close",
    "shut": "close",
    "on": "toggle_on",
    "off": "toggle_off",
    "frozen": "freeze",
    "cooked": "cook",
    "fried": "cook",
    "sliced": "slice",
    "cut": "slice",
    "wet": "soak",
    "soaked": "soak",
    "filled": "fill",
    "clean": "clean",
}
"""Adjectives after "make (sure)" -> the kind of the verb that makes it so."""

RELATIONS = {
    "next to": "next_to",
    "close to": "next_to",
    "beside": "next_to",
    "by": "next_to",
    "near": "next_to",
    "underneath": "under",
    "under": "under",
    "below": "under",
    "beneath": "under",
    "on top of": "on_top",
    "onto": "on_top",
    "upon": "on_top",
    "on": "on_top",
    "over": "on_top",
    "inside of": "inside",
    "inside": "inside",
    "into": "inside",
    "in": "inside",
    "against": "in_contact_with",
    "to": "to",
}
"""Prepositions of places -> the predicate; "to" depends on what follows it."""

FROM = ("out of", "off of", "away from", "from inside", "off", "from", "out")
"""Prepositions of where something is taken from."""

FILLERS = frozenset(
    [
        *("please", "kindly", "then", "first", "next", "finally", "now", "also", "afterwards", "just", "again", "back"),
        *("carefully", "gently", "quickly", "away", "down", "up", "for", "me", "together", "too"),
    ]
)
"""Words that change nothing where they stand between the parts of a clause."""

OPENERS = (
    "could you",
    "can you",
    "would you",
    "will you",
    "would you mind",
    "do you mind",
    "i want you to",
    "i would like you to",
    "i'd like you to",
    "i need you to",
    "you should",
    "you have to",
    "let us",
    "let's",
    "go and",
    "after that",
    "and then",
)
"""Beginnings of sentences that change nothing."""


def base_forms(word: str) -> tuple[str, ...]:
    """A word, and what it may be a gerund of: "opening" -> "open"."""
    if not word.endswith("ing") or len(word) < 6:
        return (word,)
    stem = word[:-3]
    return (word, stem, stem + "e", stem[:-1])
