"""Recordings: what a record holds, every fault at once, and what is held out."""

from __future__ import annotations

import math

import numpy as np
import pytest
from conftest import MESO_FILE, RECORDINGS, SCENARIOS
from recorded import AXES, COLUMNS, N, csv_text, described, refused, samples, two

from ctrlgen import build_model, load_device
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.outliers import outliers, stuck_samples
from ctrlgen.recordings.reader import load_recordings
from papers.s0_data import load_s0


@pytest.fixture(scope="module")
def meso():
    return build_model(load_device(MESO_FILE))


# what a record holds


def test_units_become_si_and_the_stated_noise_too(tmp_path, model):
    recording = load_recordings([two(tmp_path, samples())], model)
    assert recording.channels == ("reading.delta_x",) and recording.units == ("um",)
    assert recording.noise == (pytest.approx(1e-8),)
    assert recording.notes == () and all(r.valid.all() for r in recording.records)
    assert [r.role for r in recording.records] == ["fit", "hold_out"]
    assert not any(r.poses for r in recording.records)


def test_the_drives_stand_in_the_models_order_whatever_the_files(tmp_path, model):
    columns = {name: COLUMNS[name] for name in reversed(COLUMNS)}
    two(tmp_path, samples())
    described(tmp_path, {"file": "fit.csv", "role": "fit"}, {"file": "held.csv", "role": "hold_out"}, columns=columns)
    drive = load_recordings([tmp_path], model).records[0].drive
    assert np.allclose(drive, np.column_stack([samples()[f"u{a}"] for a in AXES]), rtol=1e-15)


def test_several_records_share_a_clock(tmp_path, model):
    two(tmp_path, samples())
    first, second = {"file": "fit.csv", "role": "fit"}, {"file": "held.csv", "role": "hold_out"}
    described(tmp_path, {**first, "start": "10 s"}, {**second, "start": "1 min"})
    records = load_recordings([tmp_path], model).records
    assert [r.time[0] for r in records] == [10, 60] and records[1].time[-1] == pytest.approx(60.399)
    described(tmp_path, {**first, "start": "10 s"}, {**second, "start": "10.2 s"})
    assert "before fit.csv ends (10.399 s)" in refused([tmp_path], model)["record[1].start"]


def test_rows_split_a_file_and_keep_their_time(tmp_path, model):
    (tmp_path / "a.csv").write_text(csv_text(samples()))
    record = {"file": "a.csv", "sample_rate": "1 kHz"}
    described(tmp_path, {**record, "role": "fit", "rows": [0, 250]}, {**record, "role": "hold_out", "rows": [250, 400]})
    fit, held = load_recordings([tmp_path], model).records
    assert (fit.name, held.name) == ("a.csv[0:250]", "a.csv[250:400]")
    assert fit.file == held.file and fit.file.endswith("a.csv")
    assert len(fit.time) == 250 and held.time[0] == pytest.approx(0.25)
    assert np.allclose(held.observed[:, 0], 1e-6 * samples()["x"][250:], rtol=1e-15)


@pytest.mark.parametrize("conditions", [{"ambient": "23.5 degC"}, {"ambient": {"column": "T", "unit": "degC"}}])
def test_the_ambient_temperature_is_a_constant_or_a_column(conditions, tmp_path, model):
    record = load_recordings([two(tmp_path, samples(), conditions=conditions)], model).records[0]
    constant = isinstance(conditions["ambient"], str)
    wanted = np.full(N, 296.65) if constant else 273.15 + samples()["T"]
    assert np.allclose(record.ambient, wanted, rtol=1e-12)


@pytest.mark.parametrize(
    "way, linear, either", [("held", False, False), ("linear", True, False), ("unstated", True, True)]
)
def test_what_the_drive_does_between_samples_is_open_unless_it_is_stated(way, linear, either, tmp_path, model):
    fit, left_out = load_recordings([two(tmp_path, samples(), between_samples=way)], model).records
    assert (fit.linear, fit.either) == (linear, either)
    assert left_out.linear and left_out.either and not left_out.smooth


def test_two_recordings_are_joined_channel_by_channel(tmp_path, model):
    a, b = tmp_path / "a", tmp_path / "b"
    a.mkdir(), b.mkdir()
    two(a, samples())
    (b / "c.csv").write_text(csv_text(samples(seed=3)))
    tilt = {**COLUMNS, "reading.theta_y": {"column": "tilt", "unit": "rad"}}
    described(b, {"file": "c.csv", "role": "fit"}, columns=tilt)
    recording = load_recordings([a, b], model)
    assert recording.channels == ("reading.delta_x", "reading.theta_y") and recording.noise[1] is None
    assert [r.valid[:, 1].all() for r in recording.records] == [False, False, True]
    assert [r.name for r in recording.records] == ["a/fit.csv", "a/held.csv", "b/c.csv"]
    assert np.isnan(recording.records[0].observed[:, 1]).all()
    assert any("given twice" in what for what in refused([a, a], model).values())


# what matters to the reader


def test_a_tolerance_is_carried_in_si_and_the_strictest_counts(tmp_path, model):
    def stating(first: str | None, second: str | None):
        two(tmp_path, samples())
        reading = COLUMNS["reading.delta_x"]
        records = [
            {
                "file": f"{name}.csv",
                "role": role,
                "columns": {"reading.delta_x": {**reading, **({"tolerance": t} if t else {})}},
            }
            for name, role, t in (("fit", "fit", first), ("held", "hold_out", second))
        ]
        return described(tmp_path, *records)

    assert load_recordings([stating(None, None)], model).tolerance == (None,)
    assert load_recordings([stating("2 um", None)], model).tolerance == (pytest.approx(2e-6),)
    recording = load_recordings([stating("2 um", "500 nm")], model)
    assert recording.tolerance == (pytest.approx(5e-7),)
    assert "records state different tolerance; the smallest is taken" in recording.notes[0]
    for wrong, said in (("0 um", "leave it out"), ("2", "unit"), ("2 deg", "deg"), ("-1 um", "negative")):
        found = refused([stating(wrong, None)], model)["record[0].columns.'reading.delta_x'"]
        assert "tolerance" in found and said in found


def test_a_drive_has_no_tolerance(tmp_path, model):
    two(tmp_path, samples())
    columns = {**COLUMNS, "drive.1X": {**COLUMNS["drive.1X"], "tolerance": "1 mW"}}
    described(tmp_path, {"file": "fit.csv", "role": "fit"}, {"file": "held.csv", "role": "hold_out"}, columns=columns)
    assert "tolerance: is for readings" in refused([tmp_path], model)["columns.'drive.1X'"]


# refusals


def test_all_faults_of_a_file_are_listed_at_once(tmp_path, model):
    drive = samples()
    drive["t"][50] = drive["t"][48]
    drive["u3X"][7] = 1.2
    two(tmp_path, drive)
    columns = {
        **COLUMNS,
        "reading.delta_x": {"column": "x", "unit": "V"},
        "reading.detla_y": {"column": "x", "unit": "um"},
    }
    columns["reading.delta_z"] = {"column": "z", "unit": "um"}
    described(
        tmp_path,
        {"file": "fit.csv", "role": "fit"},
        {"file": "none.csv", "role": "hold_out"},
        columns=columns,
        device="other",
    )
    found = refused([tmp_path], model)
    assert "'other' is not 'mems_hexapod'" in found["device"]
    assert "wrong dimension; um" in found["columns.'reading.delta_x'"]
    assert "did you mean 'reading.delta_y'" in found["columns.'reading.detla_y'"]
    assert "does not increase from row 49" in found["record[0].time"]
    assert "1.2 W at" in found["record[0].columns.'drive.3X'"]
    assert "has no column 'z'" in found["record[0].columns.'reading.delta_z'"]
    assert "does not exist" in found["record[1].file"]


def test_faults_of_the_data_are_listed_at_once_for_all_records(tmp_path, model):
    fit, held = samples(), samples(seed=2)
    fit["u3X"][7] = 1.2
    held["t"][50] = held["t"][48]
    fit["u1Y"][:] = np.nan
    two(tmp_path, fit)
    (tmp_path / "held.csv").write_text(csv_text(held))
    found = refused([tmp_path], model)
    assert "1.2 W at 0.007 s, the device allows 0 W to 1 W (1 of 400" in found["record[0].columns.'drive.3X'"]
    assert "no number at all" in found["record[0].columns.'drive.1Y'"]
    assert "does not increase from row 49 (0.049 s)" in found["record[1].time"]


def test_rounding_at_a_limit_is_no_excess(tmp_path, model):
    drive = samples()
    drive["u3X"][7] = 1 + 5e-7
    load_recordings([two(tmp_path, drive)], model)
    drive["u3X"][7] = 1 + 5e-6
    assert "record[0].columns.'drive.3X'" in refused([two(tmp_path, drive)], model)


def test_a_missing_drive_is_refused_with_the_line_to_add(tmp_path, model):
    two(tmp_path, samples())
    columns = {name: column for name, column in COLUMNS.items() if name != "drive.2Y"}
    described(tmp_path, {"file": "fit.csv", "role": "fit"}, columns=columns)
    assert '"drive.2Y" = { column' in refused([tmp_path], model)["record[0].columns"]


def test_a_unit_that_the_file_itself_contradicts_is_refused(tmp_path, model):
    (tmp_path / "fit.csv").write_text(csv_text(samples()).replace(",x,", ",x [nm],", 1))
    described(tmp_path, {"file": "fit.csv", "role": "fit"})
    assert "says nm, recording.toml says um" in refused([tmp_path], model)["record[0].columns.'reading.delta_x'"]


def test_uneven_sampling_is_refused_and_a_little_jitter_noted(tmp_path, model, rng):
    fit = samples()
    fit["t"] = fit["t"] + 1e-3 * 0.003 * rng.standard_normal(N)
    assert "jitter by 0." in load_recordings([two(tmp_path, fit)], model).notes[0]
    fit["t"] = fit["t"] + 1e-3 * 0.03 * rng.standard_normal(N)
    assert "resample to an even grid" in refused([two(tmp_path, fit)], model)["record[0].time"]


def test_held_out_data_must_not_be_the_fitted(tmp_path, model):
    two(tmp_path, samples())
    (tmp_path / "held.csv").write_text(csv_text({k: v[100:300] for k, v in samples().items()}))
    assert "holds the data of fit.csv" in refused([tmp_path], model)["record[1]"]
    record = {"file": "fit.csv"}
    described(tmp_path, {**record, "role": "fit", "rows": [0, 300]}, {**record, "role": "hold_out", "rows": [290, 400]})
    assert "share samples of column 'x' of fit.csv" in refused([tmp_path], model)["record[1].rows"]


def test_a_record_in_which_nothing_happens_is_refused(tmp_path, model):
    still = samples()
    for name in still.keys() - {"t", "T"}:
        still[name][:] = 0.1
    assert "nothing can be learnt" in refused([two(tmp_path, still)], model)["record[0]"]


def test_a_drive_that_never_moves_is_noted(tmp_path, model):
    fit = {**samples(), **{f"u{a}": np.full(N, 0.2) for a in AXES}}
    assert load_recordings([two(tmp_path, fit)], model).notes == (
        "fit.csv: no drive moves; the readings show only drift, noise, or the effect of earlier motion.",
    )


def test_rest_is_the_drive_at_rest(tmp_path, model):
    two(tmp_path, samples())
    records = [{"file": "fit.csv", "role": "rest"}, {"file": "held.csv", "role": "fit"}]
    described(tmp_path, *records)
    assert 'has role "rest", but drive.' in refused([tmp_path], model)["record[0].role"]
    rest = {**samples(), **{f"u{a}": np.full(N, 0.2) for a in AXES}}
    (tmp_path / "fit.csv").write_text(csv_text(rest))
    assert [r.role for r in load_recordings([tmp_path], model).records] == ["rest", "fit", "hold_out"]


def test_a_series_needs_one_clock_and_poses_none(tmp_path, model):
    two(tmp_path, samples())
    clock = {"time": {"column": "t", "unit": "s"}, "sample_rate": "1 kHz"}
    described(tmp_path, {"file": "fit.csv", "role": "fit", **clock})
    assert "give either" in refused([tmp_path], model)["record[0].time"]
    described(tmp_path, {"file": "fit.csv", "role": "fit", **clock}, kind="poses")
    assert "poses have no clock" in refused([tmp_path], model)["record[0].time"]


# holding out


def test_the_end_of_a_series_is_held_out_where_nothing_else_is(tmp_path, model):
    (tmp_path / "a.csv").write_text(csv_text(samples()))
    recording = load_recordings([described(tmp_path, {"file": "a.csv", "role": "fit"})], model)
    fit, held = recording.records
    assert (len(fit.time), len(held.time)) == (280, 120) and held.time[0] == pytest.approx(0.28)
    assert fit.valid.all() and held.valid.all() and "its last 120 of 400 samples" in recording.notes[-1]


def test_a_held_out_end_without_motion_is_noted(tmp_path, model):
    columns = samples()
    for axis in AXES:
        columns[f"u{axis}"][250:] = 0.2
    (tmp_path / "fit.csv").write_text(csv_text(columns))
    recording = load_recordings([described(tmp_path, {"file": "fit.csv", "role": "fit"})], model)
    assert any("no drive moves, so it proves little" in note for note in recording.notes)


def test_what_is_too_short_to_divide_is_refused(tmp_path, model):
    (tmp_path / "a.csv").write_text(csv_text(samples(199)))
    described(tmp_path, {"file": "a.csv", "role": "fit"})
    assert "too short to divide (199 rows, 200 are needed)" in refused([tmp_path], model)["record"]
    (tmp_path / "a.csv").write_text(csv_text(samples(200)))
    assert len(load_recordings([tmp_path], model).records) == 2


def poses(folder, n: int, **record):
    rng = np.random.default_rng(4)
    names = ("1x", "2x", "2y", "3x", "3y", "1y")
    columns = {name: rng.uniform(-100, 100, n) for name in names} | {"z": rng.standard_normal(n)}
    (folder / "p.csv").write_text(csv_text(columns))
    known = {f"drive.{name}": {"column": name, "unit": "um"} for name in names}
    known["reading.delta_z"] = {"column": "z", "unit": "um"}
    described(folder, {"file": "p.csv", "role": "fit", **record}, columns=known, device="meso_hexapod", kind="poses")
    return folder


def test_every_third_pose_is_held_out_in_its_place(tmp_path, meso):
    recording = load_recordings([poses(tmp_path, 14)], meso)
    fit, held = recording.records
    assert np.array_equal(np.flatnonzero(held.valid[:, 0]), [2, 5, 8, 11]) and np.array_equal(fit.valid, ~held.valid)
    assert np.isnan(fit.observed[2, 0]) and np.array_equal(fit.drive, held.drive)
    assert math.isinf(fit.sample_time) and np.array_equal(fit.time, np.arange(14))
    assert "too short to divide" in refused([poses(tmp_path, 11)], meso)["record"]


def test_poses_with_a_dwell_have_a_clock(tmp_path, meso):
    record = load_recordings([poses(tmp_path, 12, dwell="2 s", start="1 s")], meso).records[0]
    assert record.sample_time == 2 and np.array_equal(record.time, 1 + 2.0 * np.arange(12)) and record.poses


# real data


def test_the_poses_of_nist_are_a_recording(meso):
    recording = load_recordings([SCENARIOS / "nist_hexapod"], meso)
    device, _, s0 = load_s0()
    fit, held = recording.records
    single = (s0.commanded != 0).sum(1) == 1
    assert single[:24].all() and not single[24:].any() and (len(fit.time), len(held.time)) == (24, 30)
    travels = np.vstack([fit.drive, held.drive])
    assert np.allclose(travels, s0.inputs, rtol=0, atol=1e-12)  # a picometre: travels.csv has ten digits
    assert np.allclose(np.vstack([fit.observed, held.observed]), s0.measured, rtol=1e-12, atol=0)
    assert device.name == recording.device and not recording.notes


@pytest.mark.parametrize(
    "name", ["emps/DATA_EMPS.mat", "friction_damper/ds2_1Hz_36lb_1in.json", "rotary_axis/run_a.csv"]
)
def test_real_files_are_read_and_nothing_in_them_is_marked(name):
    path = RECORDINGS / name
    if not path.exists():
        pytest.skip(f"{path} is not there: the real recording was not read")
    drive, read = {".mat": ("vir", "qm"), ".json": (1, 2), ".csv": ("commanded_deg", "measured_deg")}[path.suffix]
    table = read_table(path)
    u, y = (table.numbers(table.find(column)) for column in (drive, read))
    assert len(u) > 3000 and not outliers(y, u[:, None]).any() and not stuck_samples(y, u[:, None]).any()


def test_two_signals_are_not_read_from_one_column_but_one_amplifier_may_drive_two_with_a_scale(tmp_path, model):
    two(tmp_path, samples())
    records = [{"file": "fit.csv", "role": "fit"}, {"file": "held.csv", "role": "hold_out"}]
    alike = COLUMNS | {"drive.1Y": COLUMNS["drive.1X"]}
    found = refused([described(tmp_path, *records, columns=alike)], model)
    assert found["columns.'drive.1Y'"].startswith("is read from column 'u1X', as drive.1X is")
    scaled = COLUMNS | {"drive.1Y": COLUMNS["drive.1X"] | {"scale": 0.5}}
    recording = load_recordings([described(tmp_path, *records, columns=scaled)], model)
    assert np.allclose(recording.records[0].drive[:, 1], 0.5 * recording.records[0].drive[:, 0])


def test_a_dwell_of_a_stage_with_inertia_is_refused(tmp_path):
    axis = build_model(load_device(SCENARIOS / "devices" / "flexure_axis.toml"))
    (tmp_path / "poses.csv").write_text("u,y\n" + "\n".join(f"{0.1 * k},{5.0 * k}" for k in range(8)) + "\n")
    columns = {"drive.axis": {"column": "u", "unit": "V"}, "reading.axis": {"column": "y", "unit": "um"}}
    record = {"file": "poses.csv", "role": "fit", "dwell": "1 s"}
    found = refused([described(tmp_path, record, columns=columns, device="flexure_axis", kind="poses")], axis)
    assert "this one has inertia" in found["record[0].dwell"]
