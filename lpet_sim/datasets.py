"""Where the real data sets lie: ``$LPET_DATA``, else ``../shared/data`` beside the repository."""

from __future__ import annotations

import os
from pathlib import Path

from lpet_sim.errors import LpetError

VARIABLE = "LPET_DATA"
DEFAULT_FOLDER = Path(__file__).resolve().parents[2] / "shared" / "data"


class DataError(LpetError):
    """Real data that is not where it was looked for."""


def data_folder() -> Path:
    """Find the folder of real data.

    Returns:
        ``$LPET_DATA`` where it is set, else the ``shared/data`` beside the repository.

    Raises:
        DataError: The folder does not exist.
    """
    folder = Path(os.environ.get(VARIABLE) or DEFAULT_FOLDER)
    if not folder.is_dir():
        raise DataError(f"no data folder at {folder}: set ${VARIABLE} to the folder of real data")
    return folder


def data_path(relative: Path | str) -> Path:
    """Find one file or folder of the real data.

    Args:
        relative: Its place inside the data folder.

    Raises:
        DataError: The data folder or the file does not exist.
    """
    path = data_folder() / relative
    if not path.exists():
        raise DataError(f"no '{relative}' in {data_folder()}: set ${VARIABLE} to a folder with it")
    return path
