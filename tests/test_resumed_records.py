"""A record that goes on after a gap: what the device remembers of it is not known, and is fitted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import AXIS, NOISE, H, move, record

from ctrlgen import build_model
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings import gaps
from ctrlgen.recordings.reader import load_recordings
from ctrlgen.recordings.recording import Recording

N, TAU, GAIN = 3000, 0.4, 0.1
GAP = slice(1300, 1600)
CREEP, LAG = Hypothesis("creep", "stage:axis", "axis"), Hypothesis("thermal_lag", "actuator:axis", "axis")


def lagging(x: np.ndarray, tau: float = TAU) -> np.ndarray:
    """x behind one time constant, which follows the middle between two samples."""
    kept, out = 0.0, np.empty(len(x))
    for k, middle in enumerate((x + np.append(x[1:], x[-1])) / 2):
        out[k] = kept
        kept += (1 - np.exp(-H / tau)) * (middle - kept)
    return out


def cut(read: np.ndarray, u: np.ndarray) -> list:
    """The two records beside the gap, of a drive that nobody can bridge."""
    rng = np.random.default_rng(2)
    whole = record(u, read + NOISE * rng.standard_normal(N), "fit")
    there = np.ones(N, bool)
    there[GAP] = False
    parts, notes = gaps.stretches(gaps.rows_of(whole, there), "split")
    assert [len(p.time) for p in parts] == [1300, 1400] and "cut before" in notes[-1]
    return parts


@pytest.fixture(scope="module")
def moved():
    steps = np.random.default_rng(1).uniform(-1, 1, N // 20)
    u = np.repeat(steps + 0.8 * np.sign(np.sin(np.arange(N // 20) / 12)), 20)
    return u, move(u)


def test_only_what_follows_a_gap_goes_on(moved):
    u, q = moved
    before, after = cut(q, u)
    assert (before.resumed, after.resumed) == (False, True)
    assert before.timing != after.timing


# the gap is of 0.3 s: a device that has forgotten what was before it stands where the drive has moved it within it
@pytest.mark.parametrize("tau", [TAU, 0.03], ids=["longer than the gap", "a tenth of the gap"])
def test_a_creep_that_goes_on_is_foretold_after_the_gap(moved, tau):
    u, q = moved
    after = cut(q + GAIN * lagging(q, tau), u)[1]
    structure = Structure(AXIS).with_cause(CREEP, {"gain": GAIN, "tau": tau, "slow": 0.0})
    left = {}
    for name, part in (("unknown", after), ("at rest", replace(after, resumed=False))):
        recording = Recording("t", AXIS.name, "series", ("reading.axis",), ("um",), (NOISE,), (part,), ())
        fitter = Fitter(recording, estimate_noise(recording, 0.5))
        fit = fitter.fit(structure, steps=0)
        left[name] = float(np.sqrt(np.nanmean((part.observed[:, 0] - fitter.predict(fit, part)[:, 0]) ** 2)))
    assert left["unknown"] < 1.3 * NOISE and left["at rest"] > 5 * NOISE


def test_a_record_from_rest_remembers_nothing_before_it(moved):
    """A lag could feign any slow part of a record that began at rest."""
    u, q = moved
    before, after = cut(q, u)
    structure = Structure(AXIS).with_cause(LAG, {"share": 0.1, "tau": TAU, "second": 0.1})
    at_rest, going_on = (
        len(structure.simulator(("reading.axis",), p.timing).free_initial_states) for p in (before, after)
    )
    assert going_on > at_rest


@pytest.mark.parametrize("lead_in, going_on", [(0, True), (200, False)])
def test_rows_within_a_log_go_on_unless_a_lead_in_tells_what_came_before(moved, tmp_path, lead_in, going_on):
    """Where the drive is off at the cut no reading tells it."""
    u, _ = moved
    u = np.where(np.arange(N) // 20 == 1500 // 20, 0.0, u)
    np.savetxt(tmp_path / "log.csv", np.c_[H * np.arange(N), u, move(u)], delimiter=",", header="t,u,y", comments="")
    rows = {"fit": [0, 1500], "hold_out": [1500, N]}
    (tmp_path / "recording.toml").write_text(
        f'title = "a log"\ndevice = "{AXIS.name}"\nkind = "series"\n[columns]\n"drive.axis" = {{ column = "u", unit = "V" }}\n'
        '"reading.axis" = { column = "y", unit = "m" }\n'
        + "".join(
            f'[[record]]\nfile = "log.csv"\nrole = "{role}"\nrows = {ends}\ntime = {{ column = "t", unit = "s" }}\n'
            for role, ends in rows.items()
        )
        + f"lead_in = {lead_in}\n"
    )
    recording = load_recordings([tmp_path / "recording.toml"], build_model(AXIS))
    assert [r.resumed for r in recording.records] == [False, going_on]
