"""How much noise of any shape hurts an estimator, as the Gaussian noise that hurts as much."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.stats import chi

from lpet_sim.recording.arrays import Array

ESTIMATOR_DOF: Final = 6.0
"""Degrees of freedom of the Student's t by which the two-view estimator weighs."""
ESTIMATOR_GATE: Final = 16.27
"""Chi-square at which estimators refuse a sighting: 99.9 % of three Gaussian coordinates."""


def equivalent_sigma_px(px: Array, declared_px: Array) -> Array:
    """Give the Gaussian noise that would hurt an estimator as much as this one, Shape (3,).

    An estimator that weighs by declared noise s and Student's t of n degrees of freedom, and gates,
    is an M-estimator with ``psi(r) = r / s^2 (n + 3) / (n + |r|^2 / s^2)``; the variance of its
    result is that of least squares with noise of variance ``E[psi^2] / E[psi']^2`` (Huber 1964),
    here over the same for a Gaussian.

    Args:
        px: Noise of sightings [px], Shape (m, 3).
        declared_px: What is declared of each, 1 sigma [px], Shape (m,).
    """
    rho = np.linspace(1e-3, 12.0, 4000)
    density = chi.pdf(rho, 3)
    weight, slope = _influence(rho**2)
    gauss = np.trapezoid(rho**2 * weight**2 * density, rho) / 3.0
    gauss /= np.trapezoid((weight + rho**2 / 3.0 * slope) * density, rho) ** 2
    far = np.sum(px**2, axis=1) / declared_px**2
    weight, slope = _influence(far)
    s2 = declared_px[:, None] ** 2
    psi2 = np.mean((px / s2 * weight[:, None]) ** 2, axis=0)
    gain = np.mean((weight[:, None] + px**2 / s2 * slope[:, None]) / s2, axis=0)
    return np.asarray(np.sqrt(psi2 / np.maximum(gain, 1e-12) ** 2 / gauss))


def _influence(far: Array) -> tuple[Array, Array]:
    """Give the weights, 0 beyond the gate, and twice their slope by the squared distance."""
    inside = far < ESTIMATOR_GATE
    weight = inside * (ESTIMATOR_DOF + 3.0) / (ESTIMATOR_DOF + far)
    return weight, -2.0 * weight / (ESTIMATOR_DOF + far)
