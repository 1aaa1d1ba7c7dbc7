"""Where compiled code is kept: in a folder of its own for each state of the sources.

Numba asks only whether a function's own file has changed. It does not see that a constant or a
function which was compiled into it has changed in another file, and then gives old numbers. So
the folder is named by all files that have a part in compiled code.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
import time
from pathlib import Path
from typing import Final

MARK: Final = "njit"
"""A file that holds this word has a part in compiled code."""

_PREFIX: Final = "lpet-kernels-"
_STALE_S: Final = 7 * 86400.0
_VARIABLE: Final = "NUMBA_CACHE_DIR"


def keep_kernels_apart(root: Path) -> None:
    """Point Numba at the folder of the sources as they are, unless the user chose one.

    Args:
        root: The folder that holds the packages; where it cannot be written, Numba chooses.
    """
    chosen = os.environ.get(_VARIABLE, "")
    home = root / "lpet_sim" / "__pycache__"
    if (chosen and _PREFIX not in chosen) or not os.access(root / "lpet_sim", os.W_OK):
        return
    folder = home / f"{_PREFIX}{digest(root)}"
    if not folder.exists():
        _drop_old(home)
    os.environ[_VARIABLE] = str(folder)
    if "numba" in sys.modules:
        sys.modules["numba"].config.CACHE_DIR = str(folder)


def digest(root: Path) -> str:
    """Give a short name for the state of every file that has a part in compiled code."""
    found = hashlib.sha256()
    for package in ("estimators", "lpet_sim"):
        for path in sorted((root / package).rglob("*.py")):
            text = path.read_bytes()
            if MARK.encode() in text:
                found.update(path.relative_to(root).as_posix().encode() + b"\0" + text)
    return found.hexdigest()[:16]


def _drop_old(home: Path) -> None:
    """Remove what no state of the sources has used for a week."""
    now = time.time()
    for folder in home.glob(f"{_PREFIX}*"):
        if now - folder.stat().st_mtime > _STALE_S:
            shutil.rmtree(folder, ignore_errors=True)
