"""What is the sensor's and what the device's: sizes known beforehand, and which other reading decides.

Results: docs/evidence/learning_and_sensors.md.
"""

from __future__ import annotations

import tomllib
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from axis_records import AXIS, SETTLING, axis_fitter
from axis_records import record as drive_record
from conftest import AXIS_FILE
from sensor_or_device import DEVICE, LAWS, Specimen, drawn, recorded

from battery.plant_hexapod import COMPONENTS
from ctrlgen.core.files import validate
from ctrlgen.core.units import Quantity
from ctrlgen.devices import Device
from ctrlgen.devices.axis import Axis
from ctrlgen.devices.usual_deviation import usual_deviation
from ctrlgen.diagnosis.diagnose import diagnose_recording
from ctrlgen.diagnosis.evidence.experiment_sums import Sums
from ctrlgen.diagnosis.evidence.other_readings import (
    OtherReadingEntry,
    OtherReadings,
    leans,
    other_readings,
    read_by_another,
    read_turned,
)
from ctrlgen.diagnosis.report.experiment_sentences import experiment_sentence
from ctrlgen.diagnosis.report.rival_words import unlikely_rival
from ctrlgen.diagnosis.selection.model_selection import ModelSelection, scored
from ctrlgen.diagnosis.selection.rivals import rivals
from ctrlgen.effects.gain import SensorGain
from ctrlgen.effects.offset import HomeOffset
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis, hypotheses, nominal_physics, numbers
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.estimation.size_odds import known_deviation, odds_of_size, of_sensor, prior_odds, size_odds, size_of
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Recording

GAIN = 0.006
EVERY, OF_Z = (Hypothesis("sensor_gain", f"sensor:{c}", c) for c in ("all", "delta_z"))
LEVERS = Hypothesis("lever_ratio", "stage:all", "all")
HEIGHT = Hypothesis(PARAMETER, "mechanism:height", path="hexapod.height")
GAINS = {"position_gain": "60 1/s", "velocity_gain": "20 V/(m/s)", "integral_gain": "0 V/(m*s)"}
IN_LOOP = validate(Axis, tomllib.loads(AXIS_FILE.read_text()) | {"loop": GAINS}, "device")


@pytest.fixture(scope="module")
def fits():
    """A few poses in a plane of drives, read with one channel's scale off, or that of all; the sensor and the device as causes of it."""
    found = {}
    for channel, sensor, device, start in (
        (5, OF_Z, HEIGHT, {"value": 4.127e-3}),
        (None, EVERY, LEVERS, {"gain": 0.0}),
    ):
        gain = np.zeros(6)
        gain[slice(3, 6) if channel is None else channel] = GAIN
        recording = recorded(Specimen(5, gain, {}, False, COMPONENTS[3:], True), 6)
        fitter = Fitter(recording, estimate_noise(recording, SETTLING))
        causes = ((sensor, {"gain": 0.0}), (device, start))
        found[sensor.at] = (fitter, *(fitter.fit(Structure(DEVICE).with_cause(*cause)) for cause in causes))
    return found


def decided(fits, at):
    """By kind what other readings decide between the sensor and the device."""
    fitter, ours, theirs = fits[at]
    chosen = SimpleNamespace(fit=ours, causes=ours.structure.causes)
    rival = SimpleNamespace(fit=theirs, cause=theirs.structure.causes[0])
    found = other_readings(SimpleNamespace(fitter=fitter, chosen=chosen, rivals=((rival,),)), fitter.fit_records[0])
    assert of_sensor(found.of_sensor) and not of_sensor(found.of_device)
    return found.entries[0], {e.kind: e for e in found.entries}


@pytest.mark.long
def test_a_turned_specimen_tells_a_channel_from_a_height_and_no_reference_of_all(fits):
    """The scale of one channel stays with it when the specimen turns; one of all goes round with it, as levers do: there another sensor
    decides, whose scale must be known to a sixth of the 0.6 % at three standard deviations."""
    first, by_kind = decided(fits, "delta_z")
    assert first.kind == "turned specimen" and first.separation > 10 and "about z" not in first.description
    first, by_kind = decided(fits, "all")
    assert first.kind == "second sensor" and first.scale == 1e-3 and first.settles
    assert not by_kind["turned specimen"].settles


def test_the_turned_specimen_is_read_as_turned_about_the_axis(fits):
    """By 90 deg about x: what went along z goes along -y, and y along z, where this channel's scale acts on it."""
    fitter, ours, _ = fits["delta_z"]
    record = fitter.fit_records[0]
    straight = fitter.predict(ours, record) / [1, 1, 1 + ours.theta[0]]
    turned = read_turned(0, fitter, ours, record)
    expected = np.stack([straight[:, 0], -straight[:, 2], straight[:, 1] * (1 + ours.theta[0])], axis=1)
    assert turned.y == pytest.approx(expected, abs=1e-12)
    by_skew_about_z = np.stack([-expected[:, 1], expected[:, 0]], axis=1)  # of the specimen as it stands then
    assert turned.own[:, :2, 2] == pytest.approx(by_skew_about_z, rel=1e-6, abs=1e-12)
    assert np.degrees(turned.own_sd) == pytest.approx(0.5, rel=0.05)
    another = read_by_another(1e-3, False, fitter, ours, record)
    # it has not the scale of the first, and no fit gives it one
    assert another.y == pytest.approx(straight, abs=1e-12) and not another.slopes[:, :, 0].any()


@pytest.mark.parametrize("read", [partial(read_by_another, 1e-4, False), partial(read_turned, 0)])
def test_another_reading_of_settled_poses_is_zeroed_with_the_drives_off(fits, read):
    """A reading that is not zero at home is that of the first sensor, as it was put up: by 0.1 um, five standard deviations a pose."""
    fitter, ours, _ = fits["delta_z"]
    record, home = fitter.fit_records[0], HomeOffset("delta_z", {"offset": Quantity(1e-7, "0.1 um")})
    moved = DEVICE.model_copy(update={"effect": (home,)})
    there = replace(ours, structure=replace(ours.structure, device=moved))
    assert fitter.predict(there, record)[:, 2] - fitter.predict(ours, record)[:, 2] == pytest.approx(1e-7)
    assert read(fitter, there, record).y == pytest.approx(read(fitter, ours, record).y, abs=1e-15)


def test_of_axes_that_are_not_square_a_second_sensor_may_lean_too(fits):
    """A stage that carries four tenths of its neighbour's way along, or a plate that leans: a sensor that may lean by as much as its
    scale is off tells them apart by no more than that many times."""
    assert leans(Hypothesis("squareness", "sensor:delta_x", "delta_x", "delta_y")) and not leans(OF_Z)
    fitter, ours, _ = fits["delta_z"]
    record = fitter.fit_records[0]
    square, leaning = (read_by_another(0.1, may, fitter, ours, record) for may in (False, True))
    n_y = square.y.shape[1]
    across = leaning.own[:, :, square.own.shape[2] :]
    assert across.shape[2] == n_y * (n_y - 1) and np.all(leaning.own_sd == 0.1)
    columns = {tuple(np.flatnonzero(np.abs(across[:, :, k]).max(axis=0))) for k in range(across.shape[2])}
    assert columns == {(i,) for i in range(n_y)}  # each acts on one channel
    of_first = [across[:, 0, k] for k in range(across.shape[2]) if across[:, 0, k].any()]
    assert all(any(np.array_equal(c, square.y[:, j]) for c in of_first) for j in range(1, n_y))
    nothing = Sums(np.zeros((len(ours.theta),) * 2), np.zeros(len(ours.theta)), 0.0)
    carried = square.y + 0.4 * square.y[:, [1]] * np.eye(n_y)[:1]
    apart = [nothing.plus(fitter, replace(read, y=carried), read, record).separation for read in (square, leaning)]
    assert apart[0] > 60 and apart[1] == pytest.approx(4.0, rel=0.005)  # the noise takes (4/60)^2/2 of it


def test_a_second_sensor_leans_from_ways_to_ways_and_from_angles_to_angles():
    recording = recorded(Specimen(5, np.zeros(6), {}, False, COMPONENTS, True), 6)
    fitter = Fitter(recording, estimate_noise(recording, SETTLING))
    fit, record = fitter.fit(Structure(DEVICE), steps=0), recording.records[0]
    square, leaning = (read_by_another(0.1, may, fitter, fit, record).own for may in (False, True))
    assert leaning.shape[2] - square.shape[2] == 2 * 3 * 2


def test_another_reading_of_a_motion_has_a_zero_of_its_own_and_tells_no_constant():
    """Half of the travel, thousands of standard deviations of the noise."""
    fitter = axis_fitter(n=200)
    ours, record = fitter.fit(Structure(AXIS)), fitter.fit_records[0]
    here = read_by_another(1e-4, False, fitter, ours, record)
    span, nothing = np.ptp(here.y), Sums(np.zeros((len(ours.theta),) * 2), np.zeros(len(ours.theta)), 0.0)
    beside, bare = replace(here, y=here.y + span / 2), replace(here, own=None, own_sd=None)
    zeroed, absolute = (nothing.plus(fitter, beside, read, record).separation for read in (here, bare))
    assert zeroed < 0.6 and absolute > 1000
    told = OtherReadings(
        OF_Z, HEIGHT, (OtherReadingEntry.model_construct(description="it", separation=9.0, settles=True),), False
    )
    found = SimpleNamespace(
        readings=told,
        offered=False,
        settles=False,
        alternative=None,
        drives=(),
        candidates=[SimpleNamespace(description="")],
    )
    assert "record the same motion with it" in experiment_sentence(found)
    assert "read the same poses, zeroed with the drives off, with it" in experiment_sentence(
        SimpleNamespace(**vars(found) | {"readings": replace(told, settled=True)})
    )


@pytest.mark.parametrize("off, scale", [(4e-4, 1e-4), (4e-5, 1e-5), (4e-6, 1e-6)])
def test_the_scale_of_one_channel_is_one_error_of_a_second_sensor(off, scale):
    """A laser that reads 0.04 % too much, or an axis that goes as much too far: four deviations of a scale that is known to 0.01 %."""
    servo = {"kind": "servo", "name": "servo", "title": "an axis", "source": "round numbers", "travel": "400 mm"}
    device = validate(Device.library["servo"], servo, "device")
    rng, records = np.random.default_rng(7), []
    for role, turns in (("fit", 2), ("hold_out", 3)):
        u = 0.2 - 0.2 * np.cos(2 * np.pi * turns * np.arange(200) / 200)
        records.append(drive_record(u, (1 + off) * u + 1e-9 * rng.standard_normal(200), role, h=0.01))
    recording = Recording("t", "servo", "series", ("reading.axis",), ("mm",), (1e-9,), tuple(records), ())
    fitter = Fitter(recording, estimate_noise(recording, 0.0))
    laser, axis = (
        fitter.fit(Structure(device).with_cause(Hypothesis(f"{what}_gain", at, "axis"), {"gain": 0.0}))
        for what, at in (("sensor", "sensor:axis"), ("drive", "actuator:axis"))
    )
    chosen = SimpleNamespace(fit=laser, causes=laser.structure.causes)
    rival = SimpleNamespace(fit=axis, cause=axis.structure.causes[0])
    found = other_readings(SimpleNamespace(fitter=fitter, chosen=chosen, rivals=((rival,),)), fitter.fit_records[0])
    (entry,) = found.entries
    assert entry.settles and entry.scale == scale and entry.separation == pytest.approx(4, rel=0.05)


def test_a_size_is_judged_by_what_is_stated_or_usual(fits):
    """A radius that is 5 of its deviations off is less likely than a scale that is 1.2 of its own off; a stated deviation counts first."""
    assert usual_deviation(Quantity(1.572e-3, "1.572 mm")) == pytest.approx(3.28e-6, rel=0.01)  # IT8 of 1.6 mm: 13 um
    assert usual_deviation(Quantity(0.06, "60 mm")) == pytest.approx(11.4e-6, rel=0.01)  # IT8: 46 um
    assert odds_of_size(1.0) == 0 and odds_of_size(0.1) == 0
    assert odds_of_size(3.0) == pytest.approx(np.log(3) - 2.5 * np.log(3.25 / 1.25))
    assert odds_of_size(1e3) == -4.6  # a slip of the pen
    fitter, ours, theirs = fits["delta_z"]
    assert prior_odds(ours) > -0.1 and prior_odds(theirs) < -2
    assert known_deviation(OF_Z, DEVICE).sd == 0.005
    law = SensorGain("delta_z", {"gain": Quantity(0.0, "0", sd=1e-4)})
    calibrated = DEVICE.model_copy(update={"effect": (law,)})
    assert known_deviation(OF_Z, calibrated).sd == 1e-4 and known_deviation(OF_Z, calibrated).stated
    assert known_deviation(EVERY, calibrated).sd == 0.005
    compare = ModelSelection(fitter, lambda *_: [])
    for fit in (ours, theirs):  # -2 ln of the odds is in the criterion
        left = SimpleNamespace(fit=fit, causes=())
        compare.fit_loss = compare.held_out_loss = lambda *_: 0.0
        compare.samples = lambda *_: 1.0
        left.fitted = None
        assert compare.criterion(left, None) == pytest.approx(np.log(2) - 2 * prior_odds(fit))


def test_what_fits_alike_and_is_unlikelier_of_its_size_is_told_and_nothing_likelier(fits, monkeypatch):
    fitter, ours, theirs = fits["delta_z"]
    module = "ctrlgen.diagnosis.selection.rivals"
    of_sensor_, of_height = (scored(fitter, fit, fit.structure.causes[0]) for fit in (ours, theirs))
    trials = SimpleNamespace(
        selection=SimpleNamespace(ranked=list, advantage=lambda *_: np.inf), objections=lambda *_: {}, screen=None
    )
    for name, found in (
        ("counterparts", []),
        ("twins", []),
        ("as_plainer", []),
        ("hidden_rivals", []),
        ("explains_alike_but_for_odds", True),
    ):
        monkeypatch.setattr(f"{module}.{name}", lambda *_, found=found: found)
    for named, other, told in ((of_sensor_, of_height, (of_height,)), (of_height, of_sensor_, ())):
        monkeypatch.setattr(f"{module}.replacements", lambda *_, other=other: [other])
        assert rivals(trials, named, 0) == ((), told)


def test_a_number_that_is_set_is_wrong_by_a_slip_of_the_pen_alone():
    """A gain of a digital loop is what the controller computes with; the mass is stated to 5 %."""
    fits = []
    for path, size, odds in (("mechanics.mass", pytest.approx(1.0), 0.0), ("loop.position_gain", np.inf, -4.6)):
        nominal = next(number.si for p, _, number in numbers(IN_LOOP) if p == path)
        begun = Structure(IN_LOOP).with_cause(Hypothesis(PARAMETER, "axis", path=path), {"value": 1.05 * nominal})
        for start, z, ln in ((begun.restarted(0, {"value": nominal}), 0, 0), (begun, size, odds)):
            fit = Fit(start, start.start, (), 0.0, 1, np.zeros(0), np.eye(len(start.start)), 0.0)
            assert size_of(fit, 0)[0] == z and size_odds(fit) == pytest.approx(ln, abs=1e-9)
        fits.append(SimpleNamespace(fit=fit, causes=begun.causes, cause=begun.causes[0]))
    chosen, rival = fits
    search = SimpleNamespace(chosen=chosen, unlikely=((rival,),))
    _, told = unlikely_rival(SimpleNamespace(findings=(chosen,), search=search))
    assert told == "which is set and not measured, the one named by 1"


@pytest.mark.parametrize(
    "stated, cause, known",
    [
        ("delta_z", "delta_z", True),
        ("all in m", "delta_z", True),
        ("all in m", "theta_x", False),
        ("all in m", "all in m", True),
        ("delta_x", "delta_z", False),
    ],
)
def test_what_the_file_states_of_a_gain_is_known_of_the_channels_that_it_means(stated, cause, known):
    gain = SensorGain(stated, {"gain": Quantity(0.0, "0", sd=1e-3)})
    device = DEVICE.model_copy(update={"effect": (gain,)})
    found = known_deviation(Hypothesis("sensor_gain", f"sensor:{cause}", cause), device)
    assert (found.stated, found.sd == 1e-3) == (known, known)


@pytest.mark.parametrize("other, told", [(False, 0), (True, 1)])
def test_what_has_come_to_stand_for_something_else_has_a_rival_that_does_not_do_quite_as_well(monkeypatch, other, told):
    """Worse by 10, where up to 9 is alike, and up to 9 more for such a cause."""
    fit = SimpleNamespace()
    of_z, of_height = (
        SimpleNamespace(fit=fit, causes=(c,), cause=c, errors=SimpleNamespace(is_noise=True)) for c in (OF_Z, HEIGHT)
    )
    selection = SimpleNamespace(ranked=list, advantage=lambda model, rival: 10.0)
    trials = SimpleNamespace(selection=selection, objections=lambda *_: {}, screen=None)
    answers = {
        "counterparts": [],
        "as_plainer": [],
        "replacements": [of_height],
        "twins": [],
        "size_odds": 0.0,
        "_contains": False,
        "explains_alike_but_for_odds": False,
        "stands_for_another": other,
    }
    for name, found in answers.items():
        monkeypatch.setattr(f"ctrlgen.diagnosis.selection.rivals.{name}", lambda *_, found=found: found)
    assert [len(found) for found in rivals(trials, of_z, 0)] == [told, 0]


def test_a_scale_of_all_channels_that_are_read_is_one_cause_more():
    for read in (COMPONENTS[3:], COMPONENTS[5:]):
        observed = tuple(f"reading.{c}" for c in read)
        offered = hypotheses(DEVICE, nominal_physics(DEVICE), observed, None, False, (SensorGain,))
        assert [h.at for h in offered if of_sensor(h)] == [*read, *(["all in m"] if len(read) > 1 else [])]


def test_the_answer_tells_what_fits_alike_and_is_unlikely_of_its_size(fits):
    """The height of 4.1 mm would be off by 0.6 % of it, five of its usual deviations; the channel's scale is off by 1.2."""
    _, ours, theirs = fits["delta_z"]
    rival = SimpleNamespace(fit=theirs, causes=theirs.structure.causes, cause=HEIGHT)
    chosen = SimpleNamespace(fit=ours, causes=ours.structure.causes)

    def said(*alike):
        search = SimpleNamespace(chosen=chosen, unlikely=(alike,))
        return unlikely_rival(SimpleNamespace(findings=(SimpleNamespace(cause=OF_Z),), search=search))

    of_height, of_scale = (size_of(fit, 0)[0] for fit in (theirs, ours))
    assert of_scale == pytest.approx(GAIN / 0.005, rel=0.1) and of_height > 4
    assert said() == ("", "")
    assert said(rival) == (
        "a wrong mechanism:height",
        f"which would be off by {of_height:.2g} of its usual deviations, the one named by {of_scale:.2g}",
    )


def told(seed: int) -> tuple[bool, bool, bool]:
    """Whether the first cause across sensor and device is on the right side; whether the answer says that it may be either; and whether
    it is sure of the wrong one."""
    s = drawn(seed)
    found = diagnose_recording(DEVICE, recorded(s), laws=LAWS, jobs=0)
    right = [f for f in found.findings if of_sensor(f.cause) == s.of_sensor]
    open_ = any(of_sensor(a) == s.of_sensor for f in found.findings for a in f.alternatives)
    first = found.findings and of_sensor(found.findings[0].cause) == s.of_sensor
    return bool(first), bool(open_), not right and not open_


@pytest.mark.long
def test_no_answer_is_sure_of_the_wrong_side():
    """A sensor's channel and a number of the device, read in six channels and in three."""
    for seed in (0, 6, 3, 11):
        first, _, wrong = told(seed)
        assert first and not wrong, seed
