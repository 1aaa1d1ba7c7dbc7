"""The errors that LPET raises: each sentence is built from the values and names what is valid."""

from __future__ import annotations

from collections.abc import Iterable


class LpetError(Exception):
    """Base of every error that is the user's to mend; the command line exits with code 2."""


class SpecError(LpetError):
    """A spec file or value that is not valid."""


class RecordingError(LpetError):
    """A recording that is missing, truncated, of another schema, or lacks a stream."""


class RowsError(LpetError):
    """A table of runs that is missing, cut off, or lacks what is asked of it."""


class OutputError(LpetError):
    """A place that cannot be written."""


class UnknownNameError(LpetError):
    """A name that is not among the valid ones."""

    def __init__(self, kind: str, name: str, valid: Iterable[str]) -> None:
        """Build the sentence from the kind of thing, the name given and the valid names."""
        super().__init__(f"unknown {kind} '{name}': choose one of {', '.join(sorted(valid))}")


class PlanningError(LpetError):
    """A start, goal or path that cannot be driven."""


class BlockedPlaceError(PlanningError):
    """A place at which the rover is to stand, but that is not clear."""


class BrokenFilterError(LpetError):
    """A filter whose covariance is no longer positive definite: the run ends here."""


class TimesError(RecordingError):
    """Times that do not increase strictly."""


class LengthsError(RecordingError):
    """Arrays that belong together but differ in length."""


class EstimatorFaultError(LpetError):
    """An estimator of somebody else's that went wrong: its run ends here, and nothing else.

    Attributes:
        kind: The kind of failure, one of `lpet_sim.evaluation.result.FAULTS` or of the kinds that
            every run may end with.
    """

    def __init__(self, kind: str, text: str) -> None:
        """Keep the kind beside the sentence."""
        super().__init__(text)
        self.kind = kind
