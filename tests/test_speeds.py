"""Bounds of laws that act with speed: the same for similar machines, whatever stroke a file states; and a machine that is far off."""

from __future__ import annotations

import numpy as np
import pytest
from axis_records import AXIS_FILE, NOISE, SETTLING, C, H, K, M, drive, move, record
from scipy.integrate import solve_ivp

from ctrlgen import InputError, build_model, load_device
from ctrlgen.core.units import split_unit
from ctrlgen.diagnosis.selection.far_off import is_far_off, nearer_when_simulated
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.speeds import counted_in_speeds, speeds_that_occur
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.effects import Effect, Place
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import PARAMETER, hypotheses, nominal_physics
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.recordings.recording import Recording

N = 600
FILE = """kind = "axis"
name = "scaled"
title = "scaled"
source = "test"
[mechanics]
mass = "{m!r} kg"
damping = {{ value = "{c!r} N*s/m", sd = "{sd!r} N*s/m" }}
stiffness = "{k!r} N/m"
stroke = "{stroke!r} m"
[actuator]
force_constant = {{ value = "{kf!r} N/V", sd = "2 %" }}
drive_limit = "{limit!r} V"
"""


def device_in(folder, **numbers):
    file = folder / "device.toml"
    file.write_text(FILE.format(**{"sd": 0.2 * numbers["c"], "limit": 4.0} | numbers))
    return load_device(file)


def fitter_of(readings, h, noise, settling=SETTLING) -> Fitter:
    parts = tuple(record(u, y, role, h=h) for role, u, y in readings)
    recording = Recording("t", "scaled", "series", ("reading.axis",), ("m",), (noise,), parts, ())
    return Fitter(recording, estimate_noise(recording, settling))


def bounds_of_similar(folder, length=1.0, time=1.0, force=1.0, stroke=1.0):
    """Of a flexure axis in other units of length, time and force, with another stroke stated: bounds of every number of a law that counts
    in speeds, in those units."""
    device = device_in(
        folder,
        m=M * force * time**2 / length,
        c=C * force * time / length,
        k=K * force / length,
        stroke=1e-4 * length * stroke,
        kf=10.0 * force,
    )
    rng, u = np.random.default_rng(1), drive(N)
    y = length * (move(u) + NOISE * rng.standard_normal(N))
    fitter = fitter_of([("fit", u, y), ("hold_out", u, y)], time * H, length * NOISE, time * SETTLING)
    offered = hypotheses(device, nominal_physics(device), ("reading.axis",), time * H, False)
    found = {}
    for h in counted_in_speeds(offered, fitter, device):
        for p in () if h.effect == PARAMETER else h.law.params:
            if not p.of_motion:
                continue
            powers, _ = split_unit(p.unit, ("channel", "travel", "s"))
            channel = 1.0 if h.law.place is Place.DRIVE else force  # the volt stays what it is
            unit = np.prod(
                [size ** powers.get(w, 0) for w, size in (("channel", channel), ("travel", length), ("s", time))]
            )
            found[h.effect, p.name] = np.array(h.bounds(p, h.channel_on(device))) / unit
    return found


def test_bounds_per_speed_are_those_of_any_similar_machine_whatever_its_stroke(tmp_path, rng):
    usual = bounds_of_similar(tmp_path)
    asked = {(kind, p.name) for kind, law in Effect.library.items() for p in law.params if p.of_motion}
    assert {("quadratic_damping", "damping"), ("stribeck", "speed"), ("coulomb", "smoothing")} < set(usual) < asked
    scales = [{"stroke": 0.01}, {"stroke": 1000.0}, {"time": 1e-3}, {"time": 1e3}]
    scales.append(dict(zip(("length", "time", "force", "stroke"), (10 ** rng.uniform(-2, 2, 4)).tolist(), strict=True)))
    for scaled in scales:
        for key, bounds in bounds_of_similar(tmp_path, **scaled).items():
            assert bounds == pytest.approx(usual[key], rel=0.02), (key, scaled)
    fastest = np.abs(np.diff(move(drive(N), fine=40))).max() / H
    assert usual["quadratic_damping", "damping"][1] == pytest.approx(1e4 * 40.0 / fastest**2, rel=0.3)


@pytest.mark.parametrize(
    ("text", "says"), [("1e9 N*s^2/m^2", ""), ("-1e-9 N*s^2/m^2", "damping .* must be zero or positive")]
)
def test_a_file_may_state_any_size_of_what_counts_per_speed_but_not_the_other_sign(text, says, tmp_path):
    file = tmp_path / "device.toml"
    effect = f'\n[[effect]]\nkind = "quadratic_damping"\nat = "axis"\ndamping = "{text}"\n'
    file.write_text(AXIS_FILE.read_text() + effect)
    if not says:
        build_model(load_device(file))
        return
    with pytest.raises(InputError, match=says):
        build_model(load_device(file))


J, DRAG, TORQUE = 2e-4, 2e-6, 0.02


def blown(u, h, drag=DRAG):
    """Way of a wheel with drag, by another integrator: J v' = K_t u - c v - d v |v|."""

    def rates(t, s):
        return [s[1], (TORQUE * u[min(int(t / h), len(u) - 1)] - 2e-5 * s[1] - drag * s[1] * abs(s[1])) / J]

    times = h * np.arange(len(u))
    return solve_ivp(rates, (0, times[-1]), [0, 0], t_eval=times, max_step=h, rtol=1e-8).y[0]


def wheel(folder, drag):
    device = device_in(folder, m=J, c=2e-5, k=0.0, stroke=4000.0, kf=TORQUE)
    rng, h, readings = np.random.default_rng(0), 0.05, []
    for role in ("fit", "hold_out"):
        u = np.repeat(rng.uniform(0.2, 3.0, 10), 16)
        readings.append((role, u, blown(u, h, drag) + 2e-3 * rng.standard_normal(len(u))))
    fitter = fitter_of(readings, h, 2e-3)
    offered = hypotheses(device, nominal_physics(device), ("reading.axis",), h, False)
    kinds = ("quadratic_damping", "drive_gain", "saturation")
    offered = [o for o in counted_in_speeds(offered, fitter, device) if o.effect in kinds]
    trials = Trials(fitter, Screen(fitter, offered), lambda _: None)
    fitter, fit = fitter.described(device)
    trials.use(fitter)
    return trials, trials.scored(fit.structure, fit)


def test_a_cause_that_scores_less_is_tried_where_its_simulation_comes_near(tmp_path):
    trials, current = wheel(tmp_path, DRAG)
    speed = speeds_that_occur(trials.fitter, current.fit)[0]
    assert 100 < speed < 1000  # 3 A drive it at 173 rad/s; without drag at 3000
    screened = trials.screened(current)
    chosen = [s for s in screened.suspects if s.hypothesis.effect == "saturation"]
    nearest = nearer_when_simulated(trials, current, screened, chosen)
    assert nearest[0].hypothesis.effect == "quadratic_damping"
    assert DRAG / 4 < nearest[0].start["damping"] < 4 * DRAG
    assert not any(s in chosen for s in nearest)


def test_of_a_machine_that_moves_as_described_no_more_is_simulated(tmp_path):
    trials, current = wheel(tmp_path, 1e-9)
    assert not is_far_off(trials, current)
    assert nearer_when_simulated(trials, current, trials.screened(current), []) == []
