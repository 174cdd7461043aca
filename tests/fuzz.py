"""Seeded mutations of valid inputs, for tests that feed them to a reader: nothing but typed errors may come out."""

from __future__ import annotations

import copy
import random
import re
import traceback
from collections.abc import Callable, Iterator
from typing import Any

ODD_WORDS = (
    b"nan", b"inf", b"-inf", b"1e308", b"-1", b"0", b"1e-320", b"99999999999999999999", b"1_000", b"", b" ", b"\0",
    b"\xff\xfe", b"\xef\xbb\xbf", b"\xc3\x28", "\u0663".encode(), b"../../etc/passwd", b"%00", b"&#0;", b"&x;", b"<",
    b">", b"\"", b"'", b"{", b"[", b"null", b"true", b"[]", b"{}", b"a" * 5000, b"<!--", b"<![CDATA[", b"\n" * 50,
)  # fmt: skip
ODD_VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1.5, 1e308, float("nan"), float("inf"), 2**70, "", "a", "\0", "\ud800", [], {}, [[]],
    {"a": None}, ["a", 1], "../x", [float("nan")] * 3, "9" * 400,
)  # fmt: skip


def mutated_bytes(raw: bytes, seed: int) -> bytes:
    """One to four random changes: bits, bytes, cut ends, and words that are swapped, doubled, dropped or made odd."""
    random_ = random.Random(seed)
    for _ in range(random_.randint(1, 4)):
        raw = random_.choice(_CHANGES)(raw, random_)
    return raw


def mutated_json(value: Any, seed: int) -> Any:
    """A copy of a JSON value in which one to three values are odd, missing, doubled or of another key's kind."""
    random_ = random.Random(seed)
    value = copy.deepcopy(value)
    for _ in range(random_.randint(1, 3)):
        places = list(_places(value))
        if not places:
            break
        holder, key = random_.choice(places)
        what = random_.random()
        if what < 0.2 and isinstance(holder, dict):
            del holder[key]
        elif what < 0.3 and isinstance(holder, dict):
            holder[random_.choice(("", "a", "\0", str(key) + "x"))] = holder.pop(key)
        elif what < 0.4 and isinstance(holder, list):
            holder.insert(key, copy.deepcopy(holder[key]))
        elif what < 0.5:
            other, name = random_.choice(places)
            holder[key] = copy.deepcopy(other[name])
        else:
            holder[key] = copy.deepcopy(random_.choice(ODD_VALUES))
    return value


def untyped_errors(
    read: Callable[[Any], Any], inputs: Iterator[tuple[int, Any]], typed: tuple[type[BaseException], ...]
) -> dict[int, str]:
    """Seed -> the error's last lines, of the inputs at which `read` raised anything but the typed errors."""
    found: dict[int, str] = {}
    for seed, value in inputs:
        try:
            read(value)
        except typed:
            pass
        except Exception:
            found[seed] = traceback.format_exc()[-600:]
    return found


def _places(value: Any) -> Iterator[tuple[Any, Any]]:
    keys = value.keys() if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    for key in keys:
        yield value, key
        yield from _places(value[key])


def _flip(raw: bytes, random_: random.Random) -> bytes:
    if not raw:
        return raw
    at = random_.randrange(len(raw))
    return raw[:at] + bytes([raw[at] ^ 1 << random_.randrange(8)]) + raw[at + 1 :]


def _overwrite(raw: bytes, random_: random.Random) -> bytes:
    at, length = random_.randrange(len(raw) + 1), random_.choice((1, 2, 4, 8))
    return raw[:at] + random_.choice((b"\0", b"\xff", b"\x7f", b"\x80")) * length + raw[at + length :]


def _cut(raw: bytes, random_: random.Random) -> bytes:
    return raw[: random_.randrange(len(raw) + 1)]


def _drop(raw: bytes, random_: random.Random) -> bytes:
    at = random_.randrange(len(raw) + 1)
    return raw[:at] + raw[at + random_.choice((1, 3, 10, 100)) :]


def _double(raw: bytes, random_: random.Random) -> bytes:
    at, length = random_.randrange(len(raw) + 1), random_.choice((3, 30, 300))
    return raw[:at] + raw[at : at + length] * 2 + raw[at + length :]


def _word(raw: bytes, random_: random.Random) -> bytes:
    """Another word in a word's place: an odd one, or one from elsewhere."""
    words = list(re.finditer(rb"[A-Za-z0-9_.+/#:-]+", raw))
    if not words:
        return raw
    word, other = random_.choice(words), random_.choice(words)[0]
    new = random_.choice(ODD_WORDS) if random_.random() < 0.6 else other
    return raw[: word.start()] + new + raw[word.end() :]


_CHANGES = (_flip, _overwrite, _cut, _drop, _double, _word, _word, _word, _word)
