"""A sensor that averages its readings over a window is told from a filter, a delay and a notch, which keep their names."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from axis_records import record
from recovery import fitter_of
from scipy.signal import cont2discrete

from ctrlgen.core.files import validate
from ctrlgen.devices import Device
from ctrlgen.diagnosis.diagnose import diagnose_recording
from ctrlgen.diagnosis.selection.finer_forms import as_one_law
from ctrlgen.diagnosis.selection.rivals import simplified
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.settings import CANDIDATE_TERMS
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Recording

H, FINE, N, NOISE = 1e-3, 10, 4000, 0.9e-6
COIL = validate(
    Device.library["axis"],
    {
        "kind": "axis",
        "name": "coil",
        "title": "a stage on a membrane, driven by a voice coil",
        "source": "round numbers, of which the machine differs",
        "mechanics": {
            "mass": {"value": "0.118 kg", "sd": "4 %"},
            "damping": {"value": "2.4 N*s/m", "sd": "20 %"},
            "stiffness": {"value": "3.1 N/mm", "sd": "5 %"},
            "stroke": "4 mm",
        },
        "actuator": {"force_constant": {"value": "6.3 N/A", "sd": "3 %"}, "drive_limit": "1.5 A"},
    },
    "coil.toml",
)


def stepped(A, B, C, D, u: np.ndarray) -> np.ndarray:
    """The output of a linear system under a drive held over each fine step, exactly."""
    A, B, C, D, _ = cont2discrete(tuple(np.array(part, float) for part in (A, B, C, D)), H / FINE)
    x, out = np.zeros(len(A)), np.empty(len(u))
    for k, value in enumerate(u):
        out[k] = C[0] @ x + D[0, 0] * value
        x = A @ x + B[:, 0] * value
    return out


def plant(u: np.ndarray) -> np.ndarray:
    """The position [m] ten times a sample of 0.12 kg on 3.05 N/mm with 2.6 N s/m, pushed by 6.35 N/A."""
    m, k, c, k_f = 0.12, 3050.0, 2.6, 6.35
    return stepped([[0, 1], [-k / m, -c / m]], [[0], [k_f / m]], [[1, 0]], [[0]], u)


def second_order(tau: float, D: float, notch: bool = False) -> Callable[[np.ndarray], np.ndarray]:
    """A filter of two poles, or the notch between them."""
    A, B = [[0, 1 / tau], [-1 / tau, -2 * D / tau]], [[0], [1 / tau]]
    return lambda u: stepped(A, B, [[0, -2 * D]] if notch else [[1, 0]], [[1 if notch else 0]], u)


def averaged(y: np.ndarray) -> np.ndarray:
    """The mean over the last 12 ms: of trapezia of fine steps."""
    area = np.concatenate([[0.0], np.cumsum((y[1:] + y[:-1]) / 2)])
    n = 12 * FINE
    return (area - np.concatenate([np.zeros(n), area[:-n]])) / n


def late(y: np.ndarray) -> np.ndarray:
    return np.concatenate([np.zeros(6 * FINE), y[: -6 * FINE]])


MACHINES: dict[str, tuple[Callable[[np.ndarray], np.ndarray], Callable[[np.ndarray], np.ndarray]]] = {
    "moving_average": (lambda u: u, averaged),
    "low_pass": (lambda u: u, second_order(3e-3, 0.7)),
    "delay": (lambda u: u, late),
    "notch": (second_order(1 / (2 * np.pi * 40), 0.4, notch=True), lambda y: y),
}


def waves(seed: int) -> np.ndarray:
    """A drive [A] of a few broad frequencies up to 60 Hz, held over each sample, from rest."""
    rng, t = np.random.default_rng(seed), H * np.arange(N)
    frequencies = np.array([3.0, 9.0, 17.0, 31.0, 44.0, 58.0]) * rng.uniform(0.95, 1.05, 6)
    phases = rng.uniform(0, 2 * np.pi, 6)
    u = 0.22 * np.sin(2 * np.pi * np.outer(t, frequencies) + phases).sum(axis=1)
    return u * np.clip((t - 0.05) / 0.2, 0.0, 1.0)


def steps(seed: int) -> np.ndarray:
    """Steps, and two sweeps up to 60 Hz."""
    rng, t = np.random.default_rng(seed), H * np.arange(N)
    u = np.repeat(rng.uniform(-0.8, 0.8, N // 50), 50)
    sweep = 0.6 * np.sin(2 * np.pi * (2 * t + 58 / (2 * t[-1] / 2) * t**2 / 2))
    u[N // 2 :] = sweep[: N - N // 2]
    return u * (t > 0.05)


def recording(machine: str, drive: Callable[[int], np.ndarray]) -> Recording:
    before, behind = MACHINES[machine]
    rng, parts = np.random.default_rng(3), []
    for seed, role in ((1, "fit"), (2, "hold_out")):
        u = drive(seed)
        y = behind(plant(before(np.repeat(u, FINE))))[::FINE]
        parts.append(record(u, y + NOISE * rng.standard_normal(N), role))
    return Recording("t", COIL.name, "series", ("reading.axis",), ("um",), (NOISE,), tuple(parts), ())


@pytest.mark.long
@pytest.mark.parametrize("drive", [waves, pytest.param(steps, marks=pytest.mark.exhaustive)])
@pytest.mark.parametrize("machine", MACHINES)
def test_a_mean_is_named_and_a_filter_a_delay_and_a_notch_keep_their_names(machine, drive):
    """A filter of the reading and one of the drive are one: which of them is left open."""
    found = diagnose_recording(COIL, recording(machine, drive), jobs=0)
    (finding,) = found.findings
    assert finding.effect == machine and {c.effect for c in finding.alternatives} <= {"amplifier_lag"}
    assert found.verdict == (Verdict.AMBIGUOUS if finding.alternatives else Verdict.EXPLAINED)
    if machine != "notch":  # which leaves twice the noise, whether or not the library has a mean
        assert np.sqrt(found.search.chosen.held_out.plain_mean[0]) < 1.05
    if machine == "moving_average":
        low, high = finding.parameters["window"].ci95
        assert low < 12 < high and high - low < 0.1  # ms


HIGHEST = CANDIDATE_TERMS.highest_frequency / H
MEAN, DELAY, LOW_PASS, OFFSET = (
    Hypothesis(kind, "sensor:axis", "axis", highest=HIGHEST)
    for kind in ("moving_average", "delay", "low_pass", "home_offset")
)
NOTCH, LAG = (Hypothesis(kind, "actuator:axis", "axis", highest=HIGHEST) for kind in ("notch", "amplifier_lag"))
FILTER = {"share": 1.0, "tau": 2e-3, "damping": 0.7}
ELSEWHERE = replace(NOTCH, location="actuator:other", at="other")


@pytest.mark.parametrize(
    ("causes", "places"),
    [
        ((LOW_PASS,), []),
        ((LOW_PASS, NOTCH), [{0, 1}, {1}]),
        ((NOTCH, LOW_PASS), [{0, 1}, {0}]),
        ((LOW_PASS, DELAY), [{0, 1}]),
        ((NOTCH,), [{0}]),
        ((LAG, NOTCH), [{0, 1}, {0}, {1}]),
        ((LAG, OFFSET, DELAY, NOTCH), [{0, 2, 3}, {0}, {3}]),
        ((LOW_PASS, ELSEWHERE, OFFSET), []),
    ],
)
def test_a_mean_is_tried_in_the_place_of_all_that_may_be_its_parts(causes, places):
    numbers = {c: {p.name: FILTER.get(p.name, 0.0) for p in c.law.params} for c in causes}
    structure = SimpleNamespace(device=COIL)
    fit = SimpleNamespace(restarted=structure, values=lambda k: numbers[causes[k]])
    forms: list[tuple[tuple[int, ...], Hypothesis]] = []
    as_one_law(
        SimpleNamespace(
            each=lambda one, found, told: forms.extend(found) or [],
            fitter=SimpleNamespace(recording=SimpleNamespace(channels=("reading.axis",))),
            selection=SimpleNamespace(ranked=list),
        ),
        SimpleNamespace(causes=causes, fit=fit),
    )
    assert [set(there) for there, _ in forms] == places and {law for _, law in forms} <= {MEAN}


@pytest.mark.parametrize("machine", ["moving_average", "two laws"])
def test_two_laws_that_leave_noise_are_one_where_that_explains_alike(machine):
    """A delay and a filter, each with numbers of its own, are a mean of slow signals."""
    rng, parts, t = np.random.default_rng(4), [], H * np.arange(800)
    for role, f in (("fit", (5.0, 13.0)), ("hold_out", (7.0, 11.0))):
        u = np.sin(2 * np.pi * f[0] * t) + 0.3 * np.sin(2 * np.pi * f[1] * t)
        x = plant(np.repeat(u, FINE))
        y = averaged(x) if machine == "moving_average" else second_order(3e-3, 0.7)(late(x))
        parts.append(record(u, y[::FINE] + 3e-6 * rng.standard_normal(len(u)), role))
    fitter = fitter_of(COIL, ("reading.axis",), ("um",), (3e-6,), "series", tuple(parts))
    trials = Trials(fitter, Screen(fitter, [LOW_PASS, DELAY]), lambda _: None)
    begun = Structure(COIL).with_cause(LOW_PASS, FILTER).with_cause(DELAY, {"delay": 4e-3})
    (found,) = trials.tried(begun, DELAY, steps=60)
    assert trials.leaves_noise_alone(found)
    plainest = simplified(trials, found)
    assert set(plainest.causes) == ({MEAN} if machine == "moving_average" else {LOW_PASS, DELAY})
    if machine == "moving_average":
        assert plainest.fit.values(0)["window"] == pytest.approx(12e-3, rel=0.02)
