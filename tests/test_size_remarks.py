"""Numbers of a drawing that no mechanism has, or that it does not use, are told, beside the same drawing without them."""

from __future__ import annotations

import re

import pytest
from mechanism_files import PARALLELOGRAM, hinged, loaded, place

T, W = 0.2e-3, 8e-3  # of the blades of PARALLELOGRAM


def gravity(z: str) -> str:
    body = 'name = "stage"\nmass = "50 g"\ninertia = ["1 kg*mm^2", "1 kg*mm^2", "1 kg*mm^2"]\n'
    return PARALLELOGRAM.replace('name = "stage"\n', body, 1).replace(
        "[[material]]", f'gravity = ["0 m/s^2", "0 m/s^2", "{z}"]\n[[material]]', 1
    )


@pytest.mark.parametrize(
    "text, says",
    [
        (PARALLELOGRAM.replace('"300 MPa"', '"300 GPa"'), "silicon: stress_limit"),
        (
            PARALLELOGRAM.replace("stress_limit", 'expansion = "3e-6 1/K"\nexpansion_slope = "0 1/K^2"\nstress_limit'),
            "silicon: expansion",
        ),
        (gravity("-9810 m/s^2"), "gravity of 9810 m/s^2"),
        (gravity("-9.81 mm/s^2"), "gravity of 0.00981 m/s^2"),
        (gravity("-9.81 m/s^2"), None),
        (gravity("0 m/s^2"), None),
        (PARALLELOGRAM, None),
    ],
)
def test_a_number_that_is_a_thousand_off_or_does_nothing_is_told(tmp_path, text, says):
    told = [x for x in loaded(tmp_path, text).remarks() if x.startswith(("silicon:", "gravity"))]
    assert (not told) if says is None else told[0].startswith(says)


@pytest.mark.parametrize("share", [0.5, 0.9, 1.1, 3.0, 100.0])
def test_loads_that_break_the_flexures_before_any_drive_are_told(tmp_path, share):
    """A pull along both blades by a share of what they bear, N/A; below it nothing is told."""
    force = share * 2 * 300e6 * T * W
    load = f'[[load]]\nname = "pull"\non = "stage"\nat = {place((0, 0, 0))}\nforce = ["0 N", "{force!r} N", "0 N"]\n'
    remarks = loaded(tmp_path, PARALLELOGRAM.replace("[[actuator]]", f"{load}[[actuator]]", 1)).remarks()
    told = [re.search(r"loads alone stress silicon to (\d[\d.]*) MPa", x) for x in remarks]
    told = [x for x in told if x]
    assert (float(told[0][1]) == pytest.approx(300 * share, rel=0.01)) if share > 1 else not told


@pytest.mark.parametrize("poisson", [0.2, 0.28, 0.4])
def test_a_deep_notch_is_judged_by_the_ratio_of_its_material(tmp_path, poisson):
    """At most 1/(1 - nu^2) - 1 stiffer, and nearly that where it is two hundred times as deep as its neck."""
    text = hinged(5.0).replace('b = "8 mm"', 'b = "60 mm"').replace('poisson = "0.28"', f'poisson = "{poisson}"')
    (told,) = (x for x in loaded(tmp_path, text).remarks() if "times as deep" in x)
    share = float(re.search(r"is ([\d.]+) % stiffer", told)[1]) / 100
    assert 0.9 < share / (1 / (1 - poisson**2) - 1) <= 1.01
