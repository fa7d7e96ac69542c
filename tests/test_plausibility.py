"""A wrong unit, range or rate of a recording is told with its mend; a right one never is."""

from __future__ import annotations

import re
import tomllib

import numpy as np
import pytest
from conftest import DEVICES, RECORDINGS, SCENARIOS
from model_logs import LOGS, said_of, write_log

from ctrlgen import build_model, load_device, user_device
from ctrlgen.app.check_files import check
from ctrlgen.core.errors import InputError
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.look.column_facts import table_facts
from ctrlgen.recordings.look.proposal import propose
from ctrlgen.recordings.moved import Stretch, moved_of
from ctrlgen.recordings.plausibility import early, order_notes, with_plausibility
from ctrlgen.recordings.reader import load_recordings


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """By the name of a log: its folder, its model, the lines of its recording.toml."""
    kept = {}

    def write(name):
        if name not in kept:
            kept[name] = write_log(LOGS[name], tmp_path_factory.mktemp(name))
        return kept[name]

    return write


def restated(text: str, names: str, unit: str) -> str:
    """The lines of the signals that match with another unit than their numbers are in."""
    return re.sub(rf'^("(?:{names})".*unit = )"[^"]*"', rf'\1"{unit}"', text, flags=re.MULTILINE)


WRONG = [  # a log, which signals, the unit that is stated, the one that they are in
    ("axis", "reading.axis", "mm", "um"), ("axis", "reading.axis", "nm", "um"), ("axis", "reading.axis", "m", "um"),
    ("axis", "drive.axis", "mV", "V"), ("axis", "drive.axis", "kV", "V"),
    ("levers", "reading.*", "mm", "um"), ("levers", "reading.*", "nm", "um"), ("levers", "reading.delta_x", "mm", "um"),
    ("levers", "reading.delta_y", "nm", "um"), ("levers", "drive.*", "mV", "V"), ("levers", "drive.x", "mV", "V"),
    ("levers", "drive.*", "kV", "V"), ("levers", "drive.y", "kV", "V"),
    ("guide", "reading.delta_x", "nm", "um"), ("guide", "reading.delta_x", "mm", "um"), ("guide", "reading.delta_x", "in", "um"),
    ("guide", "drive.*", "mA", "A"),
    ("mirror", "reading.*", "rad", "mrad"), ("mirror", "reading.theta_x", "urad", "mrad"), ("mirror", "reading.*", "deg", "mrad"),
    ("mirror", "drive.*", "mV", "V"), ("mirror", "reading.theta_y", "rad", "mrad"),
    ("poses", "reading.theta.*", "rad", "deg"), ("poses", "reading.theta_x", "mrad", "deg"), ("poses", "reading.theta_z", "rad", "deg"),
    ("poses", "reading.delta_x", "mm", "um"), ("poses", "reading.delta_x", "nm", "um"), ("poses", "drive.*", "mm", "um"),
    ("poses", "drive.1x", "nm", "um"), ("poses", "drive.*", "nm", "um"),
    ("heaters", "reading.theta.*", "deg", "urad"), ("heaters", "reading.theta.*", "mrad", "urad"), 
    ("heaters", "reading.delta_.", "nm", "um"),
    ("heaters", "reading.delta_x", "mm", "um"), ("heaters", "drive.*", "mW", "W"), ("heaters", "drive.1X", "mW", "W"),
]  # fmt: skip
QUICK = [
    ("axis", "drive.axis", "mV", "V"),
    ("levers", "reading.delta_x", "mm", "um"),
    ("poses", "reading.theta.*", "rad", "deg"),
]


@pytest.mark.parametrize("cases", [QUICK, pytest.param(WRONG, marks=pytest.mark.long)], ids=["few", "all"])
def test_a_wrong_unit_is_told_with_the_right_one_and_a_right_one_is_not(written, cases):
    missed = []
    for name in dict.fromkeys(case[0] for case in cases):
        folder, model, text = written(name)
        assert said_of(text, folder, model) == [], name
        for _, names, stated, right in (case for case in cases if case[0] == name):
            wrong = restated(text, names, stated)
            assert wrong != text
            said = said_of(wrong, folder, model)
            first = said[0].partition(" or if ")[0] if said else ""
            several = names == "drive.*" and all("reaches" in s for s in said)
            mended = all(re.search(names, s) and f'write unit = "{right}"' in s for s in (first, *said))
            if not said or not mended or not (several or len(said) == 1):
                missed.append((name, names, stated, said))
    assert not missed, f"{len(missed)} of {len(cases)}: {missed}"
    assert cases is QUICK or len(cases) >= 30


@pytest.mark.parametrize(
    ("name", "rate", "what"),
    [
        ("axis", "100 Hz", "a tenth"),
        ("axis", "10 kHz", "ten times"),
        ("axis", "1 Hz", "ms where s"),
        pytest.param("levers", "20 kHz", "ten times", marks=pytest.mark.long),
        pytest.param("heaters", "10 kHz", "ten times", marks=pytest.mark.long),
        pytest.param("heaters", "1 MHz", "Hz where kHz", marks=pytest.mark.long),
    ],
)
def test_a_wrong_rate_is_told_where_the_readings_show_the_dynamics(written, name, rate, what):
    folder, model, text = written(name)
    said = said_of(re.sub('sample_rate = "[^"]*"', f'sample_rate = "{rate}"', text), folder, model)
    assert any(what in s for s in said), said


def altered(folder, model, text: str, name: str, fit: float, held: float, apart: float = 0.0) -> list[str]:
    """What is said of a log whose reading is multiplied in its first half, which is fitted, and in its second one, held out, where it also
    stands so far off."""
    head, *rows = (folder / "log.csv").read_text().splitlines()
    place = head.split(",").index(name)
    half = len(rows) // 2
    for file, factor, off, part in (("fit.csv", fit, 0.0, rows[:half]), ("held.csv", held, apart, rows[half:])):
        numbers = [[float(v) for v in row.split(",")] for row in part]
        lines = [[factor * v + off if i == place else v for i, v in enumerate(row)] for row in numbers]
        (folder / file).write_text("\n".join([head, *(",".join(f"{v:.9g}" for v in line) for line in lines)]) + "\n")
    before, record, after = re.split(r"(\[\[record\]\].*)(?=\[columns\])", text, flags=re.DOTALL)
    poses = "poses" in before
    records = [
        record.replace("log.csv", "fit.csv"),
        record.replace("log.csv", "held.csv").replace('"fit"', '"hold_out"'),
    ]
    starts = ["", ""] if poses else ['start = "0 s"\n', 'start = "100 s"\n']
    both = "".join(r + start for r, start in zip(records, starts, strict=True))
    return said_of(before + both + after, folder, model)


SIZES = {"turned round": (1.0, -1.0), "another range": (1.0, 10.0), "another unit": (1.0, 1e-3), "both": (-1.0, 10.0)}
OF_LOGS = pytest.mark.parametrize(
    "log", ["axis", "poses", *(pytest.param(n, marks=pytest.mark.long) for n in ("levers", "mirror"))]
)


@OF_LOGS
def test_a_reading_of_another_size_or_sign_in_one_record_is_told(written, log):
    folder, model, text = written(log)
    for name in LOGS[log].readings:
        assert altered(folder, model, text, name, 1.0, 1.0) == []
        for what, (fit, held) in SIZES.items():
            said = [s for s in altered(folder, model, text, name, fit, held) if "changed between them" in s]
            assert len(said) == 1 and said[0].startswith(f"reading.{name} is "), (name, what, said)
            sizes = {file: float(size) for size, file in re.findall(r"(\S+) times [^,]*?in (\w+)\.csv", said[0])}
            # the one that is further from once is named first
            assert next(iter(sizes)) == ("fit" if what == "both" else "held"), said
            # the second half does not begin settled, as the model does
            assert sizes == {"fit": pytest.approx(fit, rel=0.1), "held": pytest.approx(held, rel=0.1)}, said


@OF_LOGS
def test_a_zero_that_is_another_in_one_record_is_told(written, log):
    folder, model, text = written(log)
    for name, unit in LOGS[log].readings.items():
        rows = np.genfromtxt(folder / "log.csv", delimiter=",", names=True)[name]
        for apart in (-6 * np.std(rows), 6 * np.std(rows)):
            (said,) = altered(folder, model, text, name, 1.0, 1.0, apart)
            assert said.startswith(f"the zero of reading.{name} is at ") and "zero_per_record" in said
            zeros = {file: float(v) for v, file in re.findall(rf"(\S+) {unit} in (\w+)\.csv", said)}
            assert zeros["held"] - zeros["fit"] == pytest.approx(apart, rel=0.1)
        assert altered(folder, model, text, name, 1.0, 1.0, 0.1 * np.std(rows)) == []  # a mean that a law may shift


@OF_LOGS
def test_a_reading_so_large_as_no_description_is_off_is_told_where_no_unit_makes_it(written, log):
    folder, model, text = written(log)
    for name in LOGS[log].readings:
        for times in (5.0, 0.2):
            (said,) = altered(folder, model, text, name, times, times)
            assert "the sensor's scale" in said
            told = re.match(rf"reading\.{name} is (\S+) times ", said)
            assert told and float(told[1]) == pytest.approx(times, rel=0.1)
        assert altered(folder, model, text, name, 2.0, 2.0) == []  # a description may be as far off


def test_a_speed_that_is_no_slope_of_its_position_is_told(tmp_path):
    model, t = build_model(load_device(SCENARIOS / "servo_motor" / "device.toml")), 0.01 * np.arange(1000)
    x, v, f = np.sin(t), np.cos(t), 1e-4 * np.cos(t)
    rows = "".join(f"{a:.9g},{b:.9g},{-a:.9g},{c:.9g}\n" for a, b, c in zip(x, v, f, strict=True))
    (tmp_path / "log.csv").write_text("x,v,a,f\n" + rows)
    text = f"""title = "t"
device = "{model.device.name}"
kind = "series"
[[record]]
file = "log.csv"
role = "fit"
sample_rate = "100 Hz"
[columns]
"drive.position" = {{ column = "x", unit = "rad" }}
"drive.velocity" = {{ column = "v", unit = "rad/s" }}
"drive.acceleration" = {{ column = "a", unit = "rad/s^2" }}
"reading.force" = {{ column = "f", unit = "N*m" }}
"""
    assert not [s for s in said_of(text, tmp_path, model) if "slope" in s]
    said = [s for s in said_of(restated(text, "drive.position", "mrad"), tmp_path, model) if "slope" in s]
    assert len(said) == 1 and 'write unit = "rad"' in said[0]


def test_check_and_look_tell_it(written, capsys):
    folder, model, text = written("axis")
    (folder / "recording.toml").write_text(restated(text, "reading.axis", "mm"))
    check(folder / "recording.toml", DEVICES / LOGS["axis"].file)
    assert 'if its numbers are in um, write unit = "um"' in capsys.readouterr().out
    posed = restated(text, "reading.axis", "mm").replace(
        '"reading.axis"', '"pose.axis"'
    )  # as runs that are learnt from state it
    assert len([s for s in said_of(posed, folder, model) if 'write unit = "um"' in s]) == 1
    rows = (folder / "log.csv").read_text().splitlines()[1:]
    lines = "\n".join(f"{k / 1000},{row}" for k, row in enumerate(rows))
    (folder / "named.csv").write_text("time [s],drive [V],position [mm]\n" + lines + "\n")
    said = propose([table_facts(read_table(folder / "named.csv"))], model).remarks
    assert len(said) == 1 and 'write unit = "um"' in said[0]


def recorded():
    """Every recording.toml that is shipped or lies beside the repository, with its device."""
    devices = {d.name: d for d in map(load_device, [*DEVICES.glob("*.toml"), *SCENARIOS.glob("*/device.toml")])}
    for file in sorted([*SCENARIOS.glob("*/*.toml"), *(RECORDINGS.parent).glob("*/*/recording.toml")]):
        table = tomllib.loads(file.read_text())
        if "record" not in table:
            continue
        beside = next(
            (p for p in (file.parent / "device.toml", file.parent.parent / "stage.toml") if p.is_file()), None
        )
        yield file, devices[table["device"]] if beside is None else load_device(beside)


@pytest.mark.long
def test_nothing_is_told_of_a_recording_that_is_right():
    said, read = {}, 0
    for file, device in recorded():
        model = build_model(device)
        try:
            recording = load_recordings([file], model)
        except InputError:
            continue
        read += 1
        notes = with_plausibility(recording, model).notes[len(recording.notes) :]
        said |= {str(file): notes} if notes else {}
    assert read >= 4 and not said


def test_a_reading_that_its_own_loop_answers_is_not_told_as_early():
    """A controller answers what is read, the more where friction makes it lag; a reading that is shifted is told all the same."""
    step, m, c, rub = 2e-3, 0.02, 0.25, 0.35
    t = step * np.arange(3000)
    wanted = 0.3 * (np.sin(2 * np.pi * 0.3 * t) + np.sin(2 * np.pi * 0.55 * t) + np.sin(2 * np.pi * 1.1 * t))
    u, y = np.zeros(len(t)), np.zeros(len(t))
    x, v = 0.0, 0.0
    for k in range(len(t)):
        u[k], y[k] = np.clip(14 * (wanted[k] - x) - 0.25 * v, -12, 12), x
        for _ in range(10):
            push = 0.6 * u[k] - c * v
            free = push - rub * np.sign(v if v else push)
            after = v + 0.1 * step * free / m if v or abs(push) > rub else 0.0
            v = 0.0 if after * v < 0 else after
            x += 0.1 * step * v

    servo = user_device(
        "servo",
        parameters={"m": f"{m} kg*m^2", "c": f"{c} N*m*s", "k": "0.6 N*m/V"},
        drive={"u": "12 V"},
        axes={"x": "90 deg"},
        mass=lambda p: p.m,
        force=lambda u, p: p.k * u.u,
        restoring_force=lambda d: 0 * d.x,
        damping_force=lambda v, p: p.c * v.x,
    )

    def seen(device, name, drive, reading):
        stretch = Stretch(drive[:, None], reading[:, None], step, False)
        return moved_of(build_model(device), ((f"drive.{name[0]}", "V"),), ((f"reading.{name[1]}", "rad"),), [stretch])

    assert early(u, y)  # by the drive alone
    assert not order_notes(seen(servo, "ux", u, y))
    flexure, names = load_device(DEVICES / "flexure_axis.toml"), ("axis", "axis")
    steps = np.repeat(np.random.default_rng(1).normal(size=100), 30)
    follows = seen(flexure, names, steps, steps).system.responses(steps[:, None], step, False)[:, 0, 0]
    assert not order_notes(seen(flexure, names, steps, follows))
    assert order_notes(seen(flexure, names, steps, np.roll(follows, -20)))
