"""How far tracks slide comes back from the landmark sensor's own sightings."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from lpet_sim.errors import RecordingError
from lpet_sim.evaluation.drift_fit import DriftFit, fit_drift
from lpet_sim.evaluation.drift_pairs import Pairs, driven_m, transfer
from lpet_sim.evaluation.drift_spread import spread_of
from lpet_sim.evaluation.sighting_tracks import CameraPath, Tracks
from lpet_sim.geometry import SE3
from lpet_sim.recording.arrays import Array
from lpet_sim.rng import stream
from lpet_sim.sensors.landmark_sensor import ShownLandmarks, report_sightings, show_landmarks
from lpet_sim.sensors.landmark_spec import SightingNoiseSpec
from tests.finite_difference import assert_jacobian
from tests.sensors.landmark_worlds import (
    ALL_IN_RANGE,
    CAMERA,
    GROUND_ONLY,
    MadeUpTerrain,
    sensor,
    straight_drive,
)

SIGMA_PX, DRIFT_PX, SPREAD = 0.1, 0.3, 1.0
BARE = sensor(field=GROUND_ONLY, visibility=ALL_IN_RANGE, detection_probability=0.8)


@cache
def shown() -> ShownLandmarks:
    """Look once."""
    flat: Any = MadeUpTerrain()
    return show_landmarks(straight_drive(5.0), flat, CAMERA, BARE, 5)


def path() -> CameraPath:
    """Give the true path of the camera."""
    return CameraPath.from_se3(shown().T_world_camera.inverse())


def tracks(drift_px: float, spread: float = 0.0, wrong: float = 0.0) -> Tracks:
    """Sense, with white noise and a walk; little noise where landmarks slide unlike."""
    sigma_px = SIGMA_PX if spread == 0 else 0.2 * SIGMA_PX
    noise = SightingNoiseSpec(
        sigma_left_px=sigma_px,
        sigma_right_px=sigma_px,
        sigma_v_px=sigma_px,
        drift_px=drift_px,
        drift_spread=spread,
    )
    spec = BARE.model_copy(update={"noise": noise, "misclassification_probability": wrong})
    return Tracks.of(report_sightings(shown(), CAMERA, spec, 5))


@cache
def measured(drift_px: float, spread: float = 0.0, wrong: float = 0.0) -> DriftFit:
    """Measure once."""
    return fit_drift(tracks(drift_px, spread, wrong), path(), CAMERA)


def test_the_walk_and_the_white_noise_come_back() -> None:
    """Both by means and by medians, inside intervals of a few percent; all squares explained."""
    fit = measured(DRIFT_PX)
    for found, true in (
        (fit.sigma_px, SIGMA_PX),
        (fit.drift_px, DRIFT_PX),
        (fit.drift_median_px, DRIFT_PX),
    ):
        assert found.low < true < found.high
        assert found.high - found.low < 0.08 * true
    np.testing.assert_allclose(fit.square, 1.0, atol=0.02)
    np.testing.assert_allclose(fit.median, 1.0, atol=0.03)
    assert np.all(np.abs(fit.beyond - 1e-3) < 1e-3)
    assert fit.slides and fit.spread.spread < 0.3


def test_where_nothing_slides_nothing_is_found() -> None:
    """The interval holds zero, and ends where a walk would hide in the white noise of an image."""
    fit = measured(0.0)
    assert fit.drift_px.low == 0.0 and fit.drift_px.high < 0.05
    assert fit.drift_median_px.low == 0.0 and not fit.slides
    assert fit.sigma_px.value == pytest.approx(SIGMA_PX, rel=0.01)
    assert fit.wrong == 0.0


def test_wrong_names_are_no_walk() -> None:
    """One sighting in twenty: they are counted, all but those that are wrong by a few pixels."""
    fit = measured(DRIFT_PX, wrong=0.05)
    assert fit.wrong == pytest.approx(0.05, abs=0.01)
    assert fit.drift_median_px.value == pytest.approx(DRIFT_PX, rel=0.05)
    assert fit.drift_px.value == pytest.approx(DRIFT_PX, rel=0.1)
    assert not measured(0.0, wrong=0.05).slides


def test_landmarks_that_slide_unlike_are_told_from_those_that_slide_alike() -> None:
    """Medians see a smaller walk than means, and both give the spread and the mean square."""
    fit = measured(DRIFT_PX, SPREAD)
    assert fit.drift_median_px.high < 0.75 * fit.drift_px.low
    assert fit.spread.spread == pytest.approx(SPREAD, rel=0.2)
    assert fit.spread.drift_px == pytest.approx(DRIFT_PX, rel=0.2)
    assert np.all(fit.beyond > 0.01)


@pytest.mark.parametrize("spread", [0.0, 0.4, 1.0, 1.6])
def test_the_spread_comes_back_from_what_means_and_medians_see(spread: float) -> None:
    """Against 400,000 drawn squares, whose scale is searched for."""
    rng = stream(2, "spread")
    n = 400_000
    own = np.exp(spread * rng.standard_normal(n) - spread**2)
    square = own**2 * rng.chisquare(3.0, n)
    by_median = np.median(square) / 2.366
    scales = np.geomspace(0.02, 2.0, 400)
    means = np.array([np.minimum(square[::8] / s, 16.266).mean() for s in scales])
    by_mean = np.interp(-2.985, -means, scales)
    found = spread_of(float(np.sqrt(by_mean)), float(np.sqrt(by_median)))
    assert found.spread == pytest.approx(spread, abs=0.15 if spread == 0 else 0.03)
    assert found.drift_px == pytest.approx(1.0, rel=0.05)


def test_the_transfer_is_that_of_points_and_its_derivative_that_of_itself() -> None:
    """Against triangulation and projection, and central differences; beyond infinity as well."""
    rng = stream(1, "transfer")
    T = SE3.exp(rng.normal(0.0, [0.3, 0.3, 0.3, 0.05, 0.05, 0.05], (20, 6)))
    x = np.column_stack(
        [rng.uniform(300, 700, 20), rng.uniform(0, 9, 20), rng.uniform(300, 700, 20)]
    )
    x[:, 1] = x[:, 0] - 5.0 - 10.0 * x[:, 1]
    px, G, ahead = transfer(CAMERA, T, x)
    assert ahead.all()
    wanted = CAMERA.project(T.inverse() @ CAMERA.triangulate(x))
    np.testing.assert_allclose(px, wanted, atol=1e-9)
    x[:5, 1] = x[:5, 0] + 0.3
    _, G, ahead = transfer(CAMERA, T, x)
    assert ahead.all()
    for k in range(20):

        def there(at: Array, k: int = k) -> Array:
            return np.asarray(transfer(CAMERA, T[k : k + 1], at[None])[0][0])

        assert_jacobian(there, x[k], G[k], tolerance=1e-5)


def test_pairs_have_the_covariance_that_is_said() -> None:
    """Their squares over white noise and walk are chi-square with three degrees of freedom."""
    pairs = Pairs.of(tracks(DRIFT_PX), path(), CAMERA, (2, 7))
    assert set(pairs.lag) == {2, 7}
    for lag in (2, 7):
        far = pairs.distance2(SIGMA_PX**2, DRIFT_PX**2)[pairs.lag == lag]
        assert far.mean() == pytest.approx(3.0, abs=0.1)
        assert np.median(far) == pytest.approx(2.366, abs=0.1)
    np.testing.assert_allclose(pairs.walked_m, 0.1 * pairs.lag, rtol=0.1)
    assert driven_m(path(), CAMERA)[-1] == pytest.approx(5.0, rel=0.01)


def test_too_few_pairs_are_refused_in_words() -> None:
    """Tracks of four images have no pair that is five apart."""
    few = tracks(0.0)
    short = few.image < 4
    cut = replace(
        few,
        starts=np.concatenate([[0], np.cumsum(few.total(short))]).astype(np.int64),
        image=few.image[short],
        stereo_px=few.stereo_px[short],
        sigma_px=few.sigma_px[short],
    )
    kept = np.flatnonzero(cut.lengths > 0)
    cut = replace(
        cut, starts=np.append(cut.starts[kept], cut.starts[-1]), landmark_id=cut.landmark_id[kept]
    )
    with pytest.raises(RecordingError, match=r"0 pairs .* 5 images apart"):
        fit_drift(cut, path(), CAMERA)
