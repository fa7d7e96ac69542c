"""Paths and options for which there is no fastest motion: what is said of them."""

from __future__ import annotations

import pytest
from conftest import SCENARIOS

import ctrlgen
from ctrlgen import InputError, SolverError


@pytest.mark.parametrize(
    ("scenario", "options", "said"),
    [
        ("unreachable", {"sample_rate": "1 kHz"}, "state the path as a formula"),
        ("xy_stage_force", {}, "sample_rate: is missing"),
        ("parallelogram_line", {}, "state time_constant or rate of an actuator"),
        ("circle20", {"sample_rate": "fast"}, "does not start with a number"),
        ("circle20", {"sample_rate": "0 Hz"}, "is not above zero"),
        ("circle20", {"frequency": "nan Hz"}, 'is not a finite number; write for example "50 Hz"'),
        ("circle20", {"frequency": "20 ms"}, "wrong unit"),
        ("circle20", {"frequency": "400 Hz"}, "2.5 samples"),
        ("circle20", {"frequency": "1 mHz"}, "give a lower --sample-rate"),
        ("circle20", {"sample_rate": "1e300 Hz"}, "is far too large"),
        ("circle20", {"sample_rate": "1 GHz"}, "give a lower one"),
        ("circle20", {"sample_rate": "100 Hz"}, "is too low"),
    ],
)
def test_what_cannot_be_answered_is_refused_with_what_to_do(scenario, options, said):
    with pytest.raises((InputError, SolverError), match=said) as caught:
        ctrlgen.fastest(SCENARIOS / scenario, **options)
    assert str(caught.value).count("for example") <= 1


@pytest.mark.parametrize(
    ("device", "path", "said"),
    [
        ("flexure_axis", 'kind = "line"\nstart = { axis = "5 um" }\nend = { axis = "5 um" }', "nothing moves"),
        ("xy_lever_stage", 'kind = "circle"\ndiameter = "1e-9 nm"', "nothing moves"),
        (
            "xy_lever_stage",
            'kind = "raster"\nlength = "9 um"\nspacing = "1 um"\nlines = 3\nstep_share = 1e-17',
            "step_share",
        ),
    ],
)
def test_a_path_on_which_nothing_moves_or_the_stage_would_jump_is_refused(device, path, said, tmp_path):
    file = SCENARIOS / "devices" / f"{device}.toml"
    (tmp_path / "s.toml").write_text(
        f'title = "t"\ndevice = "{file}"\nsample_rate = "2 kHz"\nduration = "0.1 s"\n[path]\n{path}\n'
    )
    with pytest.raises(InputError, match=said):
        ctrlgen.fastest(tmp_path / "s.toml")
