"""A law that is found is tried in a finer form, with more numbers, where it leaves more than noise: hysteresis with free weights,
friction in a region that falls with the speed, slots with a second harmonic, play that is worn, a sharper knee."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest
from axis_records import AXIS, H, move, record
from axis_records import NOISE as READ
from conftest import AXIS_FILE, ROOT
from play_records import NOISE, SERVO, N, lagging, moved
from recovery import fitter_of

from ctrlgen import build_model, load_device
from ctrlgen.core.errors import InputError
from ctrlgen.core.files import validate
from ctrlgen.devices import Device
from ctrlgen.diagnosis.selection.finer_forms import can_have, finer_forms
from ctrlgen.diagnosis.selection.model_selection import ModelSelection
from ctrlgen.diagnosis.selection.rivals import simplified
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.diagnosis.selection.search import Searcher
from ctrlgen.diagnosis.selection.trials import Trials
from ctrlgen.diagnosis.settings import SEARCH
from ctrlgen.effects import Effect, Place
from ctrlgen.estimation.device_with_causes import device_with_causes
from ctrlgen.estimation.error_model import ErrorModel
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis, hypotheses, nominal_physics
from ctrlgen.estimation.noise import Noise, NoiseSource
from ctrlgen.estimation.priors import prior_of
from ctrlgen.estimation.structure import Structure
from ctrlgen.model.effect_terms import channels

OFFERED = [Hypothesis(kind, "stage:axis", "axis") for kind in ("displacement_hysteresis", "backlash", "creep")]
TWO_GROUPS = np.r_[np.linspace(1e-6, 3e-6, 80), np.linspace(2e-5, 3e-5, 20)]  # half widths of plays of equal weight [m]
EVEN = np.linspace(1e-7, 2e-5, 200)


def found(radii: np.ndarray):
    device = validate(Device.library["servo"], SERVO, "device")
    rng, parts = np.random.default_rng(1), []
    for seed, role in ((2, "fit"), (4, "hold_out")):
        u = moved(seed)
        parts.append(record(u, lagging(u, radii) + NOISE * rng.standard_normal(N), role, h=H))
    fitter = fitter_of(device, ("reading.axis",), ("um",), (NOISE,), "series", parts)
    return Searcher(fitter, Screen(fitter, OFFERED), lambda _: None).run(device).chosen


def rubbing(u: np.ndarray, breakaway: float) -> np.ndarray:
    """From 0.3 s on LuGre's bristles, without damping of their own: 0.2 N at speed, more below about 1 mm/s."""

    def force(time, q, v, memory):
        z, before = memory or (0.0, 0.0)
        step, level = q - before, 1 + (breakaway - 1) * np.exp(-((v / 1e-3) ** 2))
        z += (step - abs(step) * z / level) / 1e-6
        return -0.2 * z * (time > 0.3), (z, q)

    return move(u, force, fine=40)


def friction_found(breakaway: float, plain_kind: str = "coulomb_after"):
    """The candidate of the plain law, and that of its finer form beside it."""
    n, parts, rng = 600, [], np.random.default_rng(1)
    for k, role in enumerate(("fit", "hold_out")):
        t = H * np.arange(n)
        u = 0.5 * np.sin(2 * np.pi * (3 + k) * t) + 0.3 * np.sin(2 * np.pi * (7.3 - k) * t + 1)
        parts.append(record(u, rubbing(u, breakaway) + READ * rng.standard_normal(n), role))
    fitter = fitter_of(AXIS, ("reading.axis",), ("um",), (READ,), "series", parts)
    plain = Hypothesis(plain_kind, "stage:axis", "axis")
    trials = Trials(fitter, Screen(fitter, [plain]), lambda _: None)
    nominal = trials.fit(Structure(AXIS))
    trials.screened(nominal)
    begun = {"force": 0.2, "reach": 1e-6, "smoothing": 1e-5, "moment": 0.3, "rise": 2e-3}
    found = trials.fit(Structure(AXIS).with_cause(plain, begun), plain, steps=40)
    trials.use(fitter.with_errors_of(found.fit))
    found = trials.fit(found.fit.restarted, plain, steps=40)
    return trials, found, finer_forms(trials, found)


@pytest.mark.long
def test_friction_that_sticks_from_a_moment_on_falls_with_the_speed(monkeypatch):
    asked, tried = [], Trials.tried
    with monkeypatch.context() as m:
        m.setattr(Trials, "tried", lambda self, *a, **k: asked.append(k.get("enough")) or tried(self, *a, **k))
        trials, plain, (finer,) = friction_found(2.0)
    assert asked[0] == plain.fit.objective  # what leaves more than the plain form is not fitted to its end
    assert [c.effect for c in finer.causes] == ["stribeck_after"] and trials.selection.improves_enough(plain, finer)
    values = finer.fit.values(0)
    assert values["breakaway"] == pytest.approx(2.0, rel=0.05) and values["force"] == pytest.approx(0.2, rel=0.05)
    assert values["speed"] == pytest.approx(1e-3, rel=0.1) and values["moment"] == pytest.approx(0.3, abs=H)
    # the numbers of its own are begun at several values: nothing of the plain law tells them
    assert simplified(trials, finer).causes == finer.causes
    # where no further cause could be trusted beside the error of the plain form, a better form takes that away
    searcher = Searcher(trials.fitter, trials.screen, lambda _: None)
    searcher.trials, trials.markings = trials, SEARCH.most_markings
    monkeypatch.setattr(ModelSelection, "residual_within_model_form_error", lambda *_: True)
    assert [c.effect for c in searcher.forward_rounds(plain, []).causes] == ["stribeck_after"]


@pytest.mark.long
def test_friction_alike_at_every_speed_keeps_the_plain_law():
    trials, plain, finer = friction_found(1.0)
    assert not any(trials.selection.improves_enough(plain, t) for t in finer)
    for t in finer:
        assert [c.effect for c in simplified(trials, t).causes] == ["coulomb_after"]


def reached(plain_kind: str, shape: dict[str, float], reading: Callable[[np.ndarray], np.ndarray]):
    """The candidate of the plain law, the finer form beside it, and the trials; `shape` is where the plain law is fitted from."""
    rng, parts, n = np.random.default_rng(1), [], 500
    for k, role in enumerate(("fit", "hold_out")):
        t = H * np.arange(n)
        u = 0.7 * np.sin(2 * np.pi * (3 + k) * t) + 0.3 * np.sin(2 * np.pi * (7.3 - k) * t + 1)
        parts.append(record(u, reading(u) + READ * rng.standard_normal(n), role))
    fitter = fitter_of(AXIS, ("reading.axis",), ("um",), (READ,), "series", parts)
    plain = Hypothesis(plain_kind, "stage:axis", "axis")
    trials = Trials(fitter, Screen(fitter, [plain]), lambda _: None)
    trials.screened(trials.fit(Structure(AXIS)))
    found = trials.fit(Structure(AXIS).with_cause(plain, shape), plain, steps=40)
    trials.use(fitter.with_errors_of(found.fit))
    found = trials.fit(found.fit.restarted, plain, steps=40)
    return trials, found, finer_forms(trials, found)


def slotted(second: float) -> Callable[[np.ndarray], np.ndarray]:
    """0.1 N every 25 um, and a second harmonic that is a quarter of its own period ahead."""

    def force(time, q, v, memory):
        p = 2 * np.pi * (q + v * H / 80) / 2.5e-5 + 0.7
        return -0.1 * (np.sin(p) + second * np.sin(2 * p + 0.6)), memory

    return lambda u: move(u, force, fine=40)


def worn(wear: float) -> Callable[[np.ndarray], np.ndarray]:
    """A play of 0.4 um at home whose width grows along the way, by `wear` of it in 50 um."""

    def read(u: np.ndarray) -> np.ndarray:
        q = move(u, fine=40)
        half, w, out = 2e-7 * (1 + wear * q / 5e-5), 0.0, []
        for place, h in zip(q.tolist(), half.tolist(), strict=True):
            w = min(max(w, place - h), place + h)
            out.append(w)
        return np.array(out)

    return read


def test_slots_that_are_no_sine_and_play_that_is_worn_have_a_form_of_their_own():
    slots = {"force": 0.1, "period": 2.5e-5, "phase": 0.7}
    trials, plain, (finer,) = reached("cogging", slots, slotted(0.15))
    assert [c.effect for c in finer.causes] == ["cogging_of_slots"] and trials.selection.improves_enough(plain, finer)
    values = finer.fit.values(0)
    assert values["force"] == pytest.approx(0.1, rel=0.02) and values["period"] == pytest.approx(2.5e-5, rel=1e-3)
    second = values["sine"] + 1j * values["cosine"]
    assert abs(second) == pytest.approx(0.15, rel=0.05) and np.angle(second) == pytest.approx(0.6, abs=0.1)
    assert simplified(trials, finer).causes == finer.causes
    trials, plain, (finer,) = reached("backlash", {"gap": 4e-7}, worn(0.4))
    assert [c.effect for c in finer.causes] == ["worn_backlash"] and trials.selection.improves_enough(plain, finer)
    values = finer.fit.values(0)
    assert values["gap"] == pytest.approx(4e-7, rel=0.02)
    # the slope at home of a form that levels off
    assert values["wear"] / values["spread"] == pytest.approx(0.4 / 5e-5, rel=0.3)
    assert simplified(trials, finer).causes == finer.causes


def kneed(n: float) -> Callable[[np.ndarray], np.ndarray]:
    """F = -k z, dz = dd (1 - (0.8 sgn(dd z) + 0.2)|z/10 um|^n), k = 2e4 N/m, in forty steps a sample."""

    def force(time, q, v, memory):
        z, before = memory or (0.0, 0.0)
        step = q - before
        z += step * (1 - (0.8 * np.sign(step * z) + 0.2) * abs(z / 1e-5) ** n)
        return -2e4 * z, (z, q)

    return lambda u: move(u, force, fine=40)


@pytest.mark.long
def test_a_knee_that_is_no_exponential_has_a_form_of_its_own():
    loop = {"stiffness": 2e4, "reach": 1e-5, "loop": 0.8}
    trials, plain, (finer,) = reached("bouc_wen", loop, kneed(2.0))
    assert [c.effect for c in finer.causes] == ["bouc_wen_of_power"] and trials.selection.improves_enough(plain, finer)
    assert finer.fit.values(0) == pytest.approx(loop | {"power": 2.0}, rel=0.05)
    assert simplified(trials, finer).causes == finer.causes


def creeping(power: float) -> Callable[[np.ndarray], np.ndarray]:
    """Behind each step of the stage a strain that grows by `power` of time: 5 % after a second, by its answer to a step."""
    return lambda u: (
        (y := move(u)) + np.convolve(np.diff(y, prepend=0.0), 0.05 * (H * np.arange(len(y))) ** power)[: len(y)]
    )


@pytest.mark.long
def test_a_creep_by_a_power_of_time_has_a_form_of_its_own():
    trials, plain, (finer,) = reached("log_creep", {"gain": 0.02, "tau": 0.01, "decades": 6.0}, creeping(1 / 3))
    assert [c.effect for c in finer.causes] == ["power_creep"] and trials.selection.improves_enough(plain, finer)
    assert finer.fit.values(0)["exponent"] == pytest.approx(1 / 3, rel=0.1)
    assert simplified(trials, finer).causes == finer.causes


@pytest.mark.parametrize("source, tried", [(NoiseSource.MISFIT, True), (NoiseSource.STATED, False)])
def test_where_what_is_left_alone_tells_the_noise_finer_forms_are_tried(source, tried):
    """Then nothing is left beyond it, and a play beside a hysteresis would be the only form that is."""
    noise = Noise(np.array([READ]), (np.zeros(0),), (source,), (), np.array([0]))
    structure = Structure(AXIS).with_cause(Hypothesis("bouc_wen", "stage:axis", "axis"), {"stiffness": 2e4})
    current = SimpleNamespace(
        errors=ErrorModel.of_noise(noise), causes=structure.causes, fit=SimpleNamespace(restarted=structure)
    )
    forms = []

    def each(one, found, told):
        forms.extend(found)
        return []

    current.fit.values, current.fit.objective = (lambda k: {}), 1.0
    fitter = SimpleNamespace(noise=noise, recording=SimpleNamespace(channels=("reading.axis",)))
    finer_forms(SimpleNamespace(fitter=fitter, each=each), current)
    assert [finer.effect for _, finer in forms] == (["bouc_wen_of_power"] if tried else [])


def test_a_finer_form_acts_where_the_plain_law_does():
    refined = [(law, Effect.library[plain]) for law in Effect.library.values() for plain in prior_of(law).refines]
    assert len(refined) > 10
    for law, plain in refined:
        assert (law.place, prior_of(law).domain) == (plain.place, prior_of(plain).domain)
    for plain in ("displacement_hysteresis", "asymmetric_displacement_hysteresis"):
        finer = Hypothesis(plain, "stage:axis", "axis").finer
        assert finer == (Hypothesis("weighted_displacement_hysteresis", "stage:axis", "axis"),)


def test_a_finer_form_need_not_be_worth_a_name_which_a_further_cause_must():
    plain, finer, other = (
        Hypothesis(kind, "stage:axis", "axis") for kind in ("bouc_wen", "bouc_wen_of_power", "creep")
    )

    def candidate(*causes: Hypothesis, left: float) -> SimpleNamespace:
        return SimpleNamespace(causes=causes, held_out=SimpleNamespace(plain_mean=np.array([left])))

    noise = SimpleNamespace(noise=SimpleNamespace(floor=np.array([1e-9])))
    compare = ModelSelection(noise, lambda *_: [], np.array([1e-14]))
    compare.takes_much = lambda before, after: False
    before = candidate(plain, left=16.0)  # of the noise's squares, where the device as described leaves 1e4
    assert compare.matters(before, candidate(finer, left=9.0))
    for causes in ((other,), (plain, other), (finer, other), ()):
        assert not compare.matters(before, candidate(*causes, left=9.0))


@pytest.mark.long
def test_a_sine_an_even_play_and_an_exponential_knee_keep_the_plain_law():
    slots = {"force": 0.1, "period": 2.5e-5, "phase": 0.7}
    for kind, shape, reading in (
        ("cogging", slots, slotted(0.0)),
        ("backlash", {"gap": 4e-7}, worn(0.0)),
        ("bouc_wen", {"stiffness": 2e4, "reach": 1e-5, "loop": 0.8}, kneed(1.0)),
    ):
        trials, plain, finer = reached(kind, shape, reading)
        assert not any(trials.selection.improves_enough(plain, t) for t in finer)
        for t in finer:
            assert [c.effect for c in simplified(trials, t).causes] == [kind]


@pytest.mark.long
def test_two_groups_of_plays_are_one_hysteresis_and_nothing_beside_it():
    chosen = found(TWO_GROUPS)
    assert [c.effect for c in chosen.causes] == ["weighted_displacement_hysteresis"]
    values = chosen.fit.values(0)
    parts, left, narrow = [values[f"part{j}"] for j in range(1, 8)], 1.0, 0.0
    for j, part in enumerate([*parts, 1.0], 1):
        if values["reach"] * (j / 8) ** 2 < 8e-6:
            narrow += part * left
        left *= 1 - part
    assert values["share"] * narrow == pytest.approx(0.12, rel=0.1)  # a hundred widths by eight
    assert np.sqrt(chosen.held_out.plain_mean[0]) < 2  # of the noise, for the same reason; 9 with the plain law


@pytest.mark.long
def test_plays_of_even_weights_keep_the_plain_law():
    assert [c.effect for c in found(EVEN).causes] == ["displacement_hysteresis"]


DEVICES = [AXIS_FILE, *sorted(ROOT.glob("scenarios/devices/*.toml")), *sorted(ROOT.glob("scenarios/*/device.toml"))]


@pytest.mark.parametrize("file", DEVICES, ids=["/".join(file.parts[-2:]) for file in DEVICES])
def test_a_finer_form_is_tried_on_devices_that_can_have_it_alone(file):
    """Of every law that a device of settled poses is offered: a model is made in which all numbers of the forms that are tried act, and of
    the others none."""
    device = load_device(file)
    physics = nominal_physics(device)
    readings = tuple(f"reading.{c.name}" for c in channels(physics, Place.SENSOR))
    kinds = {h.effect: h for h in hypotheses(device, physics, readings, None, False) if h.effect != PARAMETER}
    for finer in (f for h in kinds.values() for f in h.finer):
        channel = finer.channel_on(device)
        numbers = {p.name: channel.si(p.bounds[1] / 2, p) for p in finer.law.params}
        stated = device_with_causes(device, (finer,), (numbers,))
        paths = [f"effect[{len(device.effect)}].{name}" for name in numbers]
        if can_have(device, finer):
            assert set(paths) <= set(build_model(stated, paths).moved_by)
        else:
            with pytest.raises(InputError, match="does not fit this device"):
                build_model(stated, paths)
