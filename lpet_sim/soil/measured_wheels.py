"""Single wheels that were measured, and how far the law's prediction is from them.

The data are of Carnegie Mellon's testbed: a smooth and a grousered wheel of 58 mm radius and 50 mm
width, pulled at 10 mm/s at slip angles from 0 to 90 deg under about 24 N.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from lpet_sim.datasets import data_path
from lpet_sim.recording.arrays import Array
from lpet_sim.soil.spec import MechanicalSoilSpec, WheelSpec
from lpet_sim.soil.wheel_law import WheelForces, rolling_radius, wheel_forces

TABLE: Final = "wheel/cmu_single_wheel.csv"
GRAVITY_MPS2: Final = 9.81
LOCKED_ADVANCE: Final = 1e6
"""The advance by which a locked wheel stands, v / (r omega) without its infinity."""

WheelName = Literal["smooth", "grouser"]


@dataclass(frozen=True)
class MeasuredWheel:
    """The measured rows of one wheel; arrays have Shape (n,).

    Attributes:
        slip: As published, at the rim: ``1 - V / (r omega)``, and ``r omega / V - 1`` in skid.
        slip_angle_rad: Between the wheel's plane and its motion.
        speed_mps: Speed V of the axle.
        rim_mps: Speed ``r omega`` of the rim, without grousers.
        load_n: Vertical load.
        drawbar_n: Force along the wheel's plane, positive where it pulls.
        side_n: Force across it, against the side motion.
        sinkage_m: Depth; nan where it was not recorded.
    """

    slip: Array
    slip_angle_rad: Array
    speed_mps: Array
    rim_mps: Array
    load_n: Array
    drawbar_n: Array
    side_n: Array
    sinkage_m: Array

    @property
    def driving(self) -> NDArray[np.bool_]:
        """Which rows were driven at slip 0 or above, as commanded: their own is within 0.01."""
        return self.slip > -0.01

    def only(self, rows: NDArray[np.bool_]) -> MeasuredWheel:
        """Pick rows."""
        return MeasuredWheel(**{name: column[rows] for name, column in vars(self).items()})


@dataclass(frozen=True)
class PredictionError:
    """Root mean square differences between prediction and measurement over some rows.

    Attributes:
        rows: How many there are.
        drawbar_ratio: Of drawbar pull over load [-].
        side_ratio: Of side force over load [-].
        sinkage_m: Of sinkage [m].
        drawbar_bias: Mean of predicted less measured drawbar pull over load [-].
        sinkage_bias_m: Mean of predicted less measured sinkage [m].
    """

    rows: int
    drawbar_ratio: float
    side_ratio: float
    sinkage_m: float
    drawbar_bias: float
    sinkage_bias_m: float


def measured_wheel(wheel: WheelName) -> MeasuredWheel:
    """Read all rows of a wheel from the folder of real data.

    Args:
        wheel: Which of the two.

    Raises:
        DataError: The data are not there.
    """
    with data_path(TABLE).open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["wheel"] == wheel]

    def column(name: str, scale: float = 1.0) -> Array:
        return np.array([float(row[name] or "nan") * scale for row in rows])

    return MeasuredWheel(
        slip=column("slip"),
        slip_angle_rad=np.radians(column("beta_deg")),
        speed_mps=column("avg_Vx_mm_s", 1e-3),
        rim_mps=column("avg_Vry", 1e-3),
        load_n=column("Fz_N", -1.0),
        drawbar_n=column("Fy_N", -1.0),
        side_n=column("Fx_N"),
        sinkage_m=column("Z", -1e-3),
    )


def straight(measured: MeasuredWheel) -> MeasuredWheel:
    """Pick the rows without slip angle."""
    return measured.only(measured.slip_angle_rad == 0.0)


def predict(measured: MeasuredWheel, soil: MechanicalSoilSpec, wheel: WheelSpec) -> WheelForces:
    """Predict every row from its speeds, its slip angle and its measured load.

    The law takes slip at the tips of the grousers, the data at the rim: the speeds are what both
    agree on.

    Args:
        measured: What was measured.
        soil: The soil.
        wheel: The wheel.
    """
    tips = measured.rim_mps * (rolling_radius(wheel) / wheel.radius_m)
    share = measured.speed_mps / np.maximum(tips, measured.speed_mps / LOCKED_ADVANCE)
    slip = 1.0 - share * np.cos(measured.slip_angle_rad)
    creep = share * np.sin(measured.slip_angle_rad)
    return wheel_forces(soil, wheel, slip, creep, measured.load_n, GRAVITY_MPS2)


def prediction_error(
    measured: MeasuredWheel, soil: MechanicalSoilSpec, wheel: WheelSpec
) -> PredictionError:
    """Compare the law's prediction with what was measured; nothing is fitted.

    Args:
        measured: The rows to compare.
        soil: The soil.
        wheel: The wheel.
    """
    forces = predict(measured, soil, wheel)
    drawbar = (forces.drawbar_n - measured.drawbar_n) / measured.load_n
    side = (-forces.side_n - measured.side_n) / measured.load_n
    depth = forces.sinkage_m - measured.sinkage_m
    return PredictionError(
        rows=drawbar.size,
        drawbar_ratio=_rms(drawbar),
        side_ratio=_rms(side),
        sinkage_m=_rms(depth),
        drawbar_bias=float(np.nanmean(drawbar)),
        sinkage_bias_m=float(np.nanmean(depth)),
    )


def _rms(difference: Array) -> float:
    return float(np.sqrt(np.nanmean(difference**2)))
