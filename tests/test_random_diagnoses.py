"""Random cheap diagnoses of any kind say nothing that contradicts their own numbers (tests/random_diagnoses.py)."""

from __future__ import annotations

import pytest
from random_diagnoses import case


@pytest.mark.parametrize(
    "seed",
    [
        pytest.param(k, marks=pytest.mark.long if k in (8, 12, 42, 45) else pytest.mark.exhaustive)
        for k in range(1, 101)
    ],
)
def test_an_answer_does_not_contradict_itself(seed, tmp_path):
    """8 has spikes, 12 and 42 what no law describes (a pose set; a series with gaps), 45 gaps and nothing to find."""
    assert case(seed, tmp_path).wrong == ()
