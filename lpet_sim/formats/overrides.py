"""What the user declares in place of what a data set says of its own sensors."""

from __future__ import annotations

from lpet_sim.recording.calibration import Calibration


def overridden(stated: Calibration, declared: Calibration | None) -> Calibration:
    """Give a calibration in which everything that the user sets replaces what was stated.

    Args:
        stated: What the data set says.
        declared: What the user sets; fields that it does not set stay as they were stated.
    """
    if declared is None:
        return stated
    return stated.model_copy(
        update={name: getattr(declared, name) for name in declared.model_fields_set}
    )
