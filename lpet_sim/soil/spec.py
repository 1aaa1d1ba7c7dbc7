"""What a wheel and a soil are, as far as the law between them needs to know."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from lpet_sim.spec import Spec

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Fraction = Annotated[float, Field(ge=0.0, le=1.0)]

Evidence = Literal["measured", "published", "fitted", "assumed"]
"""How well a soil is known: a measured curve, others' published parameters, our fit, a guess."""


class WheelSpec(Spec):
    """A wheel on soil.

    Attributes:
        radius_m: Radius of the rim, without grousers.
        width_m: Width of the rim.
        grouser_height_m: Height of the grousers (lugs); 0 for a smooth wheel.
        grouser_count: How many there are around the rim.
    """

    radius_m: Positive
    width_m: Positive
    grouser_height_m: NotNegative = 0.0
    grouser_count: Annotated[int, Field(ge=0)] = 0


class BekkerSpec(Spec):
    """Bekker's pressure under a plate of width b: ``p = (kc / b + kphi) z^n``.

    Attributes:
        kind: "bekker".
        kc: Cohesive modulus [N/m^(n+1)]; published ones are below 0 now and then, which holds for
            wheels that are wide enough: the law refuses one for which ``kc / b + kphi`` is not
            above 0.
        kphi: Frictional modulus [N/m^(n+2)].

    Reference:
        Bekker, Introduction to Terrain-Vehicle Systems, 1969 [recalled].
    """

    kind: Literal["bekker"] = "bekker"
    kc: float
    kphi: Positive


class ReeceSpec(Spec):
    """Reece's pressure under a plate of width b: ``p = (c kc + gamma b kphi) (z / b)^n``.

    ``c`` is the soil's cohesion and ``gamma`` its weight per volume, density times gravity, so
    that this form alone knows of gravity by itself.

    Attributes:
        kind: "reece".
        kc: Cohesive modulus [-].
        kphi: Frictional modulus [-].

    Reference:
        Reece, Principles of soil-vehicle mechanics, 1965 [recalled].
    """

    kind: Literal["reece"] = "reece"
    kc: NotNegative
    kphi: Positive


class ModulusSpec(Spec):
    """One modulus for every width: ``p = k z^n``.

    Attributes:
        kind: "modulus".
        k: Modulus [N/m^(n+2)].
    """

    kind: Literal["modulus"] = "modulus"
    k: Positive


PressureSpec = Annotated[BekkerSpec | ReeceSpec | ModulusSpec, Field(discriminator="kind")]
"""The ways to say what pressure a soil bears at a depth."""


class _NamedSoil(Spec):
    """What every soil says of itself.

    Attributes:
        name: What it is called.
        evidence: How well it is known.
        source: Where each number comes from, and which are recalled or assumed.
        measured_with: The library wheel that it was measured, tuned or fitted with, if any.
    """

    name: Annotated[str, Field(min_length=1)]
    evidence: Evidence
    source: Annotated[str, Field(min_length=1)]
    measured_with: str | None = None


class MechanicalSoilSpec(_NamedSoil):
    """Loose soil by its mechanical parameters.

    With slip ``s = 1 - v / (r omega)`` at or above 0 the pressure's exponent is ``n = n0 + n1 s``
    (slip-sinkage), with skid ``s' = r omega / v - 1`` below 0 it is ``n = n0 + n2 |s'|``. Where the
    rim enters the soil at ``theta_1``, normal stress peaks at ``theta_m = (a0 + a1 s) theta_1`` and
    ends at ``theta_2 = (b0 + b1 s) theta_1``. Shear stress rises as Janosi and Hanamoto's
    ``tau = (c + sigma tan(phi)) (1 - exp(-j / K))``.

    Attributes:
        kind: "mechanics".
        pressure: Pressure against depth.
        sinkage_exponent: n0 [-].
        sinkage_exponent_slip: n1, for each unit of slip [-].
        sinkage_exponent_skid: n2, for each unit of skid [-].
        cohesion_pa: c.
        friction_rad: Angle of internal friction phi.
        shear_modulus_x_m: K along the wheel.
        shear_modulus_x_per_rad_m: What each radian of slip angle adds to it (Ishigami's form).
        shear_modulus_y_m: K across the wheel.
        shear_modulus_y_per_rad_m: What each radian of slip angle adds to it.
        density_kgpm3: Bulk density.
        peak_angle: a0 [-].
        peak_angle_slip: a1 [-].
        rear_angle: b0, 0 or below [-].
        rear_angle_slip: b1 [-].

    Reference:
        Wong and Reece, J. Terramechanics 4, 1967; Janosi and Hanamoto, 1961; Ding et al. for the
        exponent's dependence on slip [recalled].
    """

    kind: Literal["mechanics"] = "mechanics"
    pressure: PressureSpec
    sinkage_exponent: Annotated[float, Field(gt=0.0, le=3.0)]
    sinkage_exponent_slip: Annotated[float, Field(ge=-1.0, le=2.0)] = 0.0
    sinkage_exponent_skid: Annotated[float, Field(ge=-1.0, le=2.0)] = 0.0
    cohesion_pa: NotNegative
    friction_rad: Annotated[float, Field(gt=0.0, lt=math.radians(60.0))]
    shear_modulus_x_m: Positive
    shear_modulus_x_per_rad_m: NotNegative = 0.0
    shear_modulus_y_m: Positive
    shear_modulus_y_per_rad_m: NotNegative = 0.0
    density_kgpm3: Annotated[float, Field(ge=500.0, le=4000.0)]
    peak_angle: Annotated[float, Field(gt=0.0, lt=1.0)]
    peak_angle_slip: Annotated[float, Field(ge=0.0, lt=1.0)]
    rear_angle: Annotated[float, Field(ge=-1.0, le=0.0)] = 0.0
    rear_angle_slip: Annotated[float, Field(ge=-1.0, le=0.0)] = 0.0

    @model_validator(mode="after")
    def _peak_inside(self) -> Self:
        if self.peak_angle + self.peak_angle_slip >= 1.0:
            raise ValueError(
                "peak_angle + peak_angle_slip must be below 1: the peak lies in contact"
            )
        return self

    @model_validator(mode="after")
    def _rear_inside(self) -> Self:
        if self.rear_angle + self.rear_angle_slip < -1.0:
            raise ValueError(
                "rear_angle + rear_angle_slip must be at least -1: soil rises behind the wheel no "
                "higher than before it"
            )
        return self

    @model_validator(mode="after")
    def _pressure_rises(self) -> Self:
        for key in ("sinkage_exponent_slip", "sinkage_exponent_skid"):
            if self.sinkage_exponent + getattr(self, key) <= 0.0:
                raise ValueError(
                    f"sinkage_exponent + {key} must be above 0: pressure rises with depth"
                )
        return self


class MeasuredSoilSpec(_NamedSoil):
    """Loose soil by a measured curve of a rover's slip over the slope it climbs.

    Read wheel by wheel as slip over traction ratio: traction over load is ``tan(slope)``.

    Attributes:
        kind: "table".
        slope_rad: Slopes climbed, increasing from 0 or above.
        slip: Slip on each, not decreasing, below 1.
        sinkage_m: Sinkage on each, if it was measured; else sinkage is taken as 0.
        rolling_resistance: Resistance over load: on a slope of minus its arc tangent the curve
            reaches slip 0.
        holding_friction_rad: Slope on which wheels slide, turning or locked. An assumption.
    """

    kind: Literal["table"] = "table"
    slope_rad: Annotated[tuple[float, ...], Field(min_length=2)]
    slip: Annotated[tuple[float, ...], Field(min_length=2)]
    sinkage_m: tuple[NotNegative, ...] | None = None
    rolling_resistance: Annotated[float, Field(gt=0.0, le=0.5)]
    holding_friction_rad: Annotated[float, Field(gt=0.0, lt=math.pi / 4)]

    @model_validator(mode="after")
    def _table(self) -> Self:
        columns = [self.slope_rad, self.slip, self.sinkage_m or self.slip]
        if len({len(column) for column in columns}) > 1:
            raise ValueError("slope_rad, slip and sinkage_m must have the same length")
        if self.slope_rad[0] < 0 or any(b <= a for a, b in pairwise(self.slope_rad)):
            raise ValueError("slope_rad must increase from 0 or above")
        if any(b < a for a, b in pairwise(self.slip)) or not 0 < self.slip[0] <= self.slip[-1] < 1:
            raise ValueError("slip must not decrease and must lie between 0 and 1")
        if self.holding_friction_rad <= self.slope_rad[-1]:
            raise ValueError("holding_friction_rad must exceed the steepest slope that was climbed")
        return self


class FirmSoilSpec(_NamedSoil):
    """Ground that a wheel does not sink into: crust, bedrock, a rock.

    A tyre's brush smoothed: ``x + rr = mu (1 - exp(-C s / mu))`` with traction over load x, slip s.

    Attributes:
        kind: "firm".
        friction: Most tangential force over load, mu.
        slip_stiffness: Rise of the traction ratio with slip at slip 0, C.
        rolling_resistance: Resistance over load, rr.
    """

    kind: Literal["firm"] = "firm"
    friction: Annotated[float, Field(gt=0.0, lt=1.0)]
    slip_stiffness: Annotated[float, Field(ge=1.0, le=1000.0)]
    rolling_resistance: Annotated[float, Field(ge=0.0, le=0.5)] = 0.0

    @model_validator(mode="after")
    def _rolls(self) -> Self:
        if self.rolling_resistance >= self.friction:
            raise ValueError("rolling_resistance must be below friction: else no wheel rolls")
        return self


SoilSpec = Annotated[
    MechanicalSoilSpec | MeasuredSoilSpec | FirmSoilSpec, Field(discriminator="kind")
]
"""The ways to say what a soil is."""
