"""The tutorial of a rover of one's own: every block is written or run, in order, in one folder."""

import re
from pathlib import Path

import pytest

from tests.command import Lpet, runner

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "own_rover.md").read_text()
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
NAME = re.compile(r"^(?:# |<!-- )([\w.]+)")


@pytest.fixture
def lpet(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Lpet:
    """Run ``lpet`` in this process."""
    return runner(monkeypatch, capsys)


def _run(block: str, lpet: Lpet) -> None:
    """Run the commands of a block, and hold the one that is to fail to what the page says."""
    lines = block.splitlines()
    for line, said in zip(lines, [*lines[1:], ""], strict=True):
        if not line.startswith("$ lpet "):
            continue
        ended = lpet(*line.removeprefix("$ lpet ").split())
        if said.startswith("lpet: "):
            assert (ended.code, ended.err.strip()) == (2, said)
        else:
            assert ended.code == 0, ended.out + ended.err


def test_every_block_of_the_page_does_what_it_says(
    lpet: Lpet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Files are written, commands end with 0 or with the sentence that stands under them."""
    monkeypatch.chdir(tmp_path)
    assert [kind for kind, _ in BLOCKS].count("console") == 3
    for kind, text in BLOCKS:
        if kind in ("yaml", "xml"):
            name = NAME.match(text)
            assert name is not None
            (tmp_path / name[1]).write_text(text)
        elif kind == "console":
            _run(text, lpet)
        else:
            assert kind == "python"
            exec(compile(text, "own_rover.md", "exec"), {})
    assert (tmp_path / "cart.png").stat().st_size > 50_000


def test_the_files_that_the_page_names_are_there() -> None:
    """In the repository, or written by the page."""
    named = re.findall(r"`((?:lpet_sim|models|docs)/[\w./]*)`|\]\((pictures/[\w.]+)\)", PAGE)
    paths = [ROOT / (inside or f"docs/{picture}") for inside, picture in named]
    assert len(paths) >= 4
    assert all(path.exists() for path in paths)
