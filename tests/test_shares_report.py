"""The shares in a diagnosis: the ceiling beside what the laws reach, and sentences that an engineer would write."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from axis_records import AXIS, KF, NOISE, H, move, record
from result_files import faults

import ctrlgen
from ctrlgen.diagnosis.report.diagnosis_record import Provenance, diagnosis_record
from ctrlgen.diagnosis.report.html_report import page
from ctrlgen.diagnosis.report.shares_sentences import (
    ceiling_sentence,
    per_cent,
    rest_sentence,
    shares_sentences,
    with_interval,
)
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.diagnosis.shares.design import Kind
from ctrlgen.diagnosis.shares.gather import residual_shares
from ctrlgen.diagnosis.shares.shares_table import ChannelShares, KindShare, Share
from ctrlgen.effects import Family
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.recordings.recording import Recording

N, FRICTION = 3000, 0.6  # samples a record; dry friction [N]
MADE_FROM = Provenance({"flexure_axis.toml": "0" * 64}, 3)


def friction(t, q, v, memory):
    return -FRICTION * np.tanh(v / 1e-5), memory


@pytest.fixture(scope="module")
def recording() -> Recording:
    rng, t, parts = np.random.default_rng(3), np.arange(N) * H, []
    for role, slow, fast in (("fit", 1.3, 3.1), ("hold_out", 0.9, 2.3)):
        u = (8 * np.sin(2 * np.pi * slow * t) + 3 * np.sin(2 * np.pi * fast * t)) / KF
        y = move(u, friction) + NOISE * rng.standard_normal(N)
        parts.append(record(u, y, role, first=0.0 if role == "fit" else N * H))
    return Recording("t", AXIS.name, "series", ("reading.axis",), ("nm",), (NOISE,), tuple(parts), ())


@pytest.fixture(scope="module")
def found(recording):
    return ctrlgen.diagnose(AXIS, recording, laws=["coulomb"])


@pytest.fixture(scope="module")
def without(recording):
    return ctrlgen.diagnose(AXIS, recording, laws=["drift"])


@pytest.mark.long
def test_friction_is_a_function_of_the_direction_and_its_law_reaches_the_ceiling(found):
    channel = found.shares.before.of("reading.axis")
    assert channel.selected[0].kind in (Kind.DIRECTION, Kind.TRAVEL_HISTORY)
    assert channel.total.share > 0.9
    reached = found.shares.reached("reading.axis")
    assert reached.share > channel.total.share - 0.02 and reached.ci95[0] <= reached.share <= reached.ci95[1]
    (first, *_) = shares_sentences(found)
    assert (
        first.startswith("The ") and "of what the device as described leaves in axis; the accepted laws reach" in first
    )


@pytest.mark.long
def test_what_is_reached_is_the_decrease_of_the_residuals_energy(found):
    fitter, search = found.fitter, found.search
    energies = []
    for model in (search.nominal, search.chosen):
        left = [r.observed - fitter.predict(model.fit, r) for r in (*fitter.fit_records, *fitter.held_out_records)]
        energies.append(sum(float(np.sum(e**2)) for e in left))
    # 4000 of 6000 samples are drawn
    assert 1 - found.shares.reached("reading.axis").share == pytest.approx(energies[1] / energies[0], rel=0.1)


@pytest.mark.long
def test_without_the_law_the_ceiling_is_told_and_that_no_law_reaches_it(without):
    assert not without.search.chosen.causes and without.shares.after is without.shares.before
    first, beside = shares_sentences(without)
    assert first.endswith("; no law of the library is confirmed for it.")
    (term,) = without.empirical_terms
    assert term.effect.kind in beside and "names no cause" in beside


@pytest.mark.long
def test_the_record_and_the_page_hold_the_shares(found):
    result = diagnosis_record(found, MADE_FROM).as_json()
    assert faults(result, "diagnosis") == []
    shares = result["shares"]
    assert shares["statements"] == shares_sentences(found)
    row = shares["before"]["channels"]["reading.axis"]
    assert row["unit"] == "nm" and row["rms"] == pytest.approx(found.shares.before.channels[0].rms * 1e9)
    families = [f["family"] for f in shares["before"]["families"]]
    assert families[0] in (Family.FRICTION.value, Family.HYSTERESIS.value)
    html = page(found, MADE_FROM)
    assert "What the residual is a function of" in html and "dry friction" in html


@pytest.mark.long
def test_a_consistent_verdict_says_nothing_and_short_records_have_no_shares(found):
    assert shares_sentences(replace(found, verdict=Verdict.CONSISTENT)) == []
    assert shares_sentences(replace(found, shares=None)) == []
    short = [replace(r, valid=np.arange(N)[:, None] < 4) for r in found.recording.records]
    fitter = replace(found.fitter, recording=replace(found.recording, records=tuple(short)))
    assert residual_shares(fitter, found.search.nominal.fit, found.search.chosen.fit) is None
    assert diagnosis_record(replace(found, shares=None), MADE_FROM).shares is None


@pytest.mark.long
def test_a_record_along_which_a_model_diverges_has_no_part_in_the_shares(found, monkeypatch):
    fitter, search = found.fitter, found.search
    held = fitter.held_out_records[0]
    predict = type(fitter).predict
    monkeypatch.setattr(
        type(fitter), "predict", lambda self, fit, r: predict(self, fit, r) * (np.nan if r is held else 1.0)
    )
    shares = residual_shares(fitter, search.nominal.fit, search.chosen.fit)
    assert len(shares.before.blocks.rows) == len(shares.after.blocks.rows) == 1
    monkeypatch.setattr(type(fitter), "predict", lambda self, fit, r: predict(self, fit, r) * np.nan)
    assert residual_shares(fitter, search.nominal.fit, search.chosen.fit) is None


def channel(
    parts: dict[Kind, float],
    total: float,
    constant: float = 0.0,
    past: float = 0.0,
    numbers: float = 0.0,
    pitch: tuple[float, str] = (0.25e-3, "mm"),
) -> ChannelShares:
    """Shares of a channel with `parts` selected, each alone as much as it adds."""
    nothing = np.zeros(0)
    rows = tuple(
        KindShare(kind, Share(share, (share - 0.1, share + 0.1)), share, place, ())
        for place, (kind, share) in enumerate(parts.items(), 1)
    )
    return ChannelShares(
        "reading.axis",
        1.0,
        frozenset(),
        constant,
        numbers,
        rows,
        Share(total, (total - 0.05, total + 0.03)),
        1 - total,
        past,
        0.0,
        {Kind.LINE: 0.02, Kind.PITCH: pitch[0]},
        nothing,
        {},
        pitch[1],
    )


def test_a_law_that_the_readings_show_directly_is_not_told_to_be_unconfirmed():
    lattice = Hypothesis("quantisation", "sensor:axis", "axis")
    table = SimpleNamespace(channels=(channel({}, 0.0),))
    told = SimpleNamespace(
        shares=SimpleNamespace(before=table),
        verdict=Verdict.EXPLAINED,
        findings=(SimpleNamespace(cause=lattice),),
        search=SimpleNamespace(chosen=SimpleNamespace(causes=())),
        recording=SimpleNamespace(channels=("reading.axis",)),
        fitter=SimpleNamespace(noise=SimpleNamespace(floor=np.ones(1))),
        empirical_terms=(),
    )
    (said,) = shares_sentences(told)
    assert said.endswith("; quantisation at sensor:axis is seen in the readings themselves and takes no share.")


@pytest.mark.parametrize(
    ("shares", "said"),
    [
        (channel({Kind.DIRECTION: 0.85}, 0.85), "The direction of motion explains 85 % (80 ... 88 %) of what"),
        (
            channel({Kind.POSITION: 0.2, Kind.SPEED: 0.5}, 0.9, constant=0.1),
            "Speed (50 %), position (20 %) and a constant (10 %) together with lesser ones explain 90 % (85 ... 93 %) of what",
        ),
        (channel({Kind.LINE: 0.7}, 0.7), "A line of 50 Hz explains 70 % (65 ... 73 %) of what"),
        (
            channel({Kind.PITCH: 0.7}, 0.7),
            "The place in a pitch of 0.25 mm (4 a mm) explains 70 % (65 ... 73 %) of what",
        ),
        (
            channel({Kind.PITCH: 0.7}, 0.7, pitch=(np.radians(5.0), "deg")),
            "The place in a pitch of 5 deg (72 a turn) explains 70 %",
        ),
        (channel({Kind.PITCH: 0.7}, 0.7, pitch=(0.25, "")), "The place in a pitch explains 70 %"),
        (channel({Kind.TIME: 0.03}, 0.04), "No signal explains more than 5 % of what"),
        # a part of nothing: together they predict no more than chance
        (channel({}, 0.0, constant=0.3), "No signal explains more than 5 %"),
    ],
)
def test_the_ceiling_names_what_has_most_first(shares, said):
    assert ceiling_sentence(shares).startswith(said)


@pytest.mark.parametrize(
    ("shares", "said"),
    [
        (
            channel({Kind.TRAVEL_HISTORY: 0.64}, 0.7),
            "What is left in axis is mostly a function of the history of travel, 64 %, alone 64 % (54 ... 74 %), where hysteresis or "
            "dry friction would show, which no confirmed law of the library reaches.",
        ),
        (
            channel({Kind.POSITION: 0.3}, 0.4, past=0.2),
            "What is left in axis is in part a function of position, 30 %, alone 30 % (20 ... 40 %), where elastic nonlinearity or "
            "sensor geometry would show, which no confirmed law of the library reaches; its own past predicts 20 % more.",
        ),
        (channel({}, 0.6, constant=0.6), "What is left in axis is mostly a constant, 60 %."),
        (channel({Kind.RECORD: 0.7}, 0.7), "What is left in axis is mostly a constant for each record, 70 %."),
        (
            channel({Kind.SPEED: 0.2}, 0.2, past=0.5),
            "What is left in axis is mostly no function of the signals looked at: its own past predicts 50 % of it, speed 20 %.",
        ),
        (channel({}, 0.0), "What is left in axis is mostly no function of the signals looked at."),
    ],
)
def test_what_is_left_is_said_by_its_kind(shares, said):
    assert rest_sentence(shares) == said


def test_the_interval_of_a_signal_alone_stands_at_its_own_share():
    """Beside others a place in a pitch may explain more than alone, and the interval of the one need not hold the other."""
    beside = channel({Kind.TRAVEL_HISTORY: 0.43}, 0.6)
    alone = replace(beside.selected[0], alone=Share(0.12, (0.0, 0.32)))
    said = rest_sentence(replace(beside, kinds=(alone,)))
    assert "the history of travel, 43 %, alone 12 % (0 ... 32 %), where" in said


def test_shares_are_shown_in_whole_per_cent_and_near_the_whole_in_tenths():
    told = {
        0.0: "0 %",
        4e-4: "< 0.1 %",
        0.004: "0.4 %",
        0.123: "12 %",
        0.9951: "99.5 %",
        0.9999: "> 99.9 %",
        1.0: "100 %",
    }
    assert {share: per_cent(share) for share in told} == told
    assert with_interval(Share(0.5, (0.4, 0.6))) == "50 % (40 ... 60 %)"
    assert with_interval(Share(1.0, (1.0, 1.0))) == "100 %"
