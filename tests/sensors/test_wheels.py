"""Wheel and steering encoders: each error alone, as specified, and free of chunks."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from lpet_sim.errors import SpecError
from lpet_sim.recording.truth import WheelTruth
from lpet_sim.rng import stream
from lpet_sim.sensors.wheels import WheelEncoders, WheelOdometrySpec
from tests.estimators.traverses import CONTACTS, NAMES, RADIUS_M, rolling_wheels, ticks, wheel_truth


def only(**errors: float) -> WheelOdometrySpec:
    """Make encoders with one error."""
    return WheelOdometrySpec.perfect().model_copy(update=errors)


def straight(count: int = 4000) -> WheelTruth:
    """Roll straight on at 0.2 rad/s."""
    return rolling_wheels(ticks(count, 20.0), 0.2 * RADIUS_M, 0.0)


def test_perfect_encoders_read_the_truth() -> None:
    """Nothing is put on the angles, to the bit."""
    truth = rolling_wheels(ticks(100, 20.0), 0.03, 0.02)
    read = WheelEncoders(WheelOdometrySpec.perfect(), 6, stream(0)).sense(truth)
    assert read.drive_angle_rad.tobytes() == truth.drive_angle_rad.tobytes()
    assert read.steer_angle_rad.tobytes() == truth.steer_angle_rad.tobytes()


def test_readings_are_whole_counts_within_half_a_count() -> None:
    """Resolution rounds to the nearest count, without a bias that grows."""
    truth = rolling_wheels(ticks(3000, 20.0), 0.03, 0.02)
    spec = only(drive_resolution_rad=0.01, steer_resolution_rad=0.02)
    read = WheelEncoders(spec, 6, stream(0)).sense(truth)
    counts = read.drive_angle_rad / 0.01
    np.testing.assert_allclose(counts, np.rint(counts), atol=1e-6)
    assert np.abs(read.drive_angle_rad - truth.drive_angle_rad).max() <= 0.005 + 1e-12
    assert np.abs(read.steer_angle_rad - truth.steer_angle_rad).max() <= 0.01 + 1e-12


def test_the_common_scale_is_one_and_the_wheels_own_are_six() -> None:
    """Over 500 traverses both scatter as specified."""
    truth = straight(2)
    spec = only(scale_common_sigma=0.03)
    shared = np.array([WheelEncoders(spec, 6, stream(s, "c")).scale for s in range(500)]) - 1
    assert np.ptp(shared, axis=1).max() == 0.0
    assert shared[:, 0].std() == pytest.approx(0.03, rel=0.12)
    spec = only(scale_wheel_sigma=0.01)
    encoders = [WheelEncoders(spec, 6, stream(s, "w")) for s in range(500)]
    own = np.array([unit.scale for unit in encoders]) - 1
    assert own.std() == pytest.approx(0.01, rel=0.06)
    assert np.abs(np.corrcoef(own.T) - np.eye(6)).max() < 0.2
    read = encoders[0].sense(truth)
    np.testing.assert_allclose(read.drive_angle_rad, truth.drive_angle_rad * encoders[0].scale)


def test_distance_noise_grows_with_the_root_of_the_angle() -> None:
    """Variance after 40 rad is forty times that after one, and as specified."""
    truth = straight(4001)
    spec = only(distance_noise_rad_rtrad=0.02)
    error = np.array(
        [
            WheelEncoders(spec, 6, stream(s, "walk")).sense(truth).drive_angle_rad
            - truth.drive_angle_rad
            for s in range(60)
        ]
    )
    for row in (100, 1000, 4000):
        turned = truth.drive_angle_rad[row, 0]
        assert error[:, row].std() == pytest.approx(0.02 * np.sqrt(turned), rel=0.12)


def test_wheels_that_stand_gather_no_distance_noise() -> None:
    """Noise that grows with the distance stays where there is none."""
    still = wheel_truth(ticks(500, 20.0), np.full((500, 6), 3.0), np.zeros((500, 6)))
    read = WheelEncoders(only(distance_noise_rad_rtrad=0.02), 6, stream(0)).sense(still)
    assert np.ptp(read.drive_angle_rad) == 0.0


def test_white_noise_and_steering_bias_are_as_specified() -> None:
    """White noise does not grow; the bias is one number per wheel."""
    truth = straight()
    read = WheelEncoders(only(drive_noise_rad=2e-3), 6, stream(0)).sense(truth)
    error = read.drive_angle_rad - truth.drive_angle_rad
    assert error[:500].std() == pytest.approx(2e-3, rel=0.05)
    assert error[-500:].std() == pytest.approx(2e-3, rel=0.05)
    read = WheelEncoders(only(steer_bias_rad=0.01, steer_noise_rad=1e-3), 6, stream(0)).sense(truth)
    steer = read.steer_angle_rad - truth.steer_angle_rad
    assert steer.std(axis=0) == pytest.approx(1e-3, rel=0.1)
    assert np.ptp(steer.mean(axis=0)) > 5e-3


@pytest.mark.parametrize("cuts", [(1,), (7, 8, 300)])
def test_the_cut_into_chunks_changes_no_bit(cuts: tuple[int, ...]) -> None:
    """A traverse read in pieces equals the traverse read at once."""
    truth = rolling_wheels(ticks(500, 20.0), 0.03, 0.02)
    whole = WheelEncoders(WheelOdometrySpec(), 6, stream(4, "wheels")).sense(truth)
    encoders = WheelEncoders(WheelOdometrySpec(), 6, stream(4, "wheels"))
    pieces = [
        encoders.sense(
            wheel_truth(
                truth.t_ns[a:b].copy(),
                truth.drive_angle_rad[a:b].copy(),
                truth.steer_angle_rad[a:b].copy(),
            )
        )
        for a, b in itertools.pairwise([0, *cuts, len(truth)])
    ]
    for name in ("t_ns", "drive_angle_rad", "steer_angle_rad"):
        joined = np.concatenate([getattr(piece, name) for piece in pieces])
        assert joined.tobytes() == getattr(whole, name).tobytes()


def test_declared_geometry_carries_the_declared_errors_and_no_others() -> None:
    """Radius and track are stretched; what is drawn at random stays hidden."""
    spec = WheelOdometrySpec(declared_radius_error=0.02, declared_track_error=-0.05)
    declared = spec.declared(NAMES, np.array(CONTACTS), RADIUS_M, (True,) * 6)
    assert declared.radius_m == pytest.approx(RADIUS_M * 1.02)
    positions = np.array(declared.position_body_m)
    np.testing.assert_allclose(positions, np.array(CONTACTS) * [1, 0.95, 1])


def test_unknown_keys_are_refused_by_name() -> None:
    """The sentence lists what would be valid."""
    with pytest.raises(SpecError, match="valid keys are drive_resolution_rad"):
        WheelOdometrySpec.from_mapping({"resolution": 1.0})
