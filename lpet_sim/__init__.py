"""LPET: localization performance evaluation for planetary rovers."""

import os
from pathlib import Path

from lpet_sim.kernel_cache import keep_kernels_apart

__version__ = "0.1.0"

# The matrices of a filter are small: a second BLAS thread costs more than it gives, many times over
# beside other work. It counts where NumPy is not loaded yet, and where the user has not chosen.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
keep_kernels_apart(Path(__file__).resolve().parents[1])
