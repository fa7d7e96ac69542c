"""Units of a law's numbers at a channel: `channel`, `travel` and `partner` are dimensions of their own in its unit."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from effect_cases import every_effect, place_of
from pydantic import BaseModel

from ctrlgen.core.errors import InputError
from ctrlgen.core.files import validate
from ctrlgen.core.units import same_dimension, split_unit, written_unit
from ctrlgen.devices.tested_axis import Mass
from ctrlgen.devices.travel import TravelOrTurn
from ctrlgen.effects import Channel, Param, Place, State, faults_at, read_effect

# A drive of typically 50 V beside a heater of 0.2 W, on a stage that travels 20 um: no power of one is another's.
DRIVE = Channel("1X", "V", 50.0, "um", 2e-5, "1Y", "mW", 0.2)


def param(unit: str) -> Param:
    return Param("number", unit, (-1.0, 1.0), "a number", off=0.0)


@pytest.mark.parametrize(
    ("unit", "here", "si"),
    [
        ("channel", "V", 50.0),
        ("travel", "um", 2e-5),
        ("partner", "mW", 0.2),
        ("V/partner", "V/mW", 1 / 0.2),
        ("A*partner", "A*mW", 0.2),
        ("mol/partner^2", "mol/mW^2", 1 / 0.2**2),
        ("cd*travel", "cd*um", 2e-5),
        ("N/travel^3", "N/um^3", 1 / 2e-5**3),
        ("mN/travel^3", "mN/um^3", 1e-3 / 2e-5**3),
        ("channel*s^2/travel^2", "V*s^2/um^2", 50 / 2e-5**2),
        ("channel/partner", "V/mW", 50 / 0.2),
        ("channel/(travel*K)", "V/(um*K)", 50 / 2e-5),
        ("1/channel^2", "1/V^2", 1 / 50**2),
        ("mrad", "mrad", 1e-3),
    ],
)
def test_one_of_a_laws_unit_is_one_typical_size_of_each_signal_in_it(unit, here, si):
    number = param(unit)
    assert DRIVE.unit_of(number) == here
    assert DRIVE.si(1.0, number) == pytest.approx(si, rel=1e-14)  # roundings of a few products
    assert DRIVE.si(-3.0, number) == pytest.approx(-3 * si, rel=1e-14)
    assert DRIVE.si(1.0, State("memory", unit, 1.0)) == pytest.approx(si, rel=1e-14)


def test_a_compound_unit_of_a_channel_stands_in_brackets():
    channel = Channel("axis", "N*m", 0.1, "deg", 0.5)
    assert channel.unit_of(param("channel/travel^2")) == "(N*m)/deg^2"
    assert channel.unit_of(param("channel")) == "N*m"


def test_placeholders_are_taken_out_of_a_unit_with_their_powers():
    powers, rest = split_unit("channel*s^2/travel^2", ("channel", "travel", "partner"))
    assert powers == {"channel": 1.0, "travel": -2.0}
    assert rest == "s ** 2"
    assert split_unit("partner", ("partner",)) == ({"partner": 1.0}, "dimensionless")


def test_bounds_of_a_pair_count_in_typical_sizes_of_both_channels():
    """The bounds of a tilt are three, in typical microradians per typical micrometres: here 3 (2 urad)/(1 um)."""
    channel = Channel("theta_y", "urad", 2e-6, "urad", 1e-6, "delta_x", "um", 1e-6)
    table = {"kind": "link_compliance", "at": "theta_y", "of": "delta_x"}
    assert faults_at(read_effect({**table, "tilt": "5.99 urad/um"}), channel) == []
    ((name, fault),) = faults_at(read_effect({**table, "tilt": "6.01 urad/um"}), channel)
    assert name == "tilt" and "outside -6 urad/um ... 6 urad/um" in fault


def test_bounds_in_units_of_their_own_are_the_same_at_every_channel():
    """An arm of a metre, 1 um/urad, whatever the typical sizes."""
    table = {"kind": "abbe_arm", "at": "delta_x", "of": "theta_y"}
    assert read_effect({**table, "arm": "0.999 um/urad"}).values["arm"].si == pytest.approx(0.999)
    with pytest.raises(ValueError, match=r"arm = 1\.001 um/urad is outside -1 um/urad \.\.\. 1 um/urad"):
        read_effect({**table, "arm": "1.001 um/urad"})


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"kind": "abbe"}, "kind = 'abbe' is not a known effect"),
        ({"kind": []}, r"kind = \[\] is not a known effect"),
        ({"at": 3}, "at is missing"),
        ({"of": None}, "of is missing"),
        ({"arm": "two"}, "arm: 'two'"),
        ({"length": "1 m"}, "unknown key 'length'"),
    ],
)
def test_a_table_that_is_no_effect_is_refused_with_what_is_wrong(change, says):
    with pytest.raises(ValueError, match=says):
        read_effect({"kind": "abbe_arm", "at": "delta_x", "of": "theta_y", "arm": "1 um/urad", **change})


def test_a_missing_parameter_is_named_with_an_example():
    with pytest.raises(ValueError, match=r'gain is missing .*write for example gain = "0.05"'):
        read_effect({"kind": "drive_gain", "at": "1X"})


def test_every_fault_of_a_table_is_named_at_once():
    with pytest.raises(ValueError, match=r"at is missing.*delay is missing"):
        read_effect({"kind": "delay"})


def test_a_number_of_one_of_two_units_is_told_by_its_key_alone():
    class File(BaseModel):
        mass: Mass
        travel: TravelOrTurn

    for travel, place in (("3 V", "travel"), (["3 V", "1 um"], "travel[0]")):
        with pytest.raises(InputError) as error:
            validate(File, {"mass": "3 V", "travel": travel}, "file.toml")
        assert {"mass", place} <= {fault.where for fault in error.value.faults} <= {"mass", place, "travel[1]"}


@every_effect
def test_an_example_of_a_missing_number_has_a_unit_that_its_place_takes(effect):
    """Of a drive in watts, as in volts."""
    _, places = place_of(effect)
    table = {"kind": effect.kind, "at": places[0].name} | ({"of": places[0].partner} if effect.pairs else {})
    with pytest.raises(ValueError) as error:
        read_effect(table)
    examples = dict(re.findall(r'write for example (\w+) = "([^"]*)"', str(error.value)))
    assert set(examples) == {p.name for p in effect.params}
    for p in effect.params:
        where = replace(places[0], unit="V") if effect.place is Place.DRIVE else places[0]
        if not p.relative and where.unit_of(p) != "1":
            assert same_dimension(written_unit(examples[p.name]), where.unit_of(p)), (p.name, examples[p.name])
