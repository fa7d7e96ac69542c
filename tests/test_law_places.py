"""Where a law is suspected, and where it is another law."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest
from axis_records import AXIS, axis_fitter, record
from conftest import DEVICE
from planted_poses import played
from recovery import fitter_of

import ctrlgen
from ctrlgen import build_model, load_device, simulate
from ctrlgen.core.errors import InputError
from ctrlgen.core.files import validate
from ctrlgen.core.units import to_si
from ctrlgen.devices import Device
from ctrlgen.diagnosis.diagnose import diagnose_recording
from ctrlgen.diagnosis.prepared_recording import noise_before_fits
from ctrlgen.diagnosis.selection.objections import objections
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.effects import Place
from ctrlgen.estimation.fit import Fit, Fitter
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis, hypotheses, nominal_physics
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Recording


def gantry():
    """Two axes moved as told, whose forces are read; no force depends on where the second one is."""
    return ctrlgen.user_device(
        "gantry",
        parameters={"m": "8 kg", "c": "20 N*s/m", "k": "300 N/m"},
        axes={"x": "200 mm", "y": "150 mm"},
        speed={"x": "1 m/s", "y": "1 m/s"},
        needed_force=lambda d, v, a, p: [p.m * a.x + p.c * v.x + p.k * d.x, p.m * a.y + p.c * v.y],
    )


def test_a_friction_in_proportion_to_the_speed_is_damping():
    """At the highest speed at which it creeps, and where the speeds recorded do not tell that one from its force; a sharp contact, which
    they do not tell from a sharper one, is friction."""
    fitter, _ = axis_fitter(n=800).described(AXIS)
    friction = Hypothesis("coulomb", "stage:axis", "axis", time=0.1)

    def against(force: float, smoothing: float) -> str:
        start = {"force": force, "reach": 1e-8, "smoothing": smoothing}
        fit = fitter.fit(Structure(AXIS).with_cause(friction, start), steps=0)
        return objections(fitter.recording, fit).get(0, "")

    assert "bound of 100000 um/s, where it is viscous damping" in against(4.0, 0.1)
    assert "do not tell its smoothing from its size" in against(0.3, 0.08)
    assert not against(0.3, 1e-5)
    assert not against(0.3, 1e-3)


def test_a_brake_whose_critical_speed_is_far_beyond_those_recorded_is_damping():
    """A plain damper has none; a brake that passes its largest force is one."""
    fitter, _ = axis_fitter(n=800).described(AXIS)
    brake = Hypothesis("eddy_current_brake", "stage:axis", "axis", time=0.1)

    def against(speed: float, damping: float = 50.0) -> str:
        fit = fitter.fit(Structure(AXIS).with_cause(brake, {"damping": damping, "speed": speed}), steps=0)
        return objections(fitter.recording, fit).get(0, "")

    assert "where it is viscous damping" in against(0.1)
    assert "it is viscous damping" in against(0.09, damping=1.0)
    assert not against(2e-3)


def test_a_displacement_that_no_force_depends_on_has_no_law():
    """The disturbance that would tell it from others has no place to enter."""
    device = gantry()
    found = hypotheses(device, nominal_physics(device), ("reading.x", "reading.y"), 1e-3, ambient=False)
    behind = [h for h in found if h.effect != PARAMETER and h.law.place is Place.DISPLACEMENT]
    assert {h.at for h in behind} == {"x"} and "backlash" in {h.effect for h in behind}
    assert {h.at for h in found if h.effect == "coulomb"} == {"x", "y", "all"}


def motor_record(t: np.ndarray, w: float, way: float, force, rng) -> tuple[np.ndarray, np.ndarray]:
    """A slide of 4 kg with 20 N*s/m on two sines: its motion, and the force that it takes beside force(d)."""
    d, v, a = (
        way * (w**k * np.sin(w * t + k * np.pi / 2) + 0.15 * (2.7 * w) ** k * np.sin(2.7 * w * t + k * np.pi / 2))
        for k in range(3)
    )
    return np.column_stack([d, v, a]), 4 * a + 20 * v + force(d) + 0.05 * rng.standard_normal(len(t))


def linear_motor() -> Device:
    own = {"mass": {"value": "4 kg", "sd": "0.2 kg"}, "damping": {"value": "20 N*s/m", "sd": "2 N*s/m"}}
    own |= {"stiffness": "0 N/m", "stroke": "200 mm", "speed": "1 m/s", "force": "50 N"}
    table = {"kind": "tested_axis", "name": "motor", "title": "a motor", "source": "round numbers", "mechanics": own}
    return validate(Device.library["tested_axis"], table, "device")


def cogging_motor() -> tuple[Device, Recording]:
    """14 slots within the way, two harmonics, which no start value of the law knows."""
    rng, device, t, parts = np.random.default_rng(2), linear_motor(), 2e-3 * np.arange(3000), []

    def cogging(d: np.ndarray) -> np.ndarray:
        angle = 2 * np.pi * d / 0.024
        return 1.5 * np.sin(angle + 0.4) + 0.3 * np.sin(2 * angle + 1)

    for role, hertz, way in (("fit", 0.31, 0.15), ("hold_out", 0.47, 0.11)):
        moved, force = motor_record(t, 2 * np.pi * hertz, way, cogging, rng)
        parts.append(record(moved, force, role, h=2e-3))
    return device, Recording("t", device.name, "series", ("reading.force",), ("N",), (0.05,), tuple(parts), ())


def test_a_force_is_looked_for_where_the_motion_repeats_beside_where_most_is_left():
    device, recording = cogging_motor()
    fitter, described = Fitter(recording, noise_before_fits(device, recording)).described(device)
    hints = Screen(fitter, []).data_hints(described)(Place.FORCE, 0).suggested
    assert min(abs(way / 0.024 - 1) for way in hints["spatial_periods"]) < 0.01
    assert "edges_above" in hints


@pytest.mark.long
def test_the_cogging_of_a_motor_is_found_with_its_pitch():
    device, recording = cogging_motor()
    found = diagnose_recording(device, recording, jobs=0)
    first = found.findings[0]
    assert found.verdict is Verdict.EXPLAINED and {f.effect for f in found.findings} == {"cogging_of_slots"}
    period = first.parameters["period"]
    assert to_si(period.value, period.unit) == pytest.approx(0.024, rel=1e-3)
    assert first.parameters["force"].value == pytest.approx(1.5, rel=0.01)
    second = np.hypot(first.parameters["sine"].value, first.parameters["cosine"].value)
    assert second == pytest.approx(0.3 / 1.5, abs=0.0035)  # 4 sd: 0.05 N / 1.5 N * sqrt(2 / 3000)


@pytest.mark.parametrize("back", [False, True])
def test_a_constant_of_an_axis_that_moves_one_way_may_be_its_friction(back):
    """A rack that made one stroke had, for certain, a sensor that does not read zero, or a weight."""
    rng, device, parts = np.random.default_rng(3), linear_motor(), []
    s = np.linspace(0, 1, 600)
    for role, way in (("fit", 0.15), ("hold_out", 0.12)):
        ways = [way * (10 * s**3 - 15 * s**4 + 6 * s**5)]
        ways += [ways[0][::-1]] if back else []
        place = np.concatenate(ways)
        v = np.gradient(place, 2e-3)
        moved = np.column_stack([place, v, np.gradient(v, 2e-3)])
        force = 4 * moved[:, 2] + 20 * v + 3.0 + 0.05 * rng.standard_normal(len(place))
        parts.append(record(moved, force, role, h=2e-3))
    recording = Recording("t", device.name, "series", ("reading.force",), ("N",), (0.05,), tuple(parts), ())
    (found,) = diagnose_recording(device, recording, jobs=0, laws=["home_offset"]).findings
    assert found.effect == "home_offset" and ("dry friction" in found.title) == (not back)


def servo_fit(readings, effect: str, start: dict[str, float]) -> tuple[Fitter, Fit]:
    """A law fitted to poses of an axis that is told where to go."""
    rng, parts = np.random.default_rng(9), []
    table = {"kind": "servo", "name": "servo", "title": "an axis", "source": "round numbers", "travel": "100 um"}
    device = validate(Device.library["servo"], table, "device")
    for n, role in ((120, "fit"), (60, "hold_out")):
        u = rng.uniform(-1e-4, 1e-4, n)
        parts.append(record(u, readings(u) + 5e-9 * rng.standard_normal(n), role, h=np.inf))
    fitter = fitter_of(device, ("reading.axis",), ("um",), (5e-9,), "poses", parts)
    cause = Hypothesis(effect, "stage:axis", "axis")
    return fitter, fitter.fit(Structure(device).with_cause(cause, start))


PLAYS = {"share": 0.1, "taper": 0.5, "reversible": 0.0}


@pytest.mark.parametrize("reach", [5e-4, 9e-4])
def test_a_hysteresis_of_which_no_play_follows_or_all_do_is_a_gain(reach):
    """What lags in proportion is no loop, wherever the fit of its reach ends; a loop is one."""
    fitter, fit = servo_fit(lambda u: 0.93 * u, "displacement_hysteresis", PLAYS | {"reach": reach})
    assert fit.chi2 < 1.5 * fit.n
    (reason,) = objections(fitter.recording, fit).values()
    assert reason.endswith(("it is a gain", "it is a gain beside a smaller loop", "it is a single play, or a gain"))
    fitter, fit = servo_fit(played, "displacement_hysteresis", PLAYS | {"reach": 3e-5})
    assert objections(fitter.recording, fit) == {}


def test_channels_that_measure_unlike_things_have_no_scale_in_common():
    """Translations and angles of one pose: a scale of each kind, and one delay of all; each is written, read and acts so."""
    device, names = load_device(DEVICE), ("theta_x", "theta_y", "delta_x", "delta_y")
    offered = hypotheses(device, nominal_physics(device), tuple(f"reading.{c}" for c in names), 1e-3, False)
    several = {(h.effect, h.at): h for h in offered if h.effect != PARAMETER and h.law.place is Place.SENSOR}
    assert {at for law, at in several if law == "sensor_gain"} == {*names, "all in rad", "all in m"}
    assert {at for law, at in several if law == "delay"} == {*names, "all"}
    changed = Structure(device).with_cause(several["sensor_gain", "all in m"], {"gain": 0.1}).expanded_device
    assert changed.effect[0].placed()["at"] == "all in m"
    table = tomllib.loads(DEVICE.read_text())
    y, scaled = (
        simulate(build_model(validate(type(device), table | more, "device")), np.full((1, 6), 0.3), 1.0).signals[
            "reading"
        ][-1]
        for more in ({}, {"effect": [{"kind": "sensor_gain", "at": "all in m", "gain": "0.1"}]})
    )
    assert scaled / y == pytest.approx([1, 1, 1, 1.1, 1.1, 1.1], rel=1e-12) and np.all(y != 0)
    with pytest.raises(InputError, match="'all in parsec_s' is not one of"):
        build_model(
            validate(
                type(device), table | {"effect": [{"kind": "delay", "at": "all in parsec_s", "delay": "1 ms"}]}, "d"
            )
        )
