"""Sizes that cannot be meant are refused at once, before any work: what, where, and what to do."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from conftest import DEVICES

from ctrlgen import InputError, build_model, load_device, load_recordings, load_scenario
from ctrlgen.core.units import parse, to_si

AT_ONCE = 1.0
"""Seconds in which a file that cannot be meant is refused."""
SCENARIO = 'title = "t"\ndevice = "{device}"\n{timing}\n[path]\nkind = "circle"\ndiameter = "{diameter}"\n'
TIMED = 'sample_rate = "1 kHz"\nduration = "1 s"'


def refused_at_once(read, file: Path, says: str) -> None:
    build_model(load_device(DEVICES / "xy_lever_stage.toml"))  # what is imported and cached once
    begin = time.process_time()
    with pytest.raises(InputError, match=says):
        read(file)
    assert time.process_time() - begin < AT_ONCE


def bound(file: Path) -> None:
    scenario = load_scenario(file)
    _ = scenario.bind(build_model(scenario.device)).samples


@pytest.mark.long
@pytest.mark.parametrize(
    ("timing", "diameter", "says"),
    [
        (TIMED, "1e300 um", r"path\.diameter: '1e300 um' is far too large"),
        (TIMED, "1e-300 um", r"path\.diameter: '1e-300 um' is too small"),
        (TIMED, "1 um^9^9^9", r"path\.diameter: 'um\^9\^9\^9' is not a unit I know: a power in it is one number"),
        (TIMED, f"1 {'u' * 1900}", r"path\.diameter: a unit of 1900 letters is not one I know"),
        (TIMED, f"1 {'u' * 100_000}", r"path\.diameter: has 100002 characters"),
        (TIMED, f"{'9' * 1900} um", r"path\.diameter: .* is not a finite number"),
        (
            'sample_rate = "1 kHz"\nduration = "1e308 s"',
            "1 um",
            "duration: '1e308 s' is far too large; 1e\\+09 s is the most",
        ),
        ('sample_rate = "1 GHz"\nduration = "1e9 s"', "1 um", "duration"),
        ('sample_rate = "1e-50 Hz"\nduration = "1 s"', "1 um", "duration"),
        ("points = 1000000000000", "1 um", "points: Input should be less than or equal to 1000000"),
        (f"points = [{'1, ' * 10_000}]", "1 um", "points"),
        (f"points = {'[' * 3000}{']' * 3000}", "1 um", "more than 100 deep"),
        (f"expect = [{'1,' * 300_000}]", "1 um", "has 600[0-9]+ characters; a description has at most"),
    ],
    ids=lambda value: value[:24],
)
def test_of_a_scenario(timing, diameter, says, tmp_path):
    device = DEVICES / "xy_lever_stage.toml"
    (tmp_path / "s.toml").write_text(SCENARIO.format(device=device, timing=timing, diameter=diameter))
    refused_at_once(bound, tmp_path / "s.toml", says)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        (
            "[[material]]",
            '[[pattern]]\nname = "p"\ntimes = 1000000000\n[[material]]',
            r"pattern\[0\]\.times: .* less than or equal to 100",
        ),
        ('"1 ms"', '"1e300 ms"', r"time_constant: '1e300 ms' is far too large"),
        ('"5.6 N/V"', '"5.6 N^9^9^9/V"', r"gain: 'N\^9\^9\^9/V' is not a unit I know"),
    ],
    ids=["copies", "size", "unit"],
)
def test_of_a_device(old, new, says, tmp_path):
    text = (DEVICES / "xy_lever_stage.toml").read_text()
    assert old in text
    (tmp_path / "d.toml").write_text(text.replace(old, new, 1))
    refused_at_once(load_device, tmp_path / "d.toml", says)


@pytest.mark.parametrize(
    "record",
    [
        "rows = [0, 1000000000000000000]",
        "lead_in = 1000000000000000000",
        'columns = { "reading.axis" = { column = "y", unit = "um", scale = inf } }',
        "rows = [7, 3]",
        'dwell = "1e300 s"',
        'start = "1e300 s"',
    ],
)
def test_of_a_recording(record, tmp_path):
    model = build_model(load_device(DEVICES / "flexure_axis.toml"))
    (tmp_path / "run.csv").write_text("u,y\n" + "".join(f"{k % 7},{k % 5}\n" for k in range(300)))
    (tmp_path / "recording.toml").write_text(
        'title = "t"\ndevice = "flexure_axis"\nkind = "series"\n[[record]]\nfile = "run.csv"\nrole = "fit"\nsample_rate = "1 kHz"\n'
        f'{record}\n[columns]\n"drive.axis" = {{ column = "u", unit = "V" }}\n"reading.axis" = {{ column = "y", unit = "um" }}\n'
    )
    refused_at_once(lambda file: load_recordings([file], model), tmp_path, r"record\[0\]")


@pytest.mark.parametrize(
    "unit", ["um^9^9^9", "um**9**9", "u" * 100_000, "((um^9)^9)^9", "um^13", "um " * 21, "um */ x", "(um"]
)
def test_of_a_unit(unit):
    begin = time.process_time()
    with pytest.raises(ValueError, match=r"unit|factors"):
        to_si(1.0, unit)
    assert time.process_time() - begin < AT_ONCE


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("10 km", "m"),
        ("1e9 s", "s"),
        ("1e15 Pa", "GPa"),
        ("0 um", "um"),
        ("-40 degC", "degC"),
        ("2 nm/Hz^(1/2)", "m/Hz^0.5"),
    ],
)
def test_what_is_meant_passes(text, unit):
    parse(text, unit)
