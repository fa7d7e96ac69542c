"""The C of corrections: the same as its reference, with every rule kept; hostile calls of it; devices with inertia."""

from __future__ import annotations

from dataclasses import replace

import pytest
from conftest import SCENARIOS
from turntable import OPEN_TABLE, RIPPLE, RUNOUT_TABLE, made

from ctrlgen import InputError, build_model, load_scenario, solve
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.folder import generate
from ctrlgen.verification.comparison import compare
from ctrlgen.verification.hostile import check_hostile
from ctrlgen.verification.rules import check_rules


@pytest.mark.long
def test_the_c_is_the_reference_and_breaks_no_rule(tmp_path):
    """On the turntable, closed and open tables; every compiler, both arithmetics, the shipped self test, static analysis."""
    for name, sections in (("closed", (RUNOUT_TABLE, RIPPLE)), ("open", (OPEN_TABLE,))):
        folder, _, _ = made(tmp_path / name, *sections)
        scenario = load_scenario(tmp_path / name / "scenario.toml")
        compared = compare(folder, solve(scenario, build_model(scenario.device)))
        assert compared.passed, [row for row in compared.rows if not row.passed]
        assert {"corrected targets, C - CasADi", "numbers of corrections after runs, C - reference"} <= {
            str(row.what) for row in compared.rows
        }
        checks = check_rules(folder)
        for check in checks:  # an analyzer that gives up has not passed
            assert check.state == "passed" or "missing" in check.note, (check.findings, check.note)


# What a hostile caller finds where a line of the C is wrong: the line, what stands in its place, what is then told
WRONG = {
    "run->waiting >= 7U": ("run->waiting == 7U", ""),
    "TABLE_CORRECTED_F32_BUILD) && (run->checksum == ": ("TABLE_CORRECTED_F32_BUILD) || (run->checksum == ", ""),
    "(table_corrected_f32_intact(table, next) != 0)": ("(next >= 0)", "told by the call that reads it"),
    "= table_corrected_f32_bounded(then, TABLE_CORRECTED_F32_BOUND_0)": ("= then", "is within its bound"),
    "amplitudes(then, 5) <= (": ("amplitudes(then, 5) <= (9.0f * ", "a table"),
    "numbers = (table_corrected_f32_is_number(&own[k]) != 0) ? numbers : 0": ("numbers = 1", "a target that is none"),
}


@pytest.mark.exhaustive
def test_hostile_calls_of_corrections_break_no_promise_and_find_wrong_lines(tmp_path):
    """Sanitizers and a fuzzer over tables, runs and stored bytes, sound and damaged."""
    for name, sections in (("open", (OPEN_TABLE,)), ("closed", (RUNOUT_TABLE, RIPPLE))):
        folder, _, _ = made(tmp_path / name, *sections)
        scenario = load_scenario(tmp_path / name / "scenario.toml")
        model = build_model(scenario.device)
        for check in check_hostile(folder, scenario, model, runs=200_000, quick=name == "open"):
            left_out = name == "open" and check.state == "not run"
            assert check.state == "passed" or left_out or "missing" in check.note, (check.findings, check.note)
    alone = replace(folder, online={Real.FLOAT: folder.online[Real.FLOAT]})
    source = folder.path / f"{folder.corrected[Real.FLOAT]}.c"
    good = source.read_text()
    for line, (instead, told) in WRONG.items():
        assert line in good, line
        source.write_text(good.replace(line, instead))
        refused = check_hostile(alone, scenario, model, runs=300_000, quick=True)[0].refused
        assert refused and any(told in finding.text for finding in refused), (line, refused)


@pytest.mark.long
def test_a_device_with_inertia_is_corrected_with_its_derivatives_and_by_harmonics_alone(tmp_path):
    text = (
        (SCENARIOS / "dynamic_circle" / "scenario.toml").read_text().replace("../devices", str(SCENARIOS / "devices"))
    )
    ripple = '\n[[correction]]\nof = "delta_x"\nkind = "harmonic"\nperiod = "10 um"\nharmonics = 4\nbound = "50 nm"\n'
    (tmp_path / "scenario.toml").write_text(text + ripple)
    scenario = load_scenario(tmp_path / "scenario.toml")
    solution = solve(scenario, build_model(scenario.device))
    folder = generate(scenario, solution.model, tmp_path / "c", solution)
    compared = compare(folder, solution)
    assert compared.passed, [row for row in compared.rows if not row.passed]
    (hostile, _) = check_hostile(folder, scenario, solution.model, runs=50_000, quick=True)
    assert hostile.state == "passed" or "missing" in hostile.note, (hostile.findings, hostile.note)
    (tmp_path / "scenario.toml").write_text(
        text + ripple.replace('"harmonic"', '"table"').replace("harmonics", "entries")
    )
    with pytest.raises(InputError, match="which straight lines have not"):
        generate(load_scenario(tmp_path / "scenario.toml"), solution.model, tmp_path / "d")
