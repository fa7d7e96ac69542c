"""Drawings that no mechanism can have are refused by name, in any place of the file."""

from __future__ import annotations

import re

import numpy as np
import pytest
from mechanism_files import PARALLELOGRAM, blade, dm, loaded

from ctrlgen.core.errors import InputError

RIGHT = blade("right", 10)
BODY = 'name = "stage"\nmass = "35 g"\ninertia = ["6 kg*mm^2", "12 kg*mm^2", "9 kg*mm^2"]\n'


@pytest.mark.parametrize(
    "old, new, says",
    [
        ('to = "stage"', 'to = "ground"', r"element\[0\].*from and to are both 'ground'"),
        ("along = [0, 1, 0]", "along = [0, 0, 0]", r"element\[0\].*along: \[0.0, 0.0, 0.0\] is no direction"),
        (RIGHT, blade("right", -10), "right lies where left lies"),
        (RIGHT, blade("right", -10).replace("[0, 1, 0]", "[0, 3, 0]"), "right lies where left lies"),
        ('name = "stage"\n', BODY.replace('"9 kg', '"19 kg'), r"body\[0\].*inertia: that about z"),
        ('name = "stage"\n', BODY.replace('"6 kg', '"60 kg'), r"body\[0\].*inertia: that about x"),
    ],
)
def test_what_cannot_be_is_refused_by_name(tmp_path, old, new, says):
    assert old in PARALLELOGRAM
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, PARALLELOGRAM.replace(old, new, 1))
    assert re.search(says, str(caught.value), re.S)


def test_every_fault_of_a_drawing_is_told_by_its_own_key(tmp_path):
    text = PARALLELOGRAM.replace('to = "stage"', 'to = "table"', 1).replace(
        'material = "silicon"', 'material = "steel"'
    )
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, text)
    assert [f.where for f in caught.value.faults] == ["element[0].to", "element[0].material", "element[1].material"]


def test_a_flat_plate_and_blades_that_cross_are_no_faults(tmp_path):
    flat = BODY.replace('"9 kg', '"18 kg')
    crossed = blade("right", -10).replace("along = [0, 1, 0]", "along = [0, 0.8, 0.6]")
    assert loaded(tmp_path, PARALLELOGRAM.replace('name = "stage"\n', flat, 1).replace(RIGHT, crossed))


def matrix(off: float) -> str:
    C = np.zeros((6, 6))
    C[[0, 1, 2, 3, 4, 5], [3, 4, 5, 0, 1, 2]] = [9e4, 2e4, 1.8e5, 1.5e-6, 3e-4, 4e-5]
    C[2, 1], C[4, 5] = 7.1, 7.1 + off * np.sqrt(3e-4 * 1.8e5)
    rows = ", ".join(f"[{', '.join(repr(float(v)) for v in row)}]" for row in C)
    text = re.sub(r'kind = "blade"\nslender = true', f'kind = "matrix"\ncompliance_si = [{rows}]', RIGHT)
    return re.sub(r"(?m)^(length|thickness|width|material) = .*\n", "", text)


def test_a_matrix_of_printed_digits_is_made_symmetric_and_says_so(tmp_path):
    device = loaded(tmp_path, PARALLELOGRAM.replace(RIGHT, matrix(0.002)))
    assert any(re.search(r"right: compliance_si is not symmetric by 0.2 %", r) for r in device.remarks())
    C = dm(device.element[1].compliance(None, None))[[3, 4, 5, 0, 1, 2]]
    assert np.array_equal(C, C.T) and C[1, 5] == pytest.approx(7.1 + 0.001 * np.sqrt(3e-4 * 1.8e5), rel=1e-9)
    even = loaded(tmp_path, PARALLELOGRAM.replace(RIGHT, matrix(0.0)))
    assert not [r for r in even.remarks() if r.startswith("right")]
    with pytest.raises(InputError, match="differs by 2 %, and by reciprocity is equal"):
        loaded(tmp_path, PARALLELOGRAM.replace(RIGHT, matrix(0.02)))
