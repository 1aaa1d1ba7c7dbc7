"""Charts of the rows of a sweep; each is a function of the rows of one arm."""

from lpet_sim.evaluation.charts.bars import has_nees, plot_nees, plot_pass_rates
from lpet_sim.evaluation.charts.growth import has_growth, plot_error_growth
from lpet_sim.evaluation.charts.memory import (
    has_cost,
    has_memory,
    plot_cost_over_memory,
    plot_error_over_memory,
    plot_error_over_size,
)
from lpet_sim.evaluation.charts.style import GRID, INK, PAPER, chart_style

__all__ = [
    "GRID",
    "INK",
    "PAPER",
    "chart_style",
    "has_cost",
    "has_growth",
    "has_memory",
    "has_nees",
    "plot_cost_over_memory",
    "plot_error_growth",
    "plot_error_over_memory",
    "plot_error_over_size",
    "plot_nees",
    "plot_pass_rates",
]
