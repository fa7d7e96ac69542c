"""The C for calls at times that vary, held to the controller in Python: of heaters, of creep behind them, of drives with rates."""

from __future__ import annotations

import shutil

import pytest
from conftest import DEVICE, SCENARIOS
from creeping_axis import CREEP

import ctrlgen
from ctrlgen import build_model, generate, load_scenario, solve
from ctrlgen.verification.comparison import compare
from ctrlgen.verification.comparison_entry import ComparisonKind
from ctrlgen.verification.hostile import check_hostile

pytestmark = pytest.mark.long
TIMES = 'sample_times = ["0.5 ms", "2 ms"]\nsample_rate = "1 kHz"\n'
CIRCLE = 'kind = "circle"\ndiameter = "5 um"\ncentre = { x = "6 um", y = "5 um" }\nplane = ["x", "y"]\n'


def rated(memory: bool):
    """Two drives with rates, of a stage that lags by 20 ms or not at all."""
    words = dict(
        parameters={"tau": "20 ms", "r": "10 K/W", "g": "0.1 um/K", "k": "1 N/um"},
        drive={"x": ("0 W", "30 W"), "y": ("0 W", "30 W")},
        drive_rate={"x": ("-2 W/ms", "1 W/ms"), "y": "1 W/ms"},
        axes={"x": ("-1 um", "12 um"), "y": ("-1 um", "12 um")},
        restoring_force=lambda d, p: p.k * d.vector,
    )
    if memory:
        words |= dict(
            state={"a": ("-10 K", "100 K"), "b": ("-10 K", "100 K")},
            rates=lambda u, x, p: [(p.r * u.x - x.a) / p.tau, (p.r * u.y - x.b) / p.tau],
            force=lambda x, p: [p.k * p.g * x.a, p.k * p.g * x.b],
        )
    else:
        words |= dict(force=lambda u, p: [p.k * p.g * p.r * u.x, p.k * p.g * p.r * u.y])
    return ctrlgen.user_device("rated", **words)


def scenario_of(name: str, folder):
    if name in ("rated", "lagging"):
        text = f'title = "t"\ndevice = "rated"\n{TIMES}duration = "0.5 s"\nchecksum = true\n[path]\n{CIRCLE}'
        (folder / "scenario.toml").write_text(text)
        return load_scenario(folder, rated(name == "lagging"))
    text = (SCENARIOS / "circle20" / "scenario.toml").read_text().replace('sample_rate = "1 kHz"\n', TIMES)
    device = DEVICE.read_text() + (CREEP.replace('"axis"', '"1X"') if name == "creeping" else "")
    (folder / "device.toml").write_text(device)
    path = text.split("[[expect]]")[0].replace("../devices/mems_hexapod.toml", "device.toml")
    (folder / "scenario.toml").write_text(path)
    return load_scenario(folder)


@pytest.mark.parametrize(
    "name", ["heated", "rated", *(pytest.param(name, marks=pytest.mark.exhaustive) for name in ("creeping", "lagging"))]
)
def test_the_c_answers_at_any_times_as_the_controller_does(name, tmp_path):
    """Status, drives and states; its own test passes, and no hostile call breaks a promise."""
    if not shutil.which("gcc"):
        pytest.skip("gcc is missing: the C was not compared")
    scenario = scenario_of(name, tmp_path)
    model = build_model(scenario.device, sample_time=scenario.sample_time)
    solution = solve(scenario, model)
    folder = generate(scenario, model, tmp_path / "c", solution)
    compared = compare(folder, solution)
    assert compared.passed, [row for row in compared.rows if not row.passed]
    assert any(row.what is ComparisonKind.TIMED for row in compared.rows)
    random, _ = check_hostile(folder, scenario, model, runs=20_000, quick=True)
    assert not random.findings and random.state.value in ("passed", "not run"), random
