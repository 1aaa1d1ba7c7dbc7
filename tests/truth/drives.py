"""Short drives in physics, each made once for a whole test session, however many workers it has."""

from __future__ import annotations

import fcntl
import math
import os
from pathlib import Path

import pytest

from lpet_sim.rover.spec import DriveSpec, ForcedSlip
from lpet_sim.sensors.camera_spec import GroundDetailSpec, StereoCameraSpec
from lpet_sim.sensors.imu import ImuSpec
from lpet_sim.sensors.suite import SensorSuiteSpec
from lpet_sim.sensors.wheels import WheelOdometrySpec
from lpet_sim.sweep.simulate import simulate
from lpet_sim.sweep.traverse import ImagesSpec, TraverseSpec
from lpet_sim.terrain.spec import ReliefSpec, RockAbundanceSpec, TerrainSpec

SLIP = ForcedSlip(start_s=30.0, duration_s=5.0)
SPEED_MPS = 0.05
GROUND = GroundDetailSpec(supersampling=1, texel_m=0.00625, cell_m=0.08, levels=7)
STEREO = StereoCameraSpec(width_px=480, height_px=360, focal_px=377.0, ground=GROUND)
RELIEF_SLOPE_RAD = math.radians(3.0)


def traverse_spec(length_m: float = 4.0, images: ImagesSpec | None = None) -> TraverseSpec:
    """Make a traverse with a bend, over rocks that a wheel climbs."""
    return TraverseSpec(
        name="short",
        terrain=TerrainSpec(
            relief=ReliefSpec(rms_slope_rad=RELIEF_SLOPE_RAD),
            craters=None,
            rocks=RockAbundanceSpec(k=0.07, diameter_max_m=0.25),
        ),
        drive=DriveSpec(
            waypoints_m=((0.0, 0.0), (length_m / 2, 0.3), (length_m, -0.2)),
            speed_mps=SPEED_MPS,
            settle_s=2.0,
            forced_slips=(SLIP,),
        ),
        route=None,
        sensors=SensorSuiteSpec(stereo=STEREO),
        images=images,
    )


def with_perfect_sensors(spec: TraverseSpec) -> TraverseSpec:
    """Take every error from the inertial unit and the encoders."""
    update = {"imu": ImuSpec.perfect(), "wheels": WheelOdometrySpec.perfect()}
    return spec.model_copy(update={"sensors": spec.sensors.model_copy(update=update)})


def driven_once(
    tmp_path_factory: pytest.TempPathFactory, spec: TraverseSpec, seed: int, name: str
) -> Path:
    """Give the recording of a drive; the first test to ask for it, in any worker, drives."""
    folder = tmp_path_factory.getbasetemp()
    folder = folder.parent if "PYTEST_XDIST_WORKER" in os.environ else folder
    path = folder / f"{name}.rrd"
    with (folder / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not path.exists():
            simulate(spec, seed, path)
    return path
