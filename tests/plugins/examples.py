"""The worked examples of the documentation, where tests can find them."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import pytest

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"


def straight(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Give the class of the example in Python, and let its module be found."""
    monkeypatch.syspath_prepend(str(EXAMPLES))
    return importlib.import_module("straight").Straight
