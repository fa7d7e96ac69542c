"""A reading that the findings predict worse is told, beside others that they predict better."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from axis_records import AXIS, NOISE, axis_fitter

from ctrlgen.diagnosis.report.told_beside import told_beside
from ctrlgen.diagnosis.report.worse_channels import worse_channels
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.structure import Structure

OFFSET = Hypothesis("home_offset", "sensor:axis", "axis")


@pytest.fixture(scope="module")
def fitter() -> Fitter:
    return axis_fitter(n=1000)


def searched(fitter: Fitter, *offsets: float | None) -> SimpleNamespace:
    """A search that went from the first device to the second: readings that are off by so much [m], None without the law."""
    fits = [
        SimpleNamespace(
            fit=fitter.fit(
                Structure(AXIS) if by is None else Structure(AXIS).with_cause(OFFSET, {"offset": by}), steps=0
            )
        )
        for by in offsets
    ]
    return SimpleNamespace(fitter=fitter, nominal=fits[0], chosen=fits[1])


def test_an_error_that_grew_by_more_than_noise_is_told_with_both_figures(fitter):
    (said,) = worse_channels(searched(fitter, None, 20 * NOISE))
    told = "with the findings the held-out error is larger than as described, by more than noise would do: "
    assert said == f"{told}axis 0.00489 um -> 0.1 um"


@pytest.mark.parametrize("offsets", [(20 * NOISE, None), (None, 0.05 * NOISE), (None, None)])
def test_one_that_shrank_or_grew_as_noise_lets_it_is_not(fitter, offsets):
    assert worse_channels(searched(fitter, *offsets)) == []


@pytest.mark.parametrize(
    ("length", "numbers", "told"), [(5.9, 0, False), (6.1, 0, True), (6.2, 1, False), (6.4, 1, True)]
)
def test_noise_explains_three_deviations_and_what_fitted_numbers_add(length, numbers, told):
    """A device that leaves nothing, and an answer that is off by a vector of this length, in noise: x^2 beside 6 x + 2 k."""
    samples = 100
    record = SimpleNamespace(observed=np.zeros((samples, 1)), valid=np.ones((samples, 1), bool))
    fits = [
        SimpleNamespace(structure=SimpleNamespace(free_parameters=[SimpleNamespace(cause=0)] * numbers), off=off)
        for off in (0.0, length / np.sqrt(samples))
    ]
    fitter = SimpleNamespace(
        recording=SimpleNamespace(channels=("reading.axis",), units=("m",)),
        noise=SimpleNamespace(whiten=lambda e, valid: e),
        held_out_records=[record],
        predict=lambda fit, r: np.full((samples, 1), fit.off),
    )
    nominal, chosen = (SimpleNamespace(fit=fit) for fit in fits)
    assert bool(worse_channels(SimpleNamespace(fitter=fitter, nominal=nominal, chosen=chosen))) is told


def test_of_several_readings_the_worst_is_first(fitter):
    """Of two readings of the axis, the second with half of the noise."""
    recording = fitter.recording
    two = tuple(
        replace(r, observed=np.column_stack([r.observed, r.observed / 2]), valid=np.tile(r.valid, 2))
        for r in recording.records
    )
    noise = SimpleNamespace(sd=np.full(2, NOISE), whiten=lambda e, valid: e / NOISE)
    of_both = SimpleNamespace(
        recording=replace(recording, channels=("reading.axis", "reading.other"), units=("um", "um"), records=two),
        noise=noise,
        held_out_records=two[1:],
        predict=lambda fit, r: (
            np.column_stack([fitter.predict(fit, recording.records[1]) / k for k in (1, 2)]) * fit.off
        ),
    )
    nominal, chosen = searched(fitter, None, None).nominal.fit, searched(fitter, None, None).chosen.fit
    fits = [
        SimpleNamespace(**{**vars(fit), "off": np.array(off)})
        for fit, off in ((nominal, (1.0, 1.0)), (chosen, (1.01, 1.2)))
    ]
    search = SimpleNamespace(fitter=of_both, nominal=SimpleNamespace(fit=fits[0]), chosen=SimpleNamespace(fit=fits[1]))
    (said,) = worse_channels(search)
    assert said.index("other ") < said.index("axis ")


def test_it_stands_in_the_notes(fitter):
    search = searched(fitter, None, 20 * NOISE)
    search.rounds, search.withdrawn = (), ()
    live = SimpleNamespace(notes=(), recording=fitter.recording)
    assert worse_channels(search)[0] in told_beside(search, live, (), (), (), ())
