"""Running the `lpet` command in this process."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from lpet_sim.cli import main

TINY = """
name: tiny
terrain: {relief: {rms_slope_rad: 0.03}, craters: null, rocks: null}
drive: {waypoints_m: [[0, 0], [0.3, 0]], speed_mps: 0.1, settle_s: 1.0}
route: null
images: null
sensors: {stereo: null}
"""


@dataclass(frozen=True)
class Ended:
    """How a command ended."""

    code: int
    out: str
    err: str


Lpet = Callable[..., Ended]


def runner(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Lpet:
    """Make a function that runs ``lpet`` with arguments."""

    def lpet(*arguments: str | Path) -> Ended:
        monkeypatch.setattr(sys, "argv", ["lpet", *map(str, arguments)])
        capsys.readouterr()
        with pytest.raises(SystemExit) as stop:
            main()
        said = capsys.readouterr()
        assert isinstance(stop.value.code, int)
        return Ended(stop.value.code, said.out, said.err)

    return lpet
