"""What errors kept from being tried is told, and is no answer where it is everything."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from axis_records import AXIS, BACKLASH, fitter_of, played

from ctrlgen.core.errors import CtrlgenError, Fault, InputError, SolverError
from ctrlgen.diagnosis.diagnose import diagnose_recording
from ctrlgen.diagnosis.selection.failures import Failure, reason_of
from ctrlgen.diagnosis.selection.untried import refuse_without_trials, untried
from ctrlgen.effects import Effect, Param, Place
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis
from ctrlgen.estimation.simulator import Simulator

GAIN, DRIFT, LATE = (Hypothesis(effect, "sensor:axis", "axis") for effect in ("sensor_gain", "drift", "delay"))
CREEP = Hypothesis("creep", "stage:axis", "axis")
AT = "sensor_gain at sensor:axis"
WORTH = "causes worth a fit could not be fitted: no balance"
NUMBER = Hypothesis(PARAMETER, "actuator:force_constant", path="actuator.force_constant")


def searched(failed, fitted=(), dropped=(), offered=(BACKLASH, GAIN, DRIFT, LATE), loudest=None):
    """What a search that has fitted some causes left untried."""
    suspects = (SimpleNamespace(hypothesis=loudest),) if loudest else ()
    round_ = SimpleNamespace(
        failed=tuple(
            Failure(h, f"no balance of {h.effect}" if h is LATE else "no balance") for h in (*failed, *dropped)
        ),
        screened=SimpleNamespace(dropped=dict.fromkeys(dropped, "no such signal"), suspects=suspects),
    )
    return SimpleNamespace(
        rounds=(round_,),
        attempts=tuple(SimpleNamespace(candidate=SimpleNamespace(causes=(h,))) for h in fitted),
        offered=offered,
        fitter=SimpleNamespace(recording=SimpleNamespace(title="a run")),
    )


@pytest.mark.parametrize(
    "failed, fitted, dropped, refused",
    [
        ((GAIN, LATE), (), (), True),
        ((GAIN, LATE), (NUMBER,), (), True),  # a number of the device is no law
        ((GAIN, LATE), (DRIFT,), (), False),
        ((GAIN,), (GAIN,), (), False),  # from another start it was fitted
        ((NUMBER,), (), (), True),
        ((), (), (GAIN,), False),  # the others scored too little to be fitted
        ((), (), (GAIN, LATE, DRIFT, BACKLASH), True),
        ((GAIN,), (), (LATE,), True),
        ((), (NUMBER,), (), False),
        ((), (), (), False),
    ],
)
def test_there_is_no_answer_where_no_law_could_be_tried(failed, fitted, dropped, refused):
    search = searched(failed, fitted, dropped)
    assert untried(search).all_laws == refused
    if refused:
        with pytest.raises(SolverError, match=r"a run: no answer, because .* could(| not) be simulated: no "):
            refuse_without_trials(search, untried(search))
    refuse_without_trials(search, untried(searched(failed, (*fitted, BACKLASH), dropped)))


@pytest.mark.parametrize(
    "search, told",
    [
        (
            searched((GAIN, LATE, DRIFT), (BACKLASH,)),
            f"3 of 4 {WORTH} ({AT}, drift at sensor:axis; 1 for other reasons).",
        ),
        (searched((GAIN,), (BACKLASH, DRIFT, LATE, NUMBER)), f"1 of 5 {WORTH} ({AT})."),
        (searched((GAIN,), (BACKLASH, DRIFT, LATE, NUMBER, CREEP)), None),
        (searched((GAIN,), (BACKLASH, DRIFT, LATE, NUMBER, CREEP), loudest=GAIN), f"1 of 6 {WORTH} ({AT})."),
        (searched((), (BACKLASH,), (GAIN,)), f"1 of 4 laws could not be evaluated: no such signal ({AT})."),
        (searched((), (BACKLASH,), (GAIN,), [GAIN, *(Hypothesis(str(k), "") for k in range(5))]), None),
    ],
)
def test_a_considerable_part_stands_in_the_answer_with_its_number_and_reason(search, told):
    """A fifth of the causes, or the one that scored most."""
    assert untried(search).sentences() == ([told] if told else [])


def test_a_reason_says_what_is_wrong():
    assert (
        reason_of(InputError("a file", [Fault("x", "must be positive"), Fault("y", "is missing")]))
        == "must be positive; is missing"
    )
    assert reason_of(KeyError("z")) == "KeyError: 'z'" and reason_of(ValueError("no balance")) == "no balance"
    assert reason_of(ValueError()) == "ValueError: "


class Failing(Effect, listed=False):
    """A law that can be screened and not simulated."""

    place = Place.SENSOR
    source = "none"
    params = (Param("share", "1", (-1.0, 1.0), "share of the reading", off=0.0),)
    kind = "failing"

    def term(self, s, p):
        if type(s).__name__ != "_SymbolicInputs":
            raise KeyError("state")
        return p.share * s.value


def diagnosed(laws):
    recording = fitter_of(lambda u: 1.02 * played(u), n=300).recording
    return diagnose_recording(AXIS, recording, laws=laws, jobs=0)


def test_a_law_that_fails_in_every_fit_is_an_error(monkeypatch):
    monkeypatch.setitem(Effect.library, "failing", Failing)
    with pytest.raises(
        SolverError,
        match=r"the one cause .* not be simulated: KeyError: 'state' \(failing at sensor:axis\)",
    ):
        diagnosed(["failing"])


def test_a_device_that_fails_with_every_cause_is_an_error(monkeypatch):
    real = Fitter.fit

    def fit(self, structure, *given, **more):
        if structure.causes:
            raise RuntimeError("Error in a balance:\n  it does not converge.")
        return real(self, structure, *given, **more)

    monkeypatch.setattr(Fitter, "fit", fit)
    with pytest.raises(
        SolverError, match=r"none of the \d causes .* simulated: it does not converge \(backlash at stage:axis, "
    ):
        diagnosed(["backlash", "sensor_gain"])


@pytest.mark.parametrize("fails", [RuntimeError("it does not converge"), None])
def test_a_device_that_cannot_be_simulated_as_described_is_an_error(monkeypatch, fails):
    """It raises, or what it predicts is no number."""

    def simulate_states(self, record, *given):
        if fails:
            raise fails
        return np.full((len(record.time), self.n_s), np.nan), np.full(record.observed.shape, np.nan)

    real = Simulator.sensitivities
    monkeypatch.setattr(Simulator, "simulate_states", simulate_states)
    monkeypatch.setattr(Simulator, "sensitivities", lambda *given, **more: [np.nan * v for v in real(*given, **more)])
    with pytest.raises(
        CtrlgenError, match=r"cannot be simulated along it as described: (it does not converge|no reading .* is finite)"
    ):
        diagnosed(["backlash"])
