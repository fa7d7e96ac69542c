from __future__ import annotations

import re
from collections import Counter

import pytest

from ctrlgen.physics import circular_hinge_table as table
from ctrlgen.physics.sensor_models import SENSORS
from papers import all as everything
from papers import s2, s3_hinges
from papers.row import PrintedNumber, ReproductionStatus
from papers.s3_hinges import PRINTED_ERRORS


@pytest.mark.long
def test_the_page_of_s2_shows_its_measuring_chain_and_the_hinge_errors(tmp_path, found):
    """The hinge errors are S3's figures; its Table 3 is among the rows of S2."""
    page = tmp_path / "page.html"
    everything.write_page(list(found.values()), page)
    text = page.read_text()
    for figure in (
        "Figs. A.8 and A.9",
        "Figs. A.3 and A.10",
        "Fig. 3, alpha_z/M_z",
        "Fig. 4, delta_y/F_y",
        "Fig. 5, delta_x/F_x",
    ):
        assert text.count(f"<figcaption><b>{figure}") == 1
    for name, sensor in SENSORS.items():
        drawn = float(re.search(rf"{name}: ([\d.]+) um/V", text)[1])
        assert drawn == pytest.approx(sensor.sensitivity * 1e6, rel=5e-4)  # of one recording of 12 s


@pytest.fixture(scope="module")
def found() -> dict[str, PrintedNumber]:
    pytest.importorskip("skfem")
    listed = [*s2.rows(), *s3_hinges.rows()]
    by_place = {f"{row.source} {row.where}": row for row in listed}
    assert len(by_place) == len(listed)  # each number once
    return by_place


@pytest.mark.long
def test_what_is_not_reproduced_has_a_reason(found):
    silent = [
        place for place, row in found.items() if row.status is not ReproductionStatus.REPRODUCED and not row.reason
    ]
    assert not silent


@pytest.mark.long
def test_every_computable_number_of_s2_is_reproduced_but_three(found):
    listed = [row for row in found.values() if row.source == "S2" and row.ours is not None]
    differing = {row.where for row in listed if row.status is ReproductionStatus.DIFFERS}
    assert differing == {"A.5.1.1, eq. (A.2), 3338", "below C.15, coefficient, Tseytlin", "C.24"}
    assert len(listed) >= 55


@pytest.mark.long
def test_the_hinge_errors_of_s3_table_3_agree_where_the_reading_does_not_matter(found):
    bending = [row for place, row in found.items() if "delta_y_per_F_y" in place and row.ours is not None]
    assert len(bending) == 12 and Counter(row.status for row in bending)[ReproductionStatus.REPRODUCED] >= 8
    assert max(abs(row.difference) for row in bending) < 0.15


def test_the_printed_texts_are_the_numbers_the_selection_uses():
    listed = {(e.compliance, e.group): e.errors for e in table.EQUATIONS if e.errors}
    assert {key: tuple(map(float, text.split())) for key, text in PRINTED_ERRORS.items()} == listed
