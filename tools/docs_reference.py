"""A hook of mkdocs: it makes the pages of the reference from the code when the site is built."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[1]
PACKAGES = ("lpet_sim", "estimators")


def on_config(config: Any) -> Any:
    """Add the reference to the navigation."""
    rooms = [{room: f"reference/{room}.md"} for room, _ in rooms_of()]
    config.nav.append({"Reference": [{"Command line": "reference/cli.md"}, *rooms]})
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add a page for the command line, and one for each room of the code."""
    files.append(File.generated(config, "reference/cli.md", content=command_page()))
    for room, modules in rooms_of():
        text = f"# {room}\n\n" + "\n\n".join(f"::: {module}" for module in modules) + "\n"
        files.append(File.generated(config, f"reference/{room}.md", content=text))
    return files


def rooms_of() -> Iterator[tuple[str, list[str]]]:
    """Give each room with the modules in it that have anything public."""
    for package in PACKAGES:
        folders = [ROOT / package, *sorted(p for p in (ROOT / package).iterdir() if p.is_dir())]
        for folder in folders:
            modules = [_module(path) for path in sorted(folder.glob("*.py")) if _is_public(path)]
            if modules:
                yield ".".join(folder.relative_to(ROOT).parts), modules


def _module(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _is_public(path: Path) -> bool:
    named = ast.FunctionDef | ast.ClassDef
    body = ast.parse(path.read_text()).body
    return any(isinstance(node, named) and not node.name.startswith("_") for node in body)


def command_page() -> str:
    """Write every command with its arguments and options, as the code declares them."""
    from lpet_sim.cli import app

    lines = [
        "# Command line",
        "",
        "Every command ends with exit code 0, with 1 where it was asked to",
    ]
    lines += ["check and the verdict is FAIL, and with 2 and one sentence on bad input.", ""]
    for words, command in _commands(typer.main.get_command(app), ("lpet",)):
        lines += [f"## {' '.join(words)}", "", _plain(command.help), ""]
        rows = [_row(parameter) for parameter in command.params if parameter.name != "help"]
        if rows:
            lines += ["| | default | |", "|---|---|---|", *rows, ""]
    return "\n".join(lines)


def _commands(command: Any, words: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], Any]]:
    inner = getattr(command, "commands", None)
    if inner is None:
        yield words, command
        return
    for name in sorted(inner):
        yield from _commands(inner[name], (*words, name))


def _row(parameter: Any) -> str:
    names = (
        parameter.opts
        if parameter.param_type_name == "option"
        else [parameter.metavar or parameter.name]
    )
    default = "" if callable(parameter.default) else parameter.default
    shown = "" if default is None or parameter.required else f"`{default}`"
    return f"| `{', '.join(names)}` | {shown} | {_plain(getattr(parameter, 'help', ''))} |"


def _plain(text: str | None) -> str:
    return (text or "").replace("|", "\\|").replace("\n", " ").replace("  ", " ").strip()
