"""Constants that the generated C is given when it starts: the C is that of a device file with these numbers."""

from __future__ import annotations

import ctypes
import struct
import subprocess
import zlib
from dataclasses import dataclass, replace
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from conftest import SCENARIOS

from ctrlgen import Controller, InputError, build_model, load_device, load_scenario
from ctrlgen.calibration.calibrate import CalibratedConstant, Calibration, Determination
from ctrlgen.calibration.constants_files import binary
from ctrlgen.controller.controller_step import ControllerStatus
from ctrlgen.controller.kernels import ControllerKernels
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.controller.run_time_check import check_run_time
from ctrlgen.devices.changed_numbers import changed
from ctrlgen.devices.run_time import RunTimeConstant
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.toolchains import FLAGS
from ctrlgen.firmware.folder import generate
from ctrlgen.firmware.online.online import online_context
from ctrlgen.firmware.online.start_constants import derived_values
from ctrlgen.recordings.recording import Recording
from ctrlgen.trajectory.scenario import Scenario

HEXAPOD = SCENARIOS / "devices" / "mems_hexapod.toml"
EFFECTS = """
[[effect]]
kind = "drive_gain"
at = "2X"
gain = "0.02"

[[effect]]
kind = "drive_offset"
at = "1Y"
offset = "10 mV"

[run_time]
constants = [
    { number = "actuator.ambient", low = "10 degC", high = "40 degC" },
    "actuator.thermal_resistance",
    { number = "actuator.time_constant", low = "3.5 ms", high = "7 ms" },
    "actuator.heater_resistance",
    { number = "effect[0].gain", low = "-0.05", high = "0.05" },
    { number = "effect[1].offset", low = "-50 mV", high = "50 mV" },
]
input = "actuator.ambient"
"""
REFUSED = 64  # status CONSTANTS


def scenario_of(folder: Path, run_time: str, *changes: tuple[str, str]) -> Scenario:
    """The circle on the hexapod with another end of its device file."""
    text = HEXAPOD.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "device.toml").write_text(text + run_time)
    circle = (SCENARIOS / "circle20" / "scenario.toml").read_text()
    (folder / "scenario.toml").write_text(circle.replace("../devices/mems_hexapod.toml", "device.toml"))
    return load_scenario(folder)


@dataclass
class Library:
    """The generated controller in one arithmetic, called from Python."""

    scenario: Scenario
    folder: Path
    real: Real
    name: str
    start: str  # the symbol that the header's init calls

    def __post_init__(self) -> None:
        library = self.folder / f"lib_{self.real.suffix}.so"
        source = self.folder / f"{self.name}.c"
        subprocess.run(["gcc", *FLAGS, "-shared", "-fPIC", str(source), "-o", str(library)], check=True)
        self._calls = ctypes.CDLL(str(library))
        self.number = ctypes.c_double if self.real is Real.DOUBLE else ctypes.c_float
        self.state = (ctypes.c_uint64 * 200)()

    def init(self, values: dict[str, float] | None = None) -> int:
        """Starts with constants [SI, by path]; those left out, and all for None, as in the file."""
        if values is None:
            self._calls[self.start](self.state)
            return 0
        stated = self.scenario.device.given_at_start
        constants = (self.number * len(stated))(*(values.get(c.path, c.default) for c in stated))
        return self._calls[self.start.replace("_init_", "_init_with_")](self.state, constants)

    def load(self, data: bytes) -> tuple[int, np.ndarray]:
        """Status of the loader of constants.bin, and what it wrote, NaN where it wrote nothing."""
        constants = (self.number * len(self.scenario.device.given_at_start))()
        constants[:] = [np.nan] * len(constants)
        status = self._calls[f"{self.name}_load"](constants, (ctypes.c_uint8 * len(data))(*data), len(data))
        return status, np.array(constants)

    def call(self, what: str, target: np.ndarray) -> tuple[int, np.ndarray]:
        """Status, and drive (6,), displacement (6,), temperature (6,)."""
        out = (self.number * 18)()
        status = self._calls[f"{self.name}_{what}"](self.state, (self.number * 6)(*target), out)
        return status, np.array(out)

    def set_ambient(self, value: float) -> int:
        """Status of the function for the input."""
        return self._calls[f"{self.name}_set_ambient"](self.state, self.number(value))

    def write_state(self, state: tuple[np.ndarray, np.ndarray]) -> None:
        """Sets x and z."""
        numbers = (self.number * 12).from_buffer(self.state)
        numbers[:] = [*state[0], *state[1]]

    def read_state(self) -> tuple[np.ndarray, np.ndarray]:
        """x and z."""
        numbers = np.array((self.number * 12).from_buffer(self.state), dtype=float)
        return numbers[:6], numbers[6:]


@pytest.fixture(scope="module")
def volts(tmp_path_factory) -> Scenario:
    return scenario_of(tmp_path_factory.mktemp("volts"), EFFECTS, ('drive = "power"', 'drive = "voltage"'))


@pytest.fixture(scope="module")
def libraries(volts, tmp_path_factory):
    scenario = volts
    made = generate(scenario, build_model(scenario.device), tmp_path_factory.mktemp("volts_c") / "c")
    return {real: Library(scenario, made.path, real, made.online[real], made.init[real]) for real in Real}


@pytest.fixture(scope="module")
def controller(volts):
    return controller_of(build_model(volts.device), "pose", 1e-3)


@pytest.mark.long
def test_a_controller_with_another_slack_has_the_same_kernels_and_limits_of_its_own(controller):
    wide = replace(controller, slack=4e-6)
    assert wide.kernels is controller.kernels and len(wide.kernels.variants) > 10
    for own, other in zip(wide.slacks, controller.kernels.slacks(4e-6), strict=True):
        np.testing.assert_array_equal(own, other)
    assert wide.slacks[0].max() > 1000 * controller.slacks[0].max()


def test_the_same_controller_of_a_model_is_made_once(controller):
    one, again = (controller_of(controller.kernels.model, "pose", 1e-3) for _ in range(2))
    assert one is again
    assert controller_of(controller.kernels.model, "pose", 2e-3) is not one


def chosen(controller: Controller) -> list[dict[str, float]]:
    """The file's constants, both ends, and some drawn between."""
    stated = controller.kernels.model.device.given_at_start
    rng = np.random.default_rng(3)
    drawn = [{c.path: rng.uniform(c.low, c.high) for c in stated} for _ in range(3)]
    return [{}, {c.path: c.low for c in stated}, {c.path: c.high for c in stated}, *drawn]


def targets(controller: Controller) -> np.ndarray:
    """Poses within the range and beyond, one after the other, with one that is no command."""
    rng = np.random.default_rng(4)
    near = rng.uniform([-1e-3] * 3 + [-8e-6, -8e-6, 10e-6], [1e-3] * 3 + [8e-6, 8e-6, 25e-6], (60, 6))
    near[::6] *= 4
    near[20, 2] = np.nan
    return near


@pytest.mark.long
@pytest.mark.parametrize("real", Real)
def test_the_c_with_other_constants_is_the_controller_of_a_device_file_with_these_numbers(libraries, controller, real):
    """In double to 1e-9 of the largest drive; in float a rounding of 400 K is 0.2 mK, that is 2 uW of a
    step and 17 mV of a heater that is nearly off."""
    library = libraries[real]
    limit = {Real.DOUBLE: 1e-9, Real.FLOAT: 2e-3}[real]
    acted = ControllerStatus(0)
    for values in chosen(controller):
        device = changed(controller.kernels.model.device, values).model_copy(update={"run_time": None})
        reference = controller_of(build_model(device), "pose", 1e-3)
        assert library.init(values) == 0
        state = reference.rest()
        for k, target in enumerate(targets(controller)):
            step = reference.step(state, target, settle=k % 15 == 0)
            status, answer = library.call("settle" if k % 15 == 0 else "step", target)
            assert status & ~ControllerStatus.UNSURE == step.status, (values, k)
            expected = np.concatenate([step.drive / 12.2, step.displacement / 55e-6, step.actuator_state / 800])
            found = answer / np.repeat([12.2, 55e-6, 800], 6)
            acted |= step.status
            assert np.all(answer[:6] >= 0) and np.all(answer[:6] <= reference.kernels.nominal.u_bounds[1] * (1 + 1e-6))
            # In float the line search may accept another trial, an equally good answer.
            if real is Real.DOUBLE or not step.status & ControllerStatus.DRIVE:
                assert np.max(np.abs(found - expected)) < limit, (values, k, found - expected)
            library.write_state(step.state)  # each sample from one state: a path drifts where a limit acts
            state = library.read_state()
    assert acted & ControllerStatus.DRIVE and acted & ControllerStatus.DISPLACEMENT and acted & ControllerStatus.INPUT


@pytest.mark.long
@pytest.mark.parametrize("real", Real)
def test_an_ambient_that_changes_acts_from_the_next_sample_on(libraries, controller, real):
    library = libraries[real]
    assert library.init({}) == 0
    cold, warm = (Controller(controller.kernels.at({"actuator.ambient": 273.15 + degC})) for degC in (22, 31))
    target = np.array([0, 0, 0, 2e-6, 0, 20e-6])
    state = cold.step(cold.rest(), target, settle=True).state
    library.call("settle", target)
    assert library.set_ambient(273.15 + 31) == 0
    step = warm.step(state, target)
    status, answer = library.call("step", target)
    assert status & ~ControllerStatus.UNSURE == step.status == 0
    assert np.allclose(answer[:6], step.drive, rtol=0, atol={Real.DOUBLE: 1e-9, Real.FLOAT: 1e-3}[real])
    without = cold.step(state, target).drive
    assert np.min(np.abs(step.drive - without)) > 5e-3  # V: the test sees what it is about


@pytest.mark.long
def test_constants_out_of_bounds_or_no_numbers_are_refused_and_every_call_then_answers_the_safe_drive(libraries):
    for real, library in libraries.items():
        stated = library.scenario.device.given_at_start
        for c in stated:
            for value in (c.low - 1e-3 * (c.high - c.low), c.high + 1e-3 * (c.high - c.low), np.nan, np.inf, -np.inf):
                library.init()
                assert library.init({c.path: value}) == REFUSED, (real, c.path, value)
                status, answer = library.call("step", np.array([0, 0, 0, 0, 0, 20e-6]))
                assert status == ControllerStatus.LOST and not answer[:6].any()
            assert library.init({c.path: c.low}) == 0 and library.init({c.path: c.high}) == 0


@pytest.mark.long
def test_an_ambient_out_of_bounds_is_refused_and_the_last_one_kept(libraries):
    library = libraries[Real.DOUBLE]
    library.init()
    before = bytes(library.state)
    for value in (np.nan, 0.0, 400.0):
        assert library.set_ambient(value) == REFUSED
        assert bytes(library.state) == before


@pytest.mark.long
def test_what_follows_from_the_constants_is_computed_by_the_same_operations_in_c_and_in_python(libraries, controller):
    """Bit for bit, but where an elementary function was called, whose last digits are its own: four roundings there."""
    for real, library in libraries.items():
        members = online_context(library.scenario, controller, real, library.name)["derived"]
        stated = library.scenario.device.given_at_start
        for values in chosen(controller):
            library.init(values)
            given = np.array([values.get(c.path, c.default) for c in stated], dtype=library.number)
            numbers = np.frombuffer(bytes(library.state)[12 * real.bytes + 16 :], library.number)  # after x, z, 4 words
            assert np.array_equal(numbers[: len(given)], given)
            expected = derived_values(members, given, real)
            found = numbers[len(given) :][: len(expected)]
            assert len(expected) > 12 and np.all(np.isfinite(expected))
            assert np.allclose(found, expected, rtol=4 * real.epsilon, atol=0), (real, found - expected)
            assert np.mean(found == expected) > 0.7  # what no exponential enters


@pytest.mark.long
@pytest.mark.parametrize("real", Real)
def test_the_loader_reads_what_calibrate_writes_and_refuses_every_flipped_bit(libraries, real):
    library = libraries[real]
    stated = library.scenario.device.given_at_start
    ends = [
        CalibratedConstant(c, c.low if k % 2 else c.high, 1.0, Determination.DETERMINED) for k, c in enumerate(stated)
    ]
    recording = Recording("bench", "mems_hexapod", "series", (), (), (), (), ())
    calibration = Calibration(
        library.scenario.device,
        {"device": library.scenario.inputs["device"]},
        recording,
        tuple(ends),
        np.eye(len(ends)),
        (),
        (),
    )
    data = binary(calibration)
    status, read = library.load(data)
    # A float's rounding, or two
    assert status == 0 and np.allclose(read, [row.value for row in ends], rtol=2e-7, atol=0)
    assert zlib.crc32(data[:-4]) == int.from_bytes(data[-4:], "little")
    for k in range(8 * len(data)):
        flipped = bytearray(data)
        flipped[k // 8] ^= 1 << k % 8
        status, read = library.load(bytes(flipped))
        assert status == REFUSED and np.all(np.isnan(read)), k
    assert library.load(data[:-1])[0] == library.load(b"")[0] == library.load(data + b"0")[0] == REFUSED


@pytest.mark.long
def test_the_loader_refuses_a_constant_out_of_bounds_whose_check_sum_is_right(libraries):
    library = libraries[Real.FLOAT]
    count = len(library.scenario.device.given_at_start)
    head = b"CGRT" + struct.pack("<HHI", 1, count, int(library.scenario.device_sha256[:8], 16))
    for bad in (np.nan, 1e30, -1e30, np.inf):
        body = head + struct.pack(f"<{count}f", *(c.default for c in library.scenario.device.given_at_start[:-1]), bad)
        status, read = library.load(body + struct.pack("<I", zlib.crc32(body)))
        assert status == REFUSED and np.all(np.isnan(read))


def test_bounds_that_are_not_stated_are_a_fifth_of_a_number_and_twenty_kelvins_of_a_temperature(tmp_path):
    text = '\n[run_time]\nconstants = ["actuator.ambient", "actuator.time_constant", { number = "actuator.young", high = "140 GPa" }]\n'
    ambient, lag, young = scenario_of(tmp_path, text).device.given_at_start
    assert (ambient.low, ambient.high) == pytest.approx((275.15, 315.15))
    assert (lag.low, lag.high) == pytest.approx((4e-3, 6e-3))
    assert (young.low, young.high) == pytest.approx((104e9, 140e9))


@pytest.mark.parametrize(
    ("low", "high", "unit", "text"),
    [
        (0.01, 0.21, "1", "0.01 ... 0.21"),
        (1.0, 11.0, "1", "1 ... 11"),
        (1e-6, 2e-6, "um", "1 ... 2 um"),
        (0.1, 0.2, "%", "10 ... 20 %"),
    ],
)
def test_a_range_keeps_its_digits_whatever_its_unit(low, high, unit, text):
    assert RunTimeConstant("a.b", "b", low, low, high, unit).range_text == text


RESERVES = {"temperature": (3.0, 12.0), "stroke": (1e-7, 2e-6), "drive": (0.0, 0.05)}  # K, m, W below and above


def test_what_is_reserved_of_limits_is_reserved_of_those_that_follow_from_the_constants():
    """A path whose limits hold for what is uncertain, `robust`: the bounds at other constants, less the same reserve."""
    device = load_device(SCENARIOS / "devices" / "mems_hexapod_run_time.toml")
    plain = build_model(device)
    robust = ControllerKernels(plain.tightened(RESERVES, 0.999), "pose", 1e-3)
    for values in (
        {},
        {"actuator.ambient": 288.15},
        {"actuator.ambient": 303.15, "actuator.thermal_resistance": 460.0},
    ):
        own, other = ControllerKernels(plain, "pose", 1e-3).at(values).model, robust.at(values).model
        p = [values.get(path, number) for number, path in robust.given.numbers]
        for variable, below, above in (("x", 3.0, 12.0), ("u", 0.0, 0.05)):
            low, high = getattr(own, f"{variable}_bounds")
            expected = low + below, high - above
            np.testing.assert_allclose(getattr(other, f"{variable}_bounds"), expected, rtol=1e-12)
            symbolic = robust.given.model
            formula = ca.Function("bounds", [symbolic.p], list(symbolic.bounds_formula(getattr(symbolic, variable))))
            np.testing.assert_allclose([b.full().ravel() for b in formula(p)], expected, rtol=1e-12)
        assert own.x_bounds[0][0] == pytest.approx(values.get("actuator.ambient", 295.15))


@pytest.mark.long
def test_the_c_of_a_robust_path_keeps_its_reserves_whatever_constants_it_is_given(tmp_path):
    scenario = scenario_of(tmp_path, EFFECTS, ('drive = "power"', 'drive = "voltage"'))
    model = build_model(scenario.device).tightened({"temperature": (0.0, 60.0), "stroke": (0.0, 15e-6)}, 0.999)
    made = generate(scenario, model, tmp_path / "c")
    library, controller = (
        Library(scenario, made.path, Real.DOUBLE, made.online[Real.DOUBLE], made.init[Real.DOUBLE]),
        controller_of(model, "pose", 1e-3),
    )
    size = float(np.abs(controller.kernels.nominal.u_bounds[1]).max())
    met = ControllerStatus(0)
    for values in chosen(controller)[:4]:
        assert library.init(values) == 0
        reference = Controller(controller.kernels.at(values))
        state = reference.rest()
        for target in targets(controller):
            step = reference.step(state, target)
            status, answer = library.call("step", target)
            met |= step.status
            assert status == step.status
            assert np.max(np.abs(answer[:6] - step.drive)) < 1e-9 * size
            library.write_state(step.state)  # each sample from one state: a path drifts where a limit acts
            state = library.read_state()
            assert np.all(state[0] <= reference.kernels.nominal.x_bounds[1] + 1e-6)  # K: the tightened 490 degC
    assert met & ControllerStatus.DISPLACEMENT


@pytest.mark.long
def test_a_constant_that_acts_on_what_is_compiled_in_is_refused_by_name(tmp_path):
    text = '\n[run_time]\nconstants = ["stage.stroke", "stage.lever_long", "actuator.time_constant"]\n'
    scenario = scenario_of(tmp_path, text)
    with pytest.raises(InputError) as refused:
        check_run_time(ControllerKernels(build_model(scenario.device), "pose", 1e-3))
    told = str(refused.value)
    assert "stage.stroke: acts on the displacement range" in told and "stage.lever_long: acts on" in told
    assert "time_constant" not in told


def test_a_stage_with_inertia_is_refused(tmp_path):
    file = SCENARIOS / "devices" / "flexure_axis.toml"
    number = next(path for path, q in load_device(file).quantities() if not q.whole and q.si)
    (tmp_path / "device.toml").write_text(f'{file.read_text()}\n[run_time]\nconstants = ["{number}"]\n')
    model = build_model(load_device(tmp_path / "device.toml"))
    assert model.inertial
    with pytest.raises(InputError, match="stage without inertia"):
        check_run_time(controller_of(model, "displacement", 1e-3).kernels)
