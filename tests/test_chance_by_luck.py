"""The chance that luck found a cause: exact, at its level for any noise, and told in the same words as in numbers."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations, pairwise, product
from math import ceil, comb, log2
from types import MappingProxyType, SimpleNamespace

import numpy as np
import pytest
from axis_records import AXIS, BACKLASH, LATE, H, fitter_of, played, record
from fitted_causes import CREEP, DRIFT, GAIN
from scipy.linalg import block_diag
from scipy.signal import lfilter

from ctrlgen.diagnosis.evidence import chance_by_luck
from ctrlgen.diagnosis.evidence.chance_by_luck import Looks, doubted, looks, with_chances
from ctrlgen.diagnosis.evidence.independent_stretches import (
    GAP,
    Memory,
    Whitened,
    matched_innovations,
    memory_of,
    stretches,
)
from ctrlgen.diagnosis.evidence.matched_parts import change_by, matched_parts, without_causes
from ctrlgen.diagnosis.report.luck_sentences import chance_text, doubt_of_luck, luck_steps, luck_text
from ctrlgen.diagnosis.selection.findings import ChanceEntry, Finding, Role
from ctrlgen.diagnosis.selection.verdict import Verdict
from ctrlgen.diagnosis.settings import LUCK
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.structure import Structure
from ctrlgen.numerics.sign_flips import sign_flip_p

WHITE = Memory(0.0, False)
# the rate of p <= 0.05 in 2,000 draws, where it is 0.05: 0.05 +- 0.005, so that 0.06 is two deviations more
DRAWS, MOST = 2000, 0.06


def by_all_signs(parts: np.ndarray) -> float:
    signs = np.array(list(product((-1.0, 1.0), repeat=len(parts))))
    return float(np.mean(signs @ parts >= parts.sum() - 1e-12 * np.abs(parts).sum()))


@pytest.mark.parametrize("seed", range(6))
def test_p_is_that_of_all_signs_and_never_less(seed):
    rng = np.random.default_rng(seed)
    parts = rng.standard_t(2, 12) + 0.3 * seed
    assert by_all_signs(parts) <= sign_flip_p(parts) <= by_all_signs(parts) + 0.01


def test_p_reaches_two_to_the_minus_n_and_no_farther():
    assert sign_flip_p(np.ones(80)) == pytest.approx(2.0**-80)
    assert sign_flip_p(np.array([3.0, 2.0, 0.0, 1.0])) == pytest.approx(2.0**-3)
    assert sign_flip_p(np.zeros(5)) == sign_flip_p(np.zeros(0)) == sign_flip_p(-np.ones(4)) == 1.0
    with pytest.raises(ValueError):
        sign_flip_p(np.array([1.0, np.nan]))


def rate(noise, memory: Memory, draws: int = DRAWS, n: int = 1200) -> float:
    """How often p <= 5 % where `noise` (rng, n) alone is read, for an effect that is slow and one that is not."""
    rng = np.random.default_rng(11)
    effect = np.sin(np.arange(n) / 90.0) + 0.5 * np.sin(np.arange(n) / 7.0)
    labels = stretches(record(np.zeros(n), np.zeros(n), "hold_out"), effect**2, memory)
    inside, count = labels != GAP, int(labels.max()) + 1
    hits = 0
    for _ in range(draws):
        parts = np.bincount(labels[inside], (noise(rng, n) * effect)[inside], count)
        hits += sign_flip_p(parts) <= 0.05
    return hits / draws


def coloured(rng, n: int) -> np.ndarray:
    """A first-order process of heavy-tailed steps, with a memory of ten samples."""
    return lfilter([1.0], [1.0, -0.9], rng.standard_t(2.5, n))


def test_the_level_holds_for_heavy_tails_and_for_noise_with_memory():
    assert 0.03 < rate(coloured, Memory(10 * H, False)) <= MOST


def test_the_level_holds_where_the_size_of_the_noise_changes():
    def bursts(rng, n):
        return rng.standard_cauchy(n) * np.where(np.arange(n) < n // 4, 30.0, 1.0)

    assert 0.01 < rate(bursts, WHITE, draws=500) <= 0.05 + 2 * np.sqrt(0.05 * 0.95 / 500)


def test_signs_of_samples_instead_of_stretches_do_not_hold_it():
    assert rate(coloured, WHITE, draws=300) > 0.15


def test_a_stretch_is_longer_than_the_memory_and_none_touches_the_next():
    n, effect = 4000, np.ones(4000)
    held = record(np.zeros(n), np.zeros(n), "hold_out")
    labels = stretches(held, effect, Memory(20 * H, False))
    assert [np.sum(labels == b) >= LUCK.memories * 20 for b in range(labels.max() + 1)] == [True] * (labels.max() + 1)
    first = [np.flatnonzero(labels == b) for b in range(labels.max() + 1)]
    assert all(b[0] - a[-1] > LUCK.gap * 20 for a, b in pairwise(first))
    assert stretches(held, effect, WHITE).max() + 1 == pytest.approx(LUCK.most_stretches, abs=2)


def test_an_event_of_a_few_samples_has_as_many_stretches_as_the_memory_allows():
    effect = np.zeros(4000)
    effect[1000:1060] = 1.0
    labels = stretches(record(effect, effect, "hold_out"), effect, WHITE)
    assert len(np.unique(labels[1000:1060])) >= 59


def test_where_more_than_noise_is_left_the_same_phase_of_a_periodic_drive_is_one_stretch():
    u = np.sin(2 * np.pi * np.arange(4000) / 400)
    held = replace(record(u, u, "hold_out"), period=400 * H)
    once = stretches(held, np.ones(4000), Memory(10 * H, True))
    assert once.max() + 1 <= 400 / (10 * (LUCK.memories + LUCK.gap)) and np.array_equal(once[:400], once[400:800])
    assert stretches(held, np.ones(4000), Memory(10 * H, False)).max() > 8 * once.max()


def innovations(left, effect, slopes, labels) -> np.ndarray:
    """Those of one record without initial states."""
    return matched_innovations([Whitened(left, effect, slopes, np.zeros((len(left), 0)), labels)])


def by_cholesky(left, effect, slopes, labels) -> np.ndarray:
    """Whitened by the factor of I + d^2 J J'."""
    white = np.linalg.cholesky(np.eye(len(left)) + LUCK.doubt**2 * slopes @ slopes.T)
    return np.bincount(labels, np.linalg.solve(white, left) * np.linalg.solve(white, effect))


@pytest.mark.parametrize("stretch", [5, 30])
def test_innovations_are_those_of_a_known_covariance(stretch):
    rng, n = np.random.default_rng(3), 150
    left, effect, slopes, labels = *rng.standard_normal((2, n)), rng.standard_normal((n, 3)), np.arange(n) // stretch
    assert innovations(left, effect, slopes, labels) == pytest.approx(by_cholesky(left, effect, slopes, labels))


def test_parameters_are_learnt_from_record_to_record_and_initial_states_are_not():
    rng, n = np.random.default_rng(4), 60
    left, effect, slopes, labels = *rng.standard_normal((2, 2 * n)), rng.standard_normal((2 * n, 2)), np.arange(n) // 10
    starts = rng.standard_normal((2, n, 3))
    parts = [slice(0, n), slice(n, 2 * n)]
    records = [Whitened(left[p], effect[p], slopes[p], s, labels) for p, s in zip(parts, starts, strict=True)]
    every, numbers = np.hstack([slopes, block_diag(*starts)]), np.concatenate([labels, labels + 6])
    assert matched_innovations(records) == pytest.approx(by_cholesky(left, effect, every, numbers))


@pytest.mark.long
@pytest.mark.parametrize(("off", "heavy"), [(0.0, False), (300.0, False), (3.0, True)])
def test_the_level_holds_beside_numbers_with_errors(off, heavy):
    """Four numbers could take most of the effect; each is `off` by so many of its deviations, which move what is read by two."""
    rng, n, stretch, draws = np.random.default_rng(5), 240, 12, 1000
    t, labels = np.arange(n), np.arange(n) // stretch
    slopes = 2 * np.column_stack([np.sin(t / w) for w in (100.0, 40.0, 17.0, 5.0)]) / np.sqrt(n / 2)
    effect = np.sin(t / 35.0) + np.sin(t / 15.0) ** 3
    noise = rng.standard_t(2.5, (draws, n)) if heavy else rng.standard_normal((draws, n))
    left = noise + (off * rng.standard_normal((draws, 4))) @ slopes.T
    p = [sign_flip_p(innovations(e, effect, slopes, labels)) for e in left]
    # where they are off by far more than is allowed for, their errors only hide the effect
    assert np.mean(np.array(p) <= 0.05) <= 0.05 + 2 * np.sqrt(0.05 * 0.95 / draws)
    there = [sign_flip_p(innovations(e + effect, effect, slopes, labels)) for e in left[:50]]
    assert np.median(there) < 1e-2 or off > LUCK.doubt


def fitted_with(fitter, cause: Hypothesis = BACKLASH, start=MappingProxyType({"gap": 2e-8})):
    return fitter.fit(fitter.fit(Structure(AXIS)).restarted.with_cause(cause, dict(start)))


def test_a_cause_that_is_there_is_no_luck():
    fitter = fitter_of(played, seed=1, n=800)
    full = fitted_with(fitter)
    parts = matched_parts(fitter, full, [BACKLASH], memory_of(fitter, full))
    assert np.count_nonzero(parts) > 60 and sign_flip_p(parts) < 1e-12


def test_what_a_cause_changes_is_told_without_the_held_out_readings():
    """A reading that is late shows at first what was before the record: it is filled from what is read."""
    late = Hypothesis("delay", "sensor:axis", "axis")
    fitter = fitter_of(played, seed=1, n=800)
    full = fitted_with(fitter, late, {"delay": 5e-3})
    bare = without_causes(full, [late])
    (held,) = fitter.held_out_records
    other = replace(held, observed=held.observed[::-1].copy())
    first, again = (change_by(fitter, bare, full, r) for r in (held, other))
    assert np.abs(first).max() > 1e-9 and np.array_equal(first, again)


@pytest.mark.long
def test_the_level_holds_for_causes_fitted_where_there_are_none():
    """Of one record p is uniform; ten causes fitted to 30 records that lack nothing, in white noise."""
    causes = {
        BACKLASH: {"gap": 2e-8},
        Hypothesis("drive_gain", "actuator:axis", "axis"): {"gain": 1.001},
        Hypothesis("stiffening", "stage:axis", "axis"): {"k3": 1e15},
        LATE: {"gain": 1e-3, "tau": 0.1, "decades": 2.0},
    }
    p = []
    for seed in range(60):
        fitter = fitter_of(seed=seed, n=600)
        for cause, start in causes.items():
            full = fitted_with(fitter, cause, start)
            p.append(sign_flip_p(matched_parts(fitter, full, [cause], memory_of(fitter, full))))
    assert np.mean(np.array(p) <= 0.05) <= 0.05 + 2 * np.sqrt(0.05 * 0.95 / len(p))


# --- over the whole search


def finding(cause: Hypothesis, chance: ChanceEntry | None = None, role: Role = Role.CAUSE) -> Finding:
    return Finding(cause.effect, cause.location, {}, (), None, {}, "", cause, role=role, chance=chance)


def chances(
    monkeypatch, parts, causes=(CREEP, DRIFT, GAIN), role=Role.CAUSE, starts=3, offered=61
) -> list[ChanceEntry]:
    """Those of `causes` where cause k beside the causes S has parts(S, k), all alike, and so p = 2^-parts."""
    none = SimpleNamespace(causes=(), fit=frozenset())
    chosen = SimpleNamespace(causes=causes, fit=frozenset(range(len(causes))))
    all_sets = [frozenset(s) for n in range(1, len(causes) + 1) for s in combinations(causes, n)]
    attempts = [SimpleNamespace(candidate=SimpleNamespace(causes=s)) for s in all_sets] * starts
    search = SimpleNamespace(
        chosen=chosen, nominal=SimpleNamespace(fit=frozenset()), without_cause=[none] * len(causes), fitter=None
    )
    search.offered, search.attempts = (CREEP,) * offered, attempts

    def parted(full, beside):
        (k,) = (causes.index(c) for c in beside)
        return full - {k}, k

    monkeypatch.setattr(chance_by_luck, "memory_of", lambda fitter, fit: WHITE)
    monkeypatch.setattr(chance_by_luck, "hides_in_device", lambda search, k: False)
    monkeypatch.setattr(Looks, "fit", lambda self, S: S)
    monkeypatch.setattr(
        chance_by_luck, "matched_parts", lambda fitter, full, beside, memory: np.ones(parts(*parted(full, beside)))
    )
    return [f.chance for f in with_chances([finding(c, role=role) for c in causes], search)]


def test_p_counts_for_every_hypothesis_and_every_start(monkeypatch):
    (chance,) = chances(monkeypatch, lambda S, k: 20, (CREEP,))
    assert (chance.p, chance.looks, chance.stretches) == (pytest.approx(2.0**-20), 3 * 61, 20)
    assert chance.by_luck == pytest.approx(183 * 2.0**-20) and chance.certain and chance.reason is None


def test_causes_that_show_beside_all_others_are_no_luck_whatever_else_is_false(monkeypatch):
    def beside_all_others(S, k):
        assert len(S) == 2
        return {0: 80, 1: 60, 2: 50}[k]

    found = chances(monkeypatch, beside_all_others)
    assert [c.stretches for c in found] == [80, 60, 50] and all(c.certain for c in found)
    assert {c.looks for c in found} == {2 * looks(61, 3, 3)} == {2 * 3 * 2**3 * 3 * comb(63, 3)}
    # with their weights all answers of whatever size make up one
    assert sum(f * comb(60 + f, f) * 3 / looks(61, 3, f) for f in range(2, 60)) == pytest.approx(0.5)


def test_else_a_cause_is_no_luck_where_every_set_without_it_is_refuted(monkeypatch):
    """Alone, each is seen to be there: in 28, 26 and 20 stretches, whatever is beside it."""
    found = chances(monkeypatch, lambda S, k: {0: 28, 1: 26, 2: 20}[k])
    assert [c.stretches for c in found] == [28, 26, 20] and {c.looks for c in found} == {2 * 3 * 61}


def test_a_small_cause_that_another_one_hides_is_judged_beside_that(monkeypatch):
    """The second shows only beside the first; sets without the first are refuted by that."""
    found = chances(monkeypatch, lambda S, k: {0: 28, 1: 21 if 0 in S else 1, 2: 20}[k])
    assert [c.stretches for c in found] == [28, 21, 20]


def test_of_two_causes_each_of_which_could_be_all_neither_is_certain(monkeypatch):
    """One of them is there, and nothing tells which."""
    found = chances(monkeypatch, lambda S, k: 1 if S else 60, (CREEP, DRIFT))
    assert [c.by_luck for c in found] == [None, None]


def test_of_many_causes_no_sets_are_fitted(monkeypatch):
    causes = tuple(Hypothesis("coulomb", f"stage:{k}") for k in range(LUCK.most_causes + 1))
    first = chances(monkeypatch, lambda S, k: 20 if len(S) == LUCK.most_causes else 0, causes)[0]
    assert first.reason == chance_by_luck.FEW.format(
        "20 independent stretches", ceil(log2(2 * looks(61, 3, 5) / LUCK.certain))
    )


def test_what_too_few_stretches_cannot_show_is_said_with_how_many_could(monkeypatch):
    (chance,) = chances(monkeypatch, lambda S, k: 9, (CREEP,))
    assert not chance.certain and not chance.weak
    assert chance.reason.startswith("9 independent") and chance.reason.endswith(" 12")
    # 36 %, beside whatever size of a cause, would only say how few they are
    assert chance.by_luck is chance.p is chance.looks is None and chance.stretches == 9
    assert 183 * 2.0**-12 < LUCK.certain < 183 * 2.0**-11


def test_a_cause_that_only_the_records_to_fit_show_is_said_to_be_so(monkeypatch):
    (chance,) = chances(monkeypatch, lambda S, k: 9, (CREEP,), Role.UNSEEN)
    assert chance.reason == chance_by_luck.UNSEEN


def test_a_model_that_cannot_stand_is_no_evidence(monkeypatch):
    def diverges(S, k):
        raise ArithmeticError

    (chance,) = chances(monkeypatch, diverges, (CREEP,))
    assert chance.by_luck is None and chance.reason == chance_by_luck.NO_MODEL and not chance.certain


def entry(by_luck: float | None, reason: str | None = None) -> ChanceEntry:
    looks_ = None if by_luck is None else 1.0
    return ChanceEntry(by_luck=by_luck, p=by_luck, looks=looks_, stretches=50, against="noise", reason=reason)


def test_an_answer_whose_first_cause_may_be_luck_is_no_explanation():
    weak, sure, few = (finding(CREEP, c) for c in (entry(0.12), entry(1e-9), entry(None, "few")))
    assert doubted(Verdict.EXPLAINED, [weak, sure]) == Verdict.PARTLY
    assert doubted(Verdict.EXPLAINED, [sure, weak]) == doubted(Verdict.EXPLAINED, [few]) == Verdict.EXPLAINED
    assert doubted(Verdict.AMBIGUOUS, [weak]) == Verdict.AMBIGUOUS and doubted(Verdict.CONSISTENT, []) == "consistent"


def test_luck_in_words():
    assert doubt_of_luck(finding(CREEP, entry(0.12))) == "it may be luck (12 %)"
    assert doubt_of_luck(finding(CREEP, entry(None, "few"))) == "luck is not excluded"
    assert doubt_of_luck(finding(CREEP, entry(0.04))) == doubt_of_luck(finding(CREEP)) == ""
    assert doubt_of_luck(finding(CREEP, entry(None, "unseen"), Role.UNSEEN)) == ""
    assert luck_text(finding(CREEP, entry(1e-9))).startswith("< 1e-06: p < 1e-06 over all signs of 50 stretches")
    assert luck_text(finding(CREEP, entry(None, "few"))) == "cannot be judged by luck: few"
    assert chance_text(finding(CREEP, entry(None, "few"))) == "cannot be judged" and chance_text(finding(CREEP)) == "-"
    assert luck_text(finding(CREEP)) == "read from the data"
    assert luck_steps([finding(CREEP, entry(1e-9)), finding(DRIFT, entry(None, "few"))]) == [
        "drift at sensor:axis cannot be judged by luck: few."
    ]
    (step,) = luck_steps([finding(DRIFT, entry(0.2))])
    assert step.startswith("Luck is not excluded for drift at sensor:axis: its chance is 20 %")
