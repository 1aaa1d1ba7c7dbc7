"""What a sensor costs: data volume, computing and mass, by simple formulas.

They rank sensors; they are no engineering estimate. Every coefficient is a field of `ProxySpec`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from lpet_sim.spec import Spec
from lpet_sim.tradeoff.candidate import Candidate
from lpet_sim.tradeoff.grades import imu_grade

NotNegative = Annotated[float, Field(ge=0.0)]


class ProxySpec(Spec):
    """Coefficients of the proxies. All are choices of this project unless a source is given.

    Attributes:
        bits_per_px: Depth of the stored images; no compression.
        front_end_s_per_px: Computing of detection and matching for a pixel [s]: SIFT takes 56 ms
            of one core for 640 x 480 px, measured on a desktop.
        filter_s: Computing of the filter for an image with `filter_sightings` [s]: 2.7 ms, measured
            at 40 sightings and a time to live of 10.
        filter_sightings: The sightings of that image; the filter grows with their square.
        eye_kg: Mass of one camera with optics [kg]; 0.22 for the MER cameras [recalled].
        mast_kg_per_m: Mass of a mast for a metre of height above the deck [kg/m].
        deck_height_m: Height of the deck, up to which no mast is needed.
        boom_kg_per_m: Mass of the beam that holds both eyes, for a metre of baseline [kg/m].
    """

    bits_per_px: Annotated[float, Field(gt=0.0)] = 8.0
    front_end_s_per_px: NotNegative = 1.8e-7
    filter_s: NotNegative = 2.7e-3
    filter_sightings: Annotated[float, Field(gt=0.0)] = 40.0
    eye_kg: NotNegative = 0.22
    mast_kg_per_m: NotNegative = 4.0
    deck_height_m: NotNegative = 0.9
    boom_kg_per_m: NotNegative = 2.0


@dataclass(frozen=True)
class Costs:
    """What a candidate costs.

    Attributes:
        data_bit_per_m: Image data for a metre driven [bit/m].
        compute_s_per_m: Time of one desktop core for a metre driven [s/m].
        mass_kg: Cameras, mast, beam and inertial unit [kg].
    """

    data_bit_per_m: float
    compute_s_per_m: float
    mass_kg: float


def costs_of(candidate: Candidate, sightings: float, spec: ProxySpec) -> Costs:
    """Give what a candidate costs.

    ``data = 2 W H bits / d``, ``compute = (2 W H c_px + c_f (n / n_0)^2) / d`` and
    ``mass = 2 m_eye + m_mast max(0, h - h_deck) + m_boom b + m_imu``.

    Args:
        candidate: The sensor.
        sightings: Sightings n of an image.
        spec: The coefficients.
    """
    pixels = 2.0 * candidate.resolution_px * candidate.height_px
    filtering = spec.filter_s * (sightings / spec.filter_sightings) ** 2
    mast_m = max(0.0, candidate.mast_height_m - spec.deck_height_m)
    carried = spec.mast_kg_per_m * mast_m + spec.boom_kg_per_m * candidate.baseline_m
    return Costs(
        pixels * spec.bits_per_px / candidate.image_interval_m,
        (pixels * spec.front_end_s_per_px + filtering) / candidate.image_interval_m,
        2.0 * spec.eye_kg + carried + imu_grade(candidate.imu).mass_kg,
    )
