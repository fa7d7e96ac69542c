"""Limits on how fast a drive may change: kept, named, and what a slower path costs. References are written by hand."""

from __future__ import annotations

import subprocess

import numpy as np
import pytest
from command_line import ctrlgen as run
from conftest import SCENARIOS

import ctrlgen
from ctrlgen import InputError, Unreachable, build_model, load_scenario, solve
from ctrlgen.devices import load_device
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.toolchains import find_compilers
from ctrlgen.firmware.player.compression import compress
from ctrlgen.trajectory.inverse.clock import Sampled
from ctrlgen.trajectory.inverse.inertial import InertialInverse
from ctrlgen.trajectory.inverse.motion import Motion
from ctrlgen.trajectory.optimisation import TrajectoryProgramme

STIFFNESS, GAIN, RADIUS, PERIOD, N = 1e6, 0.2, 10e-6, 0.05, 500
CENTRE = 15e-6
CIRCLE = 'kind = "circle"\ndiameter = "20 um"\ncentre = { x = "15 um", y = "15 um" }\nplane = ["x", "y"]\n'


def stage(rate=None, **other):
    """A piezo X-Y stage without memory: gain u = stiffness d."""
    words = dict(
        parameters={"gain": "0.2 N/V", "k": "1 N/um"},
        drive={"x": ("0 V", "150 V"), "y": ("0 V", "150 V")},
        axes={"x": ("-1 um", "30 um"), "y": ("-1 um", "30 um")},
        force=lambda u, p: p.gain * u.vector,
        restoring_force=lambda d, p: p.k * d.vector,
        drive_rate=rate,
    )
    return ctrlgen.user_device("stage", **(words | other))


def lagging(rate):
    """The same with amplifiers that follow within 1 ms."""
    return stage(
        rate,
        parameters={"gain": "0.2 N/V", "k": "1 N/um", "tau": "1 ms"},
        state={"a": "150 V", "b": "150 V"},
        force=lambda x, p: [p.gain * x.a, p.gain * x.b],
        rates=lambda u, x, p: [(u.x - x.a) / p.tau, (u.y - x.b) / p.tau],
    )


def solved(folder, device, path=CIRCLE, duration=f"{PERIOD} s", rate=f"{N / PERIOD:g} Hz"):
    (folder / "scenario.toml").write_text(
        f'title = "t"\ndevice = "{device.name}"\nsample_rate = "{rate}"\nduration = "{duration}"\n[path]\n{path}'
    )
    scenario = load_scenario(folder, device)
    return solve(scenario, build_model(device))


def fastest(drive, before, h):
    return np.abs(np.diff(np.vstack([before, drive]), axis=0)).max() / h


def circle_rate():
    """V/s of a held drive that leads along the circle: the chord between two of its samples."""
    t = 2 * np.pi * np.arange(N + 1) / N
    return np.abs(np.diff(STIFFNESS * RADIUS / GAIN * np.cos(t))).max() / (PERIOD / N)


def test_a_rate_just_above_that_of_the_path_is_kept_and_named(tmp_path):
    wanted = circle_rate()
    solution = solved(tmp_path, stage({"x": f"{1.001 * wanted} V/s"}))
    margin = next(m for m in solution.margins if m.limit.name == "rate_x")
    found = fastest(solution.drive[:, :1], solution.drive[-1:, :1], PERIOD / N)
    assert abs(found - wanted) < 1e-6 * wanted  # IPOPT's tolerance in differences of drives
    assert solution.tightest is margin
    assert abs(abs(margin.value) - found) < 1e-12 * wanted


def test_a_rate_just_below_that_of_the_path_is_explained_and_the_slower_path_keeps_it(tmp_path):
    wanted = circle_rate()
    with pytest.raises(Unreachable, match=r"rate of x would have to be .* V/ms.*too fast") as caught:
        solved(tmp_path, stage({"x": f"{0.8e-3 * wanted} V/ms"}))
    text = str(caught.value)
    assert "1.25 times slower" in text or "1.26 times slower" in text  # 1 / 0.8, rounded up to a hundredth
    slower = next(p for what, p in caught.value.infeasibility.alternatives.items() if "slower" in what)
    drive = STIFFNESS / GAIN * slower
    assert fastest(drive, drive[-1:], PERIOD / N) <= 0.8 * wanted
    smaller = next(p for what, p in caught.value.infeasibility.alternatives.items() if "scaled to" in what)
    drive = STIFFNESS / GAIN * smaller
    assert 0.78 * wanted < fastest(drive, drive[-1:], PERIOD / N) <= 0.8 * wanted


def test_rise_and_fall_have_rates_of_their_own(tmp_path):
    up = 'kind = "line"\nstart = { x = "0 um", y = "5 um" }\nend = { x = "20 um", y = "5 um" }\n'
    down = up.replace('"0 um"', '"1 um"').replace("start", "END").replace("end", "start").replace("END", "end")
    device = stage({"x": ("-1 V/ms", "20 V/ms")})
    assert solved(tmp_path, device, up).drive[-1, 0] == pytest.approx(STIFFNESS / GAIN * 20e-6)
    with pytest.raises(Unreachable, match="below -1 V/ms"):
        solved(tmp_path, device, down)


def test_the_first_step_counts_from_rest_at_the_start(tmp_path):
    """An open path: the drive before the first sample holds it; the lagging amplifier must be led on from there."""
    path = 'kind = "line"\nstart = { x = "0 um", y = "5 um" }\nend = { x = "20 um", y = "5 um" }\neven = true\n'
    free = solved(tmp_path, lagging(None), path)
    first = abs(free.drive[0, 0] - 0.0) / (PERIOD / N)  # at rest at 0 um the drive is zero
    later = np.abs(np.diff(free.drive[1:-1, 0])).max() / (PERIOD / N)
    assert first > 3 * later  # a lag of 1 ms behind an even line makes the drive jump at its start
    with pytest.raises(Unreachable, match=r"rate of x .* at sample 0"):
        solved(tmp_path, lagging({"x": f"{0.9 * first} V/s"}), path)
    kept = solved(tmp_path, lagging({"x": f"{1.1 * first} V/s"}), path)
    assert np.allclose(kept.drive, free.drive, rtol=0, atol=1e-4)  # V: what IPOPT's barrier leaves at 150 V


def test_a_device_with_inertia_keeps_its_rates(tmp_path):
    path = 'kind = "line"\nstart = { axis = "-20 um" }\nend = { axis = "30 um" }\n'

    def coil(rate):
        return ctrlgen.user_device(
            "coil",
            parameters={"m": "0.5 kg", "c": "30 N*s/m", "k": "0.2 N/um", "f": "10 N/A"},
            axes={"axis": "100 um"},
            drive={"coil": "4 A"},
            drive_rate=rate,
            force=lambda u, p: p.f * u.coil,
            restoring_force=lambda d, p: p.k * d.axis,
            damping_force=lambda v, p: p.c * v.axis,
            mass=lambda p: p.m,
        )

    free = solved(tmp_path, coil(None), path, "0.1 s", "5 kHz")
    rest = STIFFNESS / 5 * -20e-6 / 10.0  # A
    needed = fastest(free.drive, np.array([[rest]]), 2e-4)
    kept = solved(tmp_path, coil({"coil": f"{1.02 * needed} A/s"}), path, "0.1 s", "5 kHz")
    assert fastest(kept.drive, np.array([[rest]]), 2e-4) <= 1.02 * needed
    assert any(m.limit.name == "rate_coil" and 0 < m.share < 0.02 for m in kept.margins)
    with pytest.raises(Unreachable, match=r"rate of coil .*too fast"):
        solved(tmp_path, coil({"coil": f"{0.98 * needed} A/s"}), path, "0.1 s", "5 kHz")


@pytest.mark.parametrize(
    ("rate", "what"),
    [
        ({"x": "5 V"}, "no rate of a drive in V"),
        ({"z": "5 V/ms"}, "is no drive; there are x, y"),
        ({"x": ("1 V/ms", "5 V/ms")}, "below zero and one above"),
        ({"x": "-5 V/ms"}, "above zero"),
    ],
)
def test_wrong_rates_are_faults(rate, what):
    with pytest.raises(InputError, match=what):
        stage(rate)


def test_a_mechanism_file_states_rates(tmp_path):
    text = (SCENARIOS / "devices" / "xy_lever_stage.toml").read_text()
    for wanted, given in (('"5 V/ms"', (-5e3, 5e3)), ('["-2 V/ms", "5 V/ms"]', (-2e3, 5e3))):
        (tmp_path / "d.toml").write_text(text.replace('low = "0 V"\n', f'low = "0 V"\nrate = {wanted}\n'))
        limits = build_model(load_device(tmp_path / "d.toml")).rate_limits
        assert [(limit.lower, limit.upper, limit.unit) for limit in limits] == [(*given, "V/ms")] * len(limits) != []
    for wrong, what in (('"5 V"', "no rate of a drive in V"), ('["1 V/ms", "5 V/ms"]', "below zero and one above")):
        (tmp_path / "d.toml").write_text(text.replace('low = "0 V"\n', f'low = "0 V"\nrate = {wrong}\n'))
        with pytest.raises(InputError, match=what):
            load_device(tmp_path / "d.toml")


STAGE = """
import ctrlgen

device = ctrlgen.user_device(
    "stage",
    parameters={"g": "0.2 N/V", "k": "1 N/um"},
    drive={"a": "100 V", "b": ("0 V", "150 V"), "c": ("-20 V", "130 V"), "d": "10 V"},
    drive_rate={"a": "20 V/ms"},
    axes={"x": "50 um", "y": "50 um"},
    force=lambda u, p: [p.g * (u.a + 0.5 * u.b + u.d), p.g * (u.c - 0.5 * u.b)],
    restoring_force=lambda d, p: p.k * d.vector,
)
"""


@pytest.mark.long
def test_where_two_drives_are_too_many_the_online_c_is_refused_and_the_player_plays_the_drives(tmp_path):
    (tmp_path / "stage.py").write_text(STAGE)
    circle = CIRCLE.replace("15 um", "0 um")
    (tmp_path / "scenario.toml").write_text(
        f'title = "t"\ndevice = "stage.py"\nsample_rate = "1 kHz"\nduration = "0.1 s"\n[path]\n{circle}'
    )
    for command in ("generate", "run"):
        done = run(command, tmp_path, "--out", tmp_path / "c")
        assert done.returncode == 1
        assert "(a, b, c, d) with 2 free choices" in done.stderr and "--player" in done.stderr
        assert not (tmp_path / "c").exists()
    assert run("generate", tmp_path, "--player", "--out", tmp_path / "c").returncode == 0
    assert "as it was generated" in run("check", tmp_path / "c").stdout
    shown = run("check", tmp_path / "stage.py").stdout
    assert "-20 V/ms <= rate of a <= 20 V/ms" in shown and "4 drives for 2 axes" in shown
    scenario = load_scenario(tmp_path)
    drive = solve(scenario, build_model(scenario.device)).drive
    (source,) = (tmp_path / "c").glob("*_player_f64.c")
    name = source.stem
    main = f"""#include "{name}.h"
#include <stdio.h>
int main(void) {{
    double u[4];
    for (unsigned long k = 0; k < 100; k++) {{
        {name}_sample(k, u);
        printf("%.17g %.17g %.17g %.17g\\n", u[0], u[1], u[2], u[3]);
    }}
    return 0;
}}
"""
    (tmp_path / "main.c").write_text(main)
    words = [
        "-std=c99",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-pedantic",
        "-I",
        str(tmp_path / "c"),
        str(source),
        str(tmp_path / "main.c"),
    ]
    subprocess.run([next(iter(find_compilers())), *words, "-o", str(tmp_path / "main")], check=True)
    played = np.loadtxt(
        subprocess.run([tmp_path / "main"], check=True, capture_output=True, text=True).stdout.splitlines()
    )
    # V: the player may be 0.1 nm off, which 1 N/um and 0.2 N/V (b: half) make 0.5 and 1 mV
    assert np.abs(played - drive).max() < 1e-3
    assert fastest(played[:, :1], played[-1:, :1], 1e-3) <= 20e3


def test_a_curve_that_changes_faster_than_it_may_is_no_player(tmp_path):
    """The drive of a circle of 50 nm, which may be 0.08 nm off, is played by so coarse a spline that it is half a percent too fast."""
    path = CIRCLE.replace('"20 um"', '"0.05 um"')
    wanted = circle_rate() / 400
    solution = solved(tmp_path, stage({"x": f"{1.00001 * wanted} V/s"}), path)
    found = compress(solution)[Real.DOUBLE]
    k = np.arange(N)
    quarter = np.vstack([found.drives(k, np.full(N, share)) for share in (0.0, 0.25, 0.5, 0.75)])
    along = quarter.reshape(4, N, 2).transpose(1, 0, 2).reshape(-1, 2)
    rate = np.abs(np.diff(np.vstack([along, along[:1]]), axis=0))[:, 0].max() * 4 / (PERIOD / N)
    assert rate <= 1.00001 * wanted * (1 + 2e-3)  # what rounding in float over a quarter of a sample is given


def test_where_a_path_is_too_fast_the_optimum_follows_it_as_near_as_the_rate_allows(tmp_path):
    """IPOPT is held to the rates too, where the inverse does not decide; a fall has one of its own."""
    device = lagging({"x": ("-0.5 V/ms", "1 V/ms")})
    (tmp_path / "scenario.toml").write_text(
        f'title = "t"\ndevice = "stage"\nsample_rate = "1 kHz"\nduration = "0.05 s"\n[path]\n{CIRCLE}'
    )
    model = build_model(device)
    scenario = load_scenario(tmp_path, device)
    result, _ = TrajectoryProgramme(model, "pose", scenario.bind(model).motion, scenario.clock).optimum()
    assert np.abs(result.unreachable_by).max() > 0.01  # in typical sizes, 30 um
    relaxed = 2e-7  # of the rate: IPOPT's bounds are 1e-8 of its range off, and a difference of drives rounds
    changes = np.diff(np.append(result.u[-1, 0], result.u[:, 0])) / 1e-3
    assert -500 * (1 + 3 * relaxed) <= changes.min() < -499 and 501 < changes.max() <= 1e3 * (1 + relaxed)
    assert fastest(result.u[:, 1:], result.u[-1:, 1:], 1e-3) > 3e3  # the other drive is free


def test_before_a_motion_with_inertia_stands_the_drive_that_holds_its_start(tmp_path):
    """So that its first step counts, although the motion itself starts gently."""
    device = ctrlgen.user_device(
        "mass",
        parameters={"m": "0.5 kg", "c": "30 N*s/m", "k": "0.2 N/um", "f": "10 N/A"},
        axes={"axis": "100 um"},
        drive={"coil": "4 A"},
        drive_rate={"coil": "1 kA/s"},
        force=lambda u, p: p.f * u.coil,
        mass=lambda p: p.m,
        restoring_force=lambda d, p: p.k * d.axis,
        damping_force=lambda v, p: p.c * v.axis,
    )
    n, moved = 20, np.zeros((3, 20, 1))
    moved[2] = 5.0  # m/s^2 at every sample, the first too
    motion = Motion(np.full((n, 1), -20e-6), moved[1:], closed=False)
    found = InertialInverse(build_model(device), "pose", Sampled(2e-4), approximate=True).trajectory(motion)
    assert found.u_start[0] == pytest.approx(0.2e6 * -20e-6 / 10.0)
    assert found.u[0, 0] - found.u_start[0] == pytest.approx(0.5 * 5.0 / 10.0)
