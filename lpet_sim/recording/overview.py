"""What a recording shows at a glance: its facts, kept in the file, and the text made of them."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from typing import Any, Protocol

import numpy as np

from lpet_sim.recording.arrays import NS_PER_S, Array, Ints
from lpet_sim.recording.recording import Manifest


class ErrorsOverTime(Protocol):
    """Errors of an estimate at the times that the truth covers, as evaluation makes them."""

    @property
    def t_ns(self) -> Ints:
        """Times since the start [ns], Shape (n,)."""
        ...

    @property
    def distance_m(self) -> Array:
        """Distance truly driven so far [m], Shape (n,)."""
        ...

    @property
    def position_error_m(self) -> Array:
        """``p_est - p_true`` in the world [m], Shape (n, 3)."""
        ...

    @property
    def attitude_error_rad(self) -> Array:
        """Roll, pitch and yaw error [rad], Shape (n, 3)."""
        ...


class SlipOverTime(Protocol):
    """Slip between images, as evaluation finds it by comparing vision with the wheels."""

    @property
    def t_ns(self) -> Ints:
        """End of each interval since the start [ns], Shape (n,)."""
        ...

    @property
    def slip(self) -> Array:
        """Lost share of the wheels' motion, NaN where it is not known, Shape (n,)."""
        ...


@dataclass(frozen=True)
class EstimateFacts:
    """An estimate in a recording.

    Attributes:
        name: Its name.
        slug: Its part of an entity's path.
        colour: Index of its colour.
        diagnostics: Names of its diagnostics.
        distance_m: True distance at its end [m], None without errors.
        end_error_m: Position error at its end [m], None without errors.
        attitude_deg: Worst roll, pitch and yaw error [deg], None without errors.
    """

    name: str
    slug: str
    colour: int
    diagnostics: tuple[str, ...] = ()
    distance_m: float | None = None
    end_error_m: float | None = None
    attitude_deg: tuple[float, float, float] | None = None

    @property
    def label(self) -> str:
        """The name with the end error where it is known."""
        if self.end_error_m is None or not self.distance_m:
            return self.name
        digits = 2 if self.end_error_m >= 0.1 else 3
        return f"{self.name}: {self.end_error_m:.{digits}f} m, {self._percent():.2f} %"

    def row(self) -> str:
        """Give the estimate's row of the table."""
        if self.end_error_m is None or self.attitude_deg is None or not self.distance_m:
            return f"| {self.name} | | | |"
        worst = " / ".join(f"{angle:.2f}" for angle in self.attitude_deg)
        return f"| {self.name} | {self.end_error_m:.3f} | {self._percent():.2f} | {worst} |"

    def _percent(self) -> float:
        return 100.0 * (self.end_error_m or 0.0) / (self.distance_m or np.inf)


@dataclass(frozen=True)
class Overview:
    """The facts of a recording that the text and the arrangement of views are made of.

    Attributes:
        low_m: Least corner of all that was driven or estimated [m].
        high_m: Greatest corner [m].
        duration_s: Time of the last that happened [s].
        distance_m: Length of the true path [m].
        has_truth: Whether there is a truth.
        has_wheel_truth: Whether slip, sinkage and forces of the wheels are known.
        has_seen_slip: Whether slip was found by comparing vision with the wheels.
        has_rover: Whether the rover moves in the drawing.
        aspect: Width over height of an image, None without cameras.
        has_events: Whether something happened.
        images: Number of image pairs kept.
        sightings: Number of sightings.
        estimates: The estimates, in the order in which they were added.
    """

    low_m: tuple[float, ...] = ()
    high_m: tuple[float, ...] = ()
    duration_s: float = 0.0
    distance_m: float = 0.0
    has_truth: bool = False
    has_wheel_truth: bool = False
    has_seen_slip: bool = False
    has_rover: bool = False
    aspect: float | None = None
    has_events: bool = False
    images: int = 0
    sightings: int = 0
    estimates: tuple[EstimateFacts, ...] = field(default=())

    @classmethod
    def from_json(cls, value: dict[str, Any]) -> Overview:
        """Read the facts back."""
        estimates = tuple(
            EstimateFacts(**{**e, "diagnostics": tuple(e["diagnostics"])})
            for e in value["estimates"]
        )
        return cls(**{**value, "estimates": estimates})

    def to_json(self) -> dict[str, Any]:
        """Give the facts as plain values."""
        return asdict(self)

    @property
    def extent_m(self) -> float:
        """The diagonal of all that was driven or estimated [m]."""
        return float(np.linalg.norm(np.subtract(self.high_m, self.low_m)))

    def covering(self, points_m: Array) -> Overview:
        """Widen the corners so that points lie within, Shape (n, 3)."""
        if not len(points_m):
            return self
        corners = [points_m.min(axis=0), points_m.max(axis=0)]
        if self.low_m:
            corners += [np.array(self.low_m), np.array(self.high_m)]
        low, high = np.min(corners, axis=0), np.max(corners, axis=0)
        return replace(self, low_m=tuple(map(float, low)), high_m=tuple(map(float, high)))

    def lasting(self, t_ns: Ints) -> Overview:
        """Lengthen the duration up to the last of some times [ns]."""
        last_s = float(t_ns[-1]) / NS_PER_S if len(t_ns) else 0.0
        return replace(self, duration_s=max(self.duration_s, last_s))

    def with_estimate(self, facts: EstimateFacts) -> Overview:
        """Add an estimate, in place of one of the same name."""
        others = tuple(e for e in self.estimates if e.name != facts.name)
        return replace(self, estimates=(*others, facts))

    def colour_for(self, name: str) -> int:
        """Choose a colour for an estimate: its own where it had one, else the first free one."""
        taken = {e.colour for e in self.estimates if e.name != name}
        own = [e.colour for e in self.estimates if e.name == name]
        return own[0] if own else next(i for i in range(len(taken) + 1) if i not in taken)

    def markdown(self, manifest: Manifest) -> str:
        """Write the facts and the specs as a page."""
        return "\n".join([*self._head(manifest), *self._table(), *_specs(manifest)])

    def _head(self, manifest: Manifest) -> list[str]:
        seed = "" if manifest.seed is None else f", seed {manifest.seed}"
        lines = [f"# {manifest.source}{seed}", ""]
        if self.has_truth:
            hours = f"{self.duration_s / 60.0:.1f} min"
            lines.append(f"**{self.distance_m:.1f} m** driven in {hours}. ")
        return [*lines, f"{self.images} image pairs kept, {self.sightings} sightings.", ""]

    def _table(self) -> list[str]:
        if not self.estimates:
            return []
        head = "| estimate | end error m | % | worst roll / pitch / yaw deg |"
        return [head, "|---|---|---|---|", *(e.row() for e in self.estimates), ""]


def estimate_facts(
    name: str, slug: str, colour: int, diagnostics: tuple[str, ...], errors: ErrorsOverTime | None
) -> EstimateFacts:
    """Sum an estimate up."""
    if errors is None or not len(errors.t_ns):
        return EstimateFacts(name, slug, colour, diagnostics)
    worst = np.degrees(np.abs(errors.attitude_error_rad).max(axis=0))
    return EstimateFacts(
        name,
        slug,
        colour,
        diagnostics,
        float(errors.distance_m[-1]),
        float(np.linalg.norm(errors.position_error_m[-1])),
        (float(worst[0]), float(worst[1]), float(worst[2])),
    )


def _specs(manifest: Manifest) -> list[str]:
    lines = ["## Specs", ""] if manifest.specs else []
    for name, spec in manifest.specs.items():
        lines += [f"**{name}**", "", "```yaml", *_flat(spec), "```", ""]
    versions = ", ".join(f"{name} {version}" for name, version in manifest.versions.items())
    return [*lines, f"Versions: {versions}" if versions else ""]


def _flat(value: Any, name: str = "") -> list[str]:
    """Write nested values one to a line."""
    if not isinstance(value, dict):
        return [f"{name}: {value}"]
    return [
        line for key, v in value.items() for line in _flat(v, f"{name}.{key}" if name else str(key))
    ]
