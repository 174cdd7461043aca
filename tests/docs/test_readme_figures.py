"""What README.md counts is what there is."""

from __future__ import annotations

import pathlib

from ig2mj_homes.objects.catalogue import catalogue

from ig2mj.cli.homes import shipped_homes
from ig2mj.predicates.registry import PREDICATES
from ig2mj.sensors.registry import SENSORS

INTRODUCTION = " ".join(
    (pathlib.Path(__file__).resolve().parents[2] / "README.md").read_text("utf-8").split("## Quick start")[0].split()
)


def test_homes_rooms_and_models():
    homes = [home for home in shipped_homes() if home["home"] != "small_home"]
    rooms, models = sum(len(home["rooms"]) for home in homes), sum(entry.count for entry in catalogue().values())
    assert f"{len(homes)} furnished homes** with {rooms} rooms and {models:,} object models" in INTRODUCTION


def test_predicates_and_sensors():
    assert f"{len(PREDICATES)} predicates" in INTRODUCTION
    assert len(SENSORS) == 16 and "sixteen [sensors]" in INTRODUCTION
