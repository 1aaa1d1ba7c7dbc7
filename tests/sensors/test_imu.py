"""The inertial unit: exact without noise, the published noise with it, and free of chunks."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from lpet_sim.geometry import SE3, so3
from lpet_sim.recording.truth import BodyTruth
from lpet_sim.rng import stream
from lpet_sim.sensors.imu import Imu, ImuSpec, imu_at_rest
from tests.estimators.traverses import GRAVITY_MPS2, MOUNT, tumbling_circle


def part(body: BodyTruth, start: int, stop: int) -> BodyTruth:
    """Cut a piece out of the truth."""
    return BodyTruth(
        body.t_ns[start:stop].copy(),
        body.T_world_body[start:stop],
        body.v_world_body_mps[start:stop].copy(),
        body.omega_body_radps[start:stop].copy(),
    )


def test_a_perfect_unit_reads_the_closed_form_of_a_circular_motion() -> None:
    """Rate and specific force at the lever arm are those of the circle that the site describes."""
    body = tumbling_circle(2000, 200.0)
    imu = Imu(ImuSpec.perfect(), MOUNT, GRAVITY_MPS2, stream(0)).sense(body)
    T = body.T_world_body[:-1] @ SE3(*_repeated(MOUNT, len(imu)))
    # The site turns about the world's z axis with the body: its acceleration is w x (w x p).
    half = SE3.exp([0, 0, 0, 0, 0, 0.4 * 0.005 / 2])
    middle = half @ T.translation
    force = middle * [-(0.4**2), -(0.4**2), 0] + [0, 0, GRAVITY_MPS2]
    R = half.rotation @ T.rotation
    expected = np.einsum("nji,nj->ni", R, force)
    np.testing.assert_allclose(imu.accel_mps2, expected, atol=2e-7)
    rate = np.einsum("nji,j->ni", R, np.array([0, 0, 0.4]))
    np.testing.assert_allclose(imu.gyro_radps, rate, atol=1e-11)


def _repeated(pose: SE3, count: int) -> tuple[np.ndarray, np.ndarray]:
    return np.broadcast_to(pose.rotation, (count, 3, 3)), np.broadcast_to(
        pose.translation, (count, 3)
    )


def test_a_perfect_unit_integrates_back_to_the_motion_of_its_site() -> None:
    """Attitude and velocity from the increments end where the truth does, lever arm included."""
    body = tumbling_circle(3001, 100.0)
    imu = Imu(ImuSpec.perfect(), MOUNT, GRAVITY_MPS2, stream(0)).sense(body)
    site = body.T_world_body @ SE3(*_repeated(MOUNT, len(body)))
    lever = np.cross(body.omega_body_radps, MOUNT.translation)
    v_site = body.v_world_body_mps + np.einsum("nij,nj->ni", body.T_world_body.rotation, lever)
    R, v, p = site.rotation[0], v_site[0], site.translation[0]
    for rate, force in zip(imu.gyro_radps, imu.accel_mps2, strict=True):
        middle = R @ so3.exp(0.5 * 0.01 * rate)
        v_next = v + (middle @ force - [0, 0, GRAVITY_MPS2]) * 0.01
        R, v, p = R @ so3.exp(0.01 * rate), v_next, p + 0.005 * (v + v_next)
    np.testing.assert_allclose(R, site.rotation[-1], atol=1e-11)
    np.testing.assert_allclose(v, v_site[-1], atol=1e-11)
    # The trapezoid's own error: h^2/12 times the change of the acceleration's integral.
    np.testing.assert_allclose(p, site.translation[-1], atol=2e-5)


@pytest.mark.parametrize("cuts", [(1,), (7, 8, 400), (2, 3, 5, 640)])
def test_the_cut_into_chunks_changes_no_bit(cuts: tuple[int, ...]) -> None:
    """A traverse sensed in pieces equals the traverse sensed at once."""
    body = tumbling_circle(700, 100.0)
    whole = Imu(ImuSpec(), MOUNT, GRAVITY_MPS2, stream(3, "imu")).sense(body)
    imu = Imu(ImuSpec(), MOUNT, GRAVITY_MPS2, stream(3, "imu"))
    edges = [0, *cuts, len(body)]
    pieces = [imu.sense(part(body, a, b)) for a, b in itertools.pairwise(edges)]
    for name in ("t_ns", "gyro_radps", "accel_mps2"):
        joined = np.concatenate([getattr(piece, name) for piece in pieces])
        assert joined.tobytes() == getattr(whole, name).tobytes()


def test_another_seed_gives_other_errors() -> None:
    """Nothing of the noise is shared between seeds."""
    a, b = (imu_at_rest(ImuSpec(), 10.0, stream(s, "imu")) for s in (1, 2))
    assert not np.any(a.gyro_radps == b.gyro_radps)


def test_quantisation_carries_its_remainder_over() -> None:
    """Every increment is whole quanta, and the sum is never off by more than half a quantum."""
    spec = ImuSpec.perfect().model_copy(
        update={"accel_quantum_mps": (1e-3, 2e-3, 3e-3), "accel_bias_mps2": 0.01}
    )
    imu = imu_at_rest(spec, 60.0, stream(5, "imu"))
    quantum = np.array(spec.accel_quantum_mps)
    counts = imu.accel_mps2 * 0.01 / quantum
    np.testing.assert_allclose(counts, np.rint(counts), atol=1e-6)
    exact = imu_at_rest(
        spec.model_copy(update={"accel_quantum_mps": (0.0, 0.0, 0.0)}), 60.0, stream(5, "imu")
    )
    missing = np.cumsum(imu.accel_mps2 - exact.accel_mps2, axis=0) * 0.01
    assert np.all(np.abs(missing) <= 0.5 * quantum + 1e-9)
    assert np.all(np.abs(missing).max(axis=0) > 0.4 * quantum)


def test_gyro_quantum_works_likewise() -> None:
    """Angle increments come in whole quanta where the spec asks for them."""
    spec = ImuSpec().model_copy(update={"gyro_quantum_rad": (1e-6, 1e-6, 1e-6)})
    counts = imu_at_rest(spec, 5.0, stream(5, "imu")).gyro_radps * 0.01 / 1e-6
    np.testing.assert_allclose(counts, np.rint(counts), atol=1e-6)


def test_turn_on_errors_are_drawn_as_specified() -> None:
    """Over 400 units the mean rate and force at rest scatter by the turn-on bias."""
    units = [imu_at_rest(ImuSpec(), 4.0, stream(s, "unit")) for s in range(400)]
    gyro = np.array([unit.gyro_radps.mean(axis=0) for unit in units])
    spread = np.sqrt(np.mean(gyro**2)) / np.hypot(ImuSpec().gyro_bias_radps, 1.12e-5 / 2)
    assert spread == pytest.approx(1.0, abs=0.1)
    level = np.array([unit.accel_mps2.mean(axis=0) for unit in units]) - [0, 0, 9.80665]
    # z: the scale error acts on gravity; x and y: misalignment does.
    bias, scale, off = 300e-6 * 9.80665, 300e-6 * 9.80665, 1e-4 * 9.80665
    expected = np.hypot(bias, [off, off, scale])
    np.testing.assert_allclose(np.sqrt(np.mean(level**2, axis=0)), expected, rtol=0.15)
