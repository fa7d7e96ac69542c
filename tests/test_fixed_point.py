"""The online controller in integers: it errs by no more than is proved, keeps every limit, and says what it cannot be made of."""

from __future__ import annotations

import ctypes
import gzip
import json
import shutil
import subprocess
from itertools import pairwise

import numpy as np
import pytest
from conftest import SCENARIOS

from ctrlgen import build_model, load_scenario
from ctrlgen.controller.controller_step import ControllerStatus, answer
from ctrlgen.controller.fixed_point import FINEST, SHARE_BITS, fixed_point
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.templates import write
from ctrlgen.firmware.online.fixed_source import fixed_context
from ctrlgen.verification.cores import BASE, FLAGS, M0_PLUS
from ctrlgen.verification.emulation import Machine
from ctrlgen.verification.rules import STRICT

NAME = "device_online_q31"
NAMES = {"online": NAME, "selftest": "device_selftest_q31", "vectors": "device_vectors_q31"}
WITHIN = 12_000  # instructions of a Cortex-M0+ on the circle, which takes 16,400 in emulated float: the goal


class InC:
    """The C of a scenario on this computer, called with integers."""

    def __init__(self, folder, scenario="circle20"):
        self.scenario = load_scenario(SCENARIOS / scenario)
        self.model = build_model(self.scenario.device)
        self.controller = controller_of(self.model, self.scenario.file.follow, self.scenario.sample_time)
        self.fixed = fixed_point(self.controller)
        command = self.scenario.bind(self.model).targets
        self.context = fixed_context(self.scenario, self.controller, command, NAMES)
        for template, name in (
            ("fixed", NAME),
            ("fixed_selftest", NAMES["selftest"]),
            ("fixed_vectors", NAMES["vectors"]),
        ):
            for kind in "hc":
                write(f"{template}.{kind}", self.context, folder / f"{name}.{kind}")
        self.source = folder / f"{NAME}.c"
        self.init = f"{NAME}_init_{self.context['build']}"
        library = folder / "fixed.so"
        subprocess.run(["gcc", *STRICT, "-Werror", "-O1", "-shared", "-fPIC", "-o", library, self.source], check=True)
        self.library = ctypes.CDLL(str(library))
        f = self.fixed
        self.n, self.n_s, self.n_u = (len(b) for b in (f.bits.displacement, f.bits.state, f.bits.drive))
        self.state = np.zeros(self.n_s + self.n + 3, dtype=np.int32)
        self.out = np.zeros(self.n_u + self.n + self.n_s, dtype=np.int32)

    def start(self):
        getattr(self.library, self.init)(self.state.ctypes)

    def call(self, function, target=None):
        """(status, drive, displacement, state), integers, of a target of real numbers, rounded, or of none."""
        given = None if target is None else self.counts(target)
        status = getattr(self.library, f"{NAME}_{function}")(
            self.state.ctypes, None if given is None else given.ctypes, self.out.ctypes
        )
        return (ControllerStatus(status), *np.split(self.out.astype(float), [self.n_u, self.n_u + self.n]))

    def counts(self, target):
        return np.clip(np.rint(target * 2.0**self.fixed.bits.target), -(2**31), 2**31 - 1).astype(np.int32)

    def target_of(self, z):
        """The target of a displacement, as integers can say it."""
        exact = np.linalg.solve(self.controller.kernels.target_directions, z)
        return self.counts(exact) * 2.0**-self.fixed.bits.target

    def targets(self, rng, count, beyond=0.0):
        low, high = self.model.z_bounds
        room = beyond * (high - low)
        return [self.target_of(rng.uniform(low - room, high + room)) for _ in range(count)]


@pytest.fixture(scope="module")
def circle(tmp_path_factory):
    return InC(tmp_path_factory.mktemp("fixed"))


def test_answers_are_off_those_in_real_numbers_by_no_more_than_is_proved(circle):
    """And a device as described, under these drives, stands where it was asked to be: to 0.01 nm, a hundredth of an atom."""
    rng, fixed, kernels = np.random.default_rng(11), circle.fixed, circle.controller.kernels
    assert fixed.off.stage.max() < 1e-11 and fixed.off.target.max() < 1e-12
    bound, (low, high) = kernels.composite_bound, circle.model.z_bounds
    drawn = [low + (high - low) * rng.uniform(0.1, 1.0, circle.n) for _ in range(12)]
    corners = [circle.target_of(z / max(1.0, 1.01 * float(bound(z)))) for z in drawn]
    path = [a + (b - a) * s for a, b in pairwise(corners) for s in np.linspace(0, 1, 30)]
    state, x = circle.controller.rest(), circle.model.rest
    circle.start()
    compared, largest = 0, np.zeros(4)
    for target in map(lambda t: circle.counts(t) * 2.0**-fixed.bits.target, path):
        before, x_before = state, circle.state[: circle.n_s].copy()
        real = circle.controller.step(before, target)
        status, u, z, s = circle.call("step", target)
        if not status:  # the C has the maps whose bounds are tested in test_scaled_integers
            assert np.array_equal(z, fixed.displacement(circle.counts(target))) and np.array_equal(s, fixed.state_of(z))
            both = np.concatenate([x_before, s])
            assert np.array_equal(u, np.clip(fixed.step_drive(both), *fixed.drive_ends))
        u, z, s = (
            v * 2.0**-b
            for v, b in zip((u, z, s), (fixed.bits.drive, fixed.bits.displacement, fixed.bits.state), strict=True)
        )
        x = answer(kernels.moving.advance, x, z, u)
        stands = answer(kernels.static.settle, x, z, u)
        if real.status or status:
            state = (s, z)
            continue
        state = real.state
        compared += 1
        assert np.all(np.abs(z - real.displacement) <= fixed.off.displacement)
        assert np.all(np.abs(s - real.actuator_state) <= fixed.off.state)
        assert np.all(np.abs(stands - real.displacement) <= fixed.off.stage)
        assert np.all(np.abs(u - real.drive) <= fixed.off.drive + fixed.drive_slack * 2.0**-fixed.bits.drive)
        found = (z - real.displacement, s - real.actuator_state, u - real.drive, stands - real.displacement)
        bounds = (fixed.off.displacement, fixed.off.state, fixed.off.drive, fixed.off.stage)
        largest = np.maximum(largest, [np.max(np.abs(a) / b) for a, b in zip(found, bounds, strict=True)])
    assert compared > 300 and np.all(largest > 0.1)  # the bounds are no idle ones


def test_composite_limits_are_kept_with_every_error(circle):
    """What the shares may add up to, their rounding, the bound's own rest and what the stage is off come to one at most."""
    fixed, bound = circle.fixed, circle.controller.kernels.bound
    shares = (fixed.bound_limit + fixed.bound.off.sum()) * 2.0**-SHARE_BITS
    errors = bound.rest + np.sum(np.abs(bound.rows) @ fixed.off.stage)
    assert 1 - 4 * 2.0**-SHARE_BITS < shares + errors <= 1


def test_a_jump_is_approached_in_parts_that_a_lag_outdoes_in_a_sample(circle):
    moved = 1 - np.exp(-circle.scenario.sample_time / 5e-3)  # of its way, with the device's time constant of 5 ms
    assert 2.0**-circle.fixed.trials <= moved / FINEST < 2 * 2.0**-circle.fixed.trials


def test_the_ends_of_the_range_are_within_it_in_spite_of_roundings(circle):
    (low, high), fixed = circle.model.z_bounds, circle.fixed
    slack = fixed.displacement_slack * 2.0**-fixed.bits.displacement
    assert np.all(slack >= np.maximum(circle.controller.slacks[0], fixed.off.target + fixed.off.displacement))
    for beyond, told in ((0.5, False), (3.0, True)):
        for end in (low - beyond * slack, high + beyond * slack):
            circle.start()
            assert (ControllerStatus.DISPLACEMENT in circle.call("step", circle.target_of(end))[0]) == told


def test_to_settle_starts_from_home_wherever_the_device_was(circle):
    rng, answers = np.random.default_rng(2), []
    ends = rng.uniform(0, 1, (100, circle.n)) * circle.model.z_bounds[1]
    bound = circle.controller.kernels.composite_bound
    far = circle.target_of(max(ends, key=lambda z: float(bound(z))))
    for start in (np.zeros(circle.n), *rng.uniform(0.1, 0.4, (3, circle.n)) * circle.model.z_bounds[1]):
        circle.start()
        circle.call("settle", circle.target_of(start))
        status, *answer_of = circle.call("settle", far)
        assert ControllerStatus.COMPOSITE in status
        answers.append(np.concatenate(answer_of))
    assert all(np.array_equal(answers[0], other) for other in answers)


def test_jumps_beyond_every_limit_keep_them_and_are_told(circle):
    rng, fixed, m = np.random.default_rng(5), circle.fixed, circle.model
    kernels = circle.controller.kernels
    circle.start()
    x, seen = m.rest, ControllerStatus(0)
    low, high = fixed.drive_ends
    for k, target in enumerate(circle.targets(rng, 60, beyond=0.3)):
        for _ in range(4):
            status, u, z, _ = circle.call("step", target if k % 7 else None)
            seen |= status
            assert (status == ControllerStatus.INPUT) == (k % 7 == 0)
            assert np.all((u >= low) & (u <= high))
            z = z * 2.0**-fixed.bits.displacement
            x = answer(kernels.moving.advance, x, z, u * 2.0**-fixed.bits.drive)
            stands = answer(kernels.static.settle, x, z, u)
            assert np.all(np.abs(stands - z) <= fixed.off.stage)
            assert np.all((stands >= m.z_bounds[0] - fixed.off.stage) & (stands <= m.z_bounds[1] + fixed.off.stage))
            assert answer(kernels.composite_ratio, x, z, stands)[0] <= 1
    wanted = (
        ControllerStatus.DISPLACEMENT | ControllerStatus.COMPOSITE | ControllerStatus.DRIVE | ControllerStatus.INPUT
    )
    assert seen == wanted
    # What one sample cannot reach is reached in several, a lag of five of them
    target = circle.target_of(0.4 * m.z_bounds[1])
    statuses = [circle.call("step", target)[0] for _ in range(40)]
    assert statuses[0] == ControllerStatus.DRIVE and not any(statuses[-10:])


def test_nothing_is_promised_while_the_device_settles_cools_or_is_lost(circle):
    fixed, target = circle.fixed, circle.target_of(0.3 * circle.model.z_bounds[1])
    circle.state[:] = 0
    assert circle.call("step", target)[0] == ControllerStatus.LOST
    circle.start()
    statuses = [circle.call("settle", target)[0] for _ in range(fixed.settling + 1)]
    assert statuses == [ControllerStatus.UNSURE] * fixed.settling + [ControllerStatus(0)]
    assert circle.call("step", target)[0] == 0
    near = circle.target_of(
        0.3001 * circle.model.z_bounds[1]
    )  # a state off by 10^-4: more than the 10^-6 that is known
    assert circle.call("settle", near)[0] == ControllerStatus.UNSURE
    assert getattr(circle.library, f"{NAME}_forget")(circle.state.ctypes) == ControllerStatus.UNSURE
    for _ in range(fixed.unknown):
        status, u, z, _ = circle.call("step", target)
        assert status == ControllerStatus.UNSURE and not u.any() and not z.any()
    after = np.concatenate(circle.call("step", target)[1:])
    circle.start()
    assert np.array_equal(after, np.concatenate(circle.call("step", target)[1:])) and after.any()  # it is cold now
    for place in range(circle.n_s + circle.n):
        circle.start()
        circle.state[place] ^= 1 << 30
        status, u, *_ = circle.call("step", target)
        assert status == ControllerStatus.LOST and not u.any()
        circle.state[place] ^= 1 << 30
        assert (
            circle.call("step", target)[0] == ControllerStatus.LOST
        )  # until it is initialised, also where the bit flips back


@pytest.mark.long
def test_the_test_on_the_target_takes_every_branch_and_finds_a_wrong_number(circle, tmp_path):
    for program in ("gcc", "gcov"):
        if not shutil.which(program):
            pytest.skip(f"{program} is missing: what the shipped test enters was not counted")
    write("fixed_test.c", circle.context, tmp_path / "run.c")
    text, folder = circle.source.read_text(), circle.source.parent
    others = [tmp_path / "run.c", *(folder / f"{NAMES[piece]}.c" for piece in ("selftest", "vectors"))]

    def told(changed, *flags):
        (tmp_path / f"{NAME}.c").write_text(changed)
        words = ["gcc", *STRICT, "-O0", *flags, "-I", folder, f"{NAME}.c", *others, "-o", "run"]
        subprocess.run(words, cwd=tmp_path, check=True)
        return subprocess.run(["./run"], cwd=tmp_path, capture_output=True, text=True)

    calls = circle.context["calls"]
    assert told(text, "--coverage").stdout == f"{calls} of {calls} vectors agree\n"
    words = ["gcov", "--json-format", "--branch-probabilities", f"run-{NAME}.gcda"]
    subprocess.run(words, cwd=tmp_path, check=True, capture_output=True)
    report = json.loads(gzip.decompress((tmp_path / f"run-{NAME}.gcov.json.gz").read_bytes()))
    (file,) = (f for f in report["files"] if f["file"].endswith(f"{NAME}.c"))
    assert all(f["execution_count"] for f in file["functions"]) and len(file["functions"]) > 10
    assert [line["line_number"] for line in file["lines"] if any(not b["count"] for b in line["branches"])] == []
    wide = f"is_near(wide[i], {NAME.upper()}_Z_LOW[i]"
    for right, wrong in (
        (str(circle.fixed.displacement.coefficients[0][3]), str(circle.fixed.displacement.coefficients[0][3] + 4096)),
        ("state->unsure -= 1U;", "state->unsure -= 0U;"),
        ("state->ready = 0U;", ""),
        (wide, wide.replace("[i]", "[0]")),
        ("total += (share < 0) ? -share : share;", "total += share;"),
    ):
        assert right in text
        assert told(text.replace(right, wrong)).returncode == 1, right


@pytest.mark.long
@pytest.mark.skipif(shutil.which("cppcheck") is None, reason="needs cppcheck")
def test_rules_of_misra_are_kept_but_for_those_of_the_list(circle):
    words = [
        "cppcheck",
        "--addon=misra",
        "--std=c99",
        "-U__cplusplus",
        "--quiet",
        "--enable=warning,style,performance,portability",
    ]
    done = subprocess.run([*words, "--template={id}", circle.source], capture_output=True, text=True)
    # constants of the interface, and the bits of a float, as DEVIATIONS.md says
    assert set(done.stderr.split()) == {"misra-c2012-2.5", "misra-c2012-19.2"}
    if shutil.which("clang"):
        warned = ["-Weverything", "-Wno-padded", "-Wno-declaration-after-statement", "-Werror"]
        subprocess.run(["clang", "-std=c99", *warned, "-fsyntax-only", circle.source], check=True)


@pytest.mark.long
@pytest.mark.skipif(shutil.which("arm-none-eabi-gcc") is None, reason="needs arm-none-eabi-gcc")
def test_a_cortex_m0_takes_a_sample_in_a_quarter_of_what_emulated_float_does(circle, tmp_path):
    program, target_size = tmp_path / "m0.elf", len(circle.fixed.bits.target)
    words = ["arm-none-eabi-gcc", "-mcpu=cortex-m0plus", "-mthumb", "-mfloat-abi=soft", *FLAGS, "-nostdlib"]
    words += [f"-Wl,-e,{circle.init}", f"-Wl,-Ttext={BASE:#x}", circle.source, "-lgcc", "-o", program]
    subprocess.run(words, check=True)
    machine = Machine(M0_PLUS, program)
    state, target, out = (
        machine.reserve(len(a), Real.FLOAT) for a in (circle.state, np.zeros(target_size), circle.out)
    )
    command = circle.scenario.bind(circle.model).targets

    def call(function, wanted):
        machine.emulator.mem_write(target, circle.counts(wanted).tobytes())
        return machine.call(f"{NAME}_{function}", state, target, out)

    machine.call(circle.init, state)
    circle.start()
    for _ in range(circle.fixed.settling + 1):
        call("settle", command[-1])
        circle.call("settle", command[-1])
    counted = []
    for wanted in command:
        status, count = call("step", wanted)
        counted.append(count)
        assert status == circle.call("step", wanted)[0] == 0
        assert bytes(machine.emulator.mem_read(out, 4 * len(circle.out))) == circle.out.tobytes()
    assert max(counted) <= WITHIN
    # Beyond a limit the limits are computed once more, as often as the line is halved, and once at the answer
    jumps = [call("step", target) for target in circle.targets(np.random.default_rng(5), 300, beyond=0.3)]
    told = [count for status, count in jumps if status & (ControllerStatus.COMPOSITE | ControllerStatus.DRIVE)]
    assert len(told) > 200 and max(told) <= (circle.fixed.trials + 2) * max(counted)
    print(f"{max(counted)} instructions at most on the circle, {max(told)} of {len(told)} jumps")
