"""Soils, wheels and published curves by their name in the library, or from a YAML file."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Annotated

from pydantic import BeforeValidator

from lpet_sim.errors import LpetError, UnknownNameError
from lpet_sim.soil.published import PublishedCurve, ReferenceWheelSpec
from lpet_sim.soil.spec import SoilSpec
from lpet_sim.spec import Spec, read_yaml

LIBRARY = Path(__file__).with_name("library")


class _SoilFile(Spec):
    soil: SoilSpec


def soil_names() -> tuple[str, ...]:
    """Name the soils that come with the package."""
    return _names(LIBRARY)


def wheel_names() -> tuple[str, ...]:
    """Name the test wheels that come with the package."""
    return _names(LIBRARY / "wheels")


@lru_cache(maxsize=64)
def load_soil(name_or_path: str | Path) -> SoilSpec:
    """Load a soil; a file is read once for each process.

    Args:
        name_or_path: The name of a soil of the library, or the path of a YAML file.

    Raises:
        UnknownNameError: A name that is neither in the library nor a file.
        SpecError: A file that cannot be read or holds a bad value.
    """
    path = _find("soil", name_or_path, LIBRARY)
    return _SoilFile.from_mapping({"soil": read_yaml(path)}, source=str(path)).soil


def _soil_by_name(soil: object) -> object:
    """Put a soil in place of its name, so that a manifest holds every number."""
    try:
        return load_soil(soil) if isinstance(soil, str) else soil
    except LpetError as error:
        raise ValueError(str(error)) from None


NamedSoil = Annotated[SoilSpec, BeforeValidator(_soil_by_name)]
"""A soil's numbers; in a file also the name of one of the library, or the path of a YAML file."""


def soil_beside(soil: object, folder: Path) -> object:
    """Give the path of a soil's file in a folder, if that is what a text names.

    As in `load_soil` the library goes first: a file that is called as one of its soils is not
    taken.

    Args:
        soil: What stands for a soil in a file; all but the name of a file there comes back as it
            is.
        folder: Where relative paths begin.
    """
    if not isinstance(soil, str) or soil in soil_names():
        return soil
    return str(folder / soil) if (folder / soil).is_file() else soil


def load_wheel(name_or_path: str | Path) -> ReferenceWheelSpec:
    """Load a wheel with the load and the gravity of its test.

    Args:
        name_or_path: The name of a wheel of the library, or the path of a YAML file.

    Raises:
        UnknownNameError: A name that is neither in the library nor a file.
        SpecError: A file that cannot be read or holds a bad value.
    """
    return ReferenceWheelSpec.from_yaml(_find("wheel", name_or_path, LIBRARY / "wheels"))


def published_curves(soil_name: str) -> tuple[PublishedCurve, ...]:
    """Give what others measured on a soil, to be drawn beside a simulated curve.

    Args:
        soil_name: The soil's name in the library; one without published curves gives none.
    """
    paths = sorted((LIBRARY / "published").glob("*.yaml"))
    curves = (PublishedCurve.from_yaml(path) for path in paths)
    return tuple(curve for curve in curves if soil_name in curve.soils)


def _names(folder: Path) -> tuple[str, ...]:
    return tuple(sorted(path.stem for path in folder.glob("*.yaml")))


def _find(kind: str, name_or_path: str | Path, folder: Path) -> Path:
    if str(name_or_path) in _names(folder):
        return folder / f"{name_or_path}.yaml"
    path = Path(name_or_path)
    if not path.exists() and path.suffix not in (".yaml", ".yml"):
        raise UnknownNameError(kind, str(name_or_path), _names(folder))
    return path
