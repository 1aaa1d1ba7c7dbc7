"""Curves of the wheels: means of a second, in readable units, whole across the pieces."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lpet_sim.recording import layout
from lpet_sim.recording.reader import open_store
from lpet_sim.recording.store import StoreReader
from lpet_sim.recording.truth import BodyTruth, Truth, WheelTruth
from lpet_sim.recording.wheel_curves import TITLES
from lpet_sim.recording.writer import RecordingWriter
from lpet_sim.rng import stream
from tests.recording import synthetic

RATE_HZ, SECONDS = 20, 700


def _wheels() -> WheelTruth:
    """Make wheels that turn unevenly, and one that stands in the first ten seconds."""
    rng = stream(1, "test", "curves")
    n = RATE_HZ * SECONDS
    turned = rng.uniform(0.005, 0.03, (n, 6))
    turned[: 10 * RATE_HZ, 5] = 0.0
    slip = rng.uniform(-0.1, 0.9, (n, 6))
    # What barely turns has a slip of any size.
    turned[::7, 0], slip[::7, 0] = 1e-6, 200.0
    return WheelTruth(
        t_ns=np.arange(n) * (synthetic.NS // RATE_HZ),
        drive_angle_rad=np.cumsum(turned, axis=0),
        steer_angle_rad=np.zeros((n, 6)),
        slip=slip,
        load_n=rng.uniform(50, 150, (n, 6)),
        traction_n=rng.uniform(-20, 60, (n, 6)),
        sinkage_m=rng.uniform(0, 0.05, (n, 6)),
        slip_angle_rad=rng.uniform(-0.5, 0.5, (n, 6)),
        contact=np.ones((n, 6), np.uint8),
        joint_angle_rad=np.zeros((n, 3)),
    )


def _piece(wheels: WheelTruth, rows: slice) -> WheelTruth:
    return WheelTruth(**{name: value[rows].copy() for name, value in vars(wheels).items()})


def _write(path: Path, pieces: int) -> StoreReader:
    wheels, body = _wheels(), synthetic.truth(1.0).body
    cuts = np.linspace(0, len(wheels), pieces + 1).astype(int)
    with RecordingWriter(path, synthetic.recording(1.0).manifest, synthetic.calibration()) as out:
        for i in range(pieces):
            nothing = BodyTruth(body.t_ns[:0], *(getattr(body, f)[:0] for f in _BODY))
            rows = _piece(wheels, slice(cuts[i], cuts[i + 1]))
            out.log_truth(Truth(nothing if i else body, rows))
    return open_store(path)


_BODY = ("T_world_body", "v_world_body_mps", "omega_body_radps")


def _curve(store: StoreReader, quantity: str) -> np.ndarray:
    batches = [c.to_record_batch() for c in store.chunks(layout.wheel_curve(quantity))]
    name = "Scalars:scalars"
    rows = [b.column(name).to_pylist() for b in batches if name in b.schema.names]
    return np.array([row for batch in rows for row in batch])


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> StoreReader:
    """Write the wheels in ninety-seven pieces."""
    return _write(tmp_path_factory.mktemp("curves") / "run.rrd", 97)


def test_the_slip_of_a_second_is_that_of_the_way_in_it(store: StoreReader) -> None:
    """One less the way over the roll of the second, however wild a barely turning wheel is."""
    wheels = _wheels()
    roll = np.diff(wheels.drive_angle_rad, axis=0, prepend=wheels.drive_angle_rad[:1])
    way = (roll * (1.0 - wheels.slip)).reshape(SECONDS, RATE_HZ, 6).sum(axis=1)
    whole = roll.reshape(SECONDS, RATE_HZ, 6).sum(axis=1)
    slip = _curve(store, "slip")
    assert slip.shape == (SECONDS, 6)
    np.testing.assert_allclose(slip[:, :5], 1.0 - way[:, :5] / whole[:, :5], atol=1e-9)
    assert np.abs(slip[:, 0]).max() < 1.0
    assert np.isnan(slip[:10, 5]).all() and np.isfinite(slip[10:, 5]).all()


def test_the_other_curves_are_means_in_the_units_of_their_titles(store: StoreReader) -> None:
    """Millimetres, newtons, degrees by the turn, and the ratio of mean forces."""
    wheels = _wheels()
    mean = {k: _means(v) for k, v in vars(wheels).items() if k.endswith(("_n", "sinkage_m"))}
    np.testing.assert_allclose(_curve(store, "sinkage_mm"), 1000.0 * mean["sinkage_m"])
    np.testing.assert_allclose(_curve(store, "load_n"), mean["load_n"])
    ratio = mean["traction_n"] / mean["load_n"]
    np.testing.assert_allclose(_curve(store, "traction_over_load"), ratio)
    assert np.nanmax(np.abs(_curve(store, "slip_angle_deg"))) < np.degrees(0.5)


def _means(values: np.ndarray) -> np.ndarray:
    return values.reshape(SECONDS, RATE_HZ, 6).mean(axis=1)


def test_the_cuts_between_pieces_are_not_seen(store: StoreReader, tmp_path: Path) -> None:
    """One piece and ninety-seven give the same curves."""
    whole = _write(tmp_path / "run.rrd", 1)
    for quantity in TITLES:
        np.testing.assert_allclose(_curve(store, quantity), _curve(whole, quantity), atol=1e-12)
