"""A heater whose loss does not rise in proportion to its temperature: how fast it cools, what holds it warm, which physics it meets, and
how a diagnosis finds it, or does not where it has no such law."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import effect_device
from scipy.integrate import solve_ivp
from scipy.optimize import curve_fit

from ctrlgen import build_model, diagnose, simulate
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.model.inverse import invert

AMBIENT, R, TAU = 295.15, 550.0, 5e-3  # of the hexapod's heaters [K, K/W, s]
B, N = 4e-4, 1.5


def hotter(**numbers):
    """The hexapod whose heaters lose more as they grow hot."""
    return build_model(effect_device({"kind": "heat_loss", "at": "all", "coefficient": f"{B} 1/K", "power": str(N)}))


def loss(rise):
    """G DT [W], from the definition."""
    return rise / R * (1 + B * rise * (rise / AMBIENT) ** (N - 1))


def test_it_cools_and_warms_as_the_balance_of_heat_says():
    """C dT/dt = P - G(T) DT, C = tau/R: warmed by 0.8 W for 20 ms, then left to cool; steps of a fortieth of the time constant."""
    h, warm, end = TAU / 40, 20e-3, 40e-3
    powers = np.where(h * np.arange(round(end / h) + 1) < warm, 0.8, 0.0)
    found = simulate(hotter(), np.tile(powers[:, None], 6), h).signals["state"][: len(powers), 0] - AMBIENT
    x = 0.0
    rises = [x]
    for P in powers[:-1]:
        x = solve_ivp(lambda t, q, P=P: R / TAU * (P - loss(abs(q))), (0, h), [x], rtol=1e-10, atol=1e-10).y[0, -1]
        rises.append(x)
    # what a step takes for linear within it, of 350 K: with its square, 0.006 K here
    assert np.abs(found - rises).max() < 0.01
    # at the stated time constant it would cool less fast
    first = np.flatnonzero(powers)[-1] + 1
    assert found[-1] / found[first] < 0.95 * np.exp(-(end - h * first) / TAU)


def test_the_inverse_asks_for_what_is_lost_at_the_temperature_that_is_wanted():
    model = hotter()
    powers = np.linspace(0.1, 0.6, 6)
    still = simulate(model, np.tile(powers, (400, 1)), 1e-3)
    x, z = still.x[-1], still.z[-1]
    # the law rounds its power off below 0.3 K
    assert loss(still.signals["state"][-1] - AMBIENT) == pytest.approx(powers, rel=1e-6)
    kernels = invert(model, "pose", None)
    asked = kernels.drive(x, z, z, kernels.state(x, z, z))
    assert np.asarray(asked).ravel() == pytest.approx(powers, rel=1e-9)


@pytest.mark.parametrize(("top", "sign"), [(200.0, 1), (500.0, 1), (200.0, -1), (500.0, -1)])
def test_one_power_of_the_rise_is_radiation_or_a_conductivity_that_falls(top, sign):
    """To 1.3 % of what they add at the highest rise, as its file says; a coefficient alone is off several times as far."""
    T0, rise = 293.15, np.linspace(1, top, 200)
    T = T0 + rise
    radiation = T**4 - T0**4 - 4 * T0**3 * rise
    silicon = T0 / 0.3 * (1 - (T / T0) ** -0.3) - rise  # integral of (T/T0)^-1.3
    adds = radiation / radiation[-1] if sign > 0 else silicon / silicon[-1]

    def off(form, start):
        return np.abs(form(rise, *curve_fit(form, rise, adds, start)[0]) - adds).max()

    power = off(lambda x, b, n: b * (x / top) ** (1 + n), (1.0, 1.0))
    linear = off(lambda x, b: b * (x / top) ** 2, (1.0,))
    assert power < 0.013 and 0.05 < linear < 0.13


CHEVRON = """kind = "mechanism"
name = "chevron"
title = "a chevron that pushes on a spring"
source = "round numbers"

[[material]]
name = "silicon"
young = "160 GPa"
poisson = "0.22"
expansion = "2.6e-6 1/K"
expansion_slope = "5e-9 1/K^2"

[[body]]
name = "bar"

[[element]]
kind = "bent_beam"
name = "beams"
from = "ground"
to = "bar"
material = "silicon"
at = ["0 mm", "0 mm", "0 mm"]
along = [1, 0, 0]
beams = "10"
beam_angle = "4 deg"
beam_length = "1 mm"
beam_width = "12 um"
beam_gap = "30 um"
bar_width = "30 um"
bar_half_height = "20 um"
thickness = "30 um"

[[actuator]]
name = "heater"
kind = "thermal"
on = "beams"
ambient = "20 degC"
temperature_limit = "550 degC"
thermal_resistance = { value = "500 K/W", sd = "2.5 K/W" }
time_constant = { value = "20 ms", sd = "1 ms" }
power_limit = "1 W"
travel = "40 um"

[output]
body = "bar"
at = ["0 mm", "0 mm", "0 mm"]
channels = ["delta_x"]
"""
RECORDING = 'title = "a chevron"\ndevice = "chevron"\nkind = "series"\n' + "".join(
    f'[[record]]\nfile = "{role}.csv"\nrole = "{role}"\ntime = {{ column = "t", unit = "s" }}\nbetween_samples = "held"\n'
    for role in ("fit", "hold_out")
)
COLUMNS = """[columns]
"drive.heater" = { column = "P", unit = "W" }
"reading.delta_x" = { column = "x", unit = "um", noise = "10 nm" }
"""
STIFFNESS = 5770.673  # N/m, of the beams of this device


def radiating(folder, seed=7, n=800, h=4e-3, share=0.12):
    """A record to fit and one to hold out of a heater that radiates `share` beside what it conducts at 700 K; steps of an eighth of a
    sample."""
    rng, cold = np.random.default_rng(seed), 293.15
    beyond = share * (700 - cold) / (700**4 - cold**4 - 4 * cold**3 * (700 - cold))
    for role in ("fit", "hold_out"):
        powers, T, rows = np.repeat(rng.uniform(0.02, 0.9, n // 40 + 1), 40)[:n], cold, []
        for k, P in enumerate(powers):
            expands = (2.6e-6 + 5e-9 * (T - 273.15)) * (T - cold)
            F = 20 * expands * 160e9 * 12e-6 * 30e-6 * np.sin(np.radians(4))
            rows.append((k * h, P, F / STIFFNESS * 1e6 + 0.01 * rng.standard_normal()))
            for _ in range(32):
                lost = T - cold + beyond * (T**4 - cold**4 - 4 * cold**3 * (T - cold))
                T += h / 32 * (500 * P - lost) / 20e-3
        np.savetxt(folder / f"{role}.csv", rows, delimiter=",", header="t,P,x", comments="")
    (folder / "device.toml").write_text(CHEVRON)
    (folder / "recording.toml").write_text(RECORDING + COLUMNS)


@pytest.mark.long
def test_of_a_heater_that_radiates_no_other_law_is_certain(tmp_path):
    """All of them leave several times the noise, and nearly the same."""
    radiating(tmp_path)
    files = (tmp_path / "device.toml", tmp_path / "recording.toml")
    found = diagnose(*files, laws=("bow", "expansion", "heater_resistance"), jobs=0)
    (first,) = found.findings
    assert found.verdict == Verdict.AMBIGUOUS
    assert {first.effect, *(c.effect for c in first.alternatives)} >= {"bow", "expansion"}


def driven_by_volts(folder, turns, seed=7, n=800, h=4e-3):
    """A heater of 150 Ohm and 1.5e-3 1/K, whose resistance is largest `turns` above the cold one: dR/dT falls in a straight line, to zero
    there. In steps of a 64th of a sample."""
    rng, cold = np.random.default_rng(seed), 293.15
    for role in ("fit", "hold_out"):
        volts, T, rows = np.sqrt(150 * np.repeat(rng.uniform(0.02, 0.9, n // 40 + 1), 40)[:n]), cold, []
        for k, U in enumerate(volts):
            F = 20 * (2.6e-6 + 5e-9 * (T - 273.15)) * (T - cold) * 160e9 * 12e-6 * 30e-6 * np.sin(np.radians(4))
            rows.append((k * h, U, F / STIFFNESS * 1e6 + 0.01 * rng.standard_normal()))
            for _ in range(64):
                slopes = 1.5e-3, 1.5e-3 * (1 - (T - cold) / turns)  # at the cold end and here
                R = 150 * (1 + (T - cold) * np.mean(slopes))
                T += h / 64 * (500 * U**2 / R - (T - cold)) / 20e-3
        np.savetxt(folder / f"{role}.csv", rows, delimiter=",", header="t,P,x", comments="")
    volt = 'heater_resistance = "150 ohm"\npower_limit'
    (folder / "device.toml").write_text(CHEVRON.replace("power_limit", volt))
    (folder / "recording.toml").write_text(RECORDING + COLUMNS.replace('"W"', '"V"'))


LAWS_OF_HEAT = ("end_stop", "heat_loss", "heater_resistance", "heater_resistance_of_second_order")


@pytest.mark.long
@pytest.mark.parametrize("turns", [300.0, np.inf])
def test_a_resistance_that_rises_and_falls_is_told_and_a_straight_one_stays_straight(tmp_path, turns):
    """It was an end stop."""
    driven_by_volts(tmp_path, turns)
    found = diagnose(tmp_path / "device.toml", tmp_path / "recording.toml", laws=LAWS_OF_HEAT, jobs=0)
    (only,) = found.findings
    assert found.verdict is Verdict.EXPLAINED
    straight = np.isinf(turns)
    assert only.effect == "heater_resistance" + ("" if straight else "_of_second_order")
    truth = {"slope": 1.5e-3} | ({} if straight else {"curvature": -0.5 / turns})
    for name, number in truth.items():
        low, high = only.parameters[name].ci95
        assert low - 2e-3 * abs(number) <= number <= high + 2e-3 * abs(number)  # of the steps, of either side
