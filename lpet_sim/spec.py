"""Base of every spec: a frozen pydantic model that goes to YAML and back."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Self, get_args

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

from lpet_sim.errors import SpecError

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

_NO_MAPPING: Final = ("model_type", "model_attributes_type", "dict_type")


class Spec(BaseModel):
    """A frozen set of parameters with units in the field names; it never holds a seed."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @classmethod
    def from_yaml(cls, path: Path | str) -> Self:
        """Read the spec from a YAML file; the files that it names are looked for beside it.

        Args:
            path: The file.

        Raises:
            SpecError: A file is missing, is not YAML, or holds an unknown key or a bad value.
        """
        mapping, folder = read_yaml(Path(path)), Path(path).resolve().parent
        if isinstance(mapping, dict):
            mapping = cls.files_beside(mapping, folder)
        return cls.from_mapping(mapping, source=str(path))

    @classmethod
    def files_beside(cls, mapping: dict[str, Any], folder: Path) -> dict[str, Any]:  # noqa: ARG003
        """Find the files that a mapping names; a spec that may name some has its own.

        Args:
            mapping: The spec as read from YAML, not yet validated.
            folder: Where its YAML file lies.
        """
        return mapping

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


def read_fields(path: Path) -> dict[str, Any]:
    """Read a YAML file that holds a mapping: the fields of a spec that is not known yet.

    Raises:
        SpecError: The file cannot be read, is not YAML, or holds no mapping.
    """
    fields = read_yaml(path)
    if not isinstance(fields, dict):
        raise SpecError(f"{path}: must be a mapping of keys to values")
    return fields


def _first_problem(cls: type[BaseModel], error: ValidationError) -> str:
    """Turn a complaint of pydantic's into one sentence that names what is valid.

    The first one, but an unknown key before all: what is missing may be what it should have been.
    """
    problems = error.errors(include_url=False)
    unknown = [problem for problem in problems if problem["type"] == "extra_forbidden"]
    problem = (unknown or problems)[0]
    owner, inside, where = _follow(cls, problem["loc"])
    if problem["type"] == "extra_forbidden":
        return f"unknown key '{where}'; valid keys are {', '.join(owner.model_fields)}"
    if problem["type"] == "union_tag_not_found":
        key = problem["ctx"]["discriminator"]
        kinds = sorted({tag for model in inside for tag in _literals(model, key.strip("'"))})
        return f"'{where}' lacks {key}: one of {', '.join(kinds)}"
    if problem["type"] == "value_error":
        return (f"'{where}': " if where else "") + str(problem["ctx"]["error"])
    if problem["type"] in _NO_MAPPING:
        said = f"'{where or 'spec'}': must be a mapping of keys to values{_given(problem)}"
        named = problem["type"] == "dict_type"
        keys = inside[0].model_fields if len(inside) == 1 and not named else ()
        return f"{said}; valid keys are {', '.join(keys)}" if keys else said
    return f"'{where or 'spec'}': {problem['msg']}{_given(problem)}"


def _given(problem: ErrorDetails) -> str:
    """Give the tail that shows the value, if it is short."""
    value = problem["input"]
    short = isinstance(value, int | float | str | bool) or value is None
    return f", got {value!r}" if short else ""


def _follow(
    cls: type[BaseModel], loc: tuple[int | str, ...]
) -> tuple[type[BaseModel], list[type[BaseModel]], str]:
    """Follow an error's location to the nested model that owns its last key.

    Pydantic puts the tag of the chosen member of a union into the location, which is no key of the
    file: it picks the member here and is left out of the path.

    Returns:
        The model, the models that may stand under the key, and the path of keys in the file.
    """
    owner, inside, keys = cls, [cls], list[str]()
    for part in loc:
        tagged = [model for model in inside if part in _tags(model)] if keys else []
        if tagged:
            inside = tagged[:1]
            continue
        keys.append(str(part))
        if isinstance(part, str) and inside:
            owner = inside[0]
            field = owner.model_fields.get(part)
            # What is no field is a name in a mapping of models, or unknown: the models stay.
            inside = _models_in(field.annotation) if field is not None else inside
    return owner, inside, ".".join(keys)


def _tags(model: type[BaseModel]) -> set[str]:
    """Give what pydantic may call a member of a union: its name, or a literal that tells it."""
    return {model.__name__}.union(*(_literals(model, key) for key in model.model_fields))


def _literals(model: type[BaseModel], key: str) -> set[str]:
    field = model.model_fields.get(key)
    tags = get_args(field.annotation) if field is not None else ()
    return {tag for tag in tags if isinstance(tag, str)}


def _models_in(annotation: object) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    arguments = getattr(annotation, "__args__", ())
    return [model for argument in arguments for model in _models_in(argument)]
