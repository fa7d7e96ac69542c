"""Bent-beam thermal actuators of mechanisms from files: S1's law, its limits, and S1's stage moved by them."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from command_line import ctrlgen as run_command
from conftest import DEVICE
from mechanism_files import HEAD, dm, loaded, number, place, vector, with_values
from scipy.optimize import brentq

from ctrlgen import InputError, Unreachable, build_model, load_device, load_scenario, run, solve
from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.devices.mechanism.mechanism_lines import summary
from ctrlgen.physics import thermal_actuator, xy_stage

SPECIAL = load_device(DEVICE).values()
LENGTHS = ("beam_length", "beam_width", "beam_gap", "bar_width", "bar_half_height", "thickness")


def material(a=SPECIAL.actuator) -> str:
    return (
        f'[[material]]\nname = "silicon"\nyoung = {number(a.young, "Pa")}\npoisson = "{a.poisson!r}"\n'
        f"expansion = {number(a.expansion, '1/K')}\nexpansion_slope = {number(a.expansion_slope, '1/K^2')}\n"
    )


def chevron(to: str = "bar", at=(0.0, 0.0, 0.0), along=(1, 0, 0), a=SPECIAL.actuator) -> str:
    lengths = "\n".join(f"{key} = {number(getattr(a, key), 'm')}" for key in LENGTHS)
    return (
        f'[[element]]\nkind = "bent_beam"\nname = "beams"\nfrom = "ground"\nto = "{to}"\nmaterial = "silicon"\nat = {place(at)}\n'
        f'along = {vector(along)}\nbeams = "{a.beams:.0f}"\nbeam_angle = {number(a.beam_angle, "rad")}\n{lengths}\n'
    )


def heater(more: str = "", a=SPECIAL.actuator) -> str:
    return (
        f'[[actuator]]\nname = "heater"\nkind = "thermal"\non = "beams"\nambient = {number(a.ambient, "K")}\n'
        f"temperature_limit = {number(a.temperature_limit, 'K')}\nthermal_resistance = {number(a.thermal_resistance, 'K/W')}\n"
        f'time_constant = {number(a.time_constant, "s")}\npower_limit = {number(a.power_limit, "W")}\ntravel = "30 um"\n{more}'
    )


LOAD = '[[element]]\nkind = "spring"\nname = "load"\nfrom = "ground"\nto = "bar"\nat = ["0 mm", "0 mm", "0 mm"]\n'
LOAD += 'F_x_per_delta_x = "0.02 N/um"\n'
OUTPUT = '[output]\nbody = "{}"\nat = ["0 mm", "0 mm", "0 mm"]\nchannels = ["delta_x"]\n'
BAR = HEAD + material() + '[[body]]\nname = "bar"\n' + chevron() + LOAD + heater() + OUTPUT.format("bar")


def line(folder, text: str, end: str) -> None:
    (folder / "device.toml").write_text(text)
    (folder / "scenario.toml").write_text(
        'title = "t"\ndevice = "device.toml"\nsample_rate = "1 kHz"\nduration = "0.1 s"\n'
        f'[path]\nkind = "line"\nend = {{ delta_x = "{end}" }}\n'
    )


def hot(force: float) -> float:
    """The temperature at which S1's actuator has this force, by bracketing."""
    a = SPECIAL.actuator
    return brentq(
        lambda T: thermal_actuator.force(T, a) - force, a.ambient, a.temperature_limit, xtol=1e-12, rtol=1e-15
    )


def test_a_bent_beam_has_the_papers_stiffness_and_its_heater_the_papers_law(tmp_path):
    """[K^t] of S1 eq. (6) about the bar's end; drive, temperature and force as those of the MEMS hexapod."""
    a, special = SPECIAL.actuator, load_device(DEVICE)
    device = loaded(tmp_path, BAR)
    paper = ca.DM(thermal_actuator.stiffness(a)).full()
    size = np.sqrt(np.outer(np.diag(paper[:, [3, 4, 5, 0, 1, 2]]), np.diag(paper[:, [3, 4, 5, 0, 1, 2]])))[
        :, [3, 4, 5, 0, 1, 2]
    ]
    assert np.abs((np.linalg.inv(dm(Condensed(*with_values(device)).compliances[0])) - paper) / size).max() < 1e-9
    one, six = device.physics(device.values()), special.physics(special.values())
    T, P = 500.0, 0.4
    own, whole = ca.SX.sym("T", 1), ca.SX.sym("T", 6)
    mine = ca.Function("f", [own], [one.force(0, own, 0), one.rates(own, ca.SX(P))])(T)
    papers = ca.Function("f", [whole], [six.force(0, whole, 0), six.rates(whole, ca.SX([P] * 6))])([T] * 6)
    assert [float(x) for x in mine] == pytest.approx([float(x[0]) for x in papers], rel=1e-12)


def test_the_heater_of_a_path_has_the_power_of_the_papers_equations(tmp_path):
    line(tmp_path, BAR, "5 um")
    K = float(paper_stiffness()) + 0.02e6
    solution = solve(load_scenario(tmp_path), build_model(load_scenario(tmp_path).device))
    a, forces = SPECIAL.actuator, K * solution.trace.signals["displacement"][:, 0]
    T = np.array([hot(force) for force in forces])
    assert solution.trace.signals["state"][:, 0] == pytest.approx(T, rel=1e-9)
    decay = np.exp(-1e-3 / a.time_constant)
    P = ((T[1:] - a.ambient) - decay * (T[:-1] - a.ambient)) / ((1 - decay) * a.thermal_resistance)
    assert solution.drive[:-1, 0] == pytest.approx(P, rel=1e-9)


def paper_stiffness() -> float:
    """Along the bar with its other directions free."""
    return 1 / np.linalg.inv(ca.DM(thermal_actuator.stiffness(SPECIAL.actuator)).full())[3, 0]


@pytest.mark.parametrize("power", ["200 mW", "2 W"])
def test_how_far_a_heater_takes_its_axis_is_told(tmp_path, power):
    """S1's force at the temperature that its power or its limit allows, over the stiffness of beams and load; with nothing of a stiffness
    at the end, as how hot beams press one another is not known."""
    a = SPECIAL.actuator
    stated = number(a.power_limit, "W")
    said = summary(loaded(tmp_path, BAR.replace(f"power_limit = {stated}", f'power_limit = "{power}"')))
    T = min(a.temperature_limit, a.ambient + a.thermal_resistance * (0.2 if power == "200 mW" else 2.0))
    reach = float(thermal_actuator.force(T, a)) / (paper_stiffness() + 0.02e6)
    (line_,) = [text for text in said if text.startswith("heater alone:")]
    assert f"its drive reaches 0 um to {reach * 1e6:.4g} um; its travel" in line_
    assert not any("held at" in text for text in said)


def test_a_heater_cannot_pull(tmp_path):
    line(tmp_path, BAR, "-2 um")
    with pytest.raises(Unreachable) as caught:
        solve(load_scenario(tmp_path), build_model(load_scenario(tmp_path).device))
    assert "heater" in str(caught.value) and "temperature" in str(caught.value)


@pytest.mark.long
def test_c_of_heaters_computes_what_the_model_does_by_power_and_by_voltage(tmp_path):
    for name, more in (("power", ""), ("voltage", 'heater_resistance = "150 ohm"\n')):
        (tmp_path / name).mkdir()
        line(tmp_path / name, BAR.replace(heater(), heater(more)), "4 um")
        outcome = run(tmp_path / name, tmp_path / name / "out")
        assert outcome.passed
        drives = outcome.solution.drive[:, 0]
        power = drives if name == "power" else drives**2 / 150
        assert power[-1] == pytest.approx(
            (hot((paper_stiffness() + 2e4) * 4e-6) - SPECIAL.actuator.ambient) / 550, rel=1e-9
        )


def xy_axis_text() -> str:
    """One axis of S1's X-Y stage: a bar that drives two arms, two guides; notch, lever and notch in each arm."""
    s, a = SPECIAL.stage, SPECIAL.actuator
    notch, lever = ca.DM(xy_stage.notch_compliance(s)).full(), ca.DM(xy_stage.lever_compliance(s, a)).full()
    lines, r = [HEAD, material(), '[[body]]\nname = "plate"\n[[body]]\nname = "bar"\n'], s.notch_radius

    def element(name, first, second, at, along, C) -> None:
        rows = ", ".join(vector(row) for row in C)
        lines.append(
            f'[[element]]\nkind = "matrix"\nname = "{name}"\nfrom = "{first}"\nto = "{second}"\nat = {place(at)}\n'
            f"along = {vector(along)}\nacross = {vector(np.cross([0, 0, 1], along))}\ncompliance_si = [{rows}]\n"
        )

    for side in (1, -1):
        along, push = np.array([0.0, -side, 0.0]), np.array([1.0, 0.0, 0.0])
        for x, driven in ((-s.plate_half_length, True), (s.plate_half_length, False)):
            k = f"{'drive' if driven else 'guide'}_{'plus' if side > 0 else 'minus'}"
            end = np.array([x, side * s.plate_half_width, 0.0])
            root = end - s.lever_long * along
            lines += [f'[[body]]\nname = "{k}_{part}"\n' for part in ("foot", "far")]
            element(f"{k}_root", "ground", f"{k}_foot", root + r * along, along, notch)
            element(f"{k}_lever", f"{k}_foot", f"{k}_far", end - r * along, along, lever)
            element(f"{k}_end", f"{k}_far", "plate", end + r * along, along, notch)
            if driven:
                element(f"{k}_notch", "bar", f"{k}_foot", root + s.lever_short * along + r * push, push, notch)
    lines += [chevron(at=(-s.plate_half_length, 0, 0)), heater(), OUTPUT.format("plate")]
    return "\n".join(lines)


def test_s1s_axis_moved_by_its_thermal_actuator_is_near_s1s_scalar_law(tmp_path):
    """The force on the bar per displacement of the plate, against the linear part of S1 eq. (9): that takes the lever ratio as e_4/e_3 = 10
    and of the notches their turning alone; with the shear of notches and levers the ratio is 9.4, and the bar is 4.5 % stiffer. The
    drives of the special device therefore follow from no assembly of its matrices."""
    c = Condensed(*with_values(loaded(tmp_path, xy_axis_text())))
    per_plate = dm(c.stiffness)[0, 0] / dm(c.jacobian)[0, 0]
    paper = float(xy_stage.linear_force(1.0, SPECIAL.stage, SPECIAL.actuator))
    assert per_plate / paper == pytest.approx(1.0454, abs=1e-4)
    assert dm(c.jacobian)[0, 0] == pytest.approx(9.400, abs=1e-3)
    # what a force on the plate makes of it is as in S1's K_X, but for the bar: S1 hangs half an actuator on each arm, here it is rigid
    C = np.linalg.inv(ca.DM(xy_stage.axis_stiffness(SPECIAL.stage, SPECIAL.actuator)).full())
    assert dm(c.output_compliance)[3, 0] == pytest.approx(C[3, 0], rel=1e-4)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('on = "beams"', 'on = "load"', "'load' is no bent_beam"),
        ('on = "beams"', 'on = "bams"', "'bams' is no element"),
        (
            f"expansion = {number(SPECIAL.actuator.expansion, '1/K')}\nexpansion_slope",
            "expansion_slope",
            "belong together",
        ),
        (material()[material().index("expansion") :], "", "give the material of 'beams' its expansion"),
        ("[output]", '[dynamics]\ndamping_ratio = "1 %"\n[output]', "belongs to actuators that push by force"),
        ('temperature_limit = "', 'temperature_limit = "-', "temperature_limit"),
        (
            "[output]",
            '[[actuator]]\nname = "coil"\nkind = "force"\non = "bar"\nat = ["0 mm", "0 mm", "0 mm"]\nalong = [0, 1, 0]\n'
            'gain = "1 N/V"\nlow = "0 V"\nhigh = "1 V"\ntravel = "1 um"\n[output]',
            "give one kind",
        ),
    ],
)
def test_a_heater_that_cannot_be_is_refused(tmp_path, old, new, says):
    assert old in BAR
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, BAR.replace(old, new, 1))
    assert says in str(caught.value)


def test_check_prints_and_draws_a_heater(tmp_path):
    (tmp_path / "device.toml").write_text(BAR)
    said = run_command("check", tmp_path / "device.toml", "--figure", tmp_path / "m.svg")
    assert said.returncode == 0 and "22 degC <= actuator temperature of heater <= 550 degC" in said.stdout
    assert "beams" in (tmp_path / "m.svg").read_text()
