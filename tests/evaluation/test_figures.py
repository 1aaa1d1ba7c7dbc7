"""Figures show what they are given, without any global state."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from lpet_sim.evaluation import Requirement, evaluate, failed
from lpet_sim.evaluation.figures import plot_errors, plot_plan_view, save
from lpet_sim.geometry import SE3
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.trajectory import Trajectory
from lpet_sim.rng import stream
from tests.evaluation.trajectories import as_truth, scaled, winding

PNG_HEAD = b"\x89PNG\r\n\x1a\n"


def _estimates() -> list[Estimate]:
    truth = winding()
    rolled = SE3.exp(np.array([0, 0, 0, 0.01, 0, 0.02])) @ truth.T_world_body
    drifted = Trajectory(truth.t_ns, rolled)
    return [Estimate("dead reckoning", scaled(truth, 1.03)), Estimate("frame to frame", drifted)]


def _rocks() -> np.ndarray:
    rng = stream(1, "rocks")
    return np.column_stack(
        [rng.uniform(-5, 30, 150), rng.uniform(-12, 12, 150), rng.uniform(0.1, 0.8, 150)]
    )


def _labels(figure: Figure) -> list[str]:
    legend = figure.axes[0].get_legend()
    assert legend is not None
    return [text.get_text() for text in legend.get_texts()]


def test_the_plan_view_shows_truth_and_every_estimate(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """Named in the legend, at equal scale; rocks beyond the paths do not widen the view."""
    figure = plot_plan_view(winding(), _estimates(), _rocks())
    assert _labels(figure) == ["truth", "dead reckoning", "frame to frame", "start"]
    axes = figure.axes[0]
    assert axes.get_aspect() == 1.0
    plain = plot_plan_view(winding(), _estimates()).axes[0]
    assert axes.get_xlim() == plain.get_xlim()
    save(figure, tmp_path / "plan.png")
    assert (tmp_path / "plan.png").read_bytes().startswith(PNG_HEAD)
    assert caplog.records == []


def test_the_errors_are_drawn_with_their_limits(tmp_path: Path) -> None:
    """Four rows; the position from the first metres on; a run without a series is left out."""
    results = [evaluate(estimate, as_truth(winding())) for estimate in _estimates()]
    figure = plot_errors([*results, failed("broken")], Requirement(position_ratio=0.02))
    assert _labels(figure) == ["dead reckoning", "frame to frame", "limit"]
    position = figure.axes[0].get_lines()
    assert np.min(position[0].get_xdata()) >= 5.0
    np.testing.assert_allclose(position[-1].get_ydata(), 2.0)
    np.testing.assert_allclose(figure.axes[3].get_lines()[-1].get_ydata(), -1.0)
    save(figure, tmp_path / "errors.png")
    assert (tmp_path / "errors.png").read_bytes().startswith(PNG_HEAD)
