"""The one place where GTSAM is imported."""

from __future__ import annotations

from typing import Any

from lpet_sim.errors import LpetError


def load_gtsam() -> Any:
    """Import GTSAM.

    Raises:
        LpetError: It is not installed; the sentence says how to install it.
    """
    try:
        import gtsam
    except ImportError:
        raise LpetError(
            "the estimators gtsam_fixed_lag and gtsam_batch need GTSAM, which is not installed: "
            "run 'pip install lpet[peers]'"
        ) from None
    return gtsam
