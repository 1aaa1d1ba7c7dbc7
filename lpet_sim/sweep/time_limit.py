"""Stopping work that takes too long, in whatever thread it runs."""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Iterator
from contextlib import contextmanager


class TimeLimitError(BaseException):
    """Work that was stopped; no ``except Exception`` on the way holds it up."""


class _Alarm:
    """Raises `TimeLimitError` in one thread, once, unless it was switched off before."""

    def __init__(self) -> None:
        self._thread = ctypes.c_ulong(threading.get_ident())
        self._lock = threading.Lock()
        self._off = False
        self.rung = False

    def ring(self) -> None:
        with self._lock:
            if not self._off:
                self.rung = True
                self._raise(ctypes.py_object(TimeLimitError))

    def switch_off(self) -> None:
        """Make sure that nothing is raised from here on."""
        with self._lock:
            self._off = True
        if self.rung:
            self._raise(None)

    def _raise(self, error: ctypes.py_object[type[TimeLimitError]] | None) -> None:
        ctypes.pythonapi.PyThreadState_SetAsyncExc(self._thread, error)


@contextmanager
def time_limit(limit_s: float | None) -> Iterator[None]:
    """Stop the block when its time is up.

    A second thread raises an exception in this one, which needs neither the process's main thread
    nor its signals. It comes between two steps of the interpreter: a single call of compiled code
    that never returns is not stopped.

    Args:
        limit_s: How long the block may take [s]; None: as long as it likes.

    Raises:
        TimeLimitError: The time was up before the block ended.
    """
    if limit_s is None:
        yield
        return
    alarm = _Alarm()
    timer = threading.Timer(limit_s, alarm.ring)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        alarm.switch_off()
    if alarm.rung:
        raise TimeLimitError
