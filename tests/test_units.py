from __future__ import annotations

import re

import pytest

from ctrlgen.core.units import (
    from_si,
    parse,
    parse_difference,
    read_quantity,
    same_dimension,
    show,
    show_difference,
    to_si,
)


@pytest.mark.parametrize(
    ("text", "unit", "si"),
    [
        ("130 GPa", "Pa", 130e9),
        ("20 um", "m", 20e-6),
        ("0.178 rad/(N*um)", "rad/(N*m)", 0.178e6),
        ("22 degC", "degC", 295.15),
        ("295.15 K", "degC", 295.15),
        ("3e-9 1/K^2", "1/K^2", 3e-9),
        ("3e-9 /K**2", "1/K^2", 3e-9),
        ("5 deg", "rad", 0.0872664625997165),
        ("0.051577 N/um", "N/m", 51577.0),
        (".5", "1", 0.5),
        (15, "1", 15.0),
        ("-1.5e-3 mm", "um", -1.5e-6),
    ],
)
def test_text_with_a_unit_becomes_an_si_number(text, unit, si):
    assert parse(text, unit) == pytest.approx(si, rel=1e-14)  # a few roundings of the conversion factor


@pytest.mark.parametrize(
    ("text", "unit", "says"),
    [
        ("3 N", "m", "wrong unit"),
        ("3", "m", "no unit"),
        ("three um", "m", "does not start with a number"),
        ("3 furlongz", "m", "not a unit"),
        ("nan m", "m", "not a finite number"),
        ("inf m", "m", "not a finite number"),
        (True, "1", "write a number"),
        (["1 m"], "m", "write a number"),
        ("1 N/mm", "N*m", "wrong unit"),
        ("", "m", "does not start with a number"),
        (5, "deg", "no unit"),
        ("0.28 deg", "1", "wrong unit"),
        ("60 rpm", "Hz", "wrong unit"),
        ("22 delta_degC", "degC", "wrong unit"),
    ],
)
def test_what_is_not_a_quantity_is_refused_with_the_remedy(text, unit, says):
    with pytest.raises(ValueError, match=says):
        parse(text, unit)


@pytest.mark.parametrize("unit", ["um", "degC", "mrad", "N/um", "ms", "ohm", "1"])
def test_conversion_round_trips(unit):
    assert from_si(to_si(12.5, unit), unit) == pytest.approx(12.5, rel=1e-13)  # roundings only


def test_temperature_differences_have_no_offset():
    assert to_si(1.0, "delta_degC") == 1.0
    assert same_dimension("um", "mm") and not same_dimension("um", "rad")


def test_numbers_are_shown_in_the_readers_unit():
    assert show(31.53e-6, "um") == "31.53 um"
    assert show(823.15, "degC") == "550 degC"
    assert show(0.5, "1") == "0.5"


@pytest.mark.parametrize("number", [9999.0, 1e4, 15000.0, 360000.0, 123456.0])
@pytest.mark.parametrize("unit", ["um", "ms", "N/m", "urad/(N*m)", "1"])
def test_no_power_of_ten_is_shown_below_a_million(number, unit):
    text = show(to_si(number, unit), unit)
    assert "e" not in text.split(" ")[0] and float(text.split(" ")[0]) == pytest.approx(number, rel=5e-4)
    assert "e+06" in show(to_si(2e6, unit), unit) and "e-05" in show(to_si(2e-5, unit), unit)


@pytest.mark.parametrize(
    ("value", "unit", "sd", "si"),
    [
        ("200 GPa", "Pa", "3 %", 6e9),
        ("-4 mm", "m", "0.5%", 2e-5),
        ("0.3", "1", "10 %", 0.03),
        ("2 %", "1", "0.5 %", 0.005),  # of a number in per cent a difference, as it is read by people
        ("2 %", "1", "0.001", 0.001),
        ("22 degC", "degC", "0.5 K", 0.5),
        ("40 um", "m", "0.5 um", 5e-7),
    ],
)
def test_a_standard_deviation_is_a_difference_or_a_share(value, unit, sd, si):
    assert read_quantity(unit, {"value": value, "sd": sd}).sd == pytest.approx(si, rel=1e-12)


@pytest.mark.parametrize(
    ("value", "unit", "sd", "says"),
    [
        ("22 degC", "degC", "5 %", 'write a difference, such as "1 K"'),
        ("0 mm", "m", "5 %", 'write a difference, such as "1 mm"'),
        ("40 um", "m", "-5 %", "is negative"),
        ("40 um", "m", "5", "has no unit"),
        ("40 um", "m", "5 GPa", "wrong unit"),
        ("40 um", "m", "about 5 %", "does not start with a number"),
    ],
)
def test_a_standard_deviation_that_is_neither_is_refused(value, unit, sd, says):
    with pytest.raises(ValueError, match=re.escape(says)):
        read_quantity(unit, {"value": value, "sd": sd})


@pytest.mark.parametrize("text", ["2 K", "2 degC", "2 delta_degC", "3.6 degF", "3.6 delta_degF"])
@pytest.mark.parametrize("unit", ["degC", "K"])
def test_a_difference_of_temperatures_does_not_count_from_absolute_zero(text, unit):
    assert parse_difference(text, unit) == pytest.approx(2.0, rel=1e-12)  # roundings of 459.67 and 5/9
    assert read_quantity(unit, {"value": f"20 {unit}", "sd": text}).sd == parse_difference(text, unit)


def test_a_difference_is_shown_in_kelvins_where_the_quantity_is_in_degrees():
    assert [show_difference(2.0, unit) for unit in ("degC", "K")] == ["2 K", "2 K"]
    assert show_difference(2.0, "degF") == "3.6 delta_degF" and show_difference(2e-6, "um") == "2 um"
