"""Noticing whether a program read its measurements before it wrote its estimate, by inotify."""

from __future__ import annotations

import ctypes
import os
import struct
import sys
from pathlib import Path
from typing import Any, Final

_OPEN, _CLOSE_WRITE, _IS_FOLDER = 0x20, 0x8, 0x40000000
_NONBLOCK: Final = 0x800
_HEAD: Final = struct.Struct("iIII")


class ReadWatch:
    """Watches a folder that is to be read and a file that is to be written.

    Where there is no inotify (not on Linux) it says that all was well.

    Attributes:
        wrote_first: Whether the file was written and closed before anything was read.

    Reference:
        Linux, inotify(7): numbers of events.
    """

    def __init__(self, given: Path, written: Path) -> None:
        """Watch from here on."""
        self._written, self._read, self.wrote_first = written.name, False, False
        self._descriptor, self._home = -1, -1
        if not sys.platform.startswith("linux"):
            return
        libc: Any = ctypes.CDLL(None, use_errno=True)
        self._descriptor = int(libc.inotify_init1(_NONBLOCK))
        for folder in [given, *(path for path in given.rglob("*") if path.is_dir())]:
            libc.inotify_add_watch(self._descriptor, os.fsencode(folder), _OPEN)
        home = os.fsencode(written.parent)
        self._home = int(libc.inotify_add_watch(self._descriptor, home, _CLOSE_WRITE))

    def look(self) -> None:
        """Take in what has happened since."""
        while self._descriptor >= 0:
            try:
                told = os.read(self._descriptor, 1 << 16)
            except BlockingIOError:
                return
            self._take_in(told)

    def _take_in(self, told: bytes) -> None:
        at = 0
        while at < len(told):
            watch, mask, _, length = _HEAD.unpack_from(told, at)
            name = told[at + _HEAD.size : at + _HEAD.size + length].rstrip(b"\0")
            at += _HEAD.size + length
            if watch == self._home:
                closed = os.fsdecode(name) == self._written and bool(mask & _CLOSE_WRITE)
                self.wrote_first |= closed and not self._read
            elif not mask & _IS_FOLDER:
                self._read = True

    def close(self) -> None:
        """Watch no longer."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1
