"""The page on own estimators: its code is the example, its table whole."""

from __future__ import annotations

import re

from lpet_sim import failures
from tests.plugins.examples import EXAMPLES

PAGE = (EXAMPLES.parent / "own_estimator.md").read_text()


def test_the_class_on_the_page_is_the_example() -> None:
    """To the letter; the example is run in other tests."""
    (code,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    assert code == (EXAMPLES / "straight.py").read_text()


def test_every_failure_is_in_the_table() -> None:
    """None is told to the user that is not explained."""
    assert [kind for kind in sorted(failures.BROKEN) if f"`{kind}`" not in PAGE] == []
