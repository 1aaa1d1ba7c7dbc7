"""Running a program apart: confined, within its limits, and ended with all that it started."""

from __future__ import annotations

import json
import logging
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from lpet_sim.errors import EstimatorFaultError
from lpet_sim.failures import CRASH, MEMORY_LIMIT, OUTPUT_LIMIT, TIMEOUT
from lpet_sim.plugins import confine
from lpet_sim.plugins.limits import MIB, LimitSpec

SYSTEM: Final = ("/usr", "/lib", "/lib64", "/bin", "/sbin", "/etc", "/dev", "/proc", "/sys")
"""What every program needs to start."""
_log = logging.getLogger(__name__)
_LOOK_S: Final = 0.05
_SAID_CHARS: Final = 500


@dataclass(frozen=True)
class Confinement:
    """What a program may see of the files, beside the system's.

    Attributes:
        readable: Files and folders that it may read.
        listable: Folders of which it may see the names.
        writable: Folders in which it may do as it likes.
    """

    readable: tuple[str, ...] = ()
    listable: tuple[str, ...] = ()
    writable: tuple[str, ...] = ()


def supervise(
    command: Sequence[str],
    folder: Path,
    limits: LimitSpec,
    confinement: Confinement,
    environment: Mapping[str, str],
    look: Callable[[], None] = lambda: None,
) -> None:
    """Run a program in a folder, and hold it to its limits.

    Args:
        command: Program and arguments.
        folder: Its working folder, in which alone it may write; what it prints goes into
            ``said.txt`` there, and is logged as information when it has ended.
        limits: What it may use.
        confinement: What it may see.
        environment: All its variables.
        look: Called some twenty times a second while it runs, and once after.

    Raises:
        EstimatorFaultError: It ended badly, or was ended.
    """
    told, said = folder.parent / f"{folder.name}.confinement.json", folder / "said.txt"
    told.write_text(json.dumps(_told(limits, confinement, folder)))
    given_bytes = _size_bytes(folder)
    whole = [sys.executable, "-I", "-S", confine.__file__, str(told), *command]
    with said.open("wb") as file:
        process = subprocess.Popen(
            whole,
            cwd=folder,
            env=dict(environment),
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
    try:
        _watch(process, folder, given_bytes, limits, look)
    finally:
        _end(process)
        _pass_on(said)
    look()
    _hold_to_output(folder, given_bytes, limits)
    _judge(process.returncode, said, limits)


def _told(limits: LimitSpec, confinement: Confinement, folder: Path) -> dict[str, object]:
    """Say what the launcher needs to know; twice the memory is where allocation itself fails."""
    return {
        "file_bytes": limits.output_limit_mib * MIB,
        "data_bytes": 2 * limits.memory_limit_mib * MIB,
        "readable": [*SYSTEM, sys.prefix, sys.base_prefix, *confinement.readable, *limits.readable],
        "listable": list(confinement.listable),
        "writable": ["/dev/null", str(folder), *confinement.writable],
    }


def _watch(
    process: subprocess.Popen[bytes],
    folder: Path,
    given_bytes: int,
    limits: LimitSpec,
    look: Callable[[], None],
) -> None:
    end_s = time.monotonic() + limits.time_limit_s
    while True:
        try:
            process.wait(_LOOK_S)
            return
        except subprocess.TimeoutExpired:
            look()
        if time.monotonic() > end_s:
            raise EstimatorFaultError(TIMEOUT, f"stopped after {limits.time_limit_s:g} s")
        held = memory_bytes(process.pid) / MIB
        if held > limits.memory_limit_mib:
            text = f"it held {held:.0f} MiB, more than its {limits.memory_limit_mib} MiB"
            raise EstimatorFaultError(MEMORY_LIMIT, text)
        _hold_to_output(folder, given_bytes, limits)


def _size_bytes(folder: Path) -> int:
    """Give the size of all files in a folder; one that goes away meanwhile has none."""
    size = 0
    for path in folder.rglob("*"):
        with suppress(OSError):
            size += path.stat().st_size if path.is_file() else 0
    return size


def _hold_to_output(folder: Path, given_bytes: int, limits: LimitSpec) -> None:
    if _size_bytes(folder) - given_bytes >= limits.output_limit_mib * MIB:
        text = f"it wrote more than its {limits.output_limit_mib} MiB"
        raise EstimatorFaultError(OUTPUT_LIMIT, text)


def memory_bytes(session: int) -> int:
    """Give the memory that the processes of a session hold; 0 where there is no ``/proc``."""
    held = 0
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            fields = (folder / "stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == session:
            held += int(fields[21]) * os.sysconf("SC_PAGE_SIZE")
    return held


def _end(process: subprocess.Popen[bytes]) -> None:
    """End the program and all that it started."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _pass_on(said: Path) -> None:
    """Log what a program printed, if anything."""
    text = said.read_text(errors="replace").rstrip() if said.is_file() else ""
    if text:
        _log.info("what the estimator printed:\n%s", text)


def _judge(code: int, said: Path, limits: LimitSpec) -> None:
    """Tell how a program ended that was not stopped.

    Raises:
        EstimatorFaultError: Badly.
    """
    if code == -signal.SIGXFSZ:
        text = f"it wrote a file larger than its {limits.output_limit_mib} MiB"
        raise EstimatorFaultError(OUTPUT_LIMIT, text)
    if code:
        how = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        tail = " ".join(said.read_text(errors="replace").split())[-_SAID_CHARS:]
        raise EstimatorFaultError(CRASH, f"it ended with {how}{': ' if tail else ''}{tail}")
