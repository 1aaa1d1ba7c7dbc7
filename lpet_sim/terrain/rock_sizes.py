"""How many rocks of which size: the law of Golombek and Rapp, or a customer's table."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np
from scipy.optimize import brentq
from scipy.special import expn

from lpet_sim.recording.arrays import Array
from lpet_sim.terrain.rock_spec import RockAbundanceSpec, RockSizeClass, RockTableSpec

_TABLE_NODES = 8193
_STEEPEST_TILT = 500.0


class SizeLaw(Protocol):
    """Counts and cover of rocks per m^2 of ground, and the diameter at a given rank."""

    diameter_min_m: float
    diameter_max_m: float

    def count_above(self, diameter_m: Array) -> Array:
        """Rocks of at least a diameter per m^2, Shape (n,) to (n,)."""
        ...

    def area_above(self, diameter_m: Array) -> Array:
        """Fraction of the ground that rocks of at least a diameter cover, Shape (n,) to (n,)."""
        ...

    def diameter_at(self, count_above: Array) -> Array:
        """Inverse of `count_above` [m], Shape (n,) to (n,)."""
        ...


def size_law(spec: RockAbundanceSpec | RockTableSpec | None) -> SizeLaw:
    """Build the size law that a spec asks for, its number multiplier K included."""
    if spec is None:
        return NoRocks()
    return GolombekRapp(spec) if isinstance(spec, RockAbundanceSpec) else RockTable(spec)


class NoRocks:
    """The law of bare ground: its one diameter has no rocks."""

    diameter_min_m = 1.0
    diameter_max_m = 1.0

    def count_above(self, diameter_m: Array) -> Array:
        """No rocks, Shape (n,)."""
        return np.zeros(len(diameter_m))

    def area_above(self, diameter_m: Array) -> Array:
        """No cover, Shape (n,)."""
        return np.zeros(len(diameter_m))

    def diameter_at(self, count_above: Array) -> Array:
        """The one diameter [m], Shape (n,)."""
        return np.full(len(count_above), self.diameter_min_m)


def golombek_rapp_decay(k: float) -> float:
    """Decay ``q = 1.79 + 0.152 / k`` of the cumulative cover, per m of diameter.

    Reference: Golombek and Rapp (1997), Size-frequency distributions of rocks on Mars.
    """
    return 1.79 + 0.152 / k


def golombek_rapp_count(k: float, diameter_m: Array) -> Array:
    """Count rocks of at least a diameter per m^2.

    ``N(>D) = (4 / pi) k q Integral_D^inf x^-2 exp(-q x) dx = (4 / pi) k q E_2(q D) / D`` follows
    from the cumulative cover ``F_k(D) = k exp(-q D)`` of discs; E_2 is the exponential integral.

    Args:
        k: Fraction of the ground that rocks of all sizes cover.
        diameter_m: Diameters above 0 [m], Shape (n,).

    Reference: Golombek and Rapp (1997).
    """
    q = golombek_rapp_decay(k)
    return 4.0 / math.pi * k * q * expn(2, q * diameter_m) / diameter_m


class GolombekRapp:
    """The law of Golombek and Rapp between a smallest and a largest diameter."""

    def __init__(self, spec: RockAbundanceSpec) -> None:
        """Tabulate the count so that it can be inverted; see `golombek_rapp_count`."""
        self.diameter_min_m, self.diameter_max_m = spec.diameter_min_m, spec.diameter_max_m
        self._k, self._multiplier = spec.k, spec.number_multiplier
        # Linear interpolation between 8193 log-spaced nodes is off by less than 1e-6 of D.
        nodes = np.geomspace(self.diameter_max_m, self.diameter_min_m, _TABLE_NODES)
        self._node_diameter_m, self._node_count = nodes, self.count_above(nodes)

    def count_above(self, diameter_m: Array) -> Array:
        """Rocks from a diameter up to the largest per m^2, Shape (n,)."""
        ends = np.clip(diameter_m, self.diameter_min_m, self.diameter_max_m)
        tail = golombek_rapp_count(self._k, np.array([self.diameter_max_m]))
        return self._multiplier * (golombek_rapp_count(self._k, ends) - tail)

    def area_above(self, diameter_m: Array) -> Array:
        """Cover ``K k (exp(-q D) - exp(-q D_max))``, Shape (n,)."""
        ends = np.clip(diameter_m, self.diameter_min_m, self.diameter_max_m)
        q = golombek_rapp_decay(self._k)
        tail = math.exp(-q * self.diameter_max_m)
        return self._multiplier * self._k * (np.exp(-q * ends) - tail)

    def diameter_at(self, count_above: Array) -> Array:
        """Inverse of `count_above` [m], Shape (n,)."""
        return np.interp(count_above, self._node_count, self._node_diameter_m)


class ClassSizes:
    """Diameters inside one class of a table, with the mean area that the table asks for.

    The density is a power law, written in ``t = ln(D / a) / ln(b / a)`` on [0, 1] as
    ``f(t) ~ exp(tilt t)``. The one parameter is solved for
    ``E[D^2] = a^2 M(tilt + c) / M(tilt) = area / (count pi / 4)``, with ``c = 2 ln(b / a)`` and
    ``M(s) = (exp(s) - 1) / s``: count and cover of the class both come out as given.
    """

    def __init__(self, row: RockSizeClass) -> None:
        """Solve for the tilt; without an area, diameters are uniform over the class."""
        self.row = row
        self._span = math.log(row.diameter_max_m / row.diameter_min_m)
        self._tilt = self._solved_tilt()

    def _solved_tilt(self) -> float:
        row = self.row
        if row.area_fraction is None or row.count_per_m2 == 0.0:
            return self._span  # a uniform density of D is exp(span t) in t
        wanted = math.log(row.area_fraction / (row.count_per_m2 * math.pi / 4.0))
        wanted -= 2.0 * math.log(row.diameter_min_m)
        limits = [self._log_mean_square(s) for s in (-_STEEPEST_TILT, _STEEPEST_TILT)]
        if not limits[0] < wanted < limits[1]:  # all rocks at one edge of the class
            return math.copysign(_STEEPEST_TILT, wanted - self._span)
        excess = lambda tilt: self._log_mean_square(tilt) - wanted  # noqa: E731
        return float(brentq(excess, -_STEEPEST_TILT, _STEEPEST_TILT, xtol=1e-12))

    @property
    def mean_square_m2(self) -> float:
        """Mean squared diameter [m^2]."""
        return self.row.diameter_min_m**2 * math.exp(self._log_mean_square(self._tilt))

    def _log_mean_square(self, tilt: float) -> float:
        """``ln(E[D^2] / a^2)`` under a tilt."""
        return _log_growth(tilt + 2.0 * self._span) - _log_growth(tilt)

    def share_above(self, diameter_m: Array, power: float = 0.0) -> Array:
        """Share of the class's ``sum of D^power`` that lies in rocks of at least a diameter."""
        row = self.row
        ends = np.clip(diameter_m, row.diameter_min_m, row.diameter_max_m)
        t = np.log(ends / row.diameter_min_m) / self._span
        s = self._tilt + power * self._span
        return 1.0 - _tilted_cdf(s, t)

    def diameter_at(self, share_above: Array) -> Array:
        """Inverse of `share_above` at power 0 [m], Shape (n,)."""
        t = _tilted_quantile(self._tilt, 1.0 - share_above)
        return self.row.diameter_min_m * np.exp(self._span * t)


class RockTable:
    """A customer's table: size classes with their count per m^2 and the area they cover."""

    def __init__(self, spec: RockTableSpec) -> None:
        """Sort the classes from the largest down and add up their counts."""
        rows = sorted(spec.rows, key=lambda row: row.diameter_min_m, reverse=True)
        self.diameter_min_m = rows[-1].diameter_min_m
        self.diameter_max_m = rows[0].diameter_max_m
        self._classes = [ClassSizes(row) for row in rows]
        self._counts = spec.number_multiplier * np.array([row.count_per_m2 for row in rows])
        self._counts_before = np.concatenate([[0.0], np.cumsum(self._counts)])

    def count_above(self, diameter_m: Array) -> Array:
        """Rocks of at least a diameter per m^2, Shape (n,)."""
        shares = [one.share_above(diameter_m) for one in self._classes]
        return np.sum(self._counts[:, None] * np.array(shares), axis=0)

    def area_above(self, diameter_m: Array) -> Array:
        """Fraction of the ground covered by rocks of at least a diameter, Shape (n,)."""
        shares = [one.share_above(diameter_m, power=2.0) for one in self._classes]
        whole = [math.pi / 4.0 * one.mean_square_m2 for one in self._classes]
        return np.sum((self._counts * whole)[:, None] * np.array(shares), axis=0)

    def diameter_at(self, count_above: Array) -> Array:
        """Inverse of `count_above` [m], Shape (n,)."""
        index = np.searchsorted(self._counts_before, count_above, side="right") - 1
        index = np.clip(index, 0, len(self._classes) - 1)
        out = np.empty(len(count_above))
        for i in np.unique(index):
            chosen = index == i
            rank = (count_above[chosen] - self._counts_before[i]) / max(self._counts[i], 1e-300)
            out[chosen] = self._classes[i].diameter_at(np.clip(rank, 0.0, 1.0))
        return out


def _log_growth(s: float) -> float:
    """``ln((exp(s) - 1) / s)``, smooth through 0 and safe for large ``|s|``."""
    if abs(s) < 1e-6:
        return s / 2.0
    size = abs(s)
    return max(s, 0.0) + math.log(-math.expm1(-size) / size)


def _tilted_cdf(s: float, t: Array) -> Array:
    """``(exp(s t) - 1) / (exp(s) - 1)`` on [0, 1]."""
    if abs(s) < 1e-9:
        return t
    if s > 0.0:
        return 1.0 - _tilted_cdf(-s, 1.0 - t)
    return np.expm1(s * t) / math.expm1(s)


def _tilted_quantile(s: float, u: Array) -> Array:
    """Inverse of `_tilted_cdf` in t."""
    if abs(s) < 1e-9:
        return u
    if s > 0.0:
        return 1.0 - _tilted_quantile(-s, 1.0 - u)
    return np.clip(np.log1p(u * math.expm1(s)) / s, 0.0, 1.0)
