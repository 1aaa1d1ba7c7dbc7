"""What was measured of a sensor, as a table and as a figure."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from rich.table import Table
from rich.text import Text

from lpet_sim.evaluation.sensor_fit import LAGS, RANGE_SHARES, SensorFit
from lpet_sim.evaluation.statistics import Interval
from lpet_sim.recording.arrays import Array

_NAMES = ("u_left", "u_right", "v")
_COLOURS = ("#D55E00", "#0072B2", "#009E73")
_WIDE = 5.0
_RANGE_TICKS_M = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000)


def sensor_tables(fit: SensorFit, sensed: SensorFit | None = None) -> list[Table]:
    """Lay the figures out, those of the landmark sensor made from them beside them.

    Args:
        fit: Measured on a recording.
        sensed: Measured in the same way on the landmark sensor's sightings, where there are any.
    """
    table = Table(title="the sensor, measured at true poses")
    table.add_column("figure", no_wrap=True)
    table.add_column("recording", justify="right")
    if sensed is not None:
        table.add_column("landmark sensor", justify="right")
    columns = [_rows(one) for one in (fit, sensed) if one is not None]
    for name in columns[0]:
        table.add_row(Text(name), *(column[name] for column in columns))
    return [table]


def _rows(fit: SensorFit) -> dict[str, str]:
    noise, tracks = fit.noise, fit.tracks
    shared, error = fit.shared, fit.shared_se
    return {
        "noise of u_left, u_right, v [px]": _triple(noise.sigma_px),
        "  what differs between consecutive images [px]": _triple(noise.step_px),
        "  root mean square of those that fit [px]": _triple(noise.rms_px),
        "  scale under Student's t [px]": _triple(noise.core_px[:, 0]),
        "  degrees of freedom of that t": f"{noise.tails:.1f}",
        "  kurtosis (3: Gaussian)": _triple(noise.kurtosis, 1),
        "  beyond 3 sigma (0.27: Gaussian) [%]": _triple(100 * noise.beyond_3_sigma, 2),
        "  correlation from image to image": _triple(noise.lag_correlation[0], 2),
        "fixed error of a landmark [px]": f"{noise.fixed_px[0]:.3f} +- {noise.fixed_px[1]:.3f}",
        "declared noise [px]": f"{noise.declared_px:.3f}",
        "disparity bias [px]": f"{shared[0]:+.4f} +- {error[0]:.4f}",
        "focal length, declared over true [%]": f"{100 * shared[1]:+.3f} +- {100 * error[1]:.3f}",
        "baseline, declared over true [%]": f"{100 * shared[2]:+.3f} +- {100 * error[2]:.3f}",
        **_drift_rows(fit),
        "impossible sightings [%]": f"{100 * tracks.impossible:.2f}",
        "seen again in the next image [%]": f"{100 * tracks.seen_next:.1f}",
        "seen between first and last sighting [%]": f"{100 * tracks.seen_between:.1f}",
        "lost though in view, each image [%]": f"{100 * tracks.lost:.1f}",
        "sightings of a landmark": f"{tracks.length:.1f}",
        "sightings of an image": f"{tracks.sightings.mean():.1f}",
        "range, quartiles [m]": _triple(tracks.range_m[2:5], 1),
        "range, 1 and 99 % [m]": f"{tracks.range_m[0]:.1f}, {tracks.range_m[-1]:.1f}",
    }


def _drift_rows(fit: SensorFit) -> dict[str, str]:
    """Lay out how tracks slide; without it where the truth is measured too."""
    drift = fit.drift
    names = (
        "how far tracks slide, with 95 % [px/sqrt(m)]",
        "  by medians",
        "  root mean square and spread of landmarks",
        "  declared",
        "  white noise beside it [px]",
        "  wrong names [%]",
    )
    if drift is None:
        why = "the truth is measured too" if fit.settled else "too few sightings"
        return {names[0]: f"not known: {why}", names[3]: f"{fit.declared_drift_px:.3f}"}
    apart = f"{', '.join(str(lag) for lag in drift.lag)} images apart [px]"
    values = (
        f"{_between(drift.drift_px)}, over {drift.distance_m:.1f} m",
        _between(drift.drift_median_px),
        f"{drift.spread.drift_px:.3f}, {drift.spread.spread:.2f}",
        f"{fit.declared_drift_px:.3f}",
        _between(drift.sigma_px),
        f"{100 * drift.wrong:.2f}",
    )
    return dict(zip(names, values, strict=True)) | {
        f"differ {apart}": _triple(drift.by_mean_px),
        "  by medians [px]": _triple(drift.by_median_px),
        "  mean squares over those expected": _triple(drift.square, 2),
        "  beyond the gate [%]": _triple(100 * drift.beyond, 1),
    }


def _between(interval: Interval) -> str:
    return f"{interval.value:.3f} ({interval.low:.3f} to {interval.high:.3f})"


def _triple(values: Array, digits: int = 3) -> str:
    return ", ".join(f"{value:.{digits}f}" for value in values)


def plot_sensor(fit: SensorFit, sensed: SensorFit | None = None) -> Figure:
    """Draw the noise of each coordinate, its correlation over images, and sightings per image.

    Args:
        fit: Measured on a recording.
        sensed: Of the landmark sensor, drawn in grey; None draws the recording alone.

    Returns:
        The figure; write it with `figures.save`.
    """
    figure = Figure(figsize=(11.0, 6.5), layout="constrained")
    axes = figure.subplots(2, 3)
    for k, name in enumerate(_NAMES):
        _draw_noise(axes[0, k], fit, sensed, k)
        axes[0, k].set(title=name, xlabel="noise [px]", ylabel="density [1/px]")
        lags = np.arange(1, LAGS + 1)
        axes[1, 0].plot(lags, fit.noise.lag_correlation[:, k], color=_COLOURS[k], label=name)
        if sensed is not None:
            axes[1, 0].plot(lags, sensed.noise.lag_correlation[:, k], color="grey", lw=1)
    axes[1, 0].set(xlabel="images between", ylabel="correlation", ylim=(-0.5, 1.0))
    axes[1, 0].legend()
    _draw_counts(axes[1, 1], fit, sensed)
    _draw_ranges(axes[1, 2], fit, sensed)
    for one in axes.flat:
        one.grid(alpha=0.3)
    return figure


def _draw_noise(axes: Axes, fit: SensorFit, sensed: SensorFit | None, k: int) -> None:
    """Draw a histogram on a logarithmic scale, where tails show, and the Gaussian of the spec."""
    sigma = float(fit.noise.sigma_px[k])
    limit = _WIDE * max(float(fit.noise.rms_px[k]), sigma)
    bins = np.linspace(-limit, limit, 101).tolist()
    axes.hist(fit.residual_px[:, k], bins, density=True, color=_COLOURS[k], alpha=0.6)
    if sensed is not None:
        axes.hist(sensed.residual_px[:, k], bins, density=True, histtype="step", color="grey")
    x = np.linspace(-limit, limit, 400)
    axes.plot(x, np.exp(-0.5 * (x / sigma) ** 2) / (sigma * np.sqrt(2 * np.pi)), "k", lw=1)
    axes.set_yscale("log")
    axes.set_ylim(1e-3, 3.0 / sigma)


def _draw_counts(axes: Axes, fit: SensorFit, sensed: SensorFit | None) -> None:
    axes.plot(fit.tracks.sightings, color=_COLOURS[1], label="recording")
    if sensed is not None:
        axes.plot(sensed.tracks.sightings, color="grey", label="landmark sensor")
    axes.set(xlabel="image", ylabel="sightings")
    axes.set_ylim(bottom=0)
    axes.legend()


def _draw_ranges(axes: Axes, fit: SensorFit, sensed: SensorFit | None) -> None:
    axes.plot(fit.tracks.range_m, RANGE_SHARES, "o-", color=_COLOURS[1], label="recording")
    if sensed is not None:
        axes.plot(sensed.tracks.range_m, RANGE_SHARES, "o-", color="grey", label="landmark sensor")
    axes.set(xlabel="range [m]", ylabel="share of sightings nearer", xscale="log")
    ends = fit.tracks.range_m[[0, -1]]
    ticks = [tick for tick in _RANGE_TICKS_M if ends[0] / 2 <= tick <= 2 * ends[1]]
    axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_xticks([], minor=True)
    axes.legend()
