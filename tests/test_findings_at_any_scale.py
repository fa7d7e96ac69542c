"""What is found in a machine does not depend on its size: numbers go with the scale of length, force and drive, and nothing else does."""

from __future__ import annotations

import numpy as np
import pytest
from axis_records import AXIS, NOISE, SETTLING, H, drive, fitter_of, move, record
from conftest import AXIS_FILE
from scaled_machines import USUAL, device_of, factor

from ctrlgen.core.units import to_si
from ctrlgen.devices.changed_numbers import with_numbers
from ctrlgen.diagnosis.diagnose import diagnose_recording
from ctrlgen.diagnosis.selection.score_gradient import ScoreGradient, law_terms
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import PARAMETER, DataHints, Hypothesis, hypotheses, nominal_physics
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Recording

LAWS = [
    "coulomb",
    "backlash",
    "saturation",
    "dead_zone",
    "drive_gain",
    "cyclic",
    "cubic_sensor",
    "quantisation",
    "creep",
]
SCALES = [USUAL, (1e3, 1e-3, 1e2), (1e-3, 1e3, 1e-2)]
CAUSES = {
    "saturation": lambda u: move(np.clip(u, -1.1, 1.1)),
    "dead_zone": lambda u: move(np.sign(u) * np.maximum(np.abs(u) - 0.05, 0)),
    "cubic_sensor": lambda u: move(u) + 2e6 * move(u) ** 3,
    "cyclic": lambda u: move(u) + 5e-8 * np.sin(2 * np.pi * move(u) / 8e-6 + 0.5),
}


def machine(cause, scale):
    """The axis and its recording, of another size; a sample a millisecond."""
    n, rng, parts = 1600, np.random.default_rng(5), []
    length, _, drives = scale
    held = 1.2 * np.sin(2 * np.pi * 1.7 * np.arange(n) * H)
    for role, u in (("fit", drive(n)), ("hold_out", held)):
        u = u + sum(0.2 * np.sin(2 * np.pi * f * np.arange(n) * H) for f in (97, 151, 173))
        y = CAUSES[cause](u) + NOISE * rng.standard_normal(n)
        parts.append(record(drives * u, length * y, role, first=len(parts) * n * H))
    noise = (length * NOISE,)
    return device_of(AXIS_FILE, scale), Recording(
        "t", AXIS.name, "series", ("reading.axis",), ("um",), noise, tuple(parts), ()
    )


@pytest.mark.long
@pytest.mark.parametrize("cause", CAUSES)
def test_a_finding_is_the_same_at_any_scale(cause):
    """The law, its numbers to a tenth of their intervals, the verdict and the noise."""
    told = {}
    for scale in SCALES:
        device, recording = machine(cause, scale)
        found = diagnose_recording(device, recording, jobs=0, laws=LAWS)
        first = found.findings[0]
        si = {
            name: [to_si(x, number.unit) / factor(number.unit, scale) for x in (number.value, *number.ci95)]
            for name, number in first.parameters.items()
        }
        told[scale] = first.effect, found.verdict, si, float(found.fitter.noise.sd[0]) / scale[0]
    effect, verdict, usual, noise = told[USUAL]
    assert effect == cause
    for scale in SCALES[1:]:
        assert told[scale][:2] == (effect, verdict), scale
        assert told[scale][3] == pytest.approx(noise, rel=1e-6)
        for name, (value, low, high) in usual.items():
            assert abs(told[scale][2][name][0] - value) <= 0.1 * (high - low) + 1e-6 * abs(value), (scale, name)


def test_a_damping_that_is_stated_as_zero_is_found():
    """A fit that suspects it, from where the file says that it is: 30 N s/m were beyond ten times a thousandth."""
    undamped = with_numbers(AXIS, {"mechanics.damping": 0.0})
    fitter = fitter_of()
    cause = Hypothesis(PARAMETER, "stage:damping", path="mechanics.damping")
    fit = fitter.fit(Structure(undamped).with_cause(cause, {"value": 0.0}))
    (number,) = [x for x, p in zip(fit.theta, fit.structure.free_parameters, strict=True) if p.path == cause.path]
    assert number == pytest.approx(30.0, rel=0.02)  # beside a mass and a stiffness that are free by their deviations
    assert fit.chi2 < 1.2 * fit.n


@pytest.mark.parametrize("scale", SCALES)
def test_a_number_is_screened_in_its_own_size(scale):
    """By up to half of itself, however small it is in SI: a force constant of 0.1 mN/V and a mass of 0.5 mg."""
    device, recording = machine("saturation", scale)
    fitter = Fitter(recording, estimate_noise(recording, SETTLING))
    offered = hypotheses(device, nominal_physics(device), recording.channels, H, False)
    limits = ("mechanics.stroke", "actuator.drive_limit")
    numbers = [h for h in offered if h.effect == PARAMETER and h.path not in limits]
    fit, part = fitter.fit(Structure(device), steps=0), fitter.fit_records[0]
    terms = law_terms(device, numbers, recording.channels, part.timing, len(part.time))
    slopes = ScoreGradient(fitter, fit, part, numbers, lambda *_: DataHints(), terms)
    assert len(slopes.columns) == len(numbers) > 3
    for column in slopes.columns:
        most = column.range[1] * column.size
        assert most == pytest.approx(0.5 * abs(column.shape["value"]), rel=1e-6), column.hypothesis.path
