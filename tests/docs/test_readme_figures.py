"""README.md is short, and every number in its prose is what the code, the data or a generated table says."""

from __future__ import annotations

import pathlib
import re
import tomllib

from ig2mj_homes.objects.catalogue import catalogue

from ig2mj.cli.homes import shipped_homes
from ig2mj.engine.base import SUBSTEPS
from ig2mj.predicates.registry import PREDICATES
from ig2mj.sensors.base import SensorOptions
from ig2mj.sensors.registry import SENSORS
from ig2mj.states.options import CONTROL_TIMESTEP

ROOT = pathlib.Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text("utf-8")
GENERATED = re.compile(r"<!-- begin: .*?<!-- end of [\w ]+ -->", re.DOTALL)
NAMES = ("ig2mj", "iGibson 2.0", "BEHAVIOR-100", "BEHAVIOR-1K", "H200", "H100", "A100")
WORDS = (
    "two",
    "three",
    "four",
    "five",
    "six",
    "seven",
    "eight",
    "nine",
    "ten",
    "twelve",
    "fifteen",
    "sixteen",
    "eighteen",
    "hundred",
)


def prose() -> str:
    """README without generated tables, code, targets of links, images and names with digits."""
    text = GENERATED.sub("", README)
    text = re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"^!\[.*$", "", text, flags=re.MULTILINE)
    text = re.sub(r"`[^`]*`|\]\([^)]*\)", "", text)
    for name in NAMES:
        text = text.replace(name, "")
    return " ".join(text.split())


def facts() -> list[str]:
    """The phrases of the prose that have numbers, computed from their sources."""
    homes = [home for home in shipped_homes() if home["home"] != "small_home"]
    rooms, models = sum(len(home["rooms"]) for home in homes), sum(entry.count for entry in catalogue().values())
    python = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["requires-python"]
    policies = len(list((ROOT / "policies").glob("*.npz")))
    speed = max(_speeds("the home `birch`"))
    image = SensorOptions()
    number = {4: "four", 18: "Eighteen"}
    return [
        f"**{len(homes)} furnished homes** with {rooms} rooms and {models:,} object models ship",
        f"{len(PREDICATES)} predicates",
        f"with {len(SENSORS)} [sensors",
        f"Python {python.removeprefix('>=')} or newer",
        f"{number[policies]} trained policies ship",
        f"success over {_episodes():,} held-out start states",
        f"{image.width}x{image.height} RGB-D images",
        f"A control step is 1/{round(1 / CONTROL_TIMESTEP)} s: {number[SUBSTEPS]} physics steps",
        f"on one H200 at {speed:,} control steps a second".replace(" H200", ""),
    ]


def _speeds(row: str) -> list[int]:
    """Numbers in the last cell of the row of the speed table that begins so."""
    found = re.findall(rf"^\| {re.escape(row)}[^|]*\| ([\d,]+)", README, re.MULTILINE)
    return [int(each.replace(",", "")) for each in found]


def _episodes() -> int:
    """Held-out episodes of every policy's card, which is the same number in all."""
    cards = [file.read_text("utf-8") for file in (ROOT / "policies").glob("*.md") if file.name != "README.md"]
    counts = {re.search(r"of ([\d,]+) held-out episodes", card)[1] for card in cards}  # type: ignore[index]
    (count,) = counts
    return int(count.replace(",", ""))


def test_every_number_in_the_prose_has_a_source():
    text = prose()
    for fact in facts():
        fact = " ".join(fact.split())
        assert fact in text, f"README.md does not say: {fact}"
        text = text.replace(fact, "")
    left = re.findall(r"\d[\d,./]*", text) + [word for word in WORDS if re.search(rf"\b{word}\b", text, re.IGNORECASE)]
    assert not left, f"tie these numbers of README.md to a source in `facts`, or leave them out: {left}"


def test_readme_is_short():
    """It is about 120 lines with the generated tables, whose length is that of what was measured."""
    assert len(GENERATED.sub("", README).splitlines()) <= 85


def test_no_line_of_prose_is_longer_than_100_characters():
    lines = GENERATED.sub("", README).splitlines()
    assert not [line for line in lines if len(line) > 100 and not line.startswith("|")]
