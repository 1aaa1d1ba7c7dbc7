"""What the documentation says is run: tutorials as they stand, commands as far as they go."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer

from lpet_sim.cli import app

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.glob("*.md"))
TUTORIALS = ("first_traverse.md", "reading_a_recording.md")
"""Pages that are run from top to bottom, the second one where the first has left its files."""
_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```", re.DOTALL | re.MULTILINE)
_NAMED = re.compile(r"into `([\w.]+)`:\s*\Z")
_COMMAND = re.compile(r"^\s*(?:\$ )?((?:lpet |python -m scenarios\.)[^\n]*)$", re.MULTILINE)


def test_tutorials_run_as_they_stand(tmp_path: Path) -> None:
    """Every block of them: YAML into the file that is named, commands, and Python."""
    names: dict[str, Any] = {}
    for page in TUTORIALS:
        text = (DOCS / page).read_text()
        for block in _BLOCK.finditer(text):
            _run_block(block[1], block[2], text[: block.start()], tmp_path, names)
    assert (tmp_path / "first.rrd").stat().st_size > 10_000
    assert names["first"].shape[1] == 3


def _run_block(kind: str, code: str, before: str, folder: Path, names: dict[str, Any]) -> None:
    if kind == "yaml":
        named = _NAMED.search(before)
        assert named is not None, f"no file is named for:\n{code}"
        (folder / named[1]).write_text(code)
    elif kind == "sh":
        for line in code.splitlines():
            _run(shlex.split(line), folder)
    elif kind == "python":
        here = Path.cwd()
        os.chdir(folder)
        try:
            exec(compile(code, "page", "exec"), names)
        finally:
            os.chdir(here)


def _run(words: list[str], folder: Path) -> None:
    assert words[0] == "lpet"
    command = [sys.executable, "-c", "from lpet_sim.cli import main; main()", *words[1:]]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{' '.join(words)}: {done.stderr}"


def _command(words: list[str]) -> Any:
    """Find a command and give its options, with what is left of the words."""
    found: Any = typer.main.get_command(app)
    rest = words[1:]
    while getattr(found, "commands", None):
        assert rest and rest[0] in found.commands, f"there is no '{' '.join(words)}'"
        found, rest = found.commands[rest[0]], rest[1:]
    return found, rest


@pytest.mark.parametrize("page", [*PAGES, ROOT / "README.md"], ids=lambda page: page.name)
def test_commands_on_a_page_are_there(page: Path) -> None:
    """Each names a command, options that it has, and files of the repository that are there."""
    for line in _COMMAND.findall(page.read_text()):
        words = shlex.split(line.split("#")[0].replace("|", " "))
        if words[0] == "python":
            module = words[2].rstrip(".,;:`")
            assert (ROOT / f"{module.replace('.', '/')}.py").exists(), line
            continue
        if len(words) < 2 or not re.fullmatch(r"[a-z-]+", words[1]):
            continue
        found, rest = _command([word for word in words if word != "--help"])
        options = {name for p in found.params for name in [*p.opts, *p.secondary_opts]}
        asked = [w.split("=")[0].strip("[]") for w in rest if w.strip("[").startswith("--")]
        assert [name for name in asked if name not in options] == [], line
        for word in rest:
            if word.startswith(("scenarios/", "models/")):
                assert (ROOT / word).exists(), line


def test_the_site_is_built_without_a_warning(tmp_path: Path) -> None:
    """All pages are in its navigation, no link leads nowhere, and nothing is asked from outside."""
    pytest.importorskip("mkdocs")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "-q", "-d", str(tmp_path)]
    told = os.environ | {"NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env=told, check=False)
    assert done.returncode == 0, done.stderr
    pages = list(tmp_path.rglob("*.html"))
    assert {"index.html", "cli.html", "lpet_sim.plugins.html"} <= {page.name for page in pages}
    asked = re.compile(r'(?:src|href)="(https?://[^"]+\.(?:js|css|woff2?|png|jpg))"')
    assert [found for page in pages for found in asked.findall(page.read_text())] == []
