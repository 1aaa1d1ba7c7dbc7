"""Sightings and estimates are added to a recording, and all else stays as it was."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from lpet_sim.recording import layout
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.overlay import add_estimate, add_estimates, add_sightings
from lpet_sim.recording.overview import Overview
from lpet_sim.recording.reader import open_store, read_estimates, read_recording
from lpet_sim.recording.recording import Recording
from lpet_sim.recording.store import StoreReader
from lpet_sim.recording.writer import write_recording
from tests.recording import synthetic

DURATION_S = 6.0


@dataclass(frozen=True)
class Errors:
    """Errors as evaluation gives them."""

    t_ns: NDArray[np.int64]
    distance_m: NDArray[np.float64]
    position_error_m: NDArray[np.float64]
    attitude_error_rad: NDArray[np.float64]


def errors_of(estimate: Estimate) -> Errors:
    """Make up errors that grow."""
    t_ns = estimate.trajectory.t_ns
    grow = np.arange(len(t_ns), dtype=float)
    return Errors(
        t_ns, 2.0 * grow, np.outer(0.01 * grow, [0, 0.6, 0.8]), np.outer(grow, [0, 1e-3, 0])
    )


def exact_bytes(path: Path, but: tuple[str, ...] = ()) -> dict[str, tuple[bytes, ...]]:
    """Read the bytes of every exact column and image, except under some entities."""
    store = StoreReader(path)
    columns = store.columns("/**")
    out = {
        name: (c.t_ns.tobytes(), c.values.tobytes(), str(c.values.dtype).encode())
        for name, c in columns.items()
        if not name.startswith(but)
    }
    for eye in layout.CAMERAS:
        out[eye] = tuple(store.pngs(layout.image(eye)))
    return out


def same_estimate(a: Estimate, b: Estimate) -> bool:
    """Compare all of two estimates to the bit."""
    return (
        a.name == b.name
        and a.trajectory.equals(b.trajectory)
        and a.covariance.tobytes() == b.covariance.tobytes()
        and list(a.diagnostics) == list(b.diagnostics)
        and all(a.diagnostics[k].tobytes() == b.diagnostics[k].tobytes() for k in a.diagnostics)
    )


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Write a small recording."""
    write_recording(tmp_path / "run.rrd", synthetic.recording(DURATION_S))
    return tmp_path / "run.rrd"


def test_an_estimate_comes_back_and_all_else_stays_to_the_bit(path: Path) -> None:
    """Trajectory, covariance and diagnostics are equal; other columns and images too."""
    before = exact_bytes(path)
    estimate = synthetic.estimate("frame-to-frame (M=3)", DURATION_S)
    add_estimate(path, estimate, errors_of(estimate))
    assert same_estimate(read_estimates(path)[estimate.name], estimate)
    assert exact_bytes(path, (layout.ESTIMATES, layout.ERRORS)) == before


def test_an_estimate_of_the_same_name_replaces_the_old_one(path: Path) -> None:
    """Others stay; the colour stays too."""
    first = [synthetic.estimate(name, DURATION_S) for name in ("a", "b")]
    for estimate in first:
        add_estimate(path, estimate)
    again = synthetic.estimate("a", DURATION_S, seed=5)
    add_estimate(path, replace(again, covariance=first[0].covariance))
    back = read_estimates(path)
    assert same_estimate(back["b"], first[1]) and not same_estimate(back["a"], first[0])
    assert back["a"].trajectory.equals(again.trajectory)
    facts = Overview.from_json(open_store(path).json(layout.SUMMARY))
    assert {e.name: e.colour for e in facts.estimates} == {"a": 0, "b": 1}


def test_an_estimate_may_have_no_covariance(path: Path) -> None:
    """It comes back without one."""
    add_estimate(
        path, replace(synthetic.estimate("x", DURATION_S), covariance=None, diagnostics={})
    )
    back = read_estimates(path)["x"]
    assert back.covariance is None and back.diagnostics == {}


def test_sightings_are_added_and_all_else_stays_to_the_bit(path: Path) -> None:
    """New sightings take the place of the old ones."""
    add_estimate(path, synthetic.estimate("a", DURATION_S))
    before = exact_bytes(path, (layout.SIGHTINGS,))
    new = synthetic.sightings(DURATION_S, seed=9)
    assert not new.equals(read_recording(path).measurements.sightings)
    add_sightings(path, new)
    assert read_recording(path).measurements.sightings.equals(new)
    assert exact_bytes(path, (layout.SIGHTINGS,)) == before


def test_an_overlay_can_go_to_another_file(path: Path, tmp_path: Path) -> None:
    """The source keeps its bytes, and both are the same recording to a viewer."""
    data = path.read_bytes()
    add_estimate(path, synthetic.estimate("a", DURATION_S), path_out=tmp_path / "b.rrd")
    assert path.read_bytes() == data
    assert list(read_estimates(tmp_path / "b.rrd")) == ["a"] and read_estimates(path) == {}
    assert StoreReader(path).recording_id == StoreReader(tmp_path / "b.rrd").recording_id


def test_a_recording_without_truth_takes_estimates_and_sightings(tmp_path: Path) -> None:
    """The rover then moves as estimated."""
    whole = synthetic.recording(DURATION_S)
    bare = Recording(whole.manifest, replace(whole.measurements, sightings=None))
    path = tmp_path / "bare.rrd"
    write_recording(path, bare)
    add_sightings(path, whole.measurements.sightings)
    add_estimate(path, synthetic.estimate("a", DURATION_S))
    back = read_recording(path)
    assert back.truth is None
    assert back.measurements.sightings.equals(whole.measurements.sightings)
    assert layout.ROVER in open_store(path).entities()


def test_the_summary_tells_the_end_error(path: Path) -> None:
    """The facts hold the error at the end in metres and the worst attitude in degrees."""
    estimate = synthetic.estimate("a", DURATION_S)
    errors = errors_of(estimate)
    add_estimate(path, estimate, errors)
    facts = Overview.from_json(open_store(path).json(layout.SUMMARY)).estimates[0]
    assert facts.end_error_m == pytest.approx(0.01 * (len(errors.t_ns) - 1))
    assert facts.attitude_deg[1] == pytest.approx(np.degrees(1e-3 * (len(errors.t_ns) - 1)))
    assert facts.label == "a: 0.12 m, 0.50 %"


@dataclass(frozen=True)
class Slip:
    """Slip as evaluation gives it."""

    t_ns: NDArray[np.int64]
    slip: NDArray[np.float64]


def test_slip_seen_by_vision_is_drawn_with_its_gaps_and_stays(path: Path) -> None:
    """A later overlay without slip leaves the curve; one with slip replaces it."""
    t_ns = np.arange(1, 6) * 10**9
    for level in (0.9, 0.1):
        slip = Slip(t_ns, np.array([0.1, level, np.nan, 0.2, 0.3]))
        add_estimates(path, [(synthetic.estimate("a", DURATION_S), None)], slip=slip)
    add_estimate(path, synthetic.estimate("b", DURATION_S))
    store = open_store(path)
    batches = [chunk.to_record_batch() for chunk in store.chunks(layout.SEEN_SLIP)]
    name = "Scalars:scalars"
    rows = [b.column(name).to_pylist() for b in batches if name in b.schema.names]
    drawn = [value for batch in rows for row in batch for value in row]
    np.testing.assert_array_equal(drawn, [0.1, 0.1, np.nan, 0.2, 0.3])
    assert Overview.from_json(store.json(layout.SUMMARY)).has_seen_slip
