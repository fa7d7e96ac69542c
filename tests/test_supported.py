"""Which causes the account of the mismatch leaves: searches, fits and energies are numbers here."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from fitted_causes import CREEP, GAIN, fitted

from ctrlgen.diagnosis.selection import supported as module
from ctrlgen.diagnosis.selection.attribution import Attribution, ShareEntry
from ctrlgen.diagnosis.selection.supported import amplitude_may_be_zero, is_shown, supported
from ctrlgen.diagnosis.selection.verdict import moved_numbers
from ctrlgen.diagnosis.settings import ATTRIBUTION
from ctrlgen.estimation.free_parameters import FreeParameter

DEVIATION, JUST = 0.01, 1e-6
BEFORE = 1e4


@pytest.fixture(autouse=True)
def known_deviations(monkeypatch):
    monkeypatch.setattr(module, "robust_deviations", lambda fit: [DEVIATION] * len(fit.theta))
    monkeypatch.setattr(module, "outside_its_range", lambda fit, k: False)


def share(value: float) -> ShareEntry:
    return ShareEntry(value=value, ci95=(value, value))


def test_a_cause_is_shown_by_a_hundredth_and_where_nothing_is_to_share():
    assert is_shown(Attribution((share(0.01),), share(0.99), True), 0)
    assert not is_shown(Attribution((share(0.01 - JUST),), share(0.99), True), 0)
    assert not is_shown(Attribution((None,), share(1.0), True), 0)
    assert is_shown(Attribution((None,), None, True), 0)


def amplitude(path: str, cause: int) -> FreeParameter:
    return FreeParameter(path, "1", 0.0, -1.0, 1.0, 1e-3, None, cause, True)


@pytest.mark.parametrize("deviations, zero", [(1.95, True), (1.97, False), (-1.97, False)])
def test_an_amplitude_may_be_zero_within_its_interval(deviations, zero):
    fit = fitted(causes=(GAIN,), theta=(DEVIATION * deviations,), free_parameters=(amplitude("effect[0].gain", 0),))
    assert amplitude_may_be_zero(fit, 0) == zero


@pytest.mark.parametrize("deviations, told", [(3.99, False), (4.01, True), (-4.01, True)])
def test_a_number_of_the_device_is_told_that_moves_by_four_stated_deviations(deviations, told):
    stated = FreeParameter("mass", "kg", 0.5, 0.0, 9.0, 1e-3, 0.02, None, False)
    moved = moved_numbers(fitted(theta=(0.5 + 0.02 * deviations,), free_parameters=(stated,)))
    assert moved == (pytest.approx({"mass": deviations}) if told else {})


class Search:
    """Two causes: what is left with both, with the first alone, and whether it is noise with both."""

    def __init__(
        self, monkeypatch, small: float, left: float, noise=False, improves=False, unseen=False, vague=False, against=()
    ):
        theta = (0.5, 0.001 if vague else 0.5)
        free = (amplitude("effect[0].gain", 0), amplitude("effect[1].gain", 1))
        self.both = self.model(fitted((GAIN, CREEP), theta, free), 1e3, noise)
        self.bare = self.model(fitted((GAIN,), theta[:1], free[:1]), left, False)
        self.both.fit.restarted = SimpleNamespace(without=lambda k: k)
        self.selection = SimpleNamespace(
            improves_enough=lambda bare, current: improves,
            unseen_in_held_out=lambda bare: unseen,
            takes_much=lambda bare, current: False,
        )
        self.objections = lambda candidate, accepted: dict(against)
        self.screen, self.jobs, self.fitter = SimpleNamespace(seed=0), 1, None
        accounts = {2: (share(0.9 - small), share(small)), 1: (share(0.9),)}
        monkeypatch.setattr(
            module, "attribute", lambda f, n, current, *_: Attribution(accounts[len(current.causes)], share(0.1), True)
        )
        monkeypatch.setattr(module, "held_out_energy", lambda trials, candidate: candidate.energy)

    @staticmethod
    def model(fit, energy: float, noise: bool) -> SimpleNamespace:
        errors = SimpleNamespace(is_noise=noise)
        return SimpleNamespace(fit=fit, causes=fit.structure.causes, energy=energy, errors=errors)

    def tried(self, k: int, cause) -> list:
        return [self.bare] if k == 1 else []

    def converged(self, candidate):
        return candidate

    def left(self) -> tuple:
        nominal = self.model(fitted(), BEFORE, False)
        return supported(self, nominal, self.both)[0].causes


def test_a_cause_below_a_hundredth_is_taken_out_where_nothing_is_lost(monkeypatch):
    assert Search(monkeypatch, 0.009, left=1e3 + 50).left() == (GAIN,)
    assert Search(monkeypatch, 0.011, left=1e3 + 50).left() == (GAIN, CREEP)


def test_it_stays_where_the_cause_that_is_left_would_be_refused(monkeypatch):
    refused = {0: "its period is longer than what repeats"}
    assert Search(monkeypatch, 0.009, left=1e3 + 50, against=refused).left() == (GAIN, CREEP)


@pytest.mark.parametrize("lost, kept", [(0.0099, False), (0.0101, True)])
def test_it_stays_where_a_hundredth_of_the_mismatch_would_come_back(monkeypatch, lost, kept):
    assert (CREEP in Search(monkeypatch, 0.009, left=1e3 + lost * BEFORE).left()) == kept


@pytest.mark.parametrize("lost, kept", [(0.099, False), (0.101, True)])
def test_of_an_amplitude_that_may_be_zero_a_tenth_must_come_back(monkeypatch, lost, kept):
    assert (CREEP in Search(monkeypatch, 0.5, left=1e3 + lost * BEFORE, vague=True).left()) == kept


@pytest.mark.parametrize("noise, unseen", [(True, False), (False, True)])
def test_it_stays_where_noise_alone_is_left_with_it_or_the_held_out_records_cannot_show_it(monkeypatch, noise, unseen):
    given = {"noise": noise, "unseen": unseen}
    assert CREEP in Search(monkeypatch, 0.009, left=1e3, improves=True, **given).left()
    assert CREEP not in Search(monkeypatch, 0.009, left=1e3, improves=False, **given).left()


def test_noise_keeps_no_small_law_that_may_be_off_or_lies_at_a_bound(monkeypatch):
    given = {"noise": True, "improves": True}
    assert CREEP not in Search(monkeypatch, 0.009, left=1e3, vague=True, **given).left()
    monkeypatch.setattr(module, "outside_its_range", lambda fit, k: k == 1)
    assert CREEP not in Search(monkeypatch, 0.009, left=1e3, **given).left()
    assert CREEP in Search(monkeypatch, 0.011, left=1e3, **given).left()


def test_of_two_weak_causes_the_weaker_goes_first(monkeypatch):
    """Without it the other one has a share that counts."""
    found = Search(monkeypatch, 0.001, left=1e3)
    alone = found.model(fitted((CREEP,), (0.5,), (amplitude("effect[0].gain", 0),)), 1e3, False)
    accounts = {(GAIN, CREEP): (share(0.002), share(0.001)), (GAIN,): (share(0.02),), (CREEP,): (share(0.02),)}
    monkeypatch.setattr(
        module, "attribute", lambda f, n, current, *_: Attribution(accounts[current.causes], share(0.9), True)
    )
    monkeypatch.setattr(found, "tried", lambda k, cause: [found.bare if k == 1 else alone])
    assert found.left() == (GAIN,)


def test_the_thresholds_are_those_that_the_method_states():
    assert (ATTRIBUTION.least_share, ATTRIBUTION.vague_share) == (0.01, 0.1)
