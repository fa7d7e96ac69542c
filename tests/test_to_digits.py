"""What is printed for a reader has no power of ten where a plain number is read better, on pages and in a terminal."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from ctrlgen.core.to_digits import to_digits
from ctrlgen.reporting.numbers import number

PRINTING = [
    *Path("ctrlgen").rglob("*.html.j2"),
    *Path("ctrlgen/app").glob("*.py"),
    *Path("ctrlgen").glob("*/*_page.py"),
    *Path("ctrlgen").glob("*/*_first_screen.py"),
]


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("digits", [2, 3, 4])
@pytest.mark.parametrize("power", range(-8, 9))
def test_a_number_is_rounded_and_plain_from_a_ten_thousandth_to_a_million(power, digits, sign):
    value = sign * 2.73961 * 10.0**power
    text = to_digits(value, digits)
    assert float(text) == float(f"{value:.{digits}g}")
    assert ("e" not in text) == (-4 <= power < 6)


def test_what_is_no_number_of_a_size_stays_as_it_is():
    assert [to_digits(v, 3) for v in (0.0, -0.0, float("inf"), 999_999.0, 999.9)] == ["0", "0", "inf", "1e+06", "1000"]
    assert number(-0.0) == "0"


@pytest.mark.parametrize("path", PRINTING, ids=lambda path: path.name)
def test_pages_and_consoles_round_by_this_rule(path):
    assert not re.findall(r"%\.[2-6]g'|:\.[2-4]g\}", path.read_text(encoding="utf-8"))
