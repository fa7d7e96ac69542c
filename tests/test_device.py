from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from conftest import DEVICE

from ctrlgen import InputError, build_model, load_device
from ctrlgen.devices.changed_numbers import changed
from ctrlgen.devices.quantities import member_at


def faults(tmp_path, *edits: tuple[str, str]) -> dict[str, str]:
    """Faults of the device file after textual edits, by their place."""
    text = DEVICE.read_text()
    for old, new in edits:
        assert old in text
        text = text.replace(old, new, 1)
    path = tmp_path / "device.toml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        load_device(path)
    return {fault.where: fault.what for fault in caught.value.faults}


def test_every_number_of_the_device_has_a_source_or_stands_in_a_sourced_table(device):
    missing = [path for path, q in device.quantities() if q.source is None]
    assert all(path.startswith("stage.notch.") or "_angles[" in path for path in missing)


def test_all_faults_are_listed_at_once_each_with_its_place_and_a_remedy(tmp_path):
    found = faults(
        tmp_path,
        ('young             = { value = "130 GPa"', 'young             = { value = "130 N"'),
        ("lever_short  ", "lever_shrot  "),
        ('poisson            = { value = "0.28"', 'poisson            = { value = "0.7"'),
        ('wire_length        = { value = "0.08 mm"', 'wire_length        = { value = "-0.08 mm"'),
        ('stroke               = { value = "55 um"', "stroke               = { value = 55"),
        ('drive = "power"', 'drive = "current"'),
    )
    assert "wrong unit" in found["actuator.young"] and "GPa" in found["actuator.young"]
    assert "did you mean 'lever_short'" in found["stage.lever_shrot"]
    assert "missing" in found["stage.lever_short"]
    assert "out of bounds; it must be >= 0 and <= 0.5" in found["hexapod.poisson"]
    assert "out of bounds; it must be > 0 um" in found["hexapod.wire_length"]
    assert "no unit" in found["stage.stroke"]
    assert "'power' or 'voltage'" in found["actuator.drive"]
    assert len(found) == 7


@pytest.mark.parametrize(
    ("edit", "says"),
    [
        (
            ('lever_short          = { value = "100 um"', 'lever_short          = { value = "1.5 mm"'),
            "lever multiplies",
        ),
        (('temperature_limit = { value = "550 degC"', 'temperature_limit = { value = "10 degC"'), "can only heat"),
        (('stroke               = { value = "55 um"', 'stroke               = { value = "1.2 mm"'), "asin"),
        (('wire_length        = { value = "0.08 mm"', 'wire_length        = { value = "3 mm"'), "two wires"),
        (('notch_radius         = { value = "40 um"', 'notch_radius         = { value = "600 um"'), "two notches"),
    ],
)
def test_values_that_cannot_stand_together_are_refused(tmp_path, edit, says):
    assert says in "".join(faults(tmp_path, edit).values())


def test_an_unknown_kind_names_the_known_ones(tmp_path):
    assert "mems_hexapod" in faults(tmp_path, ('kind = "mems_hexapod"', 'kind = "octopod"'))["kind"]


def test_a_syntax_error_names_its_line(tmp_path):
    assert "line 1" in faults(tmp_path, ("# NIST", "NIST"))["syntax"]


def test_an_effect_with_faults_names_them_all(tmp_path):
    text = '\n[[effect]]\nkind = "creep"\ngain = "30"\ntua = "1 s"\n'
    found = faults(tmp_path, ("[actuator]", "[actuator]"), ("[hexapod]", f"{text}\n[hexapod]"))
    message = found["effect[0]"]
    assert "'tua'" in message and "tau is missing" in message and "outside" in message and "at is missing" in message


def test_an_unknown_effect_lists_the_library(tmp_path):
    found = faults(tmp_path, ("[hexapod]", '[[effect]]\nkind = "gremlin"\nat = "1X"\n\n[hexapod]'))
    assert "creep" in found["effect[0]"]


def test_an_effect_at_a_place_that_does_not_exist_is_refused():
    from conftest import effect_device

    with pytest.raises(InputError, match="'4X' is not one of 1X, 1Y"):
        build_model(effect_device({"kind": "drive_gain", "at": "4X", "gain": 0.1}))
    with pytest.raises(InputError, match="wrong unit at theta_x: rad is needed"):
        build_model(effect_device({"kind": "home_offset", "at": "theta_x", "offset": "1 um"}))


def test_a_free_parameter_that_does_not_exist_is_refused(device):
    with pytest.raises(InputError, match=r"stage\.colour"):
        build_model(device, free=["stage.colour"])


@pytest.mark.parametrize("path", sorted(DEVICE.parent.glob("*.toml")), ids=lambda p: p.stem)
def test_a_path_leads_to_the_number_that_it_names_and_changes_that_one_alone(path):
    device = load_device(path)
    numbers = dict(device.quantities())
    for name in list(numbers)[:: max(len(numbers) // 4, 1)]:
        number = numbers[name]
        assert member_at(device, name) is number
        other = dict(changed(device, {name: number.si + 1.0}).quantities())
        assert other.pop(name).si == number.si + 1.0
        assert other == {key: kept for key, kept in numbers.items() if key != name}


def test_distances_from_a_limit_count_in_its_range_or_in_its_only_bound(device):
    (stroke,) = (limit for limit in build_model(device).limits if limit.name == "stroke")
    assert replace(stroke, lower=-2.0, upper=3.0).span == 5.0
    assert replace(stroke, lower=None, upper=3.0).span == replace(stroke, lower=-3.0, upper=None).span == 3.0
    assert replace(stroke, lower=0.0, upper=None).span == 0.0
    assert replace(stroke, lower=None, upper=3.0).bounds == (-np.inf, 3.0)
