"""Laws that look back by samples, in the commands that sample no reading, and along a path: what a diagnosis writes to a device file works
in each."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import AXIS_FILE, SCENARIOS

import ctrlgen
from ctrlgen import simulate
from ctrlgen.app.simulated import simulate_device
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.effects import Effect
from ctrlgen.firmware.fmi.fmu import write_fmus
from ctrlgen.trajectory.scenario import model_of

NUMBERS = {
    "clock_offset": 'at = "all"\noffset = "2 ms"',
    "asymmetric_slew_rate": 'at = "axis"\nshare = "1"\nrate = "250 V/s"\nexcess = "0.5"',
    "drive_quantisation": 'at = "axis"\nshare = "1"\nquantum = "2 mV"\ngrid = "0"\nrounding = "0.01"',
    "delay": 'at = "axis"\ndelay = "2 ms"',
    "moving_average": 'at = "axis"\nwindow = "2 ms"',
    "slew_rate": 'at = "axis"\nshare = "1"\nrate = "250 V/s"',
    "warm_up": 'at = "axis"\nsize = "1 um"\ntau = "2 s"',
}
every_law = pytest.mark.parametrize("kind", NUMBERS)


def with_law(folder, kind, numbers=None, extra=""):
    """A device file of the flexure axis with one law."""
    file = folder / "axis.toml"
    text = AXIS_FILE.read_text() + f'\n[[effect]]\nkind = "{kind}"\n{numbers or NUMBERS[kind]}\n{extra}'
    file.write_text(text)
    return file


def line(folder):
    """The scenario of 50 um in 4 ms for the device in `folder`."""
    text = (SCENARIOS / "flexure_axis_line" / "scenario.toml").read_text()
    file = folder / "scenario.toml"
    file.write_text(text.replace("../devices/flexure_axis.toml", "axis.toml"))
    scenario = ctrlgen.load_scenario(file)
    return ctrlgen.solve(scenario, model_of(scenario))


def slewing_circle(folder):
    """The circle of the hexapod whose amplifiers slew at 4 W/s."""
    hexapod = (SCENARIOS / "devices" / "mems_hexapod.toml").read_text()
    slewing = '\n[[effect]]\nkind = "slew_rate"\nat = "all"\nshare = "1"\nrate = "4 W/s"\n'
    (folder / "slewing.toml").write_text(hexapod + slewing)
    return ctrlgen.load_scenario(SCENARIOS / "circle20", folder / "slewing.toml")


def test_every_law_that_looks_back_is_here():
    assert set(NUMBERS) == {kind for kind, law in Effect.library.items() if "sample_time" in law.requires}


@every_law
def test_a_device_with_it_is_built_without_a_sample_time_and_the_law_does_nothing_at_rest(kind, tmp_path):
    model = ctrlgen.build_model(ctrlgen.load_device(with_law(tmp_path, kind)))
    assert [name for name in model.x_names if name.startswith(kind)] == []


def test_a_simulation_reads_late_and_slews(tmp_path):
    plain = simulate_device(AXIS_FILE, None, "1 V", 0.2, 1000.0).trace.signals["reading"][:, 0]
    late = simulate_device(with_law(tmp_path, "delay"), None, "1 V", 0.2, 1000.0).trace.signals["reading"][:, 0]
    assert late[2:] == pytest.approx(plain[:-2], abs=1e-3 * np.ptp(plain)) and np.ptp(late - plain) > 0.1 * np.ptp(
        plain
    )
    slewed = simulate_device(with_law(tmp_path, "slew_rate"), None, "1 V", 0.2, 1000.0).trace.signals["reading"][:, 0]
    # a ramp of 4 ms has no overshoot where that is 0.4 of a period
    assert slewed[20:24].max() < 0.5 * plain[20:24].max()


@pytest.mark.filterwarnings("ignore:flexure_axis")
def test_the_rate_of_an_amplifier_is_a_limit_along_a_path(tmp_path):
    """The path needs 1773 V/s. Of two amplifiers in series the slower one counts."""
    with_law(tmp_path, "slew_rate", 'at = "axis"\nshare = "1"\nrate = "4 V/ms"')
    fast = line(tmp_path)
    (limit,) = fast.model.rate_limits
    assert (limit.lower, limit.upper) == (-4e3, 4e3) and "rate_axis" in {m.limit.name for m in fast.margins}
    with_law(tmp_path, "slew_rate", 'at = "axis"\nshare = "1"\nrate = "20 V/s"')
    with pytest.raises(ctrlgen.Unreachable, match="rate of axis would have to be 1773 V/s"):
        line(tmp_path)
    both = '\n[[effect]]\nkind = "slew_rate"\nat = "axis"\nshare = "1"\nrate = "3 V/ms"\n'
    with_law(tmp_path, "slew_rate", 'at = "axis"\nshare = "1"\nrate = "4 V/ms"', both)
    (limit,) = line(tmp_path).model.rate_limits
    assert (limit.lower, limit.upper) == (-3e3, 3e3)


@pytest.mark.filterwarnings("ignore:flexure_axis")
@every_law
def test_a_path_is_followed(kind, tmp_path):
    """The pose is on the path; what of its reading grows with time is followed too."""
    with_law(tmp_path, kind, NUMBERS[kind].replace("250 V/s", "4 V/ms"))
    solution = line(tmp_path)
    pose = solution.trace.signals["pose"][: len(solution.command), 0]
    assert pose == pytest.approx(solution.command[:, 0], abs=1e-13)


def test_a_controller_has_the_rate_of_an_amplifier_and_says_what_it_leaves_out(tmp_path):
    """With the amplifier's ramps the pose is late by half a sample at most: by its speed of 63 um/s times that."""
    scenario = slewing_circle(tmp_path)
    with pytest.warns(UserWarning, match=r"slew_rate limits how fast .* up to 0\.5 ms late"):
        model = model_of(scenario)
    h = scenario.sample_time
    controller = controller_of(model, "pose", h)
    assert controller.rate is not None
    sampled = ctrlgen.build_model(scenario.device, sample_time=h)
    with pytest.raises(ctrlgen.InputError, match="slew_rate looks back by samples and is not inverted"):
        controller_of(sampled, "pose", h).step((sampled.rest, np.zeros(6)), np.zeros(6))
    # A heater settles in 20 time constants of 5 ms
    turn = np.concatenate([np.zeros(100), 2 * np.pi * h * np.arange(500)])
    targets = np.column_stack([0 * turn, 0 * turn, 0 * turn, 1e-5 * np.cos(turn), 1e-5 * np.sin(turn), 2e-5 + 0 * turn])
    state, drives = controller.rest(), []
    for target in targets:
        step = controller.step(state, target)
        state = step.state
        drives.append(step.drive)
    off = [
        simulate(m, np.array(drives), h, m.rest, np.zeros(6)).signals["pose"][101:, 3:5] - targets[100:, 3:5]
        for m in (model, sampled)
    ]
    assert np.abs(off[0]).max() < 1e-11
    assert 0.1 < np.hypot(*off[1].T).max() / (2 * np.pi * 1e-5 * h / 2) < 1


@pytest.mark.filterwarnings("ignore:mems_hexapod")
def test_a_controller_of_a_slewing_device_stands_beside_its_plant(tmp_path):
    scenario = slewing_circle(tmp_path)
    units = write_fmus(scenario, tmp_path / "units")
    assert {path.stem for path in units.paths} == {"circle20_controller", "circle20_plant"} and not units.remark
