"""Terrain specs by the name of a preset or from a YAML file."""

from __future__ import annotations

from pathlib import Path

from lpet_sim.errors import UnknownNameError
from lpet_sim.terrain.spec import TerrainSpec

PRESETS = Path(__file__).with_name("presets")


def preset_names() -> tuple[str, ...]:
    """Name the presets that come with the package."""
    return tuple(sorted(path.stem for path in PRESETS.glob("*.yaml")))


def load_terrain_spec(name_or_path: str | Path) -> TerrainSpec:
    """Load a terrain spec.

    A DEM's relative path is looked for beside the YAML file; where it is not there it stays as it
    is, to be looked for in the data folder when the terrain is built.

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
    return _with_local_dem(TerrainSpec.from_yaml(path), path.resolve().parent)


def _with_local_dem(spec: TerrainSpec, folder: Path) -> TerrainSpec:
    if spec.dem is None or not (folder / spec.dem.path).exists():
        return spec
    dem = spec.dem.model_copy(update={"path": str(folder / spec.dem.path)})
    return spec.model_copy(update={"dem": dem})
