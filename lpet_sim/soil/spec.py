"""What a wheel and a soil are, as far as the law between them needs to know."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from lpet_sim.spec import Spec

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]


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
