"""The process in which a Python estimator that is not ours runs; it is never given the truth.

    python -m lpet_sim.plugins.child describe MODULE:CLASS ANSWER.json
    python -m lpet_sim.plugins.child run MODULE:CLASS TASK.json

What goes wrong is told in a file, so that the run gets its kind of failure.
"""

from __future__ import annotations

import errno
import importlib
import inspect
import json
import sys
import traceback
from pathlib import Path
from typing import Any, Final

import lpet_sim
from lpet_sim.errors import BrokenFilterError, EstimatorFaultError, LengthsError, TimesError
from lpet_sim.failures import (
    BAD_COVARIANCE,
    EXCEPTION,
    MALFORMED,
    MEMORY_LIMIT,
    OUTPUT_LIMIT,
    TRUTH_SOUGHT,
    UNORDERED_TIMES,
    WRONG_LENGTH,
)
from lpet_sim.plugins.guard import Guard
from lpet_sim.plugins.handover import read_measurements, write_estimate
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.streams import STREAMS

ESTIMATE: Final = "estimate.npz"
FAULT: Final = "fault.json"
_READER: Final = str(Path(lpet_sim.__file__).parent / "recording" / "reader.py")
_LPET: Final = Path(lpet_sim.__file__).parent
_NOT_ITS_OWN: Final = (*map(str, (_LPET, _LPET.parent / "estimators")), sys.prefix, sys.base_prefix)
_KINDS: Final = (
    (TimesError, UNORDERED_TIMES),
    (LengthsError, WRONG_LENGTH),
    (BrokenFilterError, BAD_COVARIANCE),
    (MemoryError, MEMORY_LIMIT),
)


def load(value: str) -> Any:
    """Give the class that ``module:Class`` names."""
    module, _, name = value.partition(":")
    return getattr(importlib.import_module(module), name)


def describe(value: str) -> dict[str, Any]:
    """Say what an estimator's class is: its name, the streams it needs, its parameters.

    Raises:
        TypeError: It is no class, or a parameter has no default.
    """
    kind = load(value)
    if not inspect.isclass(kind) or not callable(getattr(kind, "estimate", None)):
        raise TypeError("it is no class with a method 'estimate(measurements)'")
    parameters = {}
    for name, parameter in inspect.signature(kind).parameters.items():
        if parameter.default is parameter.empty:
            raise TypeError(f"parameter '{name}' has no default; give it one")
        parameters[name] = parameter.default
    needs = getattr(kind, "needs", ())
    if isinstance(needs, str) or any(need not in STREAMS for need in needs):
        raise TypeError(f"'needs' is {needs!r}, not a tuple of some of {', '.join(STREAMS)}")
    return {"needs": list(needs), "parameters": json.loads(json.dumps(parameters))}


def run(value: str, task: dict[str, Any], folder: Path) -> None:
    """Run an estimator on the measurements in a folder and leave its estimate there."""
    measurements = read_measurements(folder / "measurements")
    guard = Guard(task["allowed"], task["listable"])
    guard.switch_on()
    try:
        estimate = load(value)(**task["parameters"]).estimate(measurements)
    except Exception as error:
        if _in_reader(error):
            guard.sought.append("a recording")
        if not guard.sought:
            raise
        raise _sought(guard) from error
    if guard.sought:
        raise _sought(guard)
    guard.switch_off()
    if not isinstance(estimate, Estimate):
        text = f"estimate() gave {type(estimate).__name__}, not lpet_sim's Estimate"
        raise EstimatorFaultError(MALFORMED, text)
    write_estimate(estimate, folder / ESTIMATE)


def _in_reader(error: Exception) -> bool:
    """Tell whether it was reading a recording that failed: that is done by compiled code."""
    frames = traceback.extract_tb(error.__traceback__)
    return any(frame.filename == _READER for frame in frames)


def _sought(guard: Guard) -> EstimatorFaultError:
    guard.switch_off()
    text = f"it asked for {guard.sought[0]}, which is no part of the measurements"
    return EstimatorFaultError(TRUTH_SOUGHT, text)


def _fault(error: Exception) -> dict[str, str]:
    """Name what went wrong."""
    text = " ".join(f"{type(error).__name__}: {error}".split())
    if isinstance(error, EstimatorFaultError):
        return {"kind": error.kind, "text": str(error)}
    if isinstance(error, OSError) and error.errno == errno.EFBIG:
        return {"kind": OUTPUT_LIMIT, "text": text}
    kind = next((kind for type_, kind in _KINDS if isinstance(error, type_)), EXCEPTION)
    return {"kind": kind, "text": _place(error) + text}


def _place(error: Exception) -> str:
    """Name the last line of the plug-in's own code on the way to an error."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if not frame.filename.startswith((*_NOT_ITS_OWN, "<"))]
    return f"{Path(own[-1].filename).name}, line {own[-1].lineno}: " if own else ""


def main() -> None:
    """Do what the command line says; a fault is told in a file, with exit code 0."""
    what, value, told = sys.argv[1:]
    path, answer = Path(told), dict[str, Any]()
    try:
        if what == "describe":
            answer = describe(value)
        else:
            run(value, json.loads(path.read_text()), path.parent)
            return
    except Exception as error:
        answer = {"fault": _fault(error)}
    target = path if what == "describe" else path.parent / FAULT
    target.write_text(json.dumps(answer))


if __name__ == "__main__":
    main()
