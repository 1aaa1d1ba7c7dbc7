"""Files that are written whole or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from lpet_sim.errors import OutputError


def output_folder(path: Path) -> Path:
    """Make a folder for outputs, or say why it cannot be used.

    Raises:
        OutputError: The folder cannot be made or written.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = error.strerror or str(error)
        raise OutputError(
            f"cannot make the folder {path}: {reason}; give a folder that can be written"
        ) from None
    if not os.access(path, os.W_OK | os.X_OK):
        raise OutputError(f"cannot write in {path}; give a folder that can be written")
    return path


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a temporary name beside `path`; it takes the final name only if the block succeeds.

    Raises:
        OutputError: The folder cannot be written.
    """
    output_folder(path.parent)
    if path.is_dir():
        raise OutputError(f"{path} is a folder; give the name of a file")
    handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=path.suffix, dir=path.parent)
    os.close(handle)
    temporary = Path(name)
    temporary.chmod(0o644)
    try:
        yield temporary
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def whole_folder(path: Path) -> Iterator[Path]:
    """Give a temporary folder beside `path`; it takes the final name only if the block succeeds.

    Raises:
        OutputError: There is something of that name already, or the folder cannot be made.
    """
    if path.exists() and not (path.is_dir() and not any(path.iterdir())):
        raise OutputError(f"{path} is there already; give the name of a new folder")
    output_folder(path.parent)
    temporary = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
    temporary.chmod(0o755)
    try:
        yield temporary
        temporary.replace(path)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
