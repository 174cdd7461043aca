"""All sensors, one line each, and those of plug-ins. Names are iGibson's where it has the sensor."""

from __future__ import annotations

from ig2mj.errors import UnknownNameError
from ig2mj.plugins import Registry
from ig2mj.sensors.base import Sensor
from ig2mj.sensors.cameras import split_name
from ig2mj.sensors.definitions.bump import BUMP
from ig2mj.sensors.definitions.colour import RGB
from ig2mj.sensors.definitions.depth import DEPTH
from ig2mj.sensors.definitions.flow import OPTICAL_FLOW, SCENE_FLOW
from ig2mj.sensors.definitions.ground_truth import BASE_POSE, EYE_POSE, OBJECT_POSES
from ig2mj.sensors.definitions.lidar import LIDAR
from ig2mj.sensors.definitions.normals import NORMAL
from ig2mj.sensors.definitions.occupancy_grid import OCCUPANCY_GRID
from ig2mj.sensors.definitions.point_cloud import POINT_CLOUD
from ig2mj.sensors.definitions.proprioception import PROPRIOCEPTION
from ig2mj.sensors.definitions.scan import SCAN
from ig2mj.sensors.definitions.segmentation import INS_SEG, SEG

OWN: dict[str, Sensor] = {
    sensor.name: sensor
    for sensor in (
        RGB,
        DEPTH,
        NORMAL,
        SEG,
        INS_SEG,
        OPTICAL_FLOW,
        SCENE_FLOW,
        POINT_CLOUD,
        SCAN,
        LIDAR,
        OCCUPANCY_GRID,
        BUMP,
        PROPRIOCEPTION,
        OBJECT_POSES,
        BASE_POSE,
        EYE_POSE,
    )
}

SENSORS: Registry[Sensor] = Registry("sensor", "an ig2mj.sensors.Sensor", lambda thing: isinstance(thing, Sensor), OWN)
"""`OWN`, and those of plug-ins."""


def sensor_named(observation: str) -> Sensor | None:
    """The sensor of an observation's name, with or without a camera's name before it; None: it is of none."""
    _, name = split_name(observation)
    sensor = SENSORS.get(name)
    return sensor if sensor is None or observation == name or sensor.images else None


def find_sensor(name: str) -> Sensor:
    """The sensor of a name. Raises UnknownNameError, with near matches; PluginError: it is of a plug-in, which is at
    fault."""
    if name not in SENSORS:
        raise UnknownNameError("sensor", name, SENSORS)
    return SENSORS[name]
