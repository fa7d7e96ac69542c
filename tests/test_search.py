"""How the search compares, what it tries, and when nothing more is sought."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from axis_records import AXIS, BACKLASH, LATE, LIMIT, NOISE, H, axis_fitter, fitter_of, move, played
from misfits import errors_of, left, weighed_by
from scipy.signal import lfilter

from ctrlgen.diagnosis.selection import candidates, confusable, rivals, search
from ctrlgen.diagnosis.selection.attribution import Attribution, ShareEntry
from ctrlgen.diagnosis.selection.candidate_model import CandidateModel, linearised_optimum
from ctrlgen.diagnosis.selection.candidates import fit_subsets, restart_elsewhere
from ctrlgen.diagnosis.selection.model_selection import ModelSelection
from ctrlgen.diagnosis.selection.objections import objections
from ctrlgen.diagnosis.selection.rivals import replace_cause
from ctrlgen.diagnosis.selection.screen import Screen, Screened
from ctrlgen.diagnosis.selection.search import Searcher
from ctrlgen.diagnosis.selection.subset_search import Suspect
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.diagnosis.settings import CONFUSABLE, SEARCH
from ctrlgen.estimation.error_model import ErrorModel
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.noise import NoiseSource
from ctrlgen.estimation.noise_update import update_noise, update_noise_colour
from ctrlgen.estimation.structure import Structure


def trials_of(fitter) -> Trials:
    return Trials(fitter, Screen(fitter, [BACKLASH]), lambda _: None)


def test_what_is_left_without_a_cause_is_what_the_free_numbers_cannot_take_over():
    """A cause beside which the mass has moved by 3e-5, within the corner of the loss: without it the number moves back."""
    fitter = fitter_of()
    best = fitter.fit(Structure(AXIS))
    off = fitter.fit(Structure(AXIS), theta=best.theta * np.array([1.00003, *np.ones(len(best.theta) - 1)]), steps=0)
    assert off.objective > 1.4 * best.objective
    assert linearised_optimum(off) == pytest.approx(best.objective, rel=0.02)


def test_what_a_model_leaves_without_a_cause_is_screened_once_under_the_same_errors(monkeypatch):
    fitter, screens = fitter_of(n=300), []
    trials = trials_of(fitter)
    fit = fitter.fit(Structure(AXIS).with_cause(BACKLASH, {"gap": 1e-7}), steps=0)
    monkeypatch.setattr(
        trials.screen,
        "run",
        lambda bare, threshold: screens.append(bare) or Screened((), np.zeros((0, 0)), lambda: 1.0, {}),
    )
    first = trials.screened_without(fit, 0)
    assert trials.screened_without(fit, 0) == first and first[0].structure.causes == () and len(screens) == 1
    trials.use(fitter)
    trials.screened_without(fit, 0)
    assert len(screens) == 2


def test_a_model_to_which_nothing_is_added_is_not_screened(monkeypatch):
    fitter = fitter_of(n=300)
    screen = Screen(fitter, [BACKLASH])

    def rounds_end(trials, current):
        raise InterruptedError

    monkeypatch.setattr(screen, "run", lambda *_, **__: pytest.fail("screened"))
    monkeypatch.setattr(search, "simplified", rounds_end)
    monkeypatch.setattr(ModelSelection, "residual_within_model_form_error", lambda self, model: True)
    with pytest.raises(InterruptedError):
        search.Searcher(fitter, screen, lambda _: None).run(AXIS)


def test_a_structure_is_fitted_again_from_a_better_start_only():
    fitter = fitter_of()
    trials = trials_of(fitter)
    poor = trials.fit(Structure(AXIS), steps=40)
    poor = replace(poor, fit=replace(poor.fit, chi2=10 * poor.fit.chi2))  # as if it had ended in a far minimum
    trials.fitted[frozenset()] = poor, 40
    again = trials.fit(Structure(AXIS))
    assert again.fit.objective < 0.2 * poor.fit.objective
    assert trials.fit(Structure(AXIS)).fit is again.fit


def test_a_cause_that_leaves_more_than_noise_is_begun_again_in_another_shape():
    """A line of 50 Hz that was taken for one of 60 Hz: no descent leads from one to the other."""
    hum = Hypothesis("vibration", "disturbance:axis", "axis")
    fitter = fitter_of(lambda u: move(u) + 20 * NOISE * np.sin(2 * np.pi * 50.0 * H * np.arange(len(u)) + 0.4))
    trials = trials_of(fitter)
    start = {"amplitude": 10 * NOISE, "frequency": 60.0, "phase": 0.0}
    nominal, stuck = (trials.fit(s, steps=40) for s in (Structure(AXIS), Structure(AXIS).with_cause(hum, start)))
    others = tuple({**start, "frequency": f} for f in (100.0, 50.0, 33.0))
    screened = Screened((Suspect(hum, start, 100.0, 1.0, 0, others),), np.eye(1), lambda: 4.0, {})
    found = restart_elsewhere(trials, stuck, nominal, screened)
    assert not stuck.errors.is_noise and found.errors.is_noise
    assert found.fit.values(0)["frequency"] == pytest.approx(50.0, rel=1e-3)
    assert restart_elsewhere(trials, found, nominal, screened) is found


def test_what_a_set_does_not_seem_to_need_is_swapped_before_it_is_dropped(monkeypatch):
    """A play, beside a bend of the reading that nothing shows: another law in the play's place may need what stands beside it."""
    fitter, given = fitter_of(played), []
    bend = Hypothesis("cubic_sensor", "sensor:axis", "axis")

    def both(trials, current, screened, most, plainly):
        structure = current.fit.restarted.with_cause(BACKLASH, {"gap": 5e-8}).with_cause(bend, {"curvature": 1e3})
        return tuple(trials.tried(structure, bend, current.fit))

    def swaps(trials, current, before):
        given.append((current.causes, before))
        raise InterruptedError

    monkeypatch.setattr(search, "fit_candidates", both)
    monkeypatch.setattr(search, "swapped", swaps)
    monkeypatch.setattr(search, "all_pruned", lambda trials, current, candidates, screened: list(candidates))
    with pytest.raises(InterruptedError):
        search.Searcher(fitter, Screen(fitter, [BACKLASH, bend]), lambda _: None).run(AXIS)
    assert given == [((BACKLASH, bend), 0)]


def test_causes_are_compared_in_a_round_that_leaves_more_than_noise_and_else_once_at_the_end(monkeypatch):
    """A play that leaves noise alone beside a needless bend of the reading; a lag of the reading beside it, which leaves more."""
    fitter, compared = fitter_of(played), []
    bend = Hypothesis("cubic_sensor", "sensor:axis", "axis")
    searcher = Searcher(fitter, Screen(fitter, [BACKLASH, LATE, bend]), lambda _: None)
    begun = searcher.trials.fit(Structure(AXIS).with_cause(bend, {"curvature": 1e3}), bend)

    def rounds_with(cause, start) -> list[tuple[Hypothesis, ...]]:
        compared.clear()
        structure = begun.fit.restarted.with_cause(cause, start)
        tried = iter([tuple(searcher.trials.tried(structure, cause, begun.fit)), ()])
        monkeypatch.setattr(search, "fit_candidates", lambda *_: next(tried, ()))
        searcher.forward_rounds(begun, [])
        return list(compared)

    monkeypatch.setattr(search, "swapped", lambda trials, current, before: compared.append(current.causes) or current)
    monkeypatch.setattr(search, "all_pruned", lambda trials, current, candidates, screened: list(candidates))
    assert rounds_with(BACKLASH, {"gap": 5e-8}) == []
    assert rounds_with(LATE, {"gain": 1e-3, "tau": 0.01, "decades": 2.0}) == [(bend, LATE)]
    # a search that goes on from a model compares at its end
    trials, play = searcher.trials, Structure(AXIS).with_cause(BACKLASH, {"gap": 6e-8})
    whole, bare = trials.converged(trials.fit(play, BACKLASH)), trials.fit(Structure(AXIS))
    tried = iter([tuple(trials.tried(play, BACKLASH)), ()])
    monkeypatch.setattr(search, "fit_candidates", lambda *_: next(tried, ()))
    compared.clear()
    assert searcher.searched_on(bare, whole, []).causes == (BACKLASH,) and compared == [(BACKLASH,)]


def test_fits_of_the_last_comparison_serve_the_rivals(monkeypatch):
    """They are compared as they are judged: in steps that suffice and on the drive's clock, after which earlier fits are no fits of it."""
    fitter, fits, kinds = fitter_of(played, n=700), [], {"swapped": [], "rivals": []}

    def counted(name):
        real = getattr(search, name)

        def within(*given):
            fits.clear()
            told = real(*given)
            kinds[name] += fits
            return told

        return within

    def clocked(self, current):
        self.trials.use(self.trials.fitter)
        return self.trials.converged(current)

    fit = Fitter.fit
    monkeypatch.setattr(Fitter, "fit", lambda self, s, *g, **how: fits.append(s.causes) or fit(self, s, *g, **how))
    monkeypatch.setattr(Searcher, "clocked", clocked)
    for name in kinds:
        monkeypatch.setattr(search, name, counted(name))
    # what explains little is a rival too, and stays one
    monkeypatch.setattr(candidates, "SEARCH", replace(SEARCH, smallest_score=0.0))
    monkeypatch.setattr(rivals, "SEARCH", replace(SEARCH, rival_share=0.0, rival_reach=np.inf))
    found = Searcher(fitter, Screen(fitter, [BACKLASH, LATE]), lambda _: None).run(AXIS)
    assert found.chosen.causes == (BACKLASH,)
    assert (LATE,) in kinds["swapped"] and (LATE,) not in kinds["rivals"]


@pytest.mark.parametrize(("share", "sought"), [(0.5, 1), (0.001, 0)])
def test_no_rival_is_sought_of_what_takes_away_less_than_is_worth_a_name(monkeypatch, share, sought):
    """A pose set may have nine such causes beside two, and what might stand in the place of each is fitted again."""
    told, calls = ShareEntry(value=share, ci95=(share, share)), []
    account = Attribution((told,), ShareEntry(value=1 - share, ci95=(0.0, 1.0)), True)
    monkeypatch.setattr(search, "supported", lambda trials, nominal, current, seed: (current, account))
    monkeypatch.setattr(search, "rivals", lambda trials, current, k, rounds: calls.append(k) or ((), ()))
    found = Searcher(fitter_of(played, n=700), Screen(fitter_of(played, n=700), [BACKLASH]), lambda _: None).run(AXIS)
    assert found.chosen.causes == (BACKLASH,) and len(calls) == sought and found.rivals == ((),)


def test_what_explains_better_once_all_is_fitted_takes_the_place_of_a_cause():
    """Play, for which creep was taken: in the end the better one is the answer, not its alternative."""
    fitter = fitter_of(played, n=700)
    searcher = Searcher(fitter, Screen(fitter, [BACKLASH, LATE]), lambda _: None)
    taken = searcher.trials.fit(Structure(AXIS).with_cause(LATE, {"gain": 1e-3, "tau": 0.01, "decades": 2.0}), LATE)
    found = searcher.best_settled(taken)
    assert found.causes == (BACKLASH,) and found.held_out.plain_mean[0] < 0.5 * taken.held_out.plain_mean[0]
    assert searcher.best_settled(found).causes == (BACKLASH,)


def test_of_two_laws_that_do_the_same_the_commoner_is_the_answer():
    """Behind a linear stage a lag of the reading and one of the amplifier are one; the first is ten times as common."""
    sensor, amplifier = (
        Hypothesis("low_pass", "sensor:axis", "axis"),
        Hypothesis("amplifier_lag", "actuator:axis", "axis"),
    )
    fitter = axis_fitter(change=lambda y, u: lfilter([0.2], [1, -0.8], y), n=900)
    searcher = Searcher(fitter, Screen(fitter, [sensor, amplifier]), lambda _: None)
    for taken in (amplifier, sensor):
        start = {"share": 1.0, "tau": 6e-4, "damping": 4.0}
        begun = searcher.trials.converged(searcher.trials.fit(Structure(AXIS).with_cause(taken, start), taken))
        found = searcher.best_settled(begun)
        assert found.causes == (sensor,)
        assert abs(searcher.trials.selection.advantage(found, begun)) < CONFUSABLE.criterion


@pytest.mark.parametrize("noise, ahead, expected", [(True, 1.0, True), (True, -1.0, False), (False, 1.0, False)])
def test_a_commoner_law_takes_the_place_of_another_only_where_noise_alone_is_left(monkeypatch, noise, ahead, expected):
    monkeypatch.setattr(confusable, "prior_odds", lambda odds: odds)
    common, rare = SimpleNamespace(fit=0.0), SimpleNamespace(fit=-2.3)
    compare = SimpleNamespace(
        reference=lambda _: SimpleNamespace(is_noise=noise), advantage=lambda a, b: ahead if a is common else -ahead
    )
    assert confusable.is_commoner(compare, common, rare) is expected
    assert not confusable.is_commoner(compare, rare, common)


def test_a_rival_of_the_same_family_begins_with_the_numbers_they_have_in_common():
    dahl, other = (Hypothesis(effect, "stage:axis", "axis") for effect in ("stribeck", "coulomb"))
    rubbing = {"force": 0.01, "breakaway": 1.0, "speed": 1e-4, "reach": 2e-8}
    model = fitter_of()
    fit = model.fit(Structure(AXIS).with_cause(dahl, rubbing), steps=0)
    rubbed = replace(model.fit_records[0], observed=model.predict(fit, model.fit_records[0]))
    trials = trials_of(replace(model, recording=replace(model.recording, records=(rubbed,))))
    far, bare = {"force": 0.001, "reach": 3e-6, "smoothing": 1e-9}, Structure(AXIS)
    begun = replace_cause(trials, fit, 0, bare, Suspect(other, far, 100.0, 1.0, 0)).starts[0]
    assert begun == {"force": 0.01, "reach": 2e-8, "smoothing": 1e-9}
    elsewhere = Hypothesis("backlash", "stage:axis", "axis")
    assert replace_cause(trials, fit, 0, bare, Suspect(elsewhere, {"gap": 1e-8}, 100.0, 1.0, 0)).starts == (
        {"gap": 1e-8},
    )
    near = {"force": 0.01, "reach": 2e-8, "smoothing": 1e-9}
    wrong = replace(fit, theta=fit.theta * np.array([*np.ones(len(fit.theta) - 1), 100.0]))
    assert replace_cause(trials, wrong, 0, bare, Suspect(other, near, 100.0, 1.0, 0)).starts[0] == near


def test_the_price_of_a_number_is_what_the_fit_knows_of_it():
    fitter = fitter_of()
    fit = fitter.fit(Structure(AXIS))
    step = np.sqrt(np.diag(fit.covariance)) * np.array([0.5, -1.0, 2.0, 0.3])[: len(fit.theta)]
    assert np.sum((fit.information_root @ step) ** 2) == pytest.approx(
        step @ np.linalg.solve(fit.covariance, step), rel=1e-3
    )


@pytest.mark.parametrize("at_rest, learnt", [(0.6, True), (0.0, False)])
def test_a_colour_that_the_rest_has_not_is_not_the_noises(at_rest, learnt):
    rng = np.random.default_rng(5)

    def coloured(n: int, a: float) -> np.ndarray:
        return NOISE * np.sqrt(1 - a**2) * lfilter([1.0], [1.0, -a], rng.standard_normal(n))

    fitter = fitter_of()
    clean = fitter_of(after=lambda y: y, seed=4)
    y = clean.predict(clean.fit(Structure(AXIS)), clean.fit_records[0])
    colours = {"rest": at_rest, "fit": 0.6, "hold_out": 0.6}
    moved = {"rest": 0.0, "fit": y, "hold_out": fitter.held_out_records[0].observed}
    records = tuple(
        replace(r, observed=moved[r.role] + coloured(len(r.time), colours[r.role])[:, None])
        for r in fitter.recording.records
    )
    fitter = replace(fitter, recording=replace(fitter.recording, records=records))
    noise = update_noise_colour(fitter, fitter.fit(Structure(AXIS)))
    assert (noise is not fitter.noise) == learnt
    assert not learnt or noise.ar[0][0] == pytest.approx(0.6, abs=0.08)


@pytest.mark.parametrize("times, learnt", [(5.0, True), (0.2, False)])
def test_a_guessed_noise_is_corrected_downward_alone(times, learnt):
    fitter = fitter_of()
    fit = fitter.fit(Structure(AXIS))
    guessed = replace(fitter.noise, sources=(NoiseSource.FASTEST_PART,))
    fitter = fitter.with_noise(replace(guessed, sd=times * guessed.sd, ar=(np.zeros(0),)))
    noise = update_noise(fitter, fit)
    assert (noise is not fitter.noise) == learnt
    assert not learnt or (noise.floor[0] == pytest.approx(NOISE, rel=0.1) and "move least" in noise.notes[0])


@pytest.mark.parametrize(
    "explained, most, sizes", [(0.89, 4, {2, 3}), (0.91, 4, {2}), (0.89, 3, {2, 3}), (0.89, 2, {2}), (0.89, 1, set())]
)
def test_three_at_once_are_sought_only_while_more_than_a_tenth_is_unexplained(monkeypatch, explained, most, sizes):
    """And no more than may stand beside what is there: a search without a doubtful cause asks for one more than there were."""
    trials = trials_of(fitter_of(played))
    current, tried = trials.fit(Structure(AXIS)), set()
    single = replace(current, fitted=left((1 - explained) * current.fitted.excess))
    promised = current.fit.objective

    def refuse(structure, *_, **__):
        tried.add(len(structure.causes))
        raise ValueError("no such device can be built")

    monkeypatch.setattr(trials, "fit", refuse)
    starts = {BACKLASH: {"gap": 3e-8}, LATE: {"gain": 0.01, "tau": 1.0, "decades": 3.0}, LIMIT: {"level": 0.5}}
    three = tuple(Suspect(h, s, 100.0, 1.0, k) for k, (h, s) in enumerate(starts.items()))
    together = ((0.8 * promised, three[:2]), (0.9 * promised, three))
    assert (
        fit_subsets(
            trials, current, Screened(tuple(three), np.eye(3), lambda: 4.0, {}, lambda: together), (single,), most
        )
        == []
    )
    assert tried == sizes
    assert list(map(str, trials.failed)) == [
        f"{three[n - 1].hypothesis.effect} at {three[n - 1].hypothesis.location}: no such device can be built"
        for n in sizes
    ]


def test_nothing_is_sought_in_what_the_form_of_a_law_leaves():
    """A law that is right to a hundredth of itself, which takes away 1e6 squares of each kind, may leave 100."""
    fitter = fitter_of()
    fit = fitter.fit(Structure(AXIS).with_cause(BACKLASH, {"gap": 6e-8}), steps=0)
    cause = Hypothesis("drive_gain", "actuator:axis", "axis")
    gain = fitter.fit(Structure(AXIS).with_cause(cause, {"gain": 0.1}), steps=0)

    def trial(excess, of=fit, penalty=0.0):
        found = left(excess)
        return CandidateModel(replace(of, penalty=penalty), errors_of(found), found, found)

    weigh = ModelSelection(weighed_by(), lambda *_, **__: [trial(1e6)])
    within = weigh.residual_within_model_form_error
    assert within(trial(60.0)) and not within(trial(150.0))
    assert not within(trial(60.0, gain))  # its form is right
    assert not within(trial(60.0, penalty=100.0))  # a number of the device may hide a cause
    unknown = ModelSelection(weighed_by(known=False), lambda *_, **__: [trial(1e6)])
    assert not unknown.residual_within_model_form_error(trial(60.0))


@pytest.mark.parametrize("far", [True, False])
def test_a_device_far_from_the_readings_is_fitted_from_several_starts(monkeypatch, far):
    """A hundred times the noise and more: a start a stated deviation to either side of each stated number."""
    fitter, begun = fitter_of(), []
    best = fitter.fit(Structure(AXIS))
    stated = [u for u in best.structure.free_parameters if u.sd]
    poor = replace(best, chi2=2 * best.chi2)
    size = (1.001 if far else 0.999) * 100 * fitter.noise.floor
    monkeypatch.setattr(Fitter, "with_errors_of", lambda self, fit: replace(self, errors=discrepancy(self.noise, size)))

    def fit(self, structure, **_):
        begun.append(structure.nominal_starts)
        return best if begun[-1] and len([b for b in begun if b]) == 3 else poor

    monkeypatch.setattr(Fitter, "fit", fit)
    _, found = fitter.described(AXIS)
    both = [{u.path: u.nominal + side * u.sd} for u in stated for side in (-1, 1)]
    assert len(stated) >= 2 and [b for b in begun if b] == (both if far else [])
    assert found is (best if far else poor)


def discrepancy(noise, rms) -> ErrorModel:
    return ErrorModel(noise, rms, np.ones(len(rms)))


@pytest.mark.parametrize("steps, told", [(2.0, False), (8.0, True)])
def test_fringes_as_short_as_the_steps_of_a_reading_are_its_rounding(steps, told):
    step = 10 * NOISE
    fitter = fitter_of(after=lambda y: step * np.round(y / step))
    fringe = Hypothesis("cyclic", "sensor:axis", "axis")
    start = {"amplitude": NOISE, "period": steps * step, "phase": 0.0}
    fit = fitter.fit(Structure(AXIS).with_cause(fringe, start), steps=0)
    against = objections(fitter.recording, fit)
    assert against == ({} if told else {0: "it repeats with the steps of the reading"})
    assert objections(fitter.recording, fit, accepted=(fringe,)) == {}


@pytest.mark.parametrize("lost, contradicted", [(4.1, True), (3.9, False), (-4.1, False)])
def test_held_out_records_contradict_a_cause_beyond_two_standard_deviations(lost, contradicted):
    """z^2 = 4, and only where the model with the cause predicts worse than the one without."""
    fitter = fitter_of()
    without = trials_of(fitter).fit(Structure(AXIS))
    beside = replace(without)
    compare = ModelSelection(fitter, lambda *_: [])
    compare.held_out_loss = lambda t, errors: 100.0 + lost * (t is beside)
    assert compare.contradicted(without, beside) is contradicted
