"""ctrlgen calibrate: the constants of a specimen from a recording of it, and what it writes."""

from __future__ import annotations

import json
import shutil
import struct
import subprocess
import zlib

import numpy as np
import pytest
from command_line import ctrlgen
from conftest import SCENARIOS
from recorded_lag import record_lag
from scipy import stats

from ctrlgen import InputError, build_model, calibrate, error_budget, load_device, load_scenario
from ctrlgen.calibration.budgets_compared import budgets
from ctrlgen.calibration.calibrate import CalibratedConstant, Calibration, Determination, sd_of_bounds, with_held
from ctrlgen.calibration.calibration_page import write_calibration
from ctrlgen.calibration.device_file import NAME, write_calibrated_device
from ctrlgen.core.units import to_si
from ctrlgen.devices.run_time import RunTimeConstant
from ctrlgen.recordings.reader import load_recordings

DEVICE = SCENARIOS / "devices" / "mems_hexapod_run_time.toml"
RECORDING = SCENARIOS / "hexapod_specimen"
TRUE = {"actuator.ambient": 273.15 + 26, "actuator.thermal_resistance": 583.0, "actuator.time_constant": 4.4e-3}


@pytest.fixture(scope="module")
def specimen():
    return calibrate(DEVICE, RECORDING)


@pytest.mark.long
def test_the_constants_of_the_specimen_are_found_within_their_intervals(specimen):
    for row in specimen.constants:
        low, high = row.interval
        assert row.determined and low < TRUE[row.constant.path] < high, row
        assert row.sd < 0.05 * sd_of_bounds(row.constant)


@pytest.mark.long
def test_held_out_readings_are_then_as_good_as_their_noise(specimen):
    for e in specimen.errors:
        assert e.before > 50 * e.noise
        assert abs(e.after / e.noise - 1) < 0.12  # 230 samples tell a deviation to 5 %


@pytest.mark.long
def test_constants_of_the_closed_form_of_a_lag_are_found_with_deviations_as_stated(tmp_path):
    """Twenty deviations over their stated standard deviations: their mean square is 1 within what chance leaves of twenty in 99 of 100."""
    scores = []
    for seed in range(10):
        (folder := tmp_path / str(seed)).mkdir()
        found = calibrate(*record_lag(folder, 5.7e-3, 500.0, seed))
        truth = {"actuator.time_constant": 5.7e-3, "actuator.thermal_resistance": 500.0}
        assert all(row.determined for row in found.constants)
        scores += [(row.value - truth[row.constant.path]) / row.sd for row in found.constants]
    low, high = stats.chi2.ppf([0.005, 0.995], len(scores)) / len(scores)
    assert low < np.mean(np.square(scores)) < high, scores


@pytest.mark.long
def test_a_drive_of_which_nobody_states_that_it_was_held_is_found_to_be(tmp_path):
    """In straight lines it would lead by half a sample, a twelfth of the time constant."""
    device, folder = record_lag(tmp_path, 5.7e-3, 500.0, 0)
    stated = calibrate(device, folder)
    text = (folder / "recording.toml").read_text()
    assert text.count('between_samples = "held"') == 2
    (folder / "recording.toml").write_text(text.replace('between_samples = "held"', ""))
    found = calibrate(device, folder)
    assert [row.value for row in found.constants] == pytest.approx([row.value for row in stated.constants], rel=1e-9)
    assert any("held is taken" in note for note in found.notes) and not any("is taken" in note for note in stated.notes)


@pytest.mark.long
def test_a_constant_on_which_the_recording_says_nothing_keeps_its_default(tmp_path):
    text = DEVICE.read_text().replace('input = "actuator.ambient"', "")
    device = tmp_path / "device.toml"
    device.write_text(
        text.replace("constants = [", 'constants = [\n    "actuator.heater_resistance", "hexapod.stress_limit",')
    )
    found = {row.constant.path: row for row in calibrate(device, RECORDING).constants}
    for path in ("actuator.heater_resistance", "hexapod.stress_limit"):
        assert not found[path].determined and found[path].value == found[path].constant.default
        assert found[path].determination is Determination.IDLE
    assert found["actuator.time_constant"].determined


# The spread of h beforehand: the readings tell it hardly, or better than its bounds
@pytest.mark.parametrize("spread", [0.3, 3.0])
def test_constants_fitted_beside_a_held_one_deviate_with_it_as_stated(rng, spread):
    """Readings X_c c + x_h h + e, c by least squares with h held at 0 while it is anything within its bounds: scores over 20,000 draws
    against the standard deviations, correlation and 95 % intervals that are stated. 3 %: three standard errors of these."""
    X, x, noise, draws = rng.standard_normal((12, 2)), rng.standard_normal(12), 0.4, 20_000
    h = rng.uniform(-1, 1, draws) * spread * np.sqrt(3)
    y = np.outer(h, x) + noise * rng.standard_normal((draws, 12))
    deviation = np.column_stack([np.linalg.lstsq(X, y.T, rcond=None)[0].T, -h])  # all true c are 0
    both = np.column_stack([X, x])
    joint = np.linalg.inv(both.T @ both / noise**2 + np.diag([0, 0, spread**-2]))
    stated = with_held(noise**2 * np.linalg.inv(X.T @ X), joint, np.array([spread]))
    sds = np.sqrt(np.diag(stated))
    assert (deviation / sds).std(axis=0) == pytest.approx([1, 1, 1], abs=0.03)
    assert np.corrcoef(deviation.T) == pytest.approx(stated / np.outer(sds, sds), abs=0.03)


def test_of_a_constant_the_bounds_tell_what_any_number_between_them_tells(rng):
    """450 to 650 K/W and nothing else known: the scatter of 100,000 numbers that are as likely everywhere between, known to 0.2 %."""
    between = rng.uniform(450, 650, 100_000)
    assert sd_of_bounds(constant()) == pytest.approx(between.std(), rel=0.01)


def constant(path="actuator.thermal_resistance", low=450.0, high=650.0, unit="K/W") -> RunTimeConstant:
    return RunTimeConstant(path, "R", (low + high) / 2, low, high, unit)


def test_an_interval_holds_nineteen_of_twenty_normal_numbers_and_ends_at_the_bounds(rng):
    """100,000 numbers tell 95 % to 0.07 %; beyond 650 K/W no specimen is accepted, and where nothing is told the bounds are all."""
    low, high = CalibratedConstant(constant(), 560.0, 10.0, Determination.DETERMINED).interval
    assert np.mean((rng.normal(560, 10, 100_000) > low) & (rng.normal(560, 10, 100_000) < high)) == pytest.approx(
        0.95, abs=0.004
    )
    assert CalibratedConstant(constant(), 640.0, 10.0, Determination.DETERMINED).interval == pytest.approx(
        (620.4, 650.0), abs=0.01
    )
    assert CalibratedConstant(constant(), 460.0, 10.0, Determination.DETERMINED).interval == pytest.approx(
        (450.0, 479.6), abs=0.01
    )
    assert CalibratedConstant(constant(), 550.0, 10.0, Determination.BOUNDS_ALONE).interval == (450.0, 650.0)


@pytest.mark.long
def test_in_a_budget_constants_vary_together_as_they_were_fitted_beside_what_the_path_states(tmp_path):
    """A fit that knows R_th and tau to 2 K/W and 50 us with the coefficient -0.8. Of uncertainty.toml the constants' own lines count no
    more, and a pair that is correlated there stays so; what is seen of each pair is the sum of squares with a mixed term."""
    lines = {"actuator.thermal_resistance": "5 %", "actuator.beam_width": "0.2 um", "stage.lever_long": "0.2 um"}
    (tmp_path / "scenario.toml").write_text(
        (SCENARIOS / "circle20" / "scenario.toml").read_text().partition("[[expect]]")[0].replace('"1 kHz"', '"100 Hz"')
    )
    (tmp_path / "uncertainty.toml").write_text(
        'title = "u"\n[numbers]\n'
        + "".join(f'"{name}" = {{ sd = "{sd}", source = "s" }}\n' for name, sd in lines.items())
        + '[[correlation]]\nbetween = ["actuator.beam_width", "stage.lever_long"]\ncoefficient = 0.5\nsource = "s"\n'
    )
    text = DEVICE.read_text().replace('input = "actuator.ambient"', "")
    ambient = '    { number = "actuator.ambient", low = "10 degC", high = "40 degC" },\n'
    (tmp_path / "device.toml").write_text(text.replace(ambient, ""))
    device = load_device(tmp_path / "device.toml")
    sds = {"actuator.thermal_resistance": 2.0, "actuator.time_constant": 50e-6}
    rows = tuple(CalibratedConstant(c, c.default, sds[c.path], Determination.DETERMINED) for c in device.given_at_start)
    each = np.array([row.sd for row in rows])
    covariance = np.outer(each, each) * np.array([[1, -0.8], [-0.8, 1]])
    recording = load_recordings([RECORDING], build_model(device))
    made = Calibration(device, {}, recording, rows, covariance, (), ())
    before, after = budgets(made, tmp_path, tmp_path / "device.toml")
    found = after.uncertainties
    names = [line.name for line in found.lines]
    assert sorted(names) == sorted([*sds, "actuator.beam_width", "stage.lever_long"])
    at = {name: names.index(name) for name in names}
    R, tau = at["actuator.thermal_resistance"], at["actuator.time_constant"]
    edge, lever = at["actuator.beam_width"], at["stage.lever_long"]
    expected = np.eye(4)
    expected[R, tau] = expected[tau, R] = -0.8
    expected[edge, lever] = expected[lever, edge] = 0.5
    assert found.correlation == pytest.approx(expected)
    seen = [after.linear.sensitivity["pose"][:, :, i] * found.sds[i] for i in range(4)]
    variance = (
        seen[R] ** 2
        + seen[tau] ** 2
        - 1.6 * seen[R] * seen[tau]
        + seen[edge] ** 2
        + seen[lever] ** 2
        + seen[edge] * seen[lever]
    )
    assert after.combined**2 == pytest.approx(variance, rel=1e-6, abs=1e-9 * variance.max())
    wide = dict(zip([line.name for line in before.uncertainties.lines], before.uncertainties.sds, strict=True))
    assert wide["actuator.thermal_resistance"] == pytest.approx(27.5, rel=1e-9)  # 5 % of 550 K/W, as stated
    # Not stated: 3.5 ms of bounds over the root of 12
    assert wide["actuator.time_constant"] == pytest.approx(1.01036e-3, rel=1e-4)


@pytest.mark.long
def test_of_a_list_the_numbers_that_are_no_constants_stay_uncertain(tmp_path):
    """One of six angles is a constant of the specimen: the other five count after the calibration as before it."""
    (tmp_path / "scenario.toml").write_text(
        (SCENARIOS / "circle20" / "scenario.toml").read_text().partition("[[expect]]")[0].replace('"1 kHz"', '"100 Hz"')
    )
    (tmp_path / "uncertainty.toml").write_text(
        'title = "u"\n[numbers]\n"hexapod.base_angles[*]" = { sd = "0.1 deg", source = "s" }\n'
    )
    head = DEVICE.read_text().partition("\n[run_time]\n")[0] + "\n"
    (tmp_path / "device.toml").write_text(head + '[run_time]\nconstants = ["hexapod.base_angles[0]"]\n')
    device = load_device(tmp_path / "device.toml")
    (constant,) = device.given_at_start
    row, recording = (
        CalibratedConstant(constant, constant.default, 1e-9, Determination.DETERMINED),
        load_recordings([RECORDING], build_model(device)),
    )
    made = Calibration(device, {}, recording, (row,), np.array([[1e-18]]), (), ())
    before, after = (found.uncertainties for found in budgets(made, tmp_path, tmp_path / "device.toml"))
    count = len(before.sds)
    sd = np.radians(0.1)
    assert before.sds == pytest.approx([sd] * count) and sorted(after.sds) == pytest.approx([1e-9, *[sd] * (count - 1)])
    assert len(after.correlation) == count


@pytest.mark.long
def test_the_budget_of_a_path_falls_to_what_the_recording_leaves(specimen):
    before, after = budgets(specimen, SCENARIOS / "circle20", DEVICE)
    translation = before.groups[0]
    assert translation.unit == "nm"
    taken = sum(
        line.peak["translation"] ** 2
        for line in before.lines
        if line.name in {c.path for c in specimen.device.given_at_start}
    )
    left = np.sqrt(before.peak(translation) ** 2 - taken)  # of what others do; 5 %: the specimen's path is another one
    assert after.peak(translation) == pytest.approx(left, rel=0.05) and left < before.peak(translation) / 2
    own = next(line for line in before.lines if line.name == "actuator.thermal_resistance")
    assert own.sd == "5 %"  # as uncertainty.toml beside the circle states
    alone = error_budget(load_scenario(SCENARIOS / "circle20", DEVICE), draws=0)
    assert before.peak(translation) == pytest.approx(alone.peak(translation), rel=1e-6)


@pytest.mark.long
def test_a_constant_of_which_nothing_is_stated_is_anything_within_its_bounds(specimen, tmp_path):
    """And so is all else known exactly."""
    text = (SCENARIOS / "circle20" / "scenario.toml").read_text().replace("../devices/mems_hexapod.toml", str(DEVICE))
    (tmp_path / "scenario.toml").write_text(text)
    before, after = budgets(specimen, tmp_path, DEVICE)
    own = next(line for line in before.lines if line.name == "actuator.thermal_resistance")
    assert own.sd == f"{200 / np.sqrt(12):.3g} K/W"  # uniform between 450 and 650 K/W, GUM 4.3.7
    assert {line.name for line in before.lines} == {c.path for c in specimen.device.given_at_start}
    assert after.peak(before.groups[0]) < 0.01 * before.peak(before.groups[0])


@pytest.mark.long
def test_the_files_hold_the_same_numbers(specimen, tmp_path):
    write_calibration(tmp_path, specimen)
    record = json.loads((tmp_path / "constants.json").read_text())
    data = (tmp_path / "constants.bin").read_bytes()
    magic, version, count, number = struct.unpack_from("<4sHHI", data)
    assert (magic, version, count) == (b"CGRT", 1, 3) and f"{number:08x}" == record["device_hash"]
    assert zlib.crc32(data[:-4]) == struct.unpack("<I", data[-4:])[0]
    values = [k["value_si"] for k in record["constants"]]
    assert np.allclose(struct.unpack_from("<3f", data, 12), values, rtol=1e-7, atol=0)
    for entry in record["constants"]:
        assert np.isclose(to_si(entry["value"], entry["unit"]), entry["value_si"], rtol=1e-12)
    main = tmp_path / "main.c"
    main.write_text(
        '#include <stdio.h>\n#include "constants.h"\nint main(void) { const double v[3] = MEMS_HEXAPOD_SPECIMEN_CONSTANTS_F64;\n'
        'const float f[3] = MEMS_HEXAPOD_SPECIMEN_CONSTANTS_F32;\nprintf("%.17g %.17g %.17g %g", v[0], v[1], v[2], f[2]); return 0; }\n'
    )
    words = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", str(main), "-o", str(tmp_path / "main")]
    subprocess.run(words, check=True)
    printed = subprocess.run([str(tmp_path / "main")], capture_output=True, text=True, check=True).stdout.split()
    assert [float(v) for v in printed[:3]] == values
    wrong = ["-DMEMS_HEXAPOD_SPECIMEN_ONLINE_F32_DEVICE_HASH=0x12345678U"]
    refused = subprocess.run([*words, *wrong], capture_output=True, text=True)
    assert refused.returncode and "belong to another device file" in refused.stderr


@pytest.mark.long
def test_the_device_file_of_the_specimen_has_its_constants_and_the_authors_comments(specimen, tmp_path):
    write_calibrated_device(specimen, DEVICE, tmp_path / NAME)
    found, before = (dict(load_device(path).quantities()) for path in (tmp_path / NAME, DEVICE))
    for row in specimen.constants:
        number = found[row.constant.path]
        assert number.si == pytest.approx(row.value, rel=1e-9)  # twelve digits are written, of degrees Celsius too
        assert "calibrated from" in number.source and before[row.constant.path].text in number.source
    assert all(found[path].si == number.si for path, number in before.items() if path not in TRUE)
    comments = [line.partition("#")[2] for line in DEVICE.read_text().splitlines() if line.startswith("#")]
    assert comments and all(comment in (tmp_path / NAME).read_text() for comment in comments)


@pytest.mark.long
def test_readings_in_another_unit_are_refused(tmp_path):
    shutil.copytree(RECORDING, tmp_path / "mm")
    told = tmp_path / "mm" / "recording.toml"
    told.write_text(told.read_text().replace('"nm"', '"mm"'))
    with pytest.raises(
        InputError, match=r"reading.delta_x: is .* times as far from the model as the model moves"
    ) as error:
        calibrate(DEVICE, tmp_path / "mm")
    assert len([f for f in error.value.faults if f.where.startswith("reading.")]) == 3
    assert any('write unit = "nm"' in f.what or 'write unit = "um"' in f.what for f in error.value.faults)


def test_a_device_without_run_time_constants_is_refused():
    with pytest.raises(InputError, match="run_time: is missing"):
        calibrate(SCENARIOS / "devices" / "mems_hexapod.toml", RECORDING)


@pytest.mark.parametrize(
    ("stated", "words"),
    [
        ('constants = ["actuator.ambiant"]', "did you mean actuator.ambient"),
        ('constants = ["actuator.beams"]', "is a count"),
        (
            'constants = [{ number = "actuator.time_constant", low = "6 ms", high = "7 ms" }]',
            "is not within 6 ... 7 ms",
        ),
        (
            'constants = [{ number = "actuator.time_constant", low = "3 ms", high = "4 ms" }]',
            "is not within 3 ... 4 ms",
        ),
        ('constants = [{ number = "actuator.time_constant", low = "0 ms", high = "7 ms" }]', "out of bounds"),
        ('constants = [{ number = "actuator.time_constant", low = "4 K", high = "7 ms" }]', "wrong unit"),
        ('constants = ["actuator.ambient", "actuator.ambient"]', "is named twice"),
        ('constants = ["actuator.ambient"]\ninput = "actuator.young"', "is not among the constants"),
        ("constants = []", r"1 fault\n.*run_time.constants: has 0 entries; give 1 or more"),
        (
            'constants = [{ number = "actuator.ambient", low = 10 }]',
            r"1 fault\n.*constants\[0\].low: 10: write a text in quotes",
        ),
    ],
)
def test_a_run_time_table_that_cannot_be_is_refused_with_what_to_do(tmp_path, stated, words):
    device = tmp_path / "device.toml"
    device.write_text((SCENARIOS / "devices" / "mems_hexapod.toml").read_text() + f"\n[run_time]\n{stated}\n")
    with pytest.raises(InputError, match=words):
        load_device(device)


@pytest.mark.long
def test_the_command_prints_the_constants_and_leaves_the_report(tmp_path):
    done = ctrlgen("calibrate", str(DEVICE), str(RECORDING), "--out", str(tmp_path / "out"))
    assert done.returncode == 0, done.stderr
    assert "actuator.thermal_resistance" in done.stdout and "583" in done.stdout
    names = {
        path.relative_to(tmp_path / "out").as_posix() for path in (tmp_path / "out").rglob("*") if path.is_file()
    } - {".ctrlgen"}
    page = {"calibration.html", "figures/constants.svg"}
    assert names == {"constants.h", "constants.bin", "constants.json", "device.calibrated.toml"} | page
