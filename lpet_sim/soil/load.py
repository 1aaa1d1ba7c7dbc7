"""Soils, wheels and published curves by their name in the library, or from a YAML file."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from lpet_sim.errors import UnknownNameError
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
