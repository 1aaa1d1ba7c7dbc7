"""A chain of stages, each with a product on the disk that the user may replace.

A stage is made if its product is missing, or was made from something else than what stands there
now. A product that is not as the stage left it is the user's own: it is never written over, and
what hangs on it is made anew.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

from lpet_sim.errors import OutputError
from lpet_sim.outputs import output_folder, whole_file

STAMPS: Final = "stamps"
State = Literal["made", "kept", "yours"]
Products = Mapping[str, Path]


@dataclass(frozen=True)
class Stage:
    """A step of the chain.

    Attributes:
        name: Its name.
        product: Name of the file or folder that it makes, within the study's folder.
        needs: Names of the earlier stages whose products it reads.
        depends_on: What else decides its product, ready for JSON.
        make: Makes the product at a path from those it needs; a file is to be written whole or not
            at all, a folder may be filled piece by piece over several calls.
    """

    name: str
    product: str
    needs: tuple[str, ...]
    depends_on: Any
    make: Callable[[Products, Path], None]


@dataclass(frozen=True)
class StageResult:
    """What became of a stage.

    Attributes:
        name: Its name.
        path: Its product.
        state: ``made`` now, ``kept`` from before, or the user's own.
    """

    name: str
    path: Path
    state: State


def run_stages(stages: Sequence[Stage], folder: Path) -> list[StageResult]:
    """Bring every product of a chain up to date; the same call after a kill goes on.

    Args:
        stages: The stages, each after those that it needs.
        folder: Where their products are.

    Raises:
        OutputError: The folder cannot be written, or a stage left no product.
    """
    home, done = output_folder(folder), dict[str, StageResult]()
    for stage in stages:
        products = {name: done[name].path for name in stage.needs}
        done[stage.name] = _brought_up_to_date(stage, products, home)
    return list(done.values())


def _brought_up_to_date(stage: Stage, products: Products, home: Path) -> StageResult:
    path, key = home / stage.product, _key(stage, products)
    stamp = home / STAMPS / f"{stage.name}.json"
    state = _state(path, stamp, key)
    if state == "made":
        _make_room(path, stamp, key)
        stage.make(products, path)
        if not path.exists():
            raise OutputError(f"the stage '{stage.name}' left no {path}")
        _write(stamp, {"key": key, "product": digest(path)})
    return StageResult(stage.name, path, state)


def _state(path: Path, stamp: Path, key: str) -> State:
    """Tell whether a product is to be made, stands, or is the user's own."""
    if not path.exists():
        return "made"
    known = json.loads(stamp.read_text()) if stamp.exists() else {"key": "", "product": ""}
    if known["product"] is None:
        return "made"
    if known["product"] != digest(path):
        return "yours"
    return "kept" if known["key"] == key else "made"


def _make_room(path: Path, stamp: Path, key: str) -> None:
    """Note that a product is under way; what is left of another one goes.

    A folder is filled over several calls: what an earlier call of the same stage left stays, and
    until the folder is whole it is nobody's own.
    """
    if path.is_dir() and (not stamp.exists() or json.loads(stamp.read_text())["key"] != key):
        shutil.rmtree(path)
    _write(stamp, {"key": key, "product": None})


def _write(stamp: Path, known: dict[str, str | None]) -> None:
    with whole_file(stamp) as temporary:
        temporary.write_text(json.dumps(known))


def _key(stage: Stage, products: Products) -> str:
    needed = {name: digest(path) for name, path in products.items()}
    text = json.dumps([stage.name, stage.depends_on, needed], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def digest(path: Path) -> str:
    """Name the content of a file, or of all files in a folder but hidden ones."""
    if path.is_file():
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    inner = sorted(p for p in path.rglob("*") if p.is_file() and not p.name.startswith("."))
    parts = [f"{p.relative_to(path)} {digest(p)}" for p in inner]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()
