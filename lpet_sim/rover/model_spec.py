"""What a rover is made of: a description in YAML beside its MJCF or URDF, ours or a user's own.

It names the wheels with their joints, and says where the inertial unit and the camera sit. All that
the drive needs beyond that (contact of the wheels, motors, solver) comes from here, with defaults
that are those of our own rover over a wheel's share of the weight.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from lpet_sim.errors import SpecError, UnknownNameError
from lpet_sim.recording.calibration import PoseSpec, Triple
from lpet_sim.spec import Spec

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Name = Annotated[str, Field(min_length=1)]
MARS_GRAVITY_MPS2 = 3.721
MOST_STEER_RAD = 1.5
"""A wheel that its model lets steer without end is steered no farther than this: 86 deg."""


class WheelPart(Spec):
    """A wheel, by the names that the model has for its joints.

    Attributes:
        name: What it is called in recordings and specs, as ``front_left``.
        drive: The joint that it rolls about: the only joint of its link, along the body's y.
        steer: The joint that steers it, about the body's z; None where it does not steer.
        offset_m: From the drive joint to the middle of the tread, to the left; None for where the
            link has its cylinder, or 0 where it has none.
    """

    name: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
    drive: Name | None = None
    steer: Name | None = None
    offset_m: float | None = None


class BodyPart(Spec):
    """The frame that trajectories are of: x forward, y left, z up.

    Attributes:
        link: The link that it is fixed to; None for the one that all others hang on.
        translation_m: Its origin in that link.
        q_wxyz: Its axes in that link, scalar first; those of the link by default.
    """

    link: Name | None = None
    translation_m: Triple = (0.0, 0.0, 0.0)
    q_wxyz: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)

    def pose(self) -> PoseSpec:
        """Give ``T_link_body``."""
        return PoseSpec(translation_m=self.translation_m, q_wxyz=self.q_wxyz)


class MountSpec(BodyPart):
    """Where a sensor sits: at a site of the model, or at a pose in a link.

    Attributes:
        site: A site of the model; then neither link nor pose is given.
        link: The link that it is fixed to; None for the body's frame.
    """

    site: Name | None = None

    @model_validator(mode="after")
    def _one_place(self) -> Self:
        moved = self.translation_m != (0.0, 0.0, 0.0) or self.q_wxyz != (1.0, 0.0, 0.0, 0.0)
        if self.site is not None and (self.link is not None or moved):
            raise ValueError(
                f"site '{self.site}' has its place already: leave out link, translation_m and "
                "q_wxyz, or leave out site"
            )
        return self


class CameraMountSpec(MountSpec):
    """Where an eye sits, and where it looks: first turned, then pitched.

    Attributes:
        optical: Whether the axes there are an eye's already (x right, y down, z forward); if not
            they are a body's (x forward, y left, z up), as those of most links.
        yaw_left_rad: Turned to the left by this.
        pitch_down_rad: Looks down by this.
    """

    optical: bool = False
    yaw_left_rad: float = 0.0
    pitch_down_rad: float = 0.0

    @model_validator(mode="after")
    def _one_convention(self) -> Self:
        if self.optical and (self.yaw_left_rad or self.pitch_down_rad):
            raise ValueError(
                "optical axes say where the eye looks: leave out yaw_left_rad and pitch_down_rad, "
                "or leave out optical"
            )
        return self


class BellySpec(Spec):
    """A box under the body that rests on rocks; nothing but it and the wheels collides.

    Attributes:
        centre_m: Its middle in the body's frame.
        half_size_m: Half its sides, along x, y, z.
    """

    centre_m: Triple
    half_size_m: tuple[Positive, Positive, Positive]


class MotorSpec(Spec):
    """Motors of wheels and steering; None is that of our own rover over a wheel's share.

    With the share of the weight N [N], of the mass m [kg] and the wheel's radius r [m], our own
    rover has what stands behind each (assumptions, see ``models/README.md``).

    Attributes:
        drive_stiffness_nm_rad: Of the angle to which the wheel's rate is integrated; 73 N r.
        drive_damping_nms_rad: 0.02 s of the stiffness.
        drive_torque_nm: Most that it gives; 2.2 N r.
        drive_armature_kgm2: Rotor's inertia at the wheel; 0.66 m r^2.
        steer_stiffness_nm_rad: Of the steering angle, critically damped; 146 N r.
        steer_torque_nm: Most that it gives; 5.5 N r.
        steer_armature_kgm2: Rotor's inertia at the wheel; 0.48 m r^2.
    """

    drive_stiffness_nm_rad: Positive | None = None
    drive_damping_nms_rad: Positive | None = None
    drive_torque_nm: Positive | None = None
    drive_armature_kgm2: Positive | None = None
    steer_stiffness_nm_rad: Positive | None = None
    steer_torque_nm: Positive | None = None
    steer_armature_kgm2: Positive | None = None


class RoverModelSpec(Spec):
    """A rover's model, and what its parts are.

    Attributes:
        model: The MJCF (.xml) or URDF (.urdf) file, beside the YAML.
        complete: The model has all that the drive needs, under the names that our own rover has
            (``models/README.md``): nothing is added, and only the wheels' names are read here.
        wheels: The wheels, in the order that recordings have them.
        wheel_radius_m: Radius of all wheels; None for that of the cylinders of their links.
        wheel_width_m: The same of their width.
        steer_limit_rad: Largest steering angle either way; None for the range of each joint.
        body: The frame that trajectories are of.
        imu: Where the inertial unit sits, axes as the body's.
        camera: Where the left eye sits, at its centre of projection.
        camera_right: The same of the right eye; None where the cameras' baseline says it.
        belly: What rests on rocks under the body; None for nothing.
        suspension: The joints that swing freely. Every other one that is not a wheel's (of a mast,
            an arm, a wheel that is not to steer) is held where the model has it.
        differentials: Pairs of suspension joints of which one turns back as far as the other turns
            forward, as the two rockers of a rocker suspension.
        suspension_damping_nms_rad: Damping of the suspension joints that the model gives none, so
            that they do not swing; None for 2.2 N r s, as our own rover's.
        motors: Motors of wheels and steering.
        gravity_mps2: Where it drives; Mars by default.
    """

    model: Name
    complete: bool = False
    wheels: Annotated[tuple[WheelPart, ...], Field(min_length=3, max_length=32)]
    wheel_radius_m: Positive | None = None
    wheel_width_m: Positive | None = None
    steer_limit_rad: Annotated[float, Field(gt=0.0, le=MOST_STEER_RAD)] | None = None
    body: BodyPart = BodyPart()
    imu: MountSpec = MountSpec()
    camera: CameraMountSpec = CameraMountSpec()
    camera_right: CameraMountSpec | None = None
    belly: BellySpec | None = None
    suspension: tuple[Name, ...] = ()
    differentials: tuple[tuple[Name, Name], ...] = ()
    suspension_damping_nms_rad: NotNegative | None = None
    motors: MotorSpec = MotorSpec()
    gravity_mps2: Positive = MARS_GRAVITY_MPS2

    @classmethod
    def files_beside(cls, mapping: dict[str, Any], folder: Path) -> dict[str, Any]:
        """Find the model's file beside the YAML."""
        model = mapping.get("model")
        return mapping | {"model": str(folder / model)} if isinstance(model, str) else mapping

    @model_validator(mode="after")
    def _names_apart(self) -> Self:
        """Hold every wheel to a name and a drive of its own."""
        for what in ("name", "drive", "steer"):
            named = Counter(getattr(wheel, what) for wheel in self.wheels)
            twice = [name for name, count in named.items() if name is not None and count > 1]
            if twice:
                raise ValueError(f"two wheels have the {what} '{twice[0]}'; each needs its own")
        for name in (name for pair in self.differentials for name in pair):
            if name not in self.suspension and not self.complete:
                raise ValueError(
                    f"differentials: joint '{name}' is held still; name it in suspension too, "
                    f"which has {', '.join(self.suspension) or 'none'}"
                )
        lacks = [wheel.name for wheel in self.wheels if wheel.drive is None]
        if lacks and not self.complete:
            raise ValueError(
                f"wheel '{lacks[0]}' lacks drive: the name of the joint it rolls about"
            )
        return self

    @property
    def wheel_names(self) -> tuple[str, ...]:
        """Names of the wheels; their order everywhere."""
        return tuple(wheel.name for wheel in self.wheels)

    @property
    def path(self) -> Path:
        """The model's file."""
        return Path(self.model)


def models_folder() -> Path:
    """Give the folder of our rover models, beside the package in the source tree."""
    return Path(__file__).resolve().parents[2] / "models"


def model_names() -> tuple[str, ...]:
    """Name the rovers that come with LPET."""
    return tuple(sorted(path.stem for path in models_folder().glob("*.yaml")))


def _description_path(name_or_path: str) -> Path:
    if name_or_path in model_names():
        return models_folder() / f"{name_or_path}.yaml"
    path = Path(name_or_path)
    if path.suffix in (".xml", ".urdf"):
        raise SpecError(
            f"{path} is the model itself: give the YAML that names its wheels, which "
            "docs/own_rover.md tells how to write"
        )
    if not path.exists() and path.suffix not in (".yaml", ".yml"):
        raise UnknownNameError("rover model", name_or_path, model_names())
    return path


@lru_cache(maxsize=16)
def load_rover_model(name_or_path: str) -> RoverModelSpec:
    """Load the description of a rover; it is read once for each process.

    Args:
        name_or_path: The name of one that comes with LPET, or the path of a YAML file.

    Raises:
        UnknownNameError: A name that is neither.
        SpecError: A file that cannot be read or holds a bad value.
    """
    return RoverModelSpec.from_yaml(_description_path(name_or_path))


def wheel_names(name_or_path: str) -> tuple[str, ...]:
    """Name the wheels of a rover, in their order; see `load_rover_model`."""
    return load_rover_model(name_or_path).wheel_names


def rover_beside(rover: object, folder: Path) -> object:
    """Find the description that a rover as read from YAML names, where it lies in a folder.

    Args:
        rover: A `RoverSpec` as read from YAML; anything else comes back as it is.
        folder: Where relative paths begin.
    """
    model = rover.get("model") if isinstance(rover, dict) else None
    if not isinstance(rover, dict) or not isinstance(model, str) or model in model_names():
        return rover
    return rover | {"model": str(folder / model)} if (folder / model).is_file() else rover


def identity_of(name_or_path: str) -> dict[str, Any] | None:
    """Say which rover that is: None for ours, which the version of LPET says already.

    Returns:
        The description and the SHA-256 of the model's file, without folders.
    """
    if name_or_path in model_names():
        return None
    spec = load_rover_model(name_or_path)
    said = spec.to_mapping() | {"model": spec.path.name}
    return said | {"sha256": hashlib.sha256(spec.path.read_bytes()).hexdigest()}


def limit_of(low_rad: float, high_rad: float) -> float:
    """Give how far a joint of this range steers both ways [rad]."""
    return min(-low_rad, high_rad, MOST_STEER_RAD) if low_rad < high_rad else MOST_STEER_RAD
