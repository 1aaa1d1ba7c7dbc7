"""Specs: frozen, to YAML and back, and every mistake in one clear sentence."""

from pathlib import Path
from typing import Literal, Self

import pytest
from pydantic import Field, ValidationError, model_validator

from lpet_sim.errors import SpecError
from lpet_sim.spec import Spec


class Lens(Spec):
    """An inner spec."""

    focal_px: float = Field(default=800.0, gt=0)


class Box(Spec):
    """Another inner spec, one of a union."""

    kind: Literal["box"] = "box"
    edge_m: float = 1.0
    finish: Literal["matt", "bright"] = "matt"

    @model_validator(mode="after")
    def _small(self) -> Self:
        if self.edge_m > 9.0:
            raise ValueError("edge_m must be at most 9: it does not fit")
        return self


class Ball(Spec):
    """The other of the union."""

    kind: Literal["ball"] = "ball"
    radius_m: float = 1.0


class Route(Spec):
    """A spec with a key that must be there."""

    goal_m: float


class Device(Spec):
    """An outer spec."""

    name: str = "mast"
    lens: Lens = Lens()
    lenses: tuple[Lens, ...] = ()
    spare: Lens | None = None
    shape: Box | Ball = Field(default=Box(), discriminator="kind")


def _sentence(mapping: object) -> str:
    with pytest.raises(SpecError) as caught:
        Device.from_mapping(mapping, source="device.yaml")
    return str(caught.value)


def test_a_spec_goes_to_yaml_and_back(tmp_path: Path) -> None:
    """Nested ones, tuples and the chosen one of a union too."""
    device = Device(lens=Lens(focal_px=1223.0), lenses=(Lens(), Lens(focal_px=2)), shape=Ball())
    device.to_yaml(tmp_path / "device.yaml")
    assert Device.from_yaml(tmp_path / "device.yaml") == device


def test_a_spec_cannot_be_changed() -> None:
    """Neither by a known name nor by a new one."""
    device = Device()
    with pytest.raises(ValidationError, match="frozen"):
        device.name = "other"  # type: ignore[misc]
    with pytest.raises(ValidationError):
        device.other = 1  # type: ignore[attr-defined]


def test_an_unknown_key_names_the_valid_ones() -> None:
    """At the top."""
    sentence = _sentence({"lense": {}})
    assert sentence.startswith(
        "device.yaml: unknown key 'lense'; valid keys are name, lens, lenses"
    )


def test_an_unknown_key_inside_names_the_keys_of_the_inner_spec() -> None:
    """Of a nested one, of an optional one, of one in a list and of the one chosen of a union."""
    assert "'lens.focal'; valid keys are focal_px" in _sentence({"lens": {"focal": 1}})
    assert "'spare.focal'; valid keys are focal_px" in _sentence({"spare": {"focal": 1}})
    assert "'lenses.1.focal'; valid keys are focal_px" in _sentence({"lenses": [{}, {"focal": 1}]})
    union = _sentence({"shape": {"kind": "ball", "edge_m": 1}})
    assert "unknown key 'shape.edge_m'; valid keys are kind, radius_m" in union


def test_a_wrong_key_is_told_before_the_one_that_it_stands_for_is_missed() -> None:
    """Whoever mistypes a key that must be there is told of what was typed."""
    with pytest.raises(SpecError, match="unknown key 'goal'; valid keys are goal_m"):
        Route.from_mapping({"goal": 3.0})
    with pytest.raises(SpecError, match="'goal_m': Field required"):
        Route.from_mapping({})


def test_a_value_out_of_range_names_the_field_the_limit_and_the_value() -> None:
    """One sentence of one line."""
    sentence = _sentence({"lens": {"focal_px": -3.0}})
    assert sentence == "device.yaml: 'lens.focal_px': Input should be greater than 0, got -3.0"


def test_a_value_of_the_wrong_type_and_one_that_is_not_finite_are_refused() -> None:
    """Words for numbers, and infinities."""
    assert "'lens.focal_px'" in _sentence({"lens": {"focal_px": "long"}})
    assert "finite" in _sentence({"lens": {"focal_px": float("inf")}})
    assert "'box', 'ball'" in _sentence({"shape": {"kind": "cone"}})
    assert "'shape' lacks 'kind': one of ball, box" in _sentence({"shape": {}})


def test_a_refusal_of_our_own_is_told_in_its_own_words() -> None:
    """Behind the key that it is about, without what the library puts around it."""
    sentence = _sentence({"shape": {"kind": "box", "edge_m": 10.0}})
    assert sentence == "device.yaml: 'shape': edge_m must be at most 9: it does not fit"
    with pytest.raises(SpecError, match=r"^box\.yaml: edge_m must be at most 9: it does not fit$"):
        Box.from_mapping({"edge_m": 10.0}, source="box.yaml")


def test_a_value_in_place_of_a_mapping_is_told_in_plain_words() -> None:
    """A nested spec, a member of a union, the whole."""
    expected = "must be a mapping of keys to values"
    lens, device = ", ".join(Lens.model_fields), ", ".join(Device.model_fields)
    valid = f"valid keys are {lens}"
    assert _sentence({"lens": 3}) == f"device.yaml: 'lens': {expected}, got 3; {valid}"
    assert _sentence({"shape": "box"}) == f"device.yaml: 'shape': {expected}, got 'box'"
    assert _sentence([1]) == f"device.yaml: 'spec': {expected}; valid keys are {device}"
