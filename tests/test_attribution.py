"""Shares of the mismatch: Shapley's values of energies, and those of causes whose sizes are known."""

from __future__ import annotations

from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest
from axis_records import AXIS, BACKLASH, NOISE, H, axis_fitter, fitter_of, move, played, record
from misfits import BLOCKS, left, noise_of

from battery import hexapod_cases
from battery.plant_hexapod import AXES, Hexapod
from ctrlgen import load_device
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.diagnosis.selection import attribution
from ctrlgen.diagnosis.selection.attribution import Attribution, attribute
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.search import Searcher
from ctrlgen.diagnosis.settings import ATTRIBUTION
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.misfit import Misfit
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Recording

STIFFENING = Hypothesis("stiffening", "stage:axis", "axis")
HUM = Hypothesis("vibration", "disturbance:axis", "axis")


def shared(
    monkeypatch, energy, causes: int, held: float = 1.0, blocks=None, described=None, known=True, names=(), laws=()
) -> Attribution:
    """Shares of `causes` causes where those of a set S leave energy(S) on the records to fit, one number or one a channel; held out `held`
    times as much."""
    n_y = np.size(energy(frozenset()))

    def misfit_of(present, times=1.0):
        by_block = blocks(set(present)) if callable(blocks) else blocks
        each = [left(times * e, blocks=by_block) for e in np.atleast_1d(energy(frozenset(present)))]
        return Misfit(*(np.hstack([getattr(m, f.name) for m in each]) for f in fields(Misfit)))

    def of_records(records):
        return held if records == ["held"] else 1.0

    monkeypatch.setattr(
        attribution, "left_by", lambda fitter, fit, present, records: misfit_of(present, of_records(records))
    )
    monkeypatch.setattr(attribution, "as_fitted", lambda fitter, fit, records: fit.leaves(of_records(records)))
    fitter = SimpleNamespace(
        with_errors_of=lambda fit: None,
        held_out_records=["held"],
        fit_records=["fit"],
        noise=SimpleNamespace(known=np.array([known] * n_y)),
        recording=SimpleNamespace(channels=("reading.axis", "reading.other")[:n_y]),
    )
    places = names or tuple(f"stage:{k}" for k in range(causes))
    kinds = laws or ("coulomb",) * causes
    structure = SimpleNamespace(causes=tuple(Hypothesis(k, place) for k, place in zip(kinds, places, strict=True)))

    def trial(leaves):
        fit = SimpleNamespace(structure=structure, leaves=leaves)
        return SimpleNamespace(fit=fit, fitted=leaves(1.0), predicted=leaves(held))

    nominal = trial(lambda times: misfit_of((), times) if described is None else left(described))
    return attribute(fitter, nominal, trial(lambda times: misfit_of(range(causes), times)))


def values(found: Attribution) -> list[float]:
    return [s.value for s in (*found.shares, found.rest)]


def test_causes_that_add_up_have_what_each_takes_away(monkeypatch):
    takes = (5e4, 3e4, 1e4)
    found = shared(monkeypatch, lambda S: 1e5 - sum(takes[k] for k in S), 3)
    assert values(found) == pytest.approx([0.5, 0.3, 0.1, 0.1]) and found.explained == pytest.approx(0.9)
    assert found.held_out


def test_causes_that_cannot_stand_alone_take_nothing_away_alone(monkeypatch):
    """The second softens the stage beyond what it can stand without the first: together 90, the first alone 40."""
    table = {(): 1e5, (0,): 6e4, (0, 1): 1e4}

    def energy(present):
        if present == {1}:
            raise InputError("stage", [Fault("stiffness", "does not rise")])
        return table[tuple(sorted(present))]

    found = shared(monkeypatch, energy, 2)
    assert values(found) == pytest.approx([(0.4 + 0.9) / 2, (0.0 + 0.5) / 2, 0.1])


def test_shares_are_of_the_error_that_the_table_calls_before(monkeypatch):
    """The numbers of the device bend until it leaves 1500; with those of the model it would leave 100,000: two thirds are left."""
    found = shared(monkeypatch, lambda S: 1e3 if S else 1e5, 1, described=1.5e3)
    assert values(found) == pytest.approx([1 / 3, 2 / 3]) and found.explained == pytest.approx(1 / 3)
    assert found.channels == {"reading.axis": pytest.approx((1 / 3, 2 / 3))}


def test_nothing_is_taken_away_where_more_is_left_than_there_was(monkeypatch):
    found = shared(monkeypatch, lambda S: 3e3 if S else 1e5, 1, described=1.5e3)
    assert found.rest.value == pytest.approx(2.0) and found.explained == 0.0
    assert found.channels == {"reading.axis": pytest.approx((0.0, 2.0))}


def test_where_the_noise_is_not_known_the_whole_error_counts(monkeypatch):
    """Of 1000 samples that leave 1000 and 4000 squares beyond those of a guessed noise."""
    found = shared(monkeypatch, lambda S: 1e3 if S else 4e3, 1, known=False)
    assert found.rest.value == pytest.approx(2e3 / 5e3)


def test_terms_of_one_law_at_one_place_are_one(monkeypatch):
    takes = (5e4, 3e4, 1e4)
    found = shared(monkeypatch, lambda S: 1e5 - sum(takes[k] for k in S), 3, names=("sensor:a", "sensor:b", "sensor:a"))
    assert [s.value for s in found.shares] == pytest.approx([0.6, 0.3, 0.6]) and found.rest.value == pytest.approx(0.1)


def test_a_cause_that_takes_nothing_away_has_no_share_and_says_whom_it_serves(monkeypatch):
    """The first adds 30; the second takes away 50 beside it and 10 without it; the third takes away 5 beside any. On average the
    first adds 10 and the second takes away 30: 20 together."""

    def energy(S):
        return 1e5 + 3e4 * (0 in S) - (5e4 if {0, 1} <= S else 1e4 * (1 in S)) - 5e3 * (2 in S)

    found = shared(monkeypatch, energy, 3)
    first, second, third = found.shares
    assert first is None and found.serves[0] == 1
    assert (second.value, third.value, found.rest.value) == pytest.approx((0.2, 0.05, 0.75))


def test_what_a_cause_without_a_share_takes_away_in_one_channel_is_shared_among_those_that_have_one(monkeypatch):
    """The last of so many that pairs of them were not tried: in the other channel it alone takes 30 of 100 away, and adds more in the
    first. The channels' shares are told of the causes that have one, and of what is left: they are one."""
    n = ATTRIBUTION.most_causes + 1

    def energy(S):
        last = n - 1 in S
        return 1e5 - 1e4 * len(S - {n - 1}) + 4e4 * last, 5e4 + 1e3 * len(S - {n - 1}) - 3e4 * last

    found = shared(monkeypatch, energy, n)
    assert found.shares[-1] is None and None not in found.shares[:-1] and found.serves[-1] is None
    for channel in found.channels.values():
        assert channel[-2] == 0.0 and sum(channel) == pytest.approx(1.0)


def test_of_two_causes_that_make_up_for_one_another_one_has_what_both_take(monkeypatch):
    """In every second block the first adds as much as the second takes, and the other way round in those between: neither takes
    anything away for certain, and both together 40 beside the 50 of a third."""
    side = 1.5 * (-1.0) ** np.arange(BLOCKS)

    def by_block(S):
        return (1.0 - side * ((0 in S) - float(1 in S)) - 0.4 * ({0, 1} <= S) - 0.5 * (2 in S)) / BLOCKS

    found = shared(monkeypatch, lambda S: 1e5 * by_block(S).sum(), 3, blocks=lambda S: by_block(S) / by_block(S).sum())
    told = [s for s in found.shares[:2] if s is not None]
    assert [s.value for s in (*told, found.shares[2], found.rest)] == pytest.approx([0.4, 0.5, 0.1])
    assert found.serves[:2] == (1, 0)


def test_a_cause_that_acts_in_one_block_has_a_share(monkeypatch):
    """The last of twenty blocks holds four fifths of the error, which the first takes away; the second takes the rest. A third of the
    samples that are drawn with replacement lack that block."""
    last = np.arange(BLOCKS) == BLOCKS - 1

    def by_block(S):
        return 0.8 * last * (0 not in S) + 0.2 / BLOCKS * (1 not in S) + 1e-9

    found = shared(monkeypatch, lambda S: 1e5 * by_block(S).sum(), 2, blocks=lambda S: by_block(S) / by_block(S).sum())
    assert values(found) == pytest.approx([0.8, 0.2, 0.0], abs=1e-6)
    assert 0.02 < found.shares[0].ci95[0] < 0.5


def test_two_causes_that_nearly_cancel_have_a_share_each(monkeypatch):
    """Each alone leaves two to two and a half times what there was, here more and there less; together they leave a hundredth."""
    side = 0.8 * (-1.0) ** np.arange(BLOCKS)

    def by_block(S):
        alone = {(): 1 + 0 * side, (0,): 2.1 + side, (1,): 2.4 - side, (0, 1): 0.01 + 0 * side}
        return alone[tuple(sorted(S))] / BLOCKS

    found = shared(monkeypatch, lambda S: 1e5 * by_block(S).sum(), 2, blocks=lambda S: by_block(S) / by_block(S).sum())
    assert values(found) == pytest.approx([0.645, 0.345, 0.01])
    assert found.shares[1].ci95[0] == pytest.approx(ATTRIBUTION.least_share)


def test_what_stands_in_for_a_cause_that_is_missing_has_no_share_of_it(monkeypatch):
    """A creep alone leaves 60 of 100 that a bow causes; beside the bow it takes one of them away."""
    table = {(): 1e5, (0,): 2e4, (1,): 6e4, (0, 1): 1.9e4}
    found = shared(monkeypatch, lambda S: table[tuple(sorted(S))], 2)
    assert values(found) == pytest.approx([0.8, 0.01, 0.19])


@pytest.mark.parametrize(("back", "share"), [(3.8e3, 0.038), (4.6e3, (4e4 + 4.6e3) / 2e5)])
def test_what_comes_first_is_that_without_which_a_twentieth_of_the_error_comes_back(monkeypatch, back, share):
    """Of 80 that both take away: 4.2."""
    table = {(): 1e5, (0,): 2e4, (1,): 6e4, (0, 1): 2e4 - back}
    assert shared(monkeypatch, lambda S: table[tuple(sorted(S))], 2).shares[1].value == pytest.approx(share)


def test_of_many_causes_those_that_are_needed_are_shared_in_all_their_orders(monkeypatch):
    """Two that nearly cancel, beside five that take away a hundredth each."""
    both = {(): 1e5, (0,): 1.5e5, (1,): 1.6e5, (0, 1): 6e3}

    def energy(S):
        return both[tuple(sorted(S & {0, 1}))] - 1e3 * len(S - {0, 1})

    found = shared(monkeypatch, energy, 7)
    assert values(found) == pytest.approx([0.52, 0.42, *[0.01] * 5, 0.01])


@pytest.mark.parametrize(("without_weight", "first"), [(1.1e5, "gravity"), (3e4, "drive_offset")])
def test_a_constant_is_part_of_the_law_that_needs_it(monkeypatch, without_weight, first):
    """A weight and the constant that balances it at home, each alone worse than neither; and a constant that leaves little without
    a weight, which is what is wrong then."""
    table = {(): 1e5, (0,): without_weight, (1,): 2.5e5, (0, 1): 1e3}
    found = shared(monkeypatch, lambda S: table[tuple(sorted(S))], 2, laws=("drive_offset", "gravity"))
    k = ("drive_offset", "gravity").index(first)
    assert found.shares[k].value == pytest.approx(0.99) and found.shares[1 - k] is None
    assert found.serves[1 - k] == k


def test_sets_of_causes_begin_and_end_where_the_tables_do():
    """A force in proportion to the cube, which the stiffness stands in for by 4 %: at its value in the model, a device without the
    law leaves 1.7 times what the one as described does. 2 %: what the discrepancy is estimated to."""
    fitter, described = axis_fitter(lambda t, q, v, memory: (-2e12 * q**3, memory)).described(AXIS)
    fit = fitter.fit(described.restarted.with_cause(STIFFENING, {"k3": 2e12}), nested=described)
    fitter = fitter.with_errors_of(fit)
    records = fitter.held_out_records
    for present, model in ((frozenset(), described), (frozenset({0}), fit)):
        energy = attribution.left_by(fitter, fit, present, records).plain.sum()
        assert energy == pytest.approx(attribution.as_fitted(fitter, model, records).plain.sum(), rel=0.02)
    low, high = attribution.CausesAsFound(fit.structure, fitter, fit.theta).bounds
    fixed = [p.cause is not None for p in fit.structure.free_parameters]
    assert ((high - low)[: len(fixed)] < 1e-6).tolist() == fixed


@pytest.mark.parametrize("causes", [2, 6])
def test_that_sets_are_weighed_otherwise_than_the_tables_is_taken_away_by_no_cause(monkeypatch, causes):
    """The first cause takes all away, the others nothing: the fits of sets alone leave 70 where the table says 100, all the same."""
    assert causes == 2 or causes > ATTRIBUTION.most_causes
    found = shared(monkeypatch, lambda S: 1e3 if 0 in S else 7e4, causes, described=1e5)
    assert found.shares[0].value == pytest.approx(0.99) and found.rest.value == pytest.approx(0.01)
    assert found.shares[1:] == (None,) * (causes - 1)


def test_a_set_gives_no_reading_up_for_the_others(tmp_path):
    """A heater 12 % too strong, and heaters that warm each other by 2.2 %, half cancel in some components. Alone the first leaves more of
    all than with the numbers of the model if each component has a discrepancy of its own. The same where nobody states the noise: the
    device's numbers are held by the file against what a set leaves, not against what stands for the noise."""
    (tmp_path / "device.toml").write_text(hexapod_cases.device_text())
    device, sd = load_device(tmp_path / "device.toml"), np.array([1e-6] * 3 + [12e-9] * 3)
    gain = Hypothesis("drive_gain", "actuator:1Y", "1Y")
    warmed = Hypothesis("heat_crosstalk", "actuator:all", "all")
    rng, plant, records = np.random.default_rng(3), Hexapod(), []
    for role, n in (("fit", 60), ("hold_out", 40)):
        u = rng.uniform(0.05, 0.5, (n, 6))
        driven = u * (1 + 0.12 * (np.arange(6) == AXES.index("1Y")))
        driven = driven + 0.022 * (driven.sum(axis=1, keepdims=True) - driven)
        pose = plant.pose(plant.displacement(plant.temperature(driven))) * np.repeat([1.0, 1e-6], 3)
        records.append(record(u, pose + sd * rng.standard_normal(pose.shape), role, h=np.inf))
    components = [f"reading.{kind}_{axis}" for kind in ("theta", "delta") for axis in "xyz"]
    recording = Recording(
        "t", device.name, "poses", tuple(components), ("rad",) * 3 + ("m",) * 3, (None,) * 6, tuple(records), ()
    )
    fitter = Fitter(recording, replace(noise_of(6), sd=sd))
    structure = Structure(device).with_cause(gain, {"gain": 0.12}).with_cause(warmed, {"share": 0.022})
    fit = fitter.with_errors_of(fitter.fit(structure, steps=0)).fit(structure)
    values = dict(zip((p.path for p in fit.structure.free_parameters), fit.theta, strict=True))
    for k in (0, 1):
        alone = structure.without(1 - k)
        energy = attribution.left_by(fitter, fit, frozenset({k}), fitter.fit_records).plain.sum()
        theta = np.array([fit.values(k)[p.name] if p.cause == 0 else values[p.path] for p in alone.free_parameters])
        as_accepted = attribution.as_fitted(fitter, fitter.fit(alone, theta, steps=0), fitter.fit_records).plain.sum()
        assert energy < as_accepted
        untold = Fitter(recording, replace(noise_of(6, known=False), sd=sd))
        left_untold = attribution.left_by(untold, fit, frozenset({k}), fitter.fit_records).plain.sum()
        assert left_untold == pytest.approx(energy, rel=0.02)


def test_causes_that_need_each_other_share_what_they_take_together(monkeypatch):
    """Alone 40 and 20, together 90: the mean over both orders."""
    table = {(): 1e5, (0,): 6e4, (1,): 8e4, (0, 1): 1e4}
    found = shared(monkeypatch, lambda S: table[tuple(sorted(S))], 2)
    assert values(found) == pytest.approx([(0.4 + 0.7) / 2, (0.2 + 0.5) / 2, 0.1])


@pytest.mark.parametrize("causes", [1, 3, 4, 5, 7])
def test_shares_and_the_rest_are_one(monkeypatch, causes):
    rng = np.random.default_rng(causes)
    weights = rng.uniform(1, 3, causes)

    def energy(S):
        return 1e5 * (0.05 + 0.95 * (1 - sum(weights[k] for k in S) / weights.sum()) ** 3)

    found = shared(monkeypatch, energy, causes)
    assert sum(values(found)) == pytest.approx(1.0) and values(found)[-1] == pytest.approx(0.05)
    order = np.argsort([s.value for s in found.shares])
    assert np.array_equal(order, np.argsort(weights))


def test_a_set_that_diverges_counts_as_four_times_the_mismatch(monkeypatch):
    """Parts of (1 - 4 + 4)/2 and (5 + 39)/2 tenths without the limit; of -1.3 and 2.2 of the whole with it."""
    assert ATTRIBUTION.diverged == 4.0
    table = {(): 1e5, (0,): 1.5e5, (1,): 1e30, (0, 1): 1e4}
    parts = np.array([(-0.5 + 3.9) / 2, (1 - 4 + 1.4) / 2])
    found = shared(monkeypatch, lambda S: table[tuple(sorted(S))], 2)
    assert parts[1] < 0 and found.shares[1] is None
    assert found.shares[0].value == pytest.approx(0.9) and found.rest.value == pytest.approx(0.1)


def test_where_the_held_out_records_show_no_mismatch_the_shares_are_of_those_to_fit(monkeypatch):
    """Two hundredths of the noise's squares, of 1000 samples."""
    for excess, held in ((21.0, True), (19.0, False)):
        found = shared(monkeypatch, lambda S: 1e5 * (1 - 0.9 * len(S)), 1, held=excess / 1e5)
        assert found.held_out == held and found.shares[0].value == pytest.approx(0.9)


def test_nothing_is_shared_where_nothing_is_wrong_or_nothing_was_found(monkeypatch):
    none = shared(monkeypatch, lambda S: 1e5, 0)
    assert none.shares == () and none.rest is None and none.explained == 0.0
    clean = shared(monkeypatch, lambda S: -10.0, 2)
    assert clean.shares == (None, None) and clean.rest is None


def test_an_interval_is_that_of_the_blocks(monkeypatch):
    """Blocks alike leave no doubt. Where the cause acts in half of twenty blocks alone, a draw holds 10 of them, give or take 2.2."""
    assert shared(monkeypatch, lambda S: 1e5 * (1 - 0.5 * len(S)), 1).shares[0].ci95 == pytest.approx((0.5, 0.5))
    half = np.arange(BLOCKS) % 2 / (BLOCKS / 2)

    def shares_of_blocks(excess, n=1000, blocks=None):
        return even(excess, n, half if excess < 9e4 else None)

    even = left
    monkeypatch.setattr("test_attribution.left", shares_of_blocks)
    share = shared(monkeypatch, lambda S: 1e5 if not S else 5e4, 1).shares[0]
    assert share.value == pytest.approx(0.5)
    assert share.ci95 == pytest.approx(
        (0.5 - 1.96 * np.sqrt(0.25 / BLOCKS), 0.5 + 1.96 * np.sqrt(0.25 / BLOCKS)), abs=0.04
    )


@pytest.mark.long
def test_two_causes_have_the_shares_that_were_planted():
    """A hum of 30 times the noise beside a play of 60 nm: what each adds to the held-out records is known."""
    hum = 30 * NOISE * np.sin(2 * np.pi * 50.0 * H * np.arange(1500) + 0.4)

    fitter = fitter_of(lambda u: played(u) + hum)
    search = Searcher(fitter, Screen(fitter, [BACKLASH, HUM]), lambda _: None).run(AXIS)
    found = attribute(search.fitter, search.nominal, search.chosen)
    (held,) = fitter.held_out_records
    lost = played(held.drive[:, 0]) - move(held.drive[:, 0])
    energy = {"backlash": np.sum(lost**2), "vibration": np.sum(hum**2)}
    by_name = {c.effect: s for c, s in zip(search.chosen.causes, found.shares, strict=True)}
    assert set(by_name) == set(energy)
    for name, share in by_name.items():
        assert share.value == pytest.approx(energy[name] / sum(energy.values()), abs=0.1)
        assert share.ci95[0] < share.value < share.ci95[1]
    assert sum(values(found)) == pytest.approx(1.0) and abs(found.rest.value) < 0.02
