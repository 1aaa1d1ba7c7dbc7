"""Estimators in any language: a command that reads an ASL folder and writes a TUM file."""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Final, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from lpet_sim.errors import EstimatorFaultError, RecordingError, SpecError, TimesError
from lpet_sim.failures import (
    MALFORMED,
    NO_OUTPUT,
    NOT_FINITE,
    UNORDERED_TIMES,
    UNREAD,
    WRONG_LENGTH,
)
from lpet_sim.formats.clock import EPOCH_NS
from lpet_sim.formats.euroc import write_measurements
from lpet_sim.formats.tum import read_tum
from lpet_sim.plugins.accept import accepted
from lpet_sim.plugins.limits import LimitSpec
from lpet_sim.plugins.reads import ReadWatch
from lpet_sim.plugins.supervise import Confinement, supervise
from lpet_sim.recording.arrays import Array
from lpet_sim.recording.estimate import Estimate
from lpet_sim.recording.streams import Measurements
from lpet_sim.recording.trajectory import Trajectory

MEASUREMENTS, ESTIMATE, COVARIANCE = "{measurements}", "{estimate}", "{covariance}"
_NOT_FINITE: Final = re.compile(r"^(?!#).*(?<![a-z])(nan|inf)", re.IGNORECASE | re.MULTILINE)
"""A row, no comment, with a word of C or Python for what is no number."""


class ProgramSpec(LimitSpec):
    """A command that estimates.

    Attributes:
        command: Program and arguments. ``{measurements}`` stands for the ASL folder that it reads,
            ``{estimate}`` for the TUM file that it writes, ``{covariance}`` for a text file of 36
            numbers in each line, the covariance of each pose by rows, which it may write too.
            Programs and files in it are looked for from the folder where LPET is started.
        needs: The streams without which it cannot run; images are written for it, which takes
            time, only if they are among them.
        code: Digest of the files in the command, filled in: rows of a sweep hang on it.
    """

    command: Annotated[tuple[str, ...], Field(min_length=1)] = ("./estimate",)
    needs: tuple[str, ...] = ()
    code: str = ""

    @field_validator("command", mode="before")
    @classmethod
    def _words(cls, command: object) -> object:
        """See that the command is a list, and fills in nothing that there is not."""
        if isinstance(command, str):
            raise ValueError("give the program and each of its arguments as a list")
        known = (MEASUREMENTS, ESTIMATE, COVARIANCE)
        for word in command if isinstance(command, list | tuple) else ():
            for found in re.findall(r"\{\w+\}", str(word)):
                if found not in known:
                    raise ValueError(f"there is no {found}; there are {', '.join(known)}")
        return command

    @model_validator(mode="after")
    def _name_code(self) -> Self:
        """Fill in the digest, where the program is there; a frozen spec is made once."""
        if not self.code and shutil.which(self.command[0]):
            found = hashlib.sha256()
            for word, path in _files_of(self.command):
                found.update(path.read_bytes() if path else word.encode())
            object.__setattr__(self, "code", found.hexdigest()[:16])
        return self


@dataclass(frozen=True)
class Program:
    """An estimator that is a program of its own.

    Attributes:
        spec: The command and its limits.
        name: The name under which results are reported.
    """

    spec: ProgramSpec
    name: str = "program"

    def __post_init__(self) -> None:
        """See that the program is there.

        Raises:
            SpecError: It is not.
        """
        _files_of(self.spec.command)

    @property
    def needs(self) -> tuple[str, ...]:
        """The streams without which it cannot run."""
        return self.spec.needs

    def estimate(self, measurements: Measurements) -> Estimate:
        """Run the command on the measurements; see `Estimator`.

        Raises:
            EstimatorFaultError: It went wrong, one way or another.
            RecordingError: A stream that it needs is absent.
        """
        measurements.require(*self.spec.needs)
        found = [str(path) if path else word for word, path in _files_of(self.spec.command)]
        with tempfile.TemporaryDirectory(prefix="lpet-") as made:
            work = Path(made) / "work"
            work.mkdir()
            given, with_images = work / "measurements", "images" in self.spec.needs
            given.mkdir()
            write_measurements(
                measurements if with_images else replace(measurements, images=None), given
            )
            with _watched(given, work) as watch:
                _run(found, work, self.spec, watch)
            return accepted(_estimate_in(work, self.name), measurements)


def _files_of(command: Sequence[str]) -> list[tuple[str, Path | None]]:
    """Give each word of a command with the file that it names, if it does.

    Raises:
        SpecError: The program is not there.
    """
    first, *rest = command
    program = shutil.which(first)
    if program is None:
        raise SpecError(
            f"there is no program '{first}': give one on the PATH, or its path from {Path.cwd()}"
        )
    words: list[tuple[str, Path | None]] = [(first, Path(program).absolute())]
    files = [Path(word).absolute() if Path(word).is_file() else None for word in rest]
    return words + list(zip(rest, files, strict=True))


@contextmanager
def _watched(given: Path, work: Path) -> Iterator[ReadWatch]:
    watch = ReadWatch(given, work / "estimate.txt")
    try:
        yield watch
    finally:
        watch.close()


def _run(words: list[str], work: Path, spec: ProgramSpec, watch: ReadWatch) -> None:
    """Run the command.

    Raises:
        EstimatorFaultError: It ended badly, or wrote its estimate before it read anything.
    """
    places = {
        MEASUREMENTS: work / "measurements",
        ESTIMATE: work / "estimate.txt",
        COVARIANCE: work / "covariance.txt",
    }
    command = [_filled(word, places) for word in words]
    files = [Path(word) for word in words if word.startswith("/")]
    seen = Confinement(tuple(str(f) for path in files for f in (path, path.resolve())))
    kept = {name: os.environ[name] for name in ("PATH", "LANG", "LC_ALL") if name in os.environ}
    variables = kept | {"HOME": str(work), "TMPDIR": str(work)}
    supervise(command, work, spec, seen, variables, watch.look)
    if watch.wrote_first and (work / "estimate.txt").exists():
        raise EstimatorFaultError(UNREAD, "it wrote its estimate before it read a measurement")


def _filled(word: str, places: dict[str, Path]) -> str:
    for name, path in places.items():
        word = word.replace(name, str(path))
    return word


def _estimate_in(work: Path, name: str) -> Estimate:
    """Read what the program wrote.

    Raises:
        EstimatorFaultError: Nothing, or nothing that can be read.
    """
    path = work / "estimate.txt"
    if not path.exists() or path.stat().st_size == 0:
        raise EstimatorFaultError(NO_OUTPUT, "it wrote no estimate")
    if _NOT_FINITE.search(path.read_text(errors="replace")):
        raise EstimatorFaultError(NOT_FINITE, "a number of the estimate is not finite")
    try:
        trajectory = read_tum(path, EPOCH_NS)
    except TimesError:
        raise EstimatorFaultError(UNORDERED_TIMES, "its times do not increase") from None
    except RecordingError as error:
        raise EstimatorFaultError(MALFORMED, str(error)) from None
    return Estimate(name, trajectory, _covariance_in(work / "covariance.txt", trajectory))


def _covariance_in(path: Path, trajectory: Trajectory) -> Array | None:
    """Read the covariances, if there are any.

    Raises:
        EstimatorFaultError: They are no numbers, or too few.
    """
    if not path.exists():
        return None
    try:
        rows = np.loadtxt(path, ndmin=2)
    except ValueError as error:
        raise EstimatorFaultError(MALFORMED, f"covariance.txt: {error}") from None
    if rows.shape != (len(trajectory), 36):
        text = f"covariance.txt holds {rows.shape}, not {len(trajectory)} lines of 36 numbers"
        raise EstimatorFaultError(WRONG_LENGTH, text)
    return rows.reshape(-1, 6, 6)
