"""LPET: localization performance evaluation for planetary rovers."""

from pathlib import Path

from lpet_sim.kernel_cache import keep_kernels_apart

__version__ = "0.1.0"

keep_kernels_apart(Path(__file__).resolve().parents[1])
