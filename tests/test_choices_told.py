"""A word that a file may not hold is one fault, at its key, with the words that it may be and the one that was meant."""

from __future__ import annotations

import tomllib
from typing import get_args

import pytest
from conftest import AXIS_FILE

from ctrlgen.core.errors import InputError
from ctrlgen.core.files import validate
from ctrlgen.devices import Device, load_device
from ctrlgen.effects import Effect

AXIS = tomllib.loads(AXIS_FILE.read_text())
MODEL = type(load_device(AXIS_FILE))
MACHINE = next(m for m in get_args(MODEL.model_fields["machine"].annotation) if hasattr(m, "model_fields"))


def words(annotation) -> tuple[str, ...]:
    """The words of a choice, however deep in a union they stand."""
    found = [members for member in (annotation, *get_args(annotation)) if (members := get_args(member))]
    return next(texts for texts in found if all(isinstance(text, str) for text in texts))


CHOICES = {name: words(field.annotation) for name, field in MACHINE.model_fields.items()}
every_choice = pytest.mark.parametrize("key", CHOICES)


def faults(key: str, value) -> list[tuple[str, str]]:
    with pytest.raises(InputError) as told:
        validate(
            MODEL,
            {k: v for k, v in AXIS.items() if k != "kind"} | {"kind": "axis", "machine": {key: value}},
            "device.toml",
        )
    return [(fault.where, fault.what) for fault in told.value.faults]


@every_choice
@pytest.mark.parametrize("value", ["magnetic spring", "", 3, True, {"a": 1}])
def test_what_is_no_choice_is_one_fault_at_its_key(key, value):
    found = faults(key, value)
    assert [where for where, _ in found] in ([f"machine.{key}"], [f"machine.{key}.a"])
    assert "[" not in found[0][0] and all("literal" not in what for _, what in found)
    if isinstance(value, str | int):
        assert all(f"'{word}'" in found[0][1] for word in CHOICES[key])


@every_choice
def test_a_word_that_is_nearly_one_is_told_which_was_meant(key):
    for word in CHOICES[key]:
        assert faults(key, word + "x")[0][1].endswith(f"did you mean {word!r}?"), word


def test_a_wrong_word_among_several_is_named_by_its_number():
    assert [where for where, _ in faults("transmission", ["flexure", "spring"])] == ["machine.transmission[1]"]


@pytest.mark.parametrize("law", Effect.library.values(), ids=Effect.library)
def test_the_example_of_a_number_that_is_missing_lies_well_within_its_bounds(law):
    for p in law.params:
        low, high = p.bounds
        assert low + 1e-3 * (high - low) * (low <= 0) <= p.example <= high - 1e-3 * (high - low)
        assert not low > 0 or low * 1.01 < p.example


def test_the_example_is_told_and_can_be_written_as_it_stands():
    given = {"kind": "amplifier_lag", "at": "axis", "share": "1", "damping": "1"}
    with pytest.raises(InputError, match=r'write for example tau = "0.1 s"'):
        validate(MODEL, AXIS | {"effect": [given]}, "device.toml")
    assert isinstance(validate(MODEL, AXIS | {"effect": [given | {"tau": "0.1 s"}]}, "device.toml"), Device)


@every_choice
def test_of_a_word_that_is_near_none_it_is_told_that_the_key_may_be_left_out(key):
    assert faults(key, "magnetic spring")[0][1].endswith(f"; leave {key} out where none is meant")
