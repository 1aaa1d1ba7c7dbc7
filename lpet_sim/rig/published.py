"""What others measured on a soil of the library, and on no altered copy of it."""

from __future__ import annotations

from lpet_sim.soil.load import load_soil, load_wheel, published_curves, soil_names, wheel_names
from lpet_sim.soil.published import PublishedCurve, ReferenceWheelSpec
from lpet_sim.soil.spec import SoilSpec


def is_of_library(soil: SoilSpec) -> bool:
    """Tell whether a soil is the library's own of that name, with the same parameters."""
    return soil.name in soil_names() and load_soil(soil.name) == soil


def is_wheel_of_library(wheel: ReferenceWheelSpec) -> bool:
    """Tell whether a wheel is the library's own of that name, under the load of its test."""
    return wheel.name in wheel_names() and load_wheel(wheel.name) == wheel


def published_beside(soil: SoilSpec) -> tuple[PublishedCurve, ...]:
    """Give the published curves of a soil; a user's own soil has none, whatever its name."""
    return published_curves(soil.name) if is_of_library(soil) else ()
