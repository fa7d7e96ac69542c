"""The region that a finding states: which end is open, with which interval, in which words."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from ctrlgen.diagnosis.report.answer import where
from ctrlgen.diagnosis.selection.finding_region import region_of
from ctrlgen.diagnosis.selection.findings import Estimate
from ctrlgen.effects import Effect

UM = {"edge": Estimate(-11.5, (-11.51, -11.49), "um"), "gap": Estimate(-3.0, (-3.1, -2.9), "um")}
SCRATCH = {"position": Estimate(4.0, (3.9, 4.1), "um"), "length": Estimate(2.0, (1.8, 2.2), "um")}
NUMBERS = (
    UM
    | SCRATCH
    | {
        "moment": Estimate(1.2, (1.1, 1.3), "s"),
        "speed": Estimate(2.0, (1.9, 2.1), "mm/s"),
        "level": Estimate(0.5, (0.4, 0.6), "V"),
        "reference": Estimate(1.0, (0.9, 1.1), "K"),
    }
)
WORDS = {
    "coulomb_above": "above a position of -11.5 um (-11.51 ... -11.49 um)",
    "viscous_below": "below a position of -11.5 um (-11.51 ... -11.49 um)",
    "end_stop": "below a position of -3 um (-3.1 ... -2.9 um)",
    "coulomb_after": "from 1.2 s (1.1 ... 1.3 s) on",
    "viscous_at_speed": "above a speed of 2 mm/s (1.9 ... 2.1 mm/s)",
    "drive_gain_beyond": "beyond drives of +-0.5 V (0.4 ... 0.6 V)",
    "local_error": "between positions of 3 um (2.9 ... 3.1 um) and 5 um (4.9 ... 5.1 um)",
    "temperature_sensitivity_above": "above a rise of the temperature of 1 K (0.9 ... 1.1 K)",
}


@pytest.mark.parametrize("kind", WORDS)
def test_a_sentence_says_where_a_law_acts(kind):
    (said,) = where(SimpleNamespace(region=region_of(Effect.library[kind], NUMBERS)))
    assert said == WORDS[kind]


def test_a_law_that_acts_everywhere_has_no_region():
    assert region_of(Effect.library["coulomb"], NUMBERS) is None
    assert where(SimpleNamespace(region=None)) == []


def test_the_open_end_of_a_region_is_null():
    below = region_of(Effect.library["coulomb_below"], NUMBERS)
    assert below.lower is None and below.upper.value == -11.5 and below.unit == "um"
    farther = region_of(Effect.library["stiffness_beyond"], NUMBERS)
    assert farther.size and farther.upper is None and farther.lower.ci95 == (-11.51, -11.49)
