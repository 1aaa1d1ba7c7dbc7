"""The verdict: does a run meet the requirement?"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from lpet_sim.evaluation.errors import worst_position_ratio
from lpet_sim.evaluation.result import RunResult
from lpet_sim.failures import BROKEN
from lpet_sim.spec import Spec

AXES = ("roll", "pitch", "yaw")


@dataclass(frozen=True)
class VerdictLine:
    """One line of a requirement.

    Attributes:
        quantity: What is held to a limit, such as ``position, throughout``.
        unit: ``ratio`` (of the distance; of the traverse for completion) or ``rad``.
        value: What the run reached.
        limit: The limit.
        at_least: Whether the limit is a lower one.
    """

    quantity: str
    unit: str
    value: float
    limit: float
    at_least: bool = False

    @property
    def margin(self) -> float:
        """How far the value is on the good side of the limit, negative where it fails."""
        return self.value - self.limit if self.at_least else self.limit - self.value

    @property
    def passed(self) -> bool:
        """Whether the line is met; a value that is not a number never is."""
        return self.margin >= 0


@dataclass(frozen=True)
class Verdict:
    """All lines of a requirement for one run.

    Attributes:
        name: The estimator's name.
        lines: The lines.
        broken: The run's failure where no line can make up for it (`BROKEN`), else None.
    """

    name: str
    lines: tuple[VerdictLine, ...]
    broken: str | None = None

    @property
    def passed(self) -> bool:
        """Whether every line is met by a run that is not broken."""
        return self.broken is None and all(line.passed for line in self.lines)


class Requirement(Spec):
    """Limits on a run; the paper's by default: 1 % of the distance and 1 deg per axis, throughout.

    Attributes:
        position_ratio: Limit of the position error over the distance driven so far.
        roll_rad: Limit of the roll error [rad].
        pitch_rad: Limit of the pitch error [rad].
        yaw_rad: Limit of the yaw error [rad].
        start_m: Distance from which on the position is held to its limit at every moment [m];
            attitude is held to its limits from the start.
        throughout: Hold the run to the limits at every moment.
        at_end: Hold the run to the limits at its end.
        completion: Least share of the traverse that the estimate covers.
    """

    position_ratio: float = Field(default=0.01, gt=0)
    roll_rad: float = Field(default=math.radians(1.0), gt=0)
    pitch_rad: float = Field(default=math.radians(1.0), gt=0)
    yaw_rad: float = Field(default=math.radians(1.0), gt=0)
    start_m: float = Field(default=5.0, ge=0)
    throughout: bool = True
    at_end: bool = True
    completion: float = Field(default=0.99, ge=0, le=1)

    @property
    def attitude_rad(self) -> tuple[float, float, float]:
        """Limits of roll, pitch and yaw [rad]."""
        return self.roll_rad, self.pitch_rad, self.yaw_rad

    def check(self, result: RunResult) -> Verdict:
        """Hold a run to the limits.

        Args:
            result: The run's score.

        Returns:
            One line for each limit; a run without a result fails them all, and a broken run fails
            whatever its lines say.
        """
        broken = result.failure in BROKEN
        lines = [VerdictLine("completion", "ratio", result.completion, self.completion, True)]
        if self.throughout:
            lines += self._lines("throughout", self._worst(result), result.worst_attitude_rad)
        if self.at_end:
            lines += self._lines("at the end", result.endpoint_ratio, result.endpoint_attitude_rad)
        return Verdict(result.name, tuple(lines), result.failure if broken else None)

    def _worst(self, result: RunResult) -> float:
        if result.series is None:
            return result.worst_ratio
        return worst_position_ratio(result.series, self.start_m)

    def _lines(
        self, when: str, position_ratio: float, attitude_rad: tuple[float, float, float]
    ) -> list[VerdictLine]:
        lines = [VerdictLine(f"position, {when}", "ratio", position_ratio, self.position_ratio)]
        for axis, value, limit in zip(AXES, attitude_rad, self.attitude_rad, strict=True):
            lines.append(VerdictLine(f"{axis}, {when}", "rad", float(np.abs(value)), limit))
        return lines
