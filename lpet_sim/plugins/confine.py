"""Becomes another program that sees little of the machine; a script of its own, for ``-I -S``.

    python -I -S confine.py CONFINEMENT.json PROGRAM ARGUMENTS...

It lowers the limits of its process, lets Linux's Landlock take every file away that is not listed,
and then is replaced by the program. It imports nothing of ours, so that it is there at once.
Without Landlock (before Linux 5.13, or elsewhere) the limits alone hold.

Reference:
    Linux, Documentation/userspace-api/landlock.rst: numbers of calls and rights.
"""

from __future__ import annotations

import ctypes
import json
import os
import resource
import sys
from typing import Any

CREATE, ADD_RULE, RESTRICT = 444, 445, 446
VERSION_FLAG, PATH_BENEATH, NO_NEW_PRIVILEGES = 1, 1, 38
EXECUTE, WRITE_FILE, READ_FILE, READ_DIR = 1, 2, 4, 8
ALL = (1 << 13) - 1
TRUNCATE = 1 << 14
READ = EXECUTE | READ_FILE | READ_DIR


class _PathBeneath(ctypes.Structure):
    """``struct landlock_path_beneath_attr``."""

    _pack_ = 1
    _layout_ = "ms"
    _fields_ = (("allowed", ctypes.c_uint64), ("parent", ctypes.c_int32))


def landlock_version() -> int:
    """Give the version of Landlock that the kernel has, 0 for none."""
    if not sys.platform.startswith("linux"):
        return 0
    return max(0, int(_libc().syscall(CREATE, None, ctypes.c_size_t(0), VERSION_FLAG)))


def confine(readable: list[str], listable: list[str], writable: list[str]) -> None:
    """Take every file away from this process but those below the paths given.

    Args:
        readable: Files and folders that may be read and executed.
        listable: Folders of which the names may be seen.
        writable: Folders in which all is allowed.

    Raises:
        OSError: The kernel refuses.
    """
    version = landlock_version()
    if version == 0:
        return
    handled = ALL | (TRUNCATE if version >= 3 else 0)
    attribute = ctypes.c_uint64(handled)
    rules = _call(CREATE, ctypes.byref(attribute), ctypes.c_size_t(8), 0)
    for paths, rights in ((readable, READ), (listable, READ_DIR), (writable, handled)):
        for path in paths:
            _allow(rules, path, rights)
    if _libc().prctl(NO_NEW_PRIVILEGES, 1, 0, 0, 0):
        raise OSError(ctypes.get_errno(), "prctl")
    _call(RESTRICT, rules, 0)
    os.close(rules)


def _allow(rules: int, path: str, rights: int) -> None:
    """Add a path to the rules, if it is there; a file takes no rights of folders."""
    try:
        opened = os.open(path, os.O_PATH | os.O_CLOEXEC)
    except OSError:
        return
    if not os.path.isdir(path):  # noqa: PTH112
        rights &= EXECUTE | WRITE_FILE | READ_FILE | TRUNCATE
    rule = _PathBeneath(rights, opened)
    _call(ADD_RULE, rules, PATH_BENEATH, ctypes.byref(rule), 0)
    os.close(opened)


def _call(number: int, *arguments: Any) -> int:
    result = int(_libc().syscall(number, *arguments))
    if result < 0:
        raise OSError(ctypes.get_errno(), f"Landlock, call {number}")
    return result


def _libc() -> Any:
    return ctypes.CDLL(None, use_errno=True)


def _limit(what: int, most: int) -> None:
    _, hard = resource.getrlimit(what)
    most = most if hard == resource.RLIM_INFINITY else min(most, hard)
    resource.setrlimit(what, (most, most))


def main() -> None:
    """Confine this process and become the program."""
    with open(sys.argv[1]) as file:  # noqa: PTH123
        told = json.load(file)
    _limit(resource.RLIMIT_CORE, 0)
    _limit(resource.RLIMIT_FSIZE, told["file_bytes"])
    _limit(resource.RLIMIT_DATA, told["data_bytes"])
    confine(told["readable"], told["listable"], told["writable"])
    os.execvp(sys.argv[2], sys.argv[2:])


if __name__ == "__main__":
    main()
