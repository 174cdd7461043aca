"""What agents perceive."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ig2mj.sensors.base import Percept, Sensor, SensorOptions, Setup, Space

__all__ = ["Percept", "Sensor", "SensorOptions", "Setup", "Space"]

_HOME = dict.fromkeys(__all__, "ig2mj.sensors.base")


def __getattr__(name: str) -> Any:
    """Imports the public names when they are first used."""
    from ig2mj.process.public_names import public_name

    return public_name("ig2mj.sensors", name, _HOME)
