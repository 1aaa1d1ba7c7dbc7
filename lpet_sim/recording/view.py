"""Opening a recording in the viewer."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from lpet_sim.errors import OutputError
from lpet_sim.recording.reader import open_store


def view(path: Path | str) -> None:
    """Open a recording in the viewer and wait until it is closed.

    Raises:
        RecordingError: The file is missing, truncated, or not a recording of this schema.
        OutputError: There is no display, or the viewer ends with an error.
    """
    open_store(path)
    if not has_display(os.environ, sys.platform):
        raise OutputError(
            "there is no display (neither DISPLAY nor WAYLAND_DISPLAY is set): copy the file to a "
            f"machine that has one, or run 'rerun --web-viewer {path}' and open it in a browser"
        )
    status = subprocess.run([sys.executable, "-m", "rerun", str(path)], check=False).returncode
    if status != 0:
        raise OutputError(f"the viewer ended with status {status}: try 'rerun {path}' by hand")


def has_display(environment: Mapping[str, str], platform: str) -> bool:
    """Tell whether a window can be opened."""
    if not platform.startswith("linux"):
        return True
    return bool(environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY"))
