"""The parts of a machine may be named by other words of the field."""

from __future__ import annotations

from typing import get_args

import pytest
from pydantic import ValidationError

from ctrlgen.devices.machine import ActuatorName, Machine, SensorName, TransmissionName
from ctrlgen.devices.part_names import OTHER_WORDS

KINDS = {"actuator": ActuatorName, "transmission": TransmissionName, "sensor": SensorName}


def kind_of(name):
    (kind,) = [kind for kind, names in KINDS.items() if name in get_args(names)]
    return kind


@pytest.mark.parametrize("name", OTHER_WORDS)
def test_every_word_for_a_part_is_that_part_in_any_case_and_with_any_hyphens(name):
    for word in (name, *OTHER_WORDS[name]):
        for written in (word, word.upper(), word.title(), word.replace(" ", "-"), word.replace("-", " "), f" {word} "):
            assert getattr(Machine.model_validate({kind_of(name): written}), kind_of(name)) == name, written


def test_no_word_stands_for_two_parts():
    words = [word.casefold() for name, others in OTHER_WORDS.items() for word in (name, *others)]
    assert len(words) == len(set(words)) and "" not in words


def test_several_parts_in_a_row_are_understood_too():
    assert Machine.model_validate({"transmission": ["ball screw", "Rack-and-Pinion"]}).transmission == ("screw", "rack")


@pytest.mark.parametrize(
    "stated", [{"actuator": "encoder"}, {"sensor": "ball screw"}, {"sensor": "thermometer"}, {"actuator": 3}]
)
def test_a_part_of_another_kind_or_of_none_is_a_fault(stated):
    with pytest.raises(ValidationError):
        Machine.model_validate(stated)
