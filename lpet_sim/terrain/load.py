"""Terrain specs by the name of a preset or from a YAML file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lpet_sim.errors import UnknownNameError
from lpet_sim.soil.load import soil_beside
from lpet_sim.spec import read_yaml
from lpet_sim.terrain.spec import TerrainSpec

PRESETS = Path(__file__).with_name("presets")


def preset_names() -> tuple[str, ...]:
    """Name the presets that come with the package."""
    return tuple(sorted(path.stem for path in PRESETS.glob("*.yaml")))


def load_terrain_spec(name_or_path: str | Path) -> TerrainSpec:
    """Load a terrain spec.

    Relative paths of soils and of a DEM are looked for beside the YAML file. Where a DEM is not
    there its path stays as it is, to be looked for in the data folder when the terrain is built.

    Args:
        name_or_path: The name of a preset, or the path of a YAML file.

    Raises:
        UnknownNameError: A name that is neither a preset nor a file.
        SpecError: A file that cannot be read or holds a bad value.
    """
    text = str(name_or_path)
    if text in preset_names():
        return TerrainSpec.from_yaml(PRESETS / f"{text}.yaml")
    path = Path(name_or_path)
    if not path.exists() and path.suffix not in (".yaml", ".yml"):
        raise UnknownNameError("terrain preset", text, preset_names())
    mapping = with_local_files(read_yaml(path), path.resolve().parent)
    return TerrainSpec.from_mapping(mapping, source=str(path))


def named_terrain(value: object) -> object:
    """Let a terrain be a preset's name or a file in place of its fields; for a spec's validator."""
    return load_terrain_spec(value) if isinstance(value, str) else value


def terrain_beside(terrain: object, folder: Path) -> object:
    """Find the files that a terrain as read from YAML names, where they lie in a folder."""
    if not isinstance(terrain, str):
        return with_local_files(terrain, folder)
    return str(folder / terrain) if (folder / terrain).is_file() else terrain


def with_local_files(mapping: Any, folder: Path) -> Any:
    """Give a terrain's mapping with the soils and the DEM that lie in a folder found there.

    Args:
        mapping: A terrain as read from YAML; anything else comes back as it is.
        folder: Where relative paths begin.
    """
    if not isinstance(mapping, dict):
        return mapping
    found, soils, dem = dict(mapping), mapping.get("soils"), mapping.get("dem")
    if isinstance(soils, list):
        found["soils"] = [_with_local_soil(soil, folder) for soil in soils]
    path = dem.get("path") if isinstance(dem, dict) else None
    if isinstance(dem, dict) and isinstance(path, str) and (folder / path).is_file():
        found["dem"] = dem | {"path": str(folder / path)}
    return found


def _with_local_soil(soil_class: object, folder: Path) -> object:
    if not isinstance(soil_class, dict) or "soil" not in soil_class:
        return soil_class
    return soil_class | {"soil": soil_beside(soil_class["soil"], folder)}
