"""What a sweep is: data sets x sensor arms x variants of estimators, as one YAML file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from lpet_sim.evaluation import EvaluationSpec, Requirement
from lpet_sim.sensors.camera_spec import DeclaredErrorSpec
from lpet_sim.sensors.landmark_spec import LandmarkSensorSpec
from lpet_sim.sensors.suite import SensorSuiteSpec
from lpet_sim.spec import Spec
from lpet_sim.sweep.traverse import TraverseSpec

_ARM_KEYS = {"sensor", "declared", "sensors", "draw"}


class DataSetsSpec(Spec):
    """The traverses that a sweep runs on: recordings that are there, or drives to simulate.

    Attributes:
        recordings: Paths and globs of recordings, beside the YAML file; each must hold a truth.
        traverse: A traverse to drive instead, its fields or the path of its YAML file.
        first: Seed of the first drive.
        count: How many drives, with seeds in a row from the first.
        min_path_m: Data sets with a shorter path are left out, and listed with that reason [m].
    """

    recordings: tuple[str, ...] = ()
    traverse: TraverseSpec | None = None
    first: int = 1
    count: Annotated[int, Field(ge=1)] = 1
    min_path_m: Annotated[float, Field(ge=0.0)] = 0.0

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if bool(self.recordings) == (self.traverse is not None):
            raise ValueError("give either recordings or a traverse with its count of drives")
        return self


class ArmSpec(Spec):
    """How the data sets are sensed in one arm of a sweep.

    Attributes:
        sensor: The landmark-level sensor; None takes the sightings that the recordings hold.
        sensors: Camera, inertial unit and wheels that a simulated drive is to carry in place of its
            own, as a traverse's ``sensors``; all are drawn anew. Needs a ``sensor``. None: its own.
        declared: Errors of the declared calibration, put in afterwards; None: none.
        draw: Which draw of landmarks and noise, so that arms can be draws of one sensor; 0: that of
            the traverse's seed.
    """

    sensor: LandmarkSensorSpec | None = None
    sensors: SensorSuiteSpec | None = None
    declared: DeclaredErrorSpec | None = None
    draw: Annotated[int, Field(ge=0)] = 0

    @model_validator(mode="after")
    def _sees(self) -> Self:
        if self.sensors is not None and self.sensor is None:
            raise ValueError(
                "sensors need a sensor: the landmark sensor that stands for the camera"
            )
        return self


def _arm(value: object) -> object:
    """Let the sensor's own fields stand for an arm, and null for the sightings as they are."""
    if value is None:
        return {}
    is_sensor = isinstance(value, dict) and not _ARM_KEYS.intersection(value)
    return {"sensor": value} if is_sensor else value


class VariantSpec(Spec):
    """An estimator with its parameters, and values to try for some of them.

    Attributes:
        estimator: Its name.
        name: How the variant is called in run names; None lets the estimator's spec say.
        spec: Fields of its spec; what is not given has its default.
        sweep: Lists of values for fields of the spec, by their path in it such as
            ``retention.images``; several fields make all combinations.
    """

    estimator: str
    name: Annotated[str, Field(min_length=1)] | None = None
    spec: dict[str, Any] = Field(default_factory=dict)
    sweep: dict[str, Annotated[list[Any], Field(min_length=1)]] = Field(default_factory=dict)


class SweepSpec(Spec):
    """A sweep: every variant on every data set, sensed as every arm says.

    Attributes:
        name: What the sweep is called.
        data_sets: The traverses.
        arms: How they are sensed, by name: null for the sightings that the recordings hold, a
            landmark sensor's fields or the path of its YAML file, or an `ArmSpec`.
        variants: The estimators.
        odometry: What the increments from image to image are made of, for estimators that read
            them: wheels and inertial unit, or the wheels alone.
        requirement: What the runs are held to.
        evaluation: What counts as what when they are scored.
        bounds: Whether to compute the Cramer-Rao bound of each data set in each arm.
        time_limit_s: A run that takes longer is stopped, and fails as a timeout; None: no limit.
    """

    name: Annotated[str, Field(min_length=1)]
    data_sets: DataSetsSpec
    arms: Annotated[dict[str, Annotated[ArmSpec, BeforeValidator(_arm)]], Field(min_length=1)] = (
        Field(default_factory=lambda: {"recorded": ArmSpec()})
    )
    variants: Annotated[tuple[VariantSpec, ...], Field(min_length=1)]
    odometry: Literal["fused", "wheels"] = "fused"
    requirement: Requirement = Requirement()
    evaluation: EvaluationSpec = EvaluationSpec()
    bounds: bool = False
    time_limit_s: Annotated[float, Field(gt=0.0)] | None = None

    @classmethod
    def files_beside(cls, mapping: dict[str, Any], folder: Path) -> dict[str, Any]:
        """Find the recordings, and read the traverse and the sensors."""
        found = dict(mapping)
        if isinstance(sets := mapping.get("data_sets"), dict):
            found["data_sets"] = _data_sets_beside(sets, folder)
        if isinstance(arms := mapping.get("arms"), dict):
            found["arms"] = {name: _sensor_beside(arm, folder) for name, arm in arms.items()}
        return found


def _data_sets_beside(sets: dict[str, Any], folder: Path) -> dict[str, Any]:
    found = dict(sets)
    if isinstance(globs := sets.get("recordings"), list):
        found["recordings"] = [str(folder / g) if isinstance(g, str) else g for g in globs]
    if isinstance(traverse := sets.get("traverse"), str):
        found["traverse"] = TraverseSpec.from_yaml(folder / traverse)
    elif isinstance(traverse, dict):
        found["traverse"] = TraverseSpec.files_beside(traverse, folder)
    return found


def _sensor_beside(arm: object, folder: Path) -> object:
    if isinstance(arm, str):
        return {"sensor": LandmarkSensorSpec.from_yaml(folder / arm)}
    if isinstance(arm, dict) and isinstance(arm.get("sensor"), str):
        return arm | {"sensor": LandmarkSensorSpec.from_yaml(folder / arm["sensor"])}
    return arm
