"""Random valid mechanisms: what is drawn is read, described, solved, and its C is what the model says, whatever it is."""

from __future__ import annotations

import warnings

import pytest
from random_mechanisms import RandomMechanism

from ctrlgen.app.check_files import check
from ctrlgen.app.scenario_pipeline import compare_only

QUICK = (17,)
LONG = (3, 23, 25, 26, 53, 102, 127)  # the last three: Newton lost out of reach, cubic springs, ill-conditioned
MORE = (24, *range(27, 48))


@pytest.mark.long
@pytest.mark.parametrize(
    "seeds", [QUICK, pytest.param(LONG, marks=pytest.mark.long), pytest.param(MORE, marks=pytest.mark.exhaustive)]
)
def test_random_mechanisms_are_described_and_solved_and_their_c_is_the_model(tmp_path, seeds, capsys):
    for seed in seeds:
        folder = tmp_path / str(seed)
        folder.mkdir()
        with (
            warnings.catch_warnings()
        ):  # of masses that a drawing without [dynamics] leaves out, of notches between two equations
            warnings.simplefilter("ignore")
            drawn = RandomMechanism(folder, seed)
            check(folder / "device.toml")
            check(folder)
            compared = compare_only(drawn.scenario).comparison
        assert compared is not None
        assert compared.passed, (drawn.what, [row for row in compared.rows if not row.passed])
