"""Lines in time whose phase differs from record to record: nothing starts a recorder on the phase of the mains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import AXIS, NOISE, SETTLING, H, drive, move, record

from ctrlgen.diagnosis.diagnose import diagnose_recording
from ctrlgen.diagnosis.evidence.independent_stretches import Memory
from ctrlgen.diagnosis.evidence.matched_parts import matched_parts
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.estimation.structure import Structure
from ctrlgen.numerics.sign_flips import sign_flip_p
from ctrlgen.recordings.recording import Recording

HUM = Hypothesis("vibration_per_record", "disturbance:axis", "axis")
N = 1500


def hummed(phases, lines=((50.0, 20 * NOISE),), own_clock=True, seed=4) -> Recording:
    """A record to fit for each phase [rad] but the last, and one to hold out; each on a clock of its own, or all on one."""
    rng, parts = np.random.default_rng(seed), []
    for k, phase in enumerate(phases):
        role = "fit" if k < len(phases) - 1 else "hold_out"
        first = 0.0 if own_clock else k * N * H
        t = first + np.arange(N) * H
        u = drive(N) if role == "fit" else 1.2 * np.sin(2 * np.pi * 1.7 * np.arange(N) * H)
        hum = sum(a * np.sin(2 * np.pi * f * t + phase * (1 + j)) for j, (f, a) in enumerate(lines))
        part = record(u, move(u) + hum + NOISE * rng.standard_normal(N), role, first=first)
        parts.append(replace(part, name=f"{role} {k}"))
    return Recording("t", AXIS.name, "series", ("reading.axis",), ("um",), (NOISE,), tuple(parts), ())


def fitted(recording: Recording, phase: float):
    fitter = Fitter(recording, estimate_noise(recording, SETTLING))
    start = {"amplitude": 20 * NOISE, "frequency": 50.0, "phase": phase}
    return fitter, fitter.fit(Structure(AXIS).with_cause(HUM, start), steps=10)


@pytest.mark.parametrize("later", np.linspace(-np.pi, np.pi, 9))
def test_a_held_out_record_tells_its_own_phase_wherever_that_is(later):
    """Half a turn off too, where no small change of the phase makes anything better."""
    fitter, fit = fitted(hummed((0.3, 0.3 + later)), 0.3)
    (held,) = fitter.held_out_records
    left = held.observed - fitter.predict(fit, held)
    assert np.std(left) == pytest.approx(NOISE, rel=0.08)  # four standard deviations of 1,500 samples


@pytest.mark.parametrize("later", [0.0, 1.5, 3.1])
def test_what_tells_the_phase_of_a_held_out_record_is_no_evidence_for_the_line(later):
    fitter, fit = fitted(hummed((0.3, 0.3 + later)), 0.3)
    parts = matched_parts(fitter, fit, [HUM], Memory(0.0, False))
    assert sign_flip_p(parts) < 1e-12
    assert 50 < np.count_nonzero(parts) < 80  # of a hundred stretches, without the first quarter of the record


def test_a_line_that_is_not_there_is_found_by_luck_as_often_as_is_said():
    """A fit to the noise of one record tells nothing of another, whatever phase it takes there. Were the phase told by the whole of the
    other, the line would fit there always: chances are then below 0.3. Of 40 even ones the median is below that once in 200 times."""
    found = []
    for seed in range(40):
        fitter, fit = fitted(hummed((0.0, 0.0), lines=(), seed=seed), 0.3)
        found.append(sign_flip_p(matched_parts(fitter, fit, [HUM], Memory(0.0, False))))
    assert np.median(found) > 0.3


@pytest.mark.long
@pytest.mark.parametrize(
    "recording, lines",
    [
        (hummed((0.4, 2.9)), {50.0: 0.1}),
        (hummed((0.4, 2.9, -1.7, 0.9), ((50.0, 20 * NOISE), (150.0, 7 * NOISE))), {50.0: 0.1, 150.0: 0.035}),
    ],
)
def test_the_mains_are_named_though_each_record_meets_them_elsewhere(recording, lines):
    found = diagnose_recording(AXIS, recording, jobs=0)
    (hum,) = found.findings
    assert found.verdict is Verdict.EXPLAINED and hum.effect == "vibration_per_record" and not hum.chance.weak
    told = {t["frequency"].value: abs(t["amplitude"].value) for t in (hum.parameters, *hum.terms)}
    assert sorted(told) == pytest.approx(sorted(lines), rel=1e-3)
    assert sorted(told.values()) == pytest.approx(sorted(lines.values()), rel=0.02)


@pytest.mark.long
def test_one_phase_for_all_records_is_the_plain_law():
    lines = ((50.0, 20 * NOISE), (150.0, 5 * NOISE))
    found = diagnose_recording(AXIS, hummed((1.1, 1.1), lines, own_clock=False), jobs=0)
    (hum,) = found.findings
    assert found.verdict is Verdict.EXPLAINED and hum.effect == "vibration" and len(hum.terms) == 1
