"""Kinds of failure that a run may end with, by the names that rows carry."""

from __future__ import annotations

INCOMPLETE, DIVERGED, NOT_FINITE = "incomplete", "diverged", "not_finite"
BAD_COVARIANCE, LOST, EXCEPTION = "bad_covariance", "lost", "exception"
TIMEOUT = "timeout"
CRASH, MEMORY_LIMIT, OUTPUT_LIMIT = "crash", "memory_limit", "output_limit"
NO_OUTPUT, MALFORMED, WRONG_LENGTH = "no_output", "malformed_output", "wrong_length"
UNORDERED_TIMES, WRONG_FRAME = "unordered_times", "wrong_frame"
UNREAD, TRUTH_SOUGHT = "unread_measurements", "truth_sought"
FAULTS = frozenset(
    {
        CRASH,
        MEMORY_LIMIT,
        OUTPUT_LIMIT,
        NO_OUTPUT,
        MALFORMED,
        WRONG_LENGTH,
        UNORDERED_TIMES,
        WRONG_FRAME,
        UNREAD,
        TRUTH_SOUGHT,
    }
)
"""Failures of estimators that are not our own, see docs/own_estimator.md."""
BROKEN = frozenset({NOT_FINITE, BAD_COVARIANCE, LOST, EXCEPTION, TIMEOUT}) | FAULTS
"""Failures that no small error makes up for."""
