"""Estimators that go wrong in a way each."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from lpet_sim.geometry import SE3
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.streams import Measurements
from lpet_sim.recording.trajectory import Trajectory


class Wrong:
    """Goes wrong as it is told."""

    name = "wrong"
    needs: ClassVar[tuple[str, ...]] = ("wheels",)

    def __init__(self, how: str = "crash", place: str = "/") -> None:
        self.how, self.place = how, Path(place)

    def estimate(self, measurements: Measurements) -> Estimate:
        """Go wrong."""
        good = _at_the_start(measurements)
        bad: Callable[[Estimate], Any] = getattr(self, f"_{self.how}")
        return bad(good)

    def _crash(self, _: Estimate) -> Any:
        os.abort()

    def _raises(self, _: Estimate) -> Any:
        raise ZeroDivisionError("over nothing")

    def _hang(self, _: Estimate) -> Any:
        while True:
            time.sleep(0.1)

    def _nan(self, good: Estimate) -> Any:
        p = good.trajectory.T_world_body.translation.copy()
        p[len(p) // 2 :] = np.nan
        return _moved(good, p)

    def _wrong_length(self, good: Estimate) -> Any:
        return Trajectory(good.trajectory.t_ns[:-1].copy(), good.trajectory.T_world_body)

    def _wrong_covariance_length(self, good: Estimate) -> Any:
        return Estimate(good.name, good.trajectory, np.tile(np.eye(6), (3, 1, 1)))

    def _unordered(self, good: Estimate) -> Any:
        t_ns = good.trajectory.t_ns.copy()
        t_ns[[3, 4]] = t_ns[[4, 3]]
        return Trajectory(t_ns, good.trajectory.T_world_body)

    def _covariance(self, good: Estimate) -> Any:
        P = np.tile(np.eye(6), (len(good.trajectory), 1, 1))
        P[7, 2, 2] = -1.0
        return Estimate(good.name, good.trajectory, P)

    def _memory_hog(self, _: Estimate) -> Any:
        held = []
        while True:
            held.append(np.ones(4_000_000))
            time.sleep(0.01)

    def _floods(self, good: Estimate) -> Any:
        while True:
            sys.stdout.write("said before all was read " * 100_000)

    def _no_output(self, _: Estimate) -> Any:
        os._exit(0)

    def _nothing(self, _: Estimate) -> Any:
        return None

    def _empty(self, good: Estimate) -> Any:
        none = Trajectory(good.trajectory.t_ns[:0].copy(), good.trajectory.T_world_body[:0])
        return Estimate(good.name, none)

    def _wrong_frame(self, good: Estimate) -> Any:
        optical = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
        T = good.trajectory.T_world_body @ SE3(optical, np.zeros(3))
        return Estimate(good.name, Trajectory(good.trajectory.t_ns.copy(), T))

    def _giant_file(self, good: Estimate) -> Any:
        with Path("giant.bin").open("wb") as file:
            for _ in range(1000):
                file.write(b"\0" * (1 << 20))
        return good

    def _seeks_truth(self, good: Estimate) -> Any:
        found = [path for path in self.place.rglob("*.rrd") if _opens(path)]
        return _truth_in(found[0]) if found else good

    def _opens_truth(self, good: Estimate) -> Any:
        return _truth_in(self.place)


class OneName(Wrong):
    """Has a name where names are expected."""

    needs = "wheels"  # type: ignore[assignment]


class UnknownName(Wrong):
    """Needs what is no stream."""

    needs = ("wheel",)


def _at_the_start(measurements: Measurements) -> Estimate:
    """Give an estimate with nothing wrong but that it stays where it was put."""
    assert measurements.wheels is not None
    t_ns = measurements.wheels.t_ns.copy()
    start = measurements.calibration.T_world_body_start.se3()
    T = SE3(np.tile(start.rotation, (len(t_ns), 1, 1)), np.tile(start.translation, (len(t_ns), 1)))
    return Estimate(Wrong.name, Trajectory(t_ns, T))


def _opens(path: Path) -> bool:
    try:
        path.open("rb").close()
    except OSError:
        return False
    return True


def _truth_in(path: Path) -> Estimate:
    from lpet_sim.recording.reader import read_recording  # Takes as long as all else to import.

    truth = read_recording(path).truth
    assert truth is not None
    return Estimate("wrong", truth.body)  # type: ignore[arg-type]


def _moved(good: Estimate, p: np.ndarray[Any, Any]) -> Estimate:
    T = SE3(good.trajectory.T_world_body.rotation, p)
    return Estimate(good.name, Trajectory(good.trajectory.t_ns.copy(), T))
