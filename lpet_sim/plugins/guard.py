"""What a Python estimator may open: a hook of the interpreter that notes who looks for the truth.

Landlock (see `confine`) is what keeps files out of reach; it tells nobody. The hook sees what the
code asks for before the kernel does, so that the run can be named for what it was.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from typing import Any, Final

_RECORDING: Final = ".rrd"
_DATA: Final = (".npz", ".npy", ".tum", ".csv", ".txt", ".parquet", ".mcap", ".json")
"""Endings of files in which a truth may lie."""
_EVENTS: Final = ("open", "os.listdir", "os.scandir")


class Guard:
    """Refuses what lies outside the folders allowed, and remembers what was asked for.

    Attributes:
        sought: Places outside that were asked for and may hold a truth.
    """

    def __init__(self, allowed: Sequence[str], listable: Sequence[str]) -> None:
        """Take folders and files as they are on the disk, links followed."""
        self._allowed = tuple(os.path.realpath(path) for path in allowed)
        self._listable = tuple(os.path.realpath(path) for path in listable)
        self.sought: list[str] = []
        self._on = False

    def switch_on(self) -> None:
        """Watch from here on; a hook of the interpreter is never taken off again."""
        self._on = True
        sys.addaudithook(self._hook)

    def switch_off(self) -> None:
        """Let everything pass again: our own code writes what came out."""
        self._on = False

    def _hook(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self._on or event not in _EVENTS or not isinstance(arguments[0], str | bytes):
            return
        path = os.path.realpath(os.fsdecode(arguments[0]))
        if _below(path, self._allowed):
            return
        if event == "open" and not _may_hold_truth(path):
            return
        if event != "open" and (_below(path, self._listable) or _is_settings(path)):
            return
        self.sought.append(path)
        raise PermissionError(f"{path} is no part of the measurements")


def _below(path: str, folders: Sequence[str]) -> bool:
    return any(path == folder or path.startswith(folder.rstrip("/") + "/") for folder in folders)


def _may_hold_truth(path: str) -> bool:
    name = path.lower()
    return name.endswith(_RECORDING) or (name.endswith(_DATA) and not _is_settings(path))


def _is_settings(path: str) -> bool:
    """Tell whether a path lies in a hidden folder, where libraries keep their settings."""
    return any(part.startswith(".") for part in path.split("/"))
