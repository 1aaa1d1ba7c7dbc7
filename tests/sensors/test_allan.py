"""The inertial unit at rest against the Allan deviations of 6 h of real LN-200 data."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import linprog

from lpet_sim.evaluation.allan import allan_deviation
from lpet_sim.rng import stream
from lpet_sim.sensors.imu import ImuSpec, imu_at_rest

Array = NDArray[np.float64]
TAU_S = np.array([1.28, 10.24, 81.92, 1310.72])
GYRO = np.array(
    [
        [1.06e-5, 9.9e-6, 9.8e-6],
        [3.8e-6, 3.4e-6, 3.5e-6],
        [1.27e-6, 1.23e-6, 1.24e-6],
        [2.6e-7, 3.5e-7, 3.6e-7],
    ]
)
ACCEL = np.array(
    [
        [5.7e-4, 7.9e-4, 8.4e-4],
        [1.26e-4, 1.05e-4, 1.10e-4],
        [2.4e-5, 1.8e-5, 1.7e-5],
        [1.3e-5, 1.8e-5, 1.7e-5],
    ]
)
FLOOR_TAU_S, FLOOR_GYRO = 5000.0, math.radians(0.045) / 3600


def basis(tau: Array, terms: str) -> Array:
    """Give what Q^2, N^2 and K^2 add to the Allan variance, Shape (t, terms)."""
    all_terms = {"Q": 3 / tau**2, "N": 1 / tau, "K": tau / 3}
    return np.stack([all_terms[term] for term in terms], axis=1)


def minimax(tau: Array, sigma: Array, terms: str, exact: int = 0) -> Array:
    """Fit the coefficients with the least largest misfit of sigma^2; the last ones exactly."""
    rows = basis(tau, terms) / (sigma**2)[:, None]
    unit = rows.max(axis=0)
    rows = rows / unit
    free, fixed = rows[: len(rows) - exact], rows[len(rows) - exact :]
    slack = -np.ones((len(free), 1))
    solution = linprog(
        [*np.zeros(len(terms)), 1],
        A_ub=np.block([[free, slack], [-free, slack]]),
        b_ub=np.concatenate([np.ones(len(free)), -np.ones(len(free))]),
        A_eq=np.pad(fixed, ((0, 0), (0, 1))) if exact else None,
        b_eq=np.ones(exact) if exact else None,
    )
    return np.sqrt(solution.x[: len(terms)] / unit)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_the_defaults_are_derived_from_the_published_figures(axis: int) -> None:
    """The spec's coefficients are the minimax fit of the table, to the digits given."""
    spec = ImuSpec()
    tau, sigma = np.append(TAU_S, FLOOR_TAU_S), np.append(GYRO[:, axis], FLOOR_GYRO)
    N, K = minimax(tau, sigma, "NK")
    assert spec.gyro_random_walk_radps_rthz[axis] == pytest.approx(N, rel=2e-3)
    assert spec.gyro_bias_walk_radps_rts[axis] == pytest.approx(K, rel=2e-3)
    Q, N, K = minimax(TAU_S, ACCEL[:, axis], "QNK", exact=1)
    assert spec.accel_velocity_noise_mps[axis] == pytest.approx(Q, rel=2e-3)
    assert spec.accel_random_walk_mps2_rthz[axis] == pytest.approx(N, rel=2e-3)
    assert spec.accel_bias_walk_mps2_rts[axis] == pytest.approx(K, rel=2e-3)
    assert spec.accel_quantum_mps[axis] / math.sqrt(6) == pytest.approx(Q, rel=2e-3)


def at_rest(spec: ImuSpec, seed: int, rate_hz: float, hours: float = 6.0) -> Array:
    """Give the Allan deviations of gyro and accelerometer, Shape (2, 4, 3)."""
    imu = imu_at_rest(spec, hours * 3600, stream(seed, "allan"), rate_hz)
    rates = (imu.gyro_radps, imu.accel_mps2)
    return np.array([allan_deviation(rate, rate_hz, TAU_S) for rate in rates])


def test_six_hours_at_rest_have_the_published_allan_deviation() -> None:
    """Mean over 20 seeds within 20 % at all four times and on all axes.

    Sampled at 12.5 Hz: increments of 80 ms are sums of those of 10 ms, and both are rounded as
    one running sum, so that what the Allan deviation sees from 80 ms on is the same.
    """
    mean = np.mean([at_rest(ImuSpec(), seed, 12.5) for seed in range(20)], axis=0)
    np.testing.assert_allclose(mean, [GYRO, ACCEL], rtol=0.2)


def test_white_accelerometer_noise_would_not_pass() -> None:
    """The table tells quantised increments from white noise of the same size at 1.28 s."""
    white = tuple(float(x) for x in ACCEL[0] * math.sqrt(1.28))
    spec = ImuSpec(
        accel_random_walk_mps2_rthz=white,
        accel_quantum_mps=(0.0, 0.0, 0.0),
        accel_jitter_mps=(0.0, 0.0, 0.0),
    )
    accel = at_rest(spec, 0, 12.5)[1]
    assert np.all(accel[1:3] > 1.4 * ACCEL[1:3])


def test_the_rate_of_sampling_does_not_show_in_the_allan_deviation() -> None:
    """At 100 Hz and 12.5 Hz the deviations agree where their scatter is small."""
    fine, coarse = (at_rest(ImuSpec(), 1, rate) for rate in (100.0, 12.5))
    np.testing.assert_allclose(fine[:, :2], coarse[:, :2], rtol=0.06)


def test_quantised_increments_fall_as_one_over_tau() -> None:
    """Quantum and jitter alone give ``sigma = sqrt(3) Q / tau``, ``Q^2 = q^2/12 + jitter^2``."""
    spec = ImuSpec.perfect().model_copy(
        update={
            "accel_quantum_mps": ImuSpec().accel_quantum_mps,
            "accel_jitter_mps": ImuSpec().accel_jitter_mps,
            "accel_bias_mps2": 3e-3,
        }
    )
    imu = imu_at_rest(spec, 3600.0, stream(2, "quantum"))
    tau = np.array([0.08, 0.64, 5.12, 40.96])
    expected = math.sqrt(3) * spec.accel_velocity_noise_mps / tau[:, None]
    measured = allan_deviation(imu.accel_mps2, 100.0, tau)
    np.testing.assert_allclose(measured, expected, rtol=0.08)


def test_allan_deviation_of_white_noise_and_of_a_ramp_are_the_closed_forms() -> None:
    """White noise gives ``N/sqrt(tau)``, a rate that grows by a per second ``a tau/sqrt(2)``."""
    white = stream(0, "white").standard_normal(400_000) * 3.0 * math.sqrt(50.0)
    tau = np.array([0.02, 0.4, 8.0])
    ratio = allan_deviation(white, 50.0, tau) * np.sqrt(tau) / 3.0
    assert np.all(np.abs(ratio - 1) < [0.01, 0.02, 0.08])
    ramp = 0.7 * np.arange(5000) / 50.0
    np.testing.assert_allclose(allan_deviation(ramp, 50.0, tau), 0.7 * tau / math.sqrt(2))


def test_averaging_longer_than_half_the_recording_is_refused() -> None:
    """The sentence names the longest time there is."""
    with pytest.raises(ValueError, match="half of the"):
        allan_deviation(np.zeros(100), 10.0, [5.1])
