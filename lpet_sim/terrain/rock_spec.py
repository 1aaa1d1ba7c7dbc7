"""Which rocks lie on a terrain: by the abundance model, or by a customer's table."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from lpet_sim.spec import Spec

Positive = Annotated[float, Field(gt=0.0)]
NonNegative = Annotated[float, Field(ge=0.0)]
Fraction = Annotated[float, Field(ge=0.0, le=1.0)]


def check_order(low: float, high: float) -> None:
    """Hold a range to its order, with a ValueError that pydantic turns into a SpecError."""
    if not low < high:
        raise ValueError(f"the minimum {low:g} must be below the maximum {high:g}")


class RockAbundanceSpec(Spec):
    """Rocks by the model of Golombek and Rapp (1997), ``F_k(D) = k exp(-(1.79 + 0.152/k) D)``.

    Attributes:
        kind: Which of the rock specs this is.
        k: Fraction of the ground that rocks of all sizes cover.
        number_multiplier: The paper's K: multiplies the number of rocks for a worst case.
        diameter_min_m: Smallest rock placed [m].
        diameter_max_m: Largest rock placed [m].
    """

    kind: Literal["abundance"] = "abundance"
    k: Annotated[float, Field(gt=0.0, le=0.4)]
    number_multiplier: Annotated[float, Field(gt=0.0, le=10.0)] = 1.0
    diameter_min_m: Annotated[float, Field(ge=0.02)] = 0.05
    diameter_max_m: Annotated[float, Field(le=10.0)] = 2.5

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        check_order(self.diameter_min_m, self.diameter_max_m)
        return self


class RockSizeClass(Spec):
    """One row of a customer's rock table.

    Attributes:
        diameter_min_m: Lower limit of the class [m].
        diameter_max_m: Upper limit of the class [m].
        count_per_m2: Rocks of the class per m^2.
        area_fraction: Fraction of the ground that the class covers; together with the count it
            fixes the mean area of a rock. None: sizes are uniform over the class.
    """

    diameter_min_m: Positive
    diameter_max_m: Positive
    count_per_m2: NonNegative
    area_fraction: Fraction | None = None

    @model_validator(mode="after")
    def _possible(self) -> Self:
        check_order(self.diameter_min_m, self.diameter_max_m)
        if self.area_fraction is not None:
            low, high = (
                self.count_per_m2 * math.pi / 4 * d**2
                for d in (self.diameter_min_m, self.diameter_max_m)
            )
            if not low <= self.area_fraction <= high:
                raise ValueError(
                    f"area_fraction must lie between {low:.4g} and {high:.4g}, which is what "
                    f"{self.count_per_m2:g} rocks per m2 of these diameters can cover"
                )
        return self


class RockTableSpec(Spec):
    """Rocks by a customer's table.

    Attributes:
        kind: Which of the rock specs this is.
        rows: Size classes, which must not overlap.
        number_multiplier: The paper's K: multiplies the number of rocks for a worst case.
    """

    kind: Literal["table"] = "table"
    rows: Annotated[tuple[RockSizeClass, ...], Field(min_length=1)]
    number_multiplier: Annotated[float, Field(gt=0.0, le=10.0)] = 1.0

    @model_validator(mode="after")
    def _disjoint(self) -> Self:
        rows = sorted(self.rows, key=lambda row: row.diameter_min_m)
        for below, above in pairwise(rows):
            if above.diameter_min_m < below.diameter_max_m:
                raise ValueError("size classes must not overlap")
        return self


RockSpec = Annotated[RockAbundanceSpec | RockTableSpec, Field(discriminator="kind")]
