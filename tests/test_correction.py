"""Corrections that are learnt along the way: what they add, what runs teach; the C against an independent plant that knows the truth."""

from __future__ import annotations

import ctypes
import subprocess
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from turntable import RIPPLE, RUNOUT_TABLE, made, stated

from ctrlgen import InputError, build_model, load_scenario
from ctrlgen.controller.correction import EARLY, Basis, Correction, CorrectionLearning, Corrections, CorrectionStatus
from ctrlgen.controller.motion_feedforward import controller_of
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.folder import CFolder
from ctrlgen.firmware.online.corrected import corrections_of, read_stored, stored

TURN, RUNOUT = 10e-3, 300e-9  # rad of a period, m of its error
JACOBIAN = np.array([[2e-7, 1e-8], [1e-6, 4e-4]])  # of the device file: m/V and rad/V


def error(theta: np.ndarray) -> np.ndarray:
    """(n, 2) [m, rad] by which the plant is off its Jacobian: harmonics of a period, and a jump in angle that none of the bases has."""
    x = 2 * np.pi * theta / TURN
    runout = RUNOUT * (0.7 * np.sin(x + 0.4) + 0.2 * np.cos(3 * x))
    ripple = 20e-6 * (0.8 * np.sin(2 * x) + 0.3 * np.cos(5 * x - 1)) + 1e-6 * (np.mod(x, 2 * np.pi) > np.pi)
    return np.column_stack([runout, ripple])


@dataclass
class Plant:
    """A turntable whose stage answers 30 % more than the device file says, with `error` and a sensor that is noisy and off."""

    rng: np.random.Generator
    answer: float = 1.3

    def truth(self, drive: np.ndarray) -> np.ndarray:
        """(n, 2) the true poses of drives (n, 2)."""
        pose = drive @ JACOBIAN.T * np.array([self.answer, 1.0])
        return pose + error(pose[:, 1])

    def reading(self, pose: np.ndarray) -> np.ndarray:
        return pose + np.array([2e-7, 3e-5]) + np.array([1e-8, 1e-6]) * self.rng.standard_normal(pose.shape)


class InC:
    """The compiled corrections in one arithmetic, on a table and a run of their own."""

    def __init__(self, folder: CFolder, real: Real, into: Path, compiler: str) -> None:
        self.kind = np.float32 if real is Real.FLOAT else np.float64
        self.folder, self.name, online = folder, folder.corrected[real], folder.online[real]
        (into / "sizes.c").write_text(
            f'#include "{self.name}.h"\nunsigned size(int of);\nunsigned size(int of) {{ return of == 0 ? sizeof({self.name}_table) '
            f": of == 1 ? sizeof({self.name}_run) : of == 2 ? sizeof({online}_state) : {self.name.upper()}_BYTES; }}\n"
            f"void begin({self.name}_table *t, {online}_state *s);\n"
            f"void begin({self.name}_table *t, {online}_state *s) {{ {self.name}_init(t); {online}_init(s); }}\n"
        )
        words = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wdouble-promotion", "-Werror", "-O1"]
        sources = [folder.path / f"{online}.c", folder.path / f"{self.name}.c", into / "sizes.c"]
        built = [compiler, *words, "-shared", "-fPIC", f"-I{folder.path}", *sources, "-o", into / f"{self.name}.so"]
        done = subprocess.run(list(map(str, built)), capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        self.c = ctypes.CDLL(str(into / f"{self.name}.so"))
        self.table, self.run, self.state = (np.full(self.c.size(k), 0xA5, np.uint8) for k in range(3))
        self.bytes = np.zeros(self.c.size(3), np.uint8)
        self.out = np.zeros(8, self.kind)
        self.c.begin(*map(at, (self.table, self.state)))

    def __call__(self, function: str, *arguments: object) -> int:
        call = getattr(self.c, f"{self.name}_{function}")
        call.restype = ctypes.c_uint32
        return int(call(*(at(a) if isinstance(a, np.ndarray) else a for a in arguments)))

    def values(self, count: int) -> np.ndarray:
        return self.table[: count * self.kind().nbytes].view(self.kind).astype(float)

    def play(self, targets: np.ndarray) -> tuple[np.ndarray, int]:
        """(n, 2) the drives of targets, and all statuses."""
        drives, status = np.zeros(targets.shape), 0
        for k, target in enumerate(targets.astype(self.kind)):
            status |= self("settle", self.state, self.table, target, self.out)
            drives[k] = self.out[:2]
        return drives, status

    def learn(self, targets: np.ndarray, measured: np.ndarray) -> int:
        """All statuses of a run and of its end."""
        status = 0
        for target, reading in zip(targets.astype(self.kind), measured.astype(self.kind), strict=True):
            status |= self("learn", self.run, target, reading)
        return status | self("end", self.run, self.table)


def at(array: np.ndarray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def sweep(n: int = 1600) -> np.ndarray:
    """(n, 2) targets over two periods, to and fro."""
    theta = TURN * np.concatenate([np.linspace(-1, 1, n // 2), np.linspace(1, -1, n // 2)])
    return np.column_stack([np.zeros(n), theta])


def about_mean(pose: np.ndarray, targets: np.ndarray) -> np.ndarray:
    """(2,) root mean square error of each channel about its mean."""
    return np.asarray(np.std(pose - targets, axis=0))


@pytest.fixture(scope="module")
def both(tmp_path_factory) -> tuple[CFolder, Corrections, int]:
    return made(tmp_path_factory.mktemp("correction"), RUNOUT_TABLE, RIPPLE)


def test_the_true_error_falls_to_a_tenth_in_two_runs_and_never_rises(both, compiler, tmp_path, rng):
    """The C drives the plant and learns from its sensor. A gain of 0.8 leaves 1/25 of what the bases can hold; a tenth with what they
    cannot: the jump of 1 urad, straight lines between entries, the answer of the stage."""
    folder, corrections, mark = both
    c, plant, targets = InC(folder, Real.FLOAT, tmp_path, compiler), Plant(rng), sweep()
    c("begin", c.run, c.table)
    errors, learning = [], CorrectionLearning.begin(corrections)
    bounds = np.concatenate([np.full(of.basis.count, of.bound) for of in corrections.each])
    for k in range(6):
        drives, status = c.play(targets)
        truth = plant.truth(drives)
        assert status == 0, k
        errors.append(about_mean(truth, targets))
        readings = plant.reading(truth)
        assert c.learn(targets, readings) & ~CorrectionStatus.WORSE == 0
        if k < 2:  # later runs differ by noise, and may be worse to float and not to double; sums round once a sample
            learning, _ = learning.after_run(np.float32(targets).astype(float), np.float32(readings).astype(float))
            off = np.abs(c.values(corrections.count) - learning.values) / bounds
            assert np.max(off) < len(targets) * np.finfo(np.float32).eps
    assert np.all(errors[2] < errors[0] / 10)
    floor = np.array([5e-10, 5e-8])  # a twentieth of the sensor's noise, which the best of such runs differ by
    assert all(np.all(after <= np.maximum(before, errors[2]) + floor) for before, after in pairwise(errors))
    assert c("keep", c.run, c.table) == 0
    assert np.all(about_mean(plant.truth(c.play(targets)[0]), targets) < errors[0] / 10)
    # the table goes into flash and comes back to a device that starts anew
    assert c("save", c.table, c.bytes, len(c.bytes)) == 0
    values = c.values(corrections.count)
    assert np.array_equal(read_stored(mark, c.bytes.tobytes()), values) and stored(mark, values) == c.bytes.tobytes()
    again = InC(folder, Real.FLOAT, tmp_path, compiler)
    assert np.all(again.values(corrections.count) == 0)
    assert again("load", again.table, c.bytes, len(c.bytes)) == 0
    assert np.array_equal(again.table, c.table)


def test_no_run_can_make_the_measured_error_larger(rng):
    """Any basis within its bound, any coverage of the way, any answer below 2/gain: the sum of squares about the mean falls or stays."""
    for trial in range(60):
        closed, gain = bool(trial % 2), float(rng.uniform(0.1, 1))
        basis = Basis("table", 12, 1.0, 0.0 if closed else -0.3, closed) if trial % 3 else Basis("harmonic", 8, 1.0)
        c = Correction(0, 0, basis, float(rng.uniform(0.2, 2)), gain)
        all_of, answer = Corrections((c,), 1), rng.uniform(0.05, 1.99) / gain
        covered = rng.uniform(0, rng.uniform(0.1, 2), 200)
        off = c.bound * np.sin(rng.uniform(1, 30) * covered + rng.uniform(0, 6)) * rng.uniform(0.1, 1.5)
        phi = c.phi.map(200)(covered[None]).full().T
        learning, before = CorrectionLearning.begin(all_of), np.inf
        for _ in range(8):
            e = off + answer * (phi @ learning.values)
            after = float(np.var(e))
            assert after <= before * (1 + 1e-12)
            assert np.max(np.abs(phi @ learning.values)) <= c.bound * (1 + 1e-12)
            before = after
            learning, status = learning.after_run(covered[:, None], (covered + e)[:, None])
            assert not status


def test_harmonics_move_with_the_derivatives_of_the_motion():
    """c(s(t)) of a motion s(t), differenced."""
    corrections = Corrections((Correction(1, 0, Basis("harmonic", 6, 0.3), 1.0, 0.5),), 2, 2)
    values, step = np.array([0.1, -0.2, 0.05, 0.3, 0.02, -0.1]), 1e-4

    def target(t: float) -> np.ndarray:
        s = np.array([0.1 * np.sin(3 * t), 0.3 * np.cos(3 * t), -0.9 * np.sin(3 * t)])
        return np.column_stack([s, np.zeros(3)]).reshape(1, -1)

    def added(t: float) -> np.ndarray:
        return np.asarray((corrections.corrected(values, target(t)) - target(t))[0, 1::2])

    differenced = (added(1.2 + step) - added(1.2 - step)) / (2 * step)
    assert added(1.2)[1:] == pytest.approx(differenced[:2], rel=1e-5)


def test_whatever_a_sensor_says_no_more_than_the_bound_is_added_and_limits_hold(both, compiler, tmp_path, rng):
    """Readings that are reversed, absurd, no numbers; targets at the ends of the range, where a correction leads beyond."""
    folder, corrections, _ = both
    c, targets = InC(folder, Real.FLOAT, tmp_path, compiler), sweep(400)
    c("begin", c.run, c.table)
    bounds = np.array([5e-7, 5e-5])
    at_limit = np.array([[19.2e-6, 40.1e-3], [-19.2e-6, -40.1e-3]])
    assert np.all(np.abs(np.linalg.solve(JACOBIAN, at_limit.T)) > 90)
    for k in range(12):
        readings = (
            targets - (1 if k % 3 else 100) * (c.play(targets)[0] @ JACOBIAN.T - targets) - 3 * error(targets[:, 1])
        )
        readings[rng.random(len(readings)) < 0.05] = rng.choice([np.nan, np.inf, -np.inf, 1e30, -1.0])
        assert c.learn(targets, readings) & CorrectionStatus.INPUT
        corrected = np.zeros(8, np.float32)
        for target in targets.astype(np.float32):
            assert c("target", c.table, target, corrected) == 0
            assert np.all(np.abs(corrected[:2] - target) <= bounds * 1.001 + 1e-7 * np.abs(target))
        assert np.max(np.abs(c.play(np.vstack([targets, at_limit]))[0])) <= 100
    for far in (3e38, -3e38, 1e30):  # a period of which is no number in float
        target, reading = np.array([0, far], np.float32), np.array([3e-7, far], np.float32)
        assert c("target", c.table, target, corrected) == 0
        assert abs(corrected[0]) <= bounds[0] and corrected[1] == target[1]
        c("begin", c.run, c.table)
        assert all(c("learn", c.run, target, reading) == 0 for _ in range(100))
        assert c("end", c.run, c.table) == 0 and np.any(c.values(corrections.count))
    nothing = CorrectionLearning.begin(corrections).after_run(targets, np.full(targets.shape, np.nan))
    assert nothing[1] == CorrectionStatus.INPUT | CorrectionStatus.SHORT and not nothing[0].values.any()


def test_a_device_that_answers_the_wrong_way_is_gone_back_from(both, compiler, tmp_path, rng):
    """Every second run is that of the best numbers, which are none; the steps between become ever smaller."""
    c, targets = InC(both[0], Real.DOUBLE, tmp_path, compiler), sweep(400)
    c("begin", c.run, c.table)
    worst = []
    for k in range(8):
        worst.append(float(np.linalg.norm(c.values(both[1].count))))
        added = c.play(targets)[0] @ JACOBIAN.T - targets
        status = c.learn(targets, targets - added + error(targets[:, 1]))
        assert status == CorrectionStatus.WORSE * (k % 2)
    assert worst[::2] == [0, 0, 0, 0] and np.all(np.diff(worst[1::2]) < -0.4 * np.array(worst[1:-2:2]))
    # a step is halved after a worse run, and doubled again after a better one
    learning = CorrectionLearning.begin(both[1])
    c.c.begin(at(c.table), at(c.state))
    c("begin", c.run, c.table)
    for share, gain in ((0.5, 0.8), (1.0, 0.4), (0.5, 0.4), (0.25, 0.8)):
        readings = targets + share * error(targets[:, 1])
        c.learn(targets, readings)
        learning, _ = learning.after_run(targets, readings)
        assert np.all(learning.gain == gain)
        assert c.values(both[1].count) == pytest.approx(learning.values, rel=1e-9, abs=1e-15)


def test_a_flipped_bit_is_told_and_nothing_is_added(both, compiler, tmp_path):
    """In the stored bytes and, by the check, in RAM."""
    folder, corrections, mark = both
    c = InC(folder, Real.FLOAT, tmp_path, compiler)
    learnt = stored(mark, np.concatenate([np.full(32, 1e-7), np.full(10, 1e-6)]))
    target, corrected = np.array([0, 3e-3], np.float32), np.zeros(2, np.float32)
    for bit in range(8 * len(learnt)):
        c.bytes[:] = np.frombuffer(learnt, np.uint8)
        c.bytes[bit // 8] ^= 1 << bit % 8
        assert c("load", c.table, c.bytes, len(learnt)) == CorrectionStatus.UNUSED
    assert np.all(c.values(corrections.count) == 0)
    c.bytes[:] = np.frombuffer(learnt, np.uint8)
    assert c("load", c.table, c.bytes, len(learnt)) == 0 and c("target", c.table, target, corrected) == 0
    assert corrected[0] == np.float32(1e-7)
    good, sound = c.table.copy(), corrected.copy()
    told = 0
    for bit in range(8 * len(good)):
        c.table[bit // 8] ^= 1 << bit % 8
        status = c("target", c.table, target, corrected)
        # by the call itself: of what it reads, whatever the size of the change
        assert status == CorrectionStatus.UNUSED or np.array_equal(corrected, sound), bit
        told += status == CorrectionStatus.UNUSED
        assert c("check", c.table) == CorrectionStatus.UNUSED, bit
        assert c("target", c.table, target, corrected) == CorrectionStatus.UNUSED and np.array_equal(corrected, target)
        c.table[:] = good
    assert told == 32 * (2 * (2 + 10) + 1)  # two entries and ten harmonics, each with its copy; the mark
    c.table[4 * 41 : 4 * 42].view(np.float32)[:] = np.nan  # of the other correction
    assert c("target", c.table, target, corrected) == CorrectionStatus.UNUSED and np.array_equal(corrected, target)
    assert c("check", c.table) == CorrectionStatus.UNUSED
    c("begin", c.run, c.table)
    assert c("learn", c.run, target, target) == CorrectionStatus.LOST
    c.table[:] = good
    c("begin", c.run, c.table)
    run = c.run.copy()
    for function in ("end", "keep"):
        c.run[:] = run
        c.run[4 * 7] ^= 1  # of the best numbers
        assert c(function, c.run, c.table) == CorrectionStatus.LOST and np.array_equal(c.table, good)
    beyond = np.frombuffer(stored(mark, np.full(42, 6e-7)), np.uint8).copy()
    assert c("load", c.table, beyond, len(learnt)) == CorrectionStatus.UNUSED
    with pytest.raises(ValueError, match="damaged"):
        read_stored(mark, learnt[:-1] + b"?")
    with pytest.raises(ValueError, match="another controller"):
        read_stored(mark + 1, learnt)


def test_spikes_among_the_first_samples_of_a_run_do_no_harm(both, compiler, tmp_path):
    """Three of the first seven are refused and the run teaches what the others say; four of them are the run's own zero: too short."""
    targets, c = sweep(400), InC(both[0], Real.DOUBLE, tmp_path, compiler)
    assert EARLY == 7
    for spikes in ([], [0], [0, 1, 6], [0, 1, 2, 5]):
        readings = targets + error(targets[:, 1])
        readings[spikes] += 1e-3
        begun = CorrectionLearning.begin(both[1])
        learning, expected = begun.after_run(targets, readings)
        c.c.begin(at(c.table), at(c.state))
        c("begin", c.run, c.table)
        assert c.learn(targets, readings) == expected, spikes
        assert c.values(both[1].count) == pytest.approx(learning.values, rel=1e-9, abs=1e-15)
        if len(spikes) < 4:
            kept = np.delete(np.arange(400), spikes)
            alone, _ = begun.after_run(targets[kept], readings[kept])
            assert learning.values == pytest.approx(alone.values, rel=1e-9, abs=1e-15)
            assert expected == (CorrectionStatus.INPUT if spikes else 0)
        else:
            assert expected == CorrectionStatus.INPUT | CorrectionStatus.SHORT


REFUSED = {
    'of = "theta_x"': "'theta_x' is no followed channel",
    'over = "x"': "'x' is no followed channel",
    'bound = "1 mrad"': "must have the dimension of",
    'period = "1 um"': "must have the dimension of urad",
    'period = "-1 mrad"': "must be larger than zero",
    'range = ["0 rad", "1 rad"]': "needs entries = 64",
    "harmonics = 3": "has no meaning",
    'kind = "harmonic"': "needs period",
    "entries = 3": "greater than or equal to 4",
    "gain = 1.5": "less than or equal to 1",
}


@pytest.mark.parametrize("line", REFUSED)
def test_what_cannot_be_a_correction_is_refused(line, tmp_path):
    key = line.partition(" ")[0]
    kept = [row for row in RUNOUT_TABLE.splitlines() if not row.startswith(f"{key} =")]
    with pytest.raises(InputError, match=REFUSED[line]):
        scenario = stated(tmp_path, "\n".join([*kept, line]))
        corrections_of(scenario, controller_of(build_model(scenario.device), "pose", scenario.sample_time).kernels)


def test_one_channel_has_one_correction(tmp_path):
    scenario = stated(tmp_path, RUNOUT_TABLE, RUNOUT_TABLE)
    with pytest.raises(InputError, match="corrected twice"):
        corrections_of(scenario, controller_of(build_model(scenario.device), "pose", scenario.sample_time).kernels)


def test_integers_have_no_correction_and_say_so(tmp_path):
    stated(tmp_path, RUNOUT_TABLE)
    text = (tmp_path / "scenario.toml").read_text()
    (tmp_path / "scenario.toml").write_text("fixed_point = true\n" + text)
    with pytest.raises(InputError, match=r"fixed_point has no \[\[correction\]\]"):
        load_scenario(tmp_path / "scenario.toml")
