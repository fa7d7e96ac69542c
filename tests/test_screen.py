"""The screen: sets of candidates in the order of what they explain, and what it says of a cause that nothing can show."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from axis_records import AXIS, axis_fitter
from conftest import MESO_FILE, SCENARIOS

from ctrlgen import load_device
from ctrlgen.diagnosis.evidence.detectability import detectability
from ctrlgen.diagnosis.selection import screen
from ctrlgen.diagnosis.selection.confusable import explains_alike, explains_better, look_alike
from ctrlgen.diagnosis.selection.findings import estimated_values
from ctrlgen.diagnosis.selection.screen import Screen, Screened
from ctrlgen.diagnosis.selection.subset_search import SubsetSearch, Suspect
from ctrlgen.diagnosis.settings import SCREEN
from ctrlgen.effects import Channel, laws
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis, hypotheses, nominal_physics, why_not_offered
from ctrlgen.estimation.noise import estimate_noise
from ctrlgen.estimation.structure import Structure
from ctrlgen.model.assembly import build_model
from ctrlgen.recordings.reader import load_recordings

DRIVE_GAIN = Hypothesis("drive_gain", "actuator:axis", "axis")
SENSOR_GAIN = Hypothesis("sensor_gain", "sensor:axis", "axis")
OFFSET = Hypothesis("home_offset", "sensor:axis", "axis")
BOW = Hypothesis("bow", "sensor:axis", "axis")
FORCE = Hypothesis("drive_offset", "actuator:axis", "axis")
CREEP = Hypothesis("creep", "stage:axis", "axis")


def sets_of(*z: float) -> list[tuple[float, set[str]]]:
    """The sets of candidates whose terms are independent and have these scores."""
    n = len(z)
    columns = [SimpleNamespace(hypothesis=f"h{k}", range=(-100.0, 100.0)) for k in range(n)]
    found = SubsetSearch(
        columns, np.arange(n), np.array(z), np.ones(n), np.ones(n), np.eye(n), lambda column, *_: column.hypothesis
    ).search()
    return [(gain, set(names)) for gain, names in found]


def test_sets_come_in_the_order_of_what_they_explain_and_none_has_one_member():
    """Of independent terms the squares of the scores add up."""
    gains, members = zip(*sets_of(3.0, 4.0, 5.0), strict=True)
    assert gains == pytest.approx((50.0, 41.0, 34.0, 25.0), rel=1e-6)  # the ridge is far below
    assert members == ({"h0", "h1", "h2"}, {"h1", "h2"}, {"h0", "h2"}, {"h0", "h1"})


def test_each_hypothesis_alone_scores_as_it_does_beside_the_others():
    fitter = axis_fitter(lambda t, q, v, memory: (-2e10 * q**3, memory))
    fit = fitter.fit(Structure(AXIS))
    both, alone = (Screen(fitter, [BOW, CREEP, OFFSET]).run(fit, threshold=level) for level in (None, 4.5))
    assert alone.threshold == 4.5 and both.threshold != 4.5 and both.cosine.size and not alone.cosine.size
    rows = [[(s.hypothesis, s.start, s.z, s.index) for s in found.suspects] for found in (alone, both)]
    assert len(rows[0]) == 3 and [r[0] for r in rows[0]] == [r[0] for r in rows[1]]
    for one, other in zip(*rows, strict=True):
        assert one[1] == pytest.approx(other[1]) and one[2:] == pytest.approx(other[2:], rel=1e-9)
    assert alone.amplitude_sd == pytest.approx(both.amplitude_sd)


def test_suspects_look_alike_by_the_cosine_of_what_they_do_to_the_readings():
    """The most similar first; of the opposite sign too, for an amplitude may be negative."""
    cosine = np.eye(5)
    cosine[0, 1:] = cosine[1:, 0] = 0.981, -0.999, 0.979, 0.5
    suspects = tuple(Suspect(Hypothesis(f"h{k}", "stage:axis"), {}, 5.0 - k, 1.0, k) for k in range(5))
    alike = look_alike(Screened(suspects, cosine, lambda: 3.0, {}), suspects[0])
    assert [s.hypothesis.effect for s in alike] == ["h2", "h1"]


@pytest.mark.parametrize(
    "lead, alike, better", [(-10, False, False), (-8, True, False), (8, True, False), (10, True, True)]
)
def test_models_explain_alike_within_three_standard_deviations_of_the_criterion(lead, alike, better):
    """`lead`: of the rival. One that is far ahead is no alternative but takes the other's place."""
    T = {"model": 0.0, "rival": -float(lead)}
    compare = SimpleNamespace(advantage=lambda a, b: T[b] - T[a])
    assert explains_alike(compare, "rival", "model") is alike
    assert explains_better(compare, "rival", "model") is better


def test_of_a_linear_device_the_gain_of_the_drive_hides_the_gain_of_the_sensor():
    """Either scales the reading; the numbers of the device are stated, hence not free to take the gain over."""
    fitter = axis_fitter()
    fit = fitter.fit(Structure(AXIS).with_cause(DRIVE_GAIN, {"gain": 0.0}), steps=3)
    (hidden,) = detectability(fit, Screen(fitter, [SENSOR_GAIN]).run(fit), fit.n).undetectable
    assert hidden.effect == "sensor_gain" and hidden.masked_by == "drive_gain at actuator:axis"


def test_a_gain_of_a_drive_that_is_never_used_affects_no_reading():
    fitter = axis_fitter(u=np.zeros(600))
    fit = fitter.fit(Structure(AXIS))
    (hidden,) = detectability(fit, Screen(fitter, [DRIVE_GAIN]).run(fit), fit.n).undetectable
    assert hidden.effect == "drive_gain" and hidden.masked_by.startswith("nothing")


def test_in_settled_poses_no_lag_is_suspected_however_much_its_rounding_looks_like_what_is_left():
    """A slow heat has spread, and the rounding of that is a slope too; what is in time alone, and at rest a gain at most, is not tried."""
    device = load_device(MESO_FILE)
    recording = load_recordings([SCENARIOS / "nist_hexapod"], build_model(device))
    kinds = "thermal_lag", "drive_gain", "high_pass", "low_pass", "notch", "amplifier_lag", "creep", "log_creep"
    offered = hypotheses(
        device, nominal_physics(device), recording.channels, None, False, tuple(laws()[kind] for kind in kinds)
    )
    offered = [h for h in offered if h.effect != PARAMETER]
    assert {h.effect for h in offered} == {"thermal_lag", "drive_gain"}
    fitter = Fitter(recording, estimate_noise(recording, 0.0))
    fit = fitter.fit(Structure(device), steps=0)
    found = Screen(fitter, offered).run(fit)
    lags = {h for h in offered if h.effect == "thermal_lag"}
    assert set(found.undetectable) >= lags and {s.hypothesis.effect for s in found.suspects} == {"drive_gain"}
    assert "no clock" in why_not_offered(
        laws()["high_pass"], device, nominal_physics(device), recording.channels, None, False
    )


@pytest.mark.parametrize(("share", "seen"), [(0.98, True), (1.02, False)])
def test_a_law_is_suspected_from_so_much_on_that_its_largest_amplitude_moves_the_readings(monkeypatch, share, seen):
    """Of an offset as large as its bound, over the noise of the mean of all readings."""
    fitter = axis_fitter()
    fit = fitter.fit(Structure(AXIS))
    deviation = Screen(fitter, [OFFSET]).run(fit).amplitude_sd[OFFSET.effect, OFFSET.location]
    most = max(map(abs, OFFSET.bounds(OFFSET.law.amplitude(), OFFSET.channel_on(AXIS))))
    monkeypatch.setattr(screen, "SCREEN", replace(SCREEN, least_reach=share * most / deviation))
    found = Screen(fitter, [OFFSET]).run(fit)
    assert [s.hypothesis for s in found.suspects] == [OFFSET] * seen and (OFFSET in found.undetectable) is not seen


def test_a_frequency_ends_where_the_sampling_shows_no_higher_one_and_a_ratio_does_not():
    channel, highest = Channel("axis", "N", 1.0, "m", 1.0), 0.3  # Hz, below the upper bound of the ratio
    hum, late = (Hypothesis(effect, "", "axis", highest=highest) for effect in ("vibration", "second_pole"))
    frequency, share = next(p for p in hum.law.params if p.unit == "Hz"), late.law.amplitude()
    assert hum.bounds(frequency, channel) == (frequency.bounds[0], highest)
    assert share.unit == "1" and late.bounds(share, channel) == share.bounds and share.bounds[1] > highest


def test_a_law_that_cannot_be_evaluated_is_dropped_with_its_reason_and_the_others_stay(monkeypatch):
    def broken(self, s, p):
        raise ValueError("no such place")

    fitter = axis_fitter()
    fit = fitter.fit(Structure(AXIS))
    monkeypatch.setattr(SENSOR_GAIN.law, "term", broken)
    found = Screen(fitter, [SENSOR_GAIN, DRIVE_GAIN]).run(fit)
    assert found.dropped == {SENSOR_GAIN: "no such place"}
    assert [suspect.hypothesis for suspect in found.suspects] == [DRIVE_GAIN]


def test_a_number_is_as_unsure_as_a_law_that_was_not_taken_would_move_it():
    """An offset beside a bow, whose square of the reading has a mean: fitted alone, the offset takes that, and no residual tells it."""
    offset, bow, span = 1e-8, 4e-9, 7.5e-5
    fitter = axis_fitter(change=lambda y, u: y + offset + bow * y**2 / span**2)
    alone = fitter.fit(Structure(AXIS).with_cause(OFFSET, {"offset": offset}))
    screened = Screen(fitter, [BOW]).run(alone)
    (suspect,) = screened.suspects
    assert abs(suspect.z) > 3 * screened.threshold
    both = fitter.fit(alone.restarted.with_cause(BOW, suspect.start))
    path = "effect[0].offset"
    plain, told = (estimated_values(alone, moves=m)[path] for m in (None, screened.moves))
    together = estimated_values(both)[path]
    k = [u.path for u in alone.structure.free_parameters].index(path)
    assert abs(both.theta[k] - alone.theta[k]) == pytest.approx(screened.moves[k], rel=0.02)
    assert not plain.ci95[0] <= together.value <= plain.ci95[1]
    assert told.ci95[0] <= together.value <= told.ci95[1] and told.value == plain.value


def test_a_law_that_is_not_suspected_or_is_the_same_as_a_number_moves_none():
    """Where noise alone is left; and what is an offset but for a hundredth is told as its alternative."""
    fitter = axis_fitter(change=lambda y, u: y + 1e-7)
    fit = fitter.fit(Structure(AXIS).with_cause(OFFSET, {"offset": 1e-7}))
    assert not Screen(fitter, [BOW]).run(fit).moves.any()
    bent = axis_fitter(change=lambda y, u: y + 1e-7 + 4e-8 * y**2 / 7.5e-5**2)
    fit = bent.fit(Structure(AXIS).with_cause(OFFSET, {"offset": 1e-7}))
    assert not Screen(bent, [FORCE]).run(fit).moves.any()
    assert Screen(bent, [FORCE, BOW]).run(fit).moves.any()


@pytest.mark.parametrize("offset", [1e-8, -1e-8])
def test_a_size_that_a_law_would_move_beyond_nothing_stays_one(offset):
    """The cause is there by other evidence; its interval ends short of nothing on that side, and reaches as far as it may on the other."""
    fitter = axis_fitter(change=lambda y, u: y + offset)
    fit = fitter.fit(Structure(AXIS).with_cause(OFFSET, {"offset": offset}))
    k = [u.path for u in fit.structure.free_parameters].index("effect[0].offset")
    moves = np.where(np.arange(len(fit.theta)) == k, 1e-8, 0.0)
    found = estimated_values(fit, moves=moves)["effect[0].offset"]
    ends = sorted((end * fit.theta[k] / found.value for end in found.ci95), key=abs)
    size = fit.theta[k]
    # its own deviation, a hundredth of the move, adds half of the square of that
    assert ends == pytest.approx([size * np.exp(-1.96e-8 / abs(size)), size + np.sign(size) * 1.96e-8], abs=5e-12)
