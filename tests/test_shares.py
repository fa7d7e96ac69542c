"""Model-free shares: residuals that are a known function of known signals, noise that is a function of nothing, and families."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from ctrlgen.diagnosis.report.shares_sentences import part_name
from ctrlgen.diagnosis.shares.design import Kind
from ctrlgen.diagnosis.shares.families import SPEAKS_FOR, alone, family_of, ranking
from ctrlgen.diagnosis.shares.model_free_shares import model_free_shares
from ctrlgen.diagnosis.shares.shares_record import table_record
from ctrlgen.diagnosis.shares.signals import Signals
from ctrlgen.effects import Effect, Family
from ctrlgen.estimation.hypothesis import PARAMETER
from ctrlgen.reporting.result_file import json_text

N, H = 6000, 0.002
T = H * np.arange(N)
PART = 0.8  # of the energy that the planted function has; the rest is white
CLOSE = 0.06  # a smoother loses some of it where a block goes further than all others, as the last one does in time


def multisine(rng, time=T, low=0.3, high=3.0):
    f, phase = rng.uniform(low, high, 10), rng.uniform(0, 2 * np.pi, 10)
    return np.sin(2 * np.pi * f * time[:, None] + phase).sum(axis=1) / 3


def play(x, r):
    p, out = x[0], np.empty_like(x)
    for k, value in enumerate(x):
        p = max(value - r, min(value + r, p))
        out[k] = p
    return out


@pytest.fixture(scope="module")
def signals():
    """Two axes with slow random motion, and a drive that is neither."""
    rng = np.random.default_rng(11)
    x, y, u = (np.sin(multisine(rng)) for _ in range(3))  # within limits that every stretch reaches
    return Signals(
        time=T,
        sample_time=H,
        position={"x": x, "y": y},
        drive={"u": u},
        reading={"x": x, "y": y},
        temperature=np.sin(multisine(rng, low=0.2, high=0.8)),
    )


def planted(function, rng, part=PART):
    """`function` with unit variance and white noise beside it, of which it has `part` of the energy."""
    function = (function - function.mean()) / function.std()
    return np.sqrt(part) * function + np.sqrt(1 - part) * rng.standard_normal(len(function))


FUNCTIONS = {
    Kind.DIRECTION: lambda s: np.sign(np.gradient(s.position["x"])),
    Kind.POSITION: lambda s: s.position["x"] ** 3,
    Kind.SPEED: lambda s: np.gradient(s.position["x"]) * np.abs(np.gradient(s.position["x"])),
    Kind.DRIVE: lambda s: np.maximum(s.drive["u"], 0.3),
    Kind.TRAVEL_HISTORY: lambda s: s.position["x"] - play(s.position["x"], 0.4),
    Kind.DRIVE_HISTORY: lambda s: s.drive["u"] - play(s.drive["u"], 0.4),
    Kind.DRIVE_LAG: lambda s: s.drive["u"] - lfilter([0.02], [1, -0.98], s.drive["u"]),  # 0.1 s
    Kind.OTHER_AXIS: lambda s: s.position["y"] ** 2,
    Kind.PRODUCT: lambda s: s.position["x"] * s.position["y"],
    Kind.WARM_PRODUCT: lambda s: s.position["x"] * s.temperature,
    Kind.TEMPERATURE: lambda s: np.exp(s.temperature),
    Kind.PITCH: lambda s: np.sin(2 * np.pi * s.position["x"] / 0.11 + 1.0),
    Kind.TIME: lambda s: np.sin(2 * np.pi * s.time / T[-1]),
    Kind.LINE: lambda s: np.sin(2 * np.pi * 51.3 * s.time + 1.0),
}


@pytest.mark.long
@pytest.mark.parametrize("kind", FUNCTIONS, ids=lambda k: k.name.lower())
def test_a_function_of_one_kind_gets_its_share_and_is_selected_first(kind, signals, rng):
    y = planted(FUNCTIONS[kind](signals), rng)
    (found,) = model_free_shares([y[:, None]], [signals], ["x"]).channels
    row = next(row for row in found.kinds if row.kind is kind)
    assert row.selected == 1
    assert row.alone.share == pytest.approx(PART, abs=CLOSE)
    assert row.alone.ci95[0] - CLOSE <= row.alone.share <= row.alone.ci95[1] + CLOSE
    assert found.total.share == pytest.approx(PART, abs=CLOSE + 0.02)  # the ceiling costs the columns of all kinds


@pytest.mark.parametrize(
    ("product", "factors"),
    [
        (lambda s: s.position["x"] * s.position["y"], ("position of x", "position of y")),
        (lambda s: s.position["x"] * np.sign(np.gradient(s.position["x"])), ("position of x", "direction of x")),
        (lambda s: s.drive["u"] * s.temperature, ("the drive", "temperature")),
        # three quarters of it
        (lambda s: s.position["x"] * (s.position["y"] + 0.6 * s.drive["u"]), ("position of x", "position of y")),
        (
            lambda s: s.position["x"] * (s.position["y"] + s.drive["u"] + 0.5 * np.sign(np.gradient(s.position["x"]))),
            (),
        ),
    ],
)
def test_the_two_signals_of_a_product_are_named_where_one_product_makes_up_most(product, factors, signals, rng):
    (found,) = model_free_shares([planted(product(signals), rng)[:, None]], [signals], ["x"]).channels
    kind = Kind.WARM_PRODUCT if "temperature" in factors else Kind.PRODUCT
    assert found.factors.get(kind, ()) == factors
    assert (part_name(found, kind) == " times ".join(factors)) == bool(factors)


@pytest.mark.parametrize(("axis", "period", "unit"), [("x", 0.11, "mm"), ("y", 0.13, "deg")])
def test_a_pitch_is_that_of_its_own_axis_in_the_unit_of_that(axis, period, unit, signals, rng):
    """Of a reading that several axes move."""
    y = planted(np.sin(2 * np.pi * signals.position[axis] / period + 1.0), rng)
    both = replace(signals, reading={}, units={"position x": "mm", "position y": "deg"})
    (found,) = model_free_shares([y[:, None]], [both], ["sum"]).channels
    assert found.pitch_unit == unit and found.periods[Kind.PITCH] == pytest.approx(period, rel=0.01)


@pytest.mark.long
def test_two_causes_add_up_to_the_ceiling(signals, rng):
    friction, cubic = (FUNCTIONS[kind](signals) for kind in (Kind.DIRECTION, Kind.POSITION))
    y = planted(friction / friction.std() + 0.5 * cubic / cubic.std(), rng)
    (found,) = model_free_shares([y[:, None]], [signals], ["x"]).channels
    assert [row.kind for row in found.selected] == [Kind.DIRECTION, Kind.POSITION]
    assert [row.additional for row in found.selected] == pytest.approx([0.8 * PART, 0.2 * PART], abs=CLOSE)
    assert found.constant + sum(row.additional for row in found.selected) + found.rest == pytest.approx(1, abs=0.01)
    assert found.rest_own_past < 0.02  # what is left is white


@pytest.mark.long
def test_what_no_kind_explains_is_left_and_has_memory(signals, rng):
    y = planted(lfilter([1.0], [1, -0.95], rng.standard_normal(N)), rng)
    (found,) = model_free_shares([y[:, None]], [signals], ["x"]).channels
    assert found.rest > 0.9 and found.rest_own_past > 0.4


@pytest.mark.long
def test_numbers_that_the_fit_has_moved_do_not_hide_friction(signals, rng):
    """Viscous damping fitted to dry friction leaves F sign(v) - c v, of which the direction alone predicts little."""
    v = np.gradient(signals.position["x"], H)
    y = planted(np.sign(v), rng, part=0.9)
    y = y - (y @ v) / (v @ v) * v
    (plain,) = model_free_shares([y[:, None]], [signals], ["x"]).channels
    (freed,) = model_free_shares([y[:, None]], [signals], ["x"], [v[:, None, None]]).channels
    shares = [next(row.alone.share for row in c.kinds if row.kind is Kind.DIRECTION) for c in (plain, freed)]
    left = 1 - 0.1 / np.mean(y**2)  # of what the fit leaves all but the noise is friction
    assert shares[1] == pytest.approx(left, abs=CLOSE) and shares[0] < left - 0.1
    assert freed.selected[0].kind is Kind.DIRECTION and freed.numbers == 0


NULLS = {"white": [1.0], "AR(1)": [1, -0.95], "random walk": [1, -1.0]}


@pytest.mark.long
@pytest.mark.parametrize("name", NULLS)
def test_noise_is_a_function_of_nothing_but_its_past_and_time(name):
    """Six recordings, fifteen kinds each: 90 shares, of which chance may show a few per cent."""
    shown = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        time = 0.01 * np.arange(800)
        x, y, u = (multisine(rng, time, 0.2, 2.0) for _ in range(3))
        s = Signals(time=time, sample_time=0.01, position={"x": x, "y": y}, drive={"u": u}, reading={"x": x})
        noise = lfilter([1.0], NULLS[name], rng.standard_normal(len(time)))
        (found,) = model_free_shares([noise[:, None]], [s], ["x"]).channels
        shown += [row.kind for row in found.kinds if row.alone.share > 0.05]
    slow = {Kind.PAST, Kind.TIME} if name != "white" else set()
    false = [kind for kind in shown if kind not in slow]
    assert len(false) <= (3 if name == "random walk" else 1), false  # a walk goes with any slow signal now and then
    assert name == "white" or shown.count(Kind.PAST) >= 4


@pytest.mark.long
@pytest.mark.parametrize("n", [24, 54])
def test_noise_of_few_poses_is_a_function_of_nothing(n):
    shown = []
    for seed in range(16):
        rng = np.random.default_rng(seed)
        position = {axis: rng.uniform(-1, 1, n) for axis in "xyz"}
        s = Signals(time=np.arange(float(n)), sample_time=np.inf, position=position)
        (found,) = model_free_shares([rng.standard_normal((n, 1))], [s], ["r"]).channels
        shown += [row.kind for row in found.kinds if row.alone.share > 0.05]
    assert len(shown) <= 4  # of some 130


def test_memory_shows_in_the_order_of_poses(rng):
    n = 60
    x = np.sin(2 * np.pi * np.arange(n) / 13.7) * np.linspace(1, 0.4, n)
    y = planted(x - play(x, 0.3), rng, part=0.9)
    s = Signals(time=np.arange(float(n)), sample_time=np.inf, position={"x": x})
    (found,) = model_free_shares([y[:, None]], [s], ["r"]).channels
    assert found.selected[0].kind is Kind.TRAVEL_HISTORY
    assert found.selected[0].additional > 0.65  # of 0.9: eight widths from sixty poses
    mixed = rng.permutation(n)
    s = replace(s, position={"x": x[mixed]})
    (other,) = model_free_shares([y[mixed][:, None]], [s], ["r"]).channels
    assert all(row.kind is not Kind.TRAVEL_HISTORY for row in other.selected)


@pytest.mark.long
def test_spikes_change_nothing(signals, rng):
    y = planted(FUNCTIONS[Kind.POSITION](signals), rng)
    spiked = y.copy()
    spiked[rng.choice(N, 30, replace=False)] += 30.0
    clean, found = (model_free_shares([v[:, None]], [signals], ["x"]).channels[0] for v in (y, spiked))
    assert 0 < found.spikes < 0.01
    assert found.total.share == pytest.approx(clean.total.share, abs=CLOSE)
    assert found.selected[0].kind is Kind.POSITION


@pytest.mark.long
def test_samples_that_are_not_valid_and_a_second_record_are_taken_as_they_are(signals, rng):
    y = planted(FUNCTIONS[Kind.DIRECTION](signals), rng)
    second = y + 2.0  # another zero point
    second[1000:2500] = np.nan
    (found,) = model_free_shares([y[:, None], second[:, None]], [signals, signals], ["x"]).channels
    assert {row.kind for row in found.selected} == {Kind.DIRECTION, Kind.RECORD}
    assert np.isnan(found.residual).any()


def test_a_drive_that_is_the_position_has_no_row(signals, rng):
    s = replace(signals, drive={"u": 3.0 * signals.position["x"]})
    table = model_free_shares([planted(FUNCTIONS[Kind.POSITION](s), rng)[:, None]], [s], ["x"])
    assert table.design.same_as == {"u": "position of x"}
    assert not {Kind.DRIVE, Kind.DRIVE_HISTORY} & {row.kind for row in table.channels[0].kinds}


def test_every_kind_speaks_and_every_effect_of_the_library_belongs_to_a_family():
    assert set(SPEAKS_FOR) == set(Kind) and all(reason for _, reason in SPEAKS_FOR.values())
    # These name no cause
    families = {kind: law.family for kind, law in Effect.library.items() if not kind.startswith("empirical_")}
    assert set(families.values()) == set(Family)
    assert family_of("creep") is Family.CREEP and family_of(PARAMETER) is None
    assert {family for families, _ in SPEAKS_FOR.values() for family in families} == set(Family)


@pytest.mark.long
@pytest.mark.parametrize(
    ("kind", "family"),
    [
        (Kind.DIRECTION, Family.FRICTION),
        (Kind.TRAVEL_HISTORY, Family.HYSTERESIS),
        (Kind.POSITION, Family.ELASTIC),
        (Kind.PITCH, Family.PERIODIC),
        (Kind.OTHER_AXIS, Family.CROSS_TALK),
        (Kind.SPEED, Family.DYNAMICS),
    ],
)
def test_the_family_of_what_was_planted_comes_first(kind, family, signals, rng):
    noise = rng.standard_normal(N)
    table = model_free_shares([np.column_stack([planted(FUNCTIONS[kind](signals), rng), noise])], [signals], ["x", "y"])
    found = ranking(table, noise={"x": 0.1, "y": 1.0})  # the second channel has nothing but its noise
    assert found[0][0] is family and found[0][1] == pytest.approx(PART, abs=CLOSE)


@pytest.mark.long
def test_the_record_is_plain_and_says_what_was_selected(signals, rng):
    table = model_free_shares([planted(FUNCTIONS[Kind.POSITION](signals), rng)[:, None]], [signals], ["x"])
    record = json.loads(json_text(table_record(table, {"x": "um"}, {"x": 1.0})))
    first = record["channels"]["x"]["kinds"][0]
    assert first["kind"] == "position" and first["share"] == table.channels[0].kinds[0].alone.share
    assert first["selected"] == 1 and record["channels"]["x"]["rms"] == pytest.approx(1e6 * table.channels[0].rms)


def test_a_kind_that_another_one_took_the_place_of_still_speaks_alone():
    """In a sine the speed and the history of travel are nearly one signal."""
    rows = [
        SimpleNamespace(kind=Kind.SPEED, alone=SimpleNamespace(share=0.96), additional=0.96, selected=1),
        SimpleNamespace(kind=Kind.TRAVEL_HISTORY, alone=SimpleNamespace(share=0.97), additional=0.02, selected=2),
    ]
    channel = SimpleNamespace(channel="x", rms=1.0, kinds=rows, constant=0.0, numbers=0.0, axes=frozenset())
    other = SimpleNamespace(channel="y", rms=0.0, kinds=[], constant=0.0, numbers=0.0, axes=frozenset())
    table = SimpleNamespace(channels=[channel, other], design=SimpleNamespace(one_way=lambda axes: False))
    assert dict(ranking(table))[Family.HYSTERESIS] == pytest.approx(0.01)
    by_itself = alone(table, {"x": 1.0, "y": 1.0})
    assert by_itself[Family.HYSTERESIS] == pytest.approx(0.97) and by_itself[Family.DYNAMICS] == pytest.approx(0.96)
    assert by_itself[Family.CREEP] == 0.0


@pytest.mark.parametrize(("axes", "geometry"), [({"x"}, 0.0), ({"x", "y"}, 0.2)])
def test_what_is_constant_or_in_proportion_may_count_for_no_family(axes, geometry):
    """A gain and an offset over a drive that a dead zone bends; a turned frame too is a function of the drives of several axes."""
    rows = [
        SimpleNamespace(kind=Kind.PROPORTION, additional=0.6, selected=1),
        SimpleNamespace(kind=Kind.DRIVE, additional=0.2, selected=2),
    ]
    channel = SimpleNamespace(channel="x", rms=1.0, kinds=rows, constant=0.1, numbers=0.05, axes=frozenset(axes))
    table = SimpleNamespace(channels=[channel], design=SimpleNamespace(one_way=lambda axes: False))
    whole, bent = dict(ranking(table)), dict(ranking(table, linear=False))
    assert whole[Family.GAIN] == pytest.approx(0.95) and whole[Family.GEOMETRY] == pytest.approx(0.6 + geometry)
    assert bent[Family.DRIVE] == pytest.approx(0.2) and bent.get(Family.GEOMETRY, 0.0) == pytest.approx(geometry)
    assert bent[Family.GAIN] == pytest.approx(0.2)  # by what the drive bends
