"""Names of the entities in a recording's .rrd."""

from __future__ import annotations

from urllib.parse import quote

MANIFEST = "/manifest"
CALIBRATION = "/calibration"

IMU = "/measurements/imu"
WHEELS = "/measurements/wheels"
ODOMETRY = "/measurements/odometry"
SIGHTINGS = "/measurements/sightings"
IMAGE_INDEX = "/measurements/images/index"

TRUTH_BODY = "/truth/body"
TRUTH_WHEELS = "/truth/wheels"
EVENTS = "/truth/events"
EVENT_LOG = "/events"

ESTIMATES = "/estimates"
ERRORS = "/errors"
WHEEL_CURVES = "/curves/wheels"
# Sorts after the wheels, so that it is drawn over them.
SEEN_SLIP = "/curves/wheels_seen"

WORLD = "/world"
ROVER = "/world/rover"
CAMERAS = {"left": "/world/rover/camera", "right": "/world/rover/camera_right"}
TERRAIN = "/world/terrain"
PATHS = "/world/paths"
LANDMARKS = "/world/landmarks"
EVENT_PLACES = "/world/events"
SUMMARY = "/summary"

# Which column of (u_left, u_right, v) is the u of an eye.
EYE_COLUMNS = {"left": 0, "right": 1}


def image(eye: str) -> str:
    """Name the entity of an eye's images."""
    return f"{CAMERAS[eye]}/image"


def wheel_curve(quantity: str) -> str:
    """Name the entity of a curve of the wheels."""
    return f"{WHEEL_CURVES}/{quantity}"


def slug(name: str) -> str:
    """Turn a name into one part of an entity's path, different names into different parts."""
    return quote(name, safe="").replace("%", "_x").replace(".", "_x2E")
