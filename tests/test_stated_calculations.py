"""A column whose name states a calculation is asked for, whichever way it is written and whatever the column is; no other name is."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from conftest import ROOT

from ctrlgen.devices import load_device
from ctrlgen.model.assembly import build_model
from ctrlgen.recordings.formats import read_table
from ctrlgen.recordings.formats.formula_names import formula_of
from ctrlgen.recordings.look.answers import NOTHING, read_answers
from ctrlgen.recordings.look.column_facts import table_facts
from ctrlgen.recordings.look.proposal import propose

N = np.arange(60)
WAYS = (
    "{}*1e3", "{} * 0.001", "{} \u00d7 1000", "{} \u00b710^-3", "{} x20", "{} x 1e-6", "1000*{}", "0.1 \u00d7 {}", "{}/10", "{} / 1000",
    "-{}", "1/{}", "{}+100", "{}^2", "{}\u00b2", "log10({})", "sqrt({})", "abs({})",
)  # fmt: skip
PLAIN = (
    "{}", "{}1", "{} 1", "{} x1", "{}-{}0", "{}*", "{} (axis 1)", "pos {} rel", "Dev1/{}", "{}/1", "log.{}", "{} abs.", "3x3 {}", "{}_2",
    "d{}/dt", "cos_{}", "V({})", "{} 10",
)  # fmt: skip


@pytest.fixture(scope="module")
def axis():
    return build_model(load_device(ROOT / "tests" / "logs" / "stage.toml"))


@pytest.mark.parametrize("way", WAYS)
def test_a_name_with_a_calculation_states_one_and_plain_names_none(way):
    for name, unit in itertools.product(("x", "weg", "out_V"), ("[um]", "(mm)", "[V]")):
        assert formula_of(f"{way.format(name)} {unit}"), (way, name, unit)


@pytest.mark.parametrize("way", PLAIN)
def test_a_plain_name_states_no_calculation(way):
    for name, unit in itertools.product(("x", "weg"), (" [um]", " (mm)", "")):
        shown = way.replace("{}", name) + unit
        assert not formula_of(shown), shown


@pytest.mark.parametrize("behind", ["", "_mm", "_m", " / mm", " [mm]"])
def test_a_stroke_parts_a_number_of_a_group_where_names_have_groups(behind):
    assert formula_of(f"pos/10{behind}") and bool(formula_of(f"pos/10{behind}", grouped=True)) == (behind == " [mm]")


def test_units_of_one_dimension_behind_one_name_are_told_apart():
    assert formula_of("x [um] [mm]") and formula_of("z (V) [mV]")
    assert not formula_of("Channel (A) (mV)") and not formula_of("m/s^2") and not formula_of("gauge (axis 1) (um)")


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("role", ["t [s]", "u [V]", "x [um]"])
def test_it_is_asked_in_every_role_until_its_unit_is_stated(tmp_path, axis, role, way):
    heads = {"t [s]": N * 0.01, "u [V]": 5 + np.sin(N), "x [um]": np.cos(N)}
    name = way.format(role[0]) + role[1:]
    named = {name if head == role else head: column for head, column in heads.items()}
    lines = ["\t".join(named), *("\t".join(f"{v:.6f}" for v in row) for row in zip(*named.values(), strict=True))]
    (tmp_path / "log.txt").write_text("\n".join(lines) + "\n")
    unit = role.strip("]").partition("[")[2]

    def asked(answers) -> str:
        facts = table_facts(read_table(tmp_path / "log.txt", None, answers.layout), answers)
        return "; ".join(q for q in propose([facts], axis, answers).asked if name in q)

    assert "calculation" in asked(NOTHING)
    assert not asked(read_answers(None, None, [], [f"{name}={unit}"], None, None, False)), name
