"""What a sensor trade-off is: the space, where it is used, what is required, and the rules."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from lpet_sim.evaluation import Requirement
from lpet_sim.sensors.landmark_spec import LandmarkSensorSpec
from lpet_sim.sensors.wheels import WheelOdometrySpec
from lpet_sim.spec import Spec
from lpet_sim.sweep.sweep_spec import VariantSpec
from lpet_sim.terrain.load import named_terrain, terrain_beside
from lpet_sim.terrain.spec import TerrainSpec
from lpet_sim.tradeoff.proxies import ProxySpec
from lpet_sim.tradeoff.space import SamplingSpec, SensorSpaceSpec

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]


class SiteSpec(Spec):
    """Where and how the sensor is used, the same for all candidates.

    Attributes:
        terrain: The ground, or the name of a preset, or the path of a YAML file.
        speed_mps: Speed of the rover; 100 m/h (the paper).
        distance_m: Distance after which the error counts.
        standstill_s: The rover stands so long at the start, and learns the bias of its gyro.
        slips_per_m: Times that the wheels slip so that the filter believes their step, and the
            gyro's, to within its length only; one in 60 s at 100 m/h, as in the data sets of the
            paper's experiment (a choice).
        ride_height_m: Height of the body's origin above flat ground; that of the ExoMars model.
        landmarks: Landmarks and front end of the default camera, of which a candidate changes the
            period, the noise, and the range with the focal length.
        wheels: Wheel odometry.
    """

    terrain: Annotated[TerrainSpec, BeforeValidator(named_terrain)]
    speed_mps: Positive = 100.0 / 3600.0
    distance_m: Annotated[float, Field(ge=2.0)] = 100.0
    standstill_s: NotNegative = 36.0
    slips_per_m: NotNegative = 0.6
    ride_height_m: NotNegative = 0.3
    landmarks: LandmarkSensorSpec = LandmarkSensorSpec()
    wheels: WheelOdometrySpec = WheelOdometrySpec()


class StaticSpec(Spec):
    """How closely the static analysis looks. All are choices.

    Attributes:
        path_max_m: Longest path that is analysed as one; a longer distance is cut into equal
            stretches, each of which begins with no landmark.
        lump_m: Images nearer together than this are taken as one that tells as much as all of
            them.
        memory_images: Images after which a landmark that is not seen is forgotten: the filter's
            time to live.
        tilt_share: RMS tilt of the rover over the RMS slope of the terrain: its length evens out
            part of it.
    """

    path_max_m: Annotated[float, Field(ge=2.0, le=200.0)] = 30.0
    lump_m: Positive = 0.25
    memory_images: Annotated[int, Field(ge=1)] = 10
    tilt_share: NotNegative = 0.7


class ConstraintSpec(Spec):
    """What a candidate must not exceed; None: no limit.

    Attributes:
        data_bit_per_m: Image data for a metre driven.
        compute_s_per_m: Computing for a metre driven.
        mass_kg: Mass.
        data_rate_bitps: Image data for a second of driving.
    """

    data_bit_per_m: Positive | None = None
    compute_s_per_m: Positive | None = None
    mass_kg: Positive | None = None
    data_rate_bitps: Positive | None = None


class RuleSpec(Spec):
    """The rule by which one sensor is recommended.

    Attributes:
        efficiency: RMS error of a real estimator over the least possible, for candidates that were
            not simulated. 1.5 is a choice: the SLAM filter of the paper's experiment had 1.3.
        spread: 95th percentile of the length of an error over its RMS: between 1.6 (the same along
            all axes) and 1.96 (along one); the larger is taken.
        margin: Share of the limit that must be left free.
        tie_ratio: Candidates within this ratio of the least cost are tied, and the most accurate of
            them is taken: it keeps the recommendation from hanging on single draws.
        data_weight: Weight of the data volume in the cost, over the median of all candidates.
        compute_weight: Likewise of the computing.
        mass_weight: Likewise of the mass.
    """

    efficiency: Annotated[float, Field(ge=1.0)] = 1.5
    spread: Annotated[float, Field(ge=1.0)] = 1.96
    margin: Annotated[float, Field(ge=0.0, lt=1.0)] = 0.2
    tie_ratio: Annotated[float, Field(ge=0.0)] = 0.1
    data_weight: NotNegative = 1.0
    compute_weight: NotNegative = 1.0
    mass_weight: NotNegative = 1.0


class SimulationSpec(Spec):
    """How the survivors are simulated.

    Attributes:
        recordings: Simulated traverses with truth: paths and globs, beside the YAML file.
        survivors_max: Most candidates that are simulated.
        draws: Independent draws of landmarks, noise and odometry for each recording.
        variants: The estimators; the first one's error decides.
        time_limit_s: A run that takes longer fails; None: no limit.
    """

    recordings: Annotated[tuple[str, ...], Field(min_length=1)]
    survivors_max: Annotated[int, Field(ge=1)] = 12
    draws: Annotated[int, Field(ge=1)] = 5
    variants: Annotated[tuple[VariantSpec, ...], Field(min_length=1)] = (
        VariantSpec(estimator="slam"),
        VariantSpec(estimator="frame_to_frame"),
    )
    time_limit_s: Positive | None = None


class TradeoffSpec(Spec):
    """A sensor trade-off.

    Attributes:
        name: What it is called.
        space: The sensors to choose from.
        sampling: How candidates are drawn from it.
        site: Where and how the sensor is used.
        static: How closely the static analysis looks.
        proxies: What sensors cost.
        constraints: What they must not exceed.
        requirement: What the localization is held to: the position at the end of the distance, and
            the attitude.
        rule: How one is recommended.
        simulation: How the survivors are simulated; None: they are not.
    """

    name: Annotated[str, Field(min_length=1)]
    space: SensorSpaceSpec
    sampling: SamplingSpec = SamplingSpec()
    site: SiteSpec
    static: StaticSpec = StaticSpec()
    proxies: ProxySpec = ProxySpec()
    constraints: ConstraintSpec = ConstraintSpec()
    requirement: Requirement = Requirement()
    rule: RuleSpec = RuleSpec()
    simulation: SimulationSpec | None = None

    @classmethod
    def files_beside(cls, mapping: dict[str, Any], folder: Path) -> dict[str, Any]:
        """Find the files of terrain and soils, and the recordings."""
        found = dict(mapping)
        if isinstance(site := mapping.get("site"), dict) and "terrain" in site:
            found["site"] = site | {"terrain": terrain_beside(site["terrain"], folder)}
        if isinstance(runs := mapping.get("simulation"), dict):
            globs = runs.get("recordings")
            if isinstance(globs, list):
                globs = [str(folder / glob) if isinstance(glob, str) else glob for glob in globs]
                found["simulation"] = runs | {"recordings": globs}
        return found
