"""Errors, consistency and the verdict against a requirement."""

from lpet_sim.evaluation.requirement import Requirement, Verdict, VerdictLine
from lpet_sim.evaluation.result import EvaluationSpec, RunResult, evaluate, failed

__all__ = [
    "EvaluationSpec",
    "Requirement",
    "RunResult",
    "Verdict",
    "VerdictLine",
    "evaluate",
    "failed",
]
