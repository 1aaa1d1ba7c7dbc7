"""Compiled code is never older than the sources it came from."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import lpet_sim
from lpet_sim.kernel_cache import digest

KERNEL = """
import lpet_sim
from numba import njit
from lpet_sim.numbers import TWO

@njit(cache=True)
def double(x):
    return TWO * x
"""


def _write(root: Path, two: int) -> None:
    package = root / "lpet_sim"
    package.mkdir(exist_ok=True)
    source = Path(lpet_sim.__file__).parent
    for name in ("__init__.py", "kernel_cache.py"):
        (package / name).write_text((source / name).read_text())
    (package / "numbers.py").write_text(f"TWO = {two}  # njit\n")
    (package / "kernel.py").write_text(KERNEL)


def _doubled(root: Path, cache_dir: str = "") -> str:
    code = "from lpet_sim.kernel import double; print(double(10), end='')"
    environment = os.environ | {"PYTHONPATH": str(root), "NUMBA_CACHE_DIR": cache_dir}
    command = [sys.executable, "-c", code]
    return subprocess.run(
        command, cwd=root, env=environment, capture_output=True, text=True, check=True
    ).stdout


def test_a_constant_changed_in_another_file_changes_what_is_compiled(tmp_path: Path) -> None:
    """Numba alone would give the old number again: it looks at the function's own file only."""
    _write(tmp_path, two=2)
    kernel = tmp_path / "lpet_sim" / "kernel.py"
    seen = kernel.stat()
    chosen = str(tmp_path / "chosen")
    assert _doubled(tmp_path) == _doubled(tmp_path, chosen) == "20"
    _write(tmp_path, two=3)
    os.utime(kernel, ns=(seen.st_atime_ns, seen.st_mtime_ns))
    assert _doubled(tmp_path) == "30"
    assert _doubled(tmp_path, chosen) == "20"


@pytest.mark.parametrize(("text", "same"), [("x = 2\n", True), ("x = 2  # njit\n", False)])
def test_only_files_with_a_part_in_compiled_code_count(
    tmp_path: Path, text: str, same: bool
) -> None:
    """So that most edits cost no compiling."""
    _write(tmp_path, two=2)
    before = digest(tmp_path)
    (tmp_path / "lpet_sim" / "more.py").write_text(text)
    assert (digest(tmp_path) == before) is same
