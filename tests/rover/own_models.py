"""Descriptions of rovers written to files, as a user has them."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import yaml

from lpet_sim.rover.model_spec import models_folder
from lpet_sim.spec import read_yaml


def description(name: str, **changes: Any) -> dict[str, Any]:
    """Give the description of one of our rovers as a mapping, changed."""
    found = read_yaml(models_folder() / f"{name}.yaml")
    assert isinstance(found, dict)
    return found | changes


def written(folder: Path, mapping: dict[str, Any], name: str = "mine.yaml") -> str:
    """Write a description, and the model that it names beside it; give its path."""
    model = models_folder() / mapping["model"]
    if model.is_file():
        shutil.copy(model, folder)
    path = folder / name
    path.write_text(yaml.safe_dump(mapping))
    return str(path)


def changed(folder: Path, name: str, **changes: Any) -> str:
    """Write one of our rovers under another description."""
    return written(folder, description(name, **changes))


def foreign_exomars(folder: Path) -> str:
    """Describe our own rover's model as if it were someone else's, with our motors."""
    wheels = [
        {"name": n, "drive": f"drive_{n}", "steer": f"steer_{n}"}
        for n in (f"{end}_{side}" for end in ("front", "middle", "rear") for side in _SIDES)
    ]
    motors = {
        "drive_stiffness_nm_rad": 2000.0,
        "drive_damping_nms_rad": 40.0,
        "drive_torque_nm": 60.0,
        "drive_armature_kgm2": 0.7,
        "steer_stiffness_nm_rad": 4000.0,
        "steer_torque_nm": 150.0,
        "steer_armature_kgm2": 0.5,
    }
    mapping = {
        "model": "exomars.xml",
        "wheels": wheels,
        "imu": {"site": "imu"},
        "camera": {"site": "camera", "optical": True},
        "camera_right": {"site": "camera_right", "optical": True},
        "belly": {"centre_m": [0.0, 0.0, 0.11], "half_size_m": [0.33, 0.40, 0.03]},
        "suspension": ["bogie_left", "bogie_right", "bogie_rear"],
        "motors": motors,
    }
    return written(folder, mapping, "foreign.yaml")


_SIDES = ("left", "right")
