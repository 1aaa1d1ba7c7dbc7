"""Base of every spec: a frozen pydantic model that goes to YAML and back."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Self

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from lpet_sim.errors import SpecError


class Spec(BaseModel):
    """A frozen set of parameters with units in the field names; it never holds a seed."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @classmethod
    def from_yaml(cls, path: Path | str) -> Self:
        """Read the spec from a YAML file.

        Args:
            path: The file.

        Raises:
            SpecError: The file is missing, is not YAML, or holds an unknown key or a bad value.
        """
        return cls.from_mapping(read_yaml(Path(path)), source=str(path))

    @classmethod
    def from_mapping(cls, mapping: object, source: str = "spec") -> Self:
        """Validate a mapping as read from YAML.

        Raises:
            SpecError: An unknown key or a bad value; the sentence names the valid ones.
        """
        try:
            return cls.model_validate(mapping)
        except ValidationError as error:
            raise SpecError(f"{source}: {_first_problem(cls, error)}") from None

    def to_mapping(self) -> dict[str, Any]:
        """Give the spec as plain YAML- and JSON-ready values."""
        return self.model_dump(mode="json")

    def to_yaml(self, path: Path | str) -> None:
        """Write the spec to a YAML file."""
        Path(path).write_text(yaml.safe_dump(self.to_mapping(), sort_keys=False))


def read_yaml(path: Path) -> object:
    """Read a YAML file.

    Raises:
        SpecError: The file cannot be read or is not YAML.
    """
    try:
        return yaml.safe_load(path.read_text())
    except OSError as error:
        reason = error.strerror or str(error)
        raise SpecError(f"cannot read {path}: {reason}; give the path of a YAML file") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        reason = str(error).replace("\n", " ")
        raise SpecError(f"{path} is not valid YAML: {reason}") from None


def _first_problem(cls: type[BaseModel], error: ValidationError) -> str:
    """Turn pydantic's first complaint into one sentence that names what is valid."""
    problem = error.errors(include_url=False)[0]
    where = ".".join(str(part) for part in problem["loc"])
    if problem["type"] == "extra_forbidden":
        owner = _model_at(cls, problem["loc"][:-1])
        return f"unknown key '{where}'; valid keys are {', '.join(owner.model_fields)}"
    given = f", got {problem['input']!r}" if _is_short(problem["input"]) else ""
    return f"'{where or 'spec'}': {problem['msg']}{given}"


def _is_short(value: object) -> bool:
    return isinstance(value, int | float | str | bool) or value is None


def _model_at(cls: type[BaseModel], loc: tuple[int | str, ...]) -> type[BaseModel]:
    """Follow an error's location to the nested model whose key was unknown."""
    model = cls
    for part in loc:
        field = model.model_fields.get(str(part))
        candidates = _models_in(field.annotation) if field is not None else []
        model = candidates[0] if candidates else model
    return model


def _models_in(annotation: object) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    arguments = getattr(annotation, "__args__", ())
    return [model for argument in arguments for model in _models_in(argument)]
