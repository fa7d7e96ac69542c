"""When a fit begins again, and what it says of a number: at the two sides of each threshold."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from axis_records import AXIS
from conftest import DEVICES
from misfits import noise_of

from ctrlgen import load_device
from ctrlgen.devices.changed_numbers import changed
from ctrlgen.diagnosis.selection import model_selection
from ctrlgen.estimation.error_model import ErrorModel
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.held_out import HeldOutRefit
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.robust_covariance import sandwich_over_model
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Record

N = 1000


class Scripted:
    """A fitter whose fits all leave the same `rms` [noise deviations], as `Fitter.described` sees one."""

    described, with_settled_errors = Fitter.described, Fitter.with_settled_errors

    def __init__(self, rms: float, errors: ErrorModel, starts: list) -> None:
        self.rms, self.error, self.starts = rms, errors, starts
        self.noise = errors.noise

    def fit(self, structure, steps=40, enough=np.inf):
        self.starts.append(structure.nominal_starts)
        return SimpleNamespace(structure=structure, objective=float(N))

    def with_errors_of(self, fit):
        found = ErrorModel(self.noise, np.array([self.rms]), np.ones(1))
        return Scripted(self.rms, found if self.noise.known[0] else self.error, self.starts)


@pytest.mark.parametrize("rms, again", [(100 * (1 - 1e-9), False), (100 * (1 + 1e-9), True)])
@pytest.mark.parametrize("known", [True, False])
def test_a_device_is_fitted_from_several_starts_where_it_is_a_hundred_times_the_noise_off(rms, again, known):
    """And only where the noise is known: a start a stated deviation to either side of each stated number."""
    starts: list[dict] = []
    Scripted(rms, ErrorModel.of_noise(noise_of(known=known)), starts).described(AXIS)
    stated = [u for u in Structure(AXIS).free_parameters if u.sd]
    both = [{u.path: u.nominal + side * u.sd} for u in stated for side in (-1, 1)]
    assert stated and [s for s in starts if s] == (both if again and known else [])


def test_the_errors_of_a_device_are_those_that_it_leaves_itself():
    """Estimated and fitted in turn until they stay."""
    starts: list[dict] = []
    fitter, found = Scripted(50.0, ErrorModel.of_noise(noise_of()), starts).described(AXIS)
    assert fitter.error.rms[0] == 50.0 and found.structure.causes == () and len(starts) == 3


class Unfolding(Scripted):
    """One whose fits each leave a third of what its errors, which outweigh what is known of its numbers, let stay, down to the noise."""

    def with_errors_of(self, fit):
        least, left = self.noise.floor[0], self.error.rms[0] / 3 if self.error.rms[0] else self.rms
        found = ErrorModel(self.noise, np.array([max(left, least)]), np.ones(1))
        return Unfolding(self.rms, found, self.starts)


def test_what_a_device_leaves_is_not_taken_for_its_errors_before_it_is_fitted_to_its_end():
    """A reading of metres in a stiff loop, off by a per cent, hid every cause of a thousandth of that."""
    noise = noise_of()
    fitter, _ = Unfolding(500 * noise.floor[0], ErrorModel.of_noise(noise), []).described(AXIS)
    assert fitter.error.rms[0] == noise.floor[0]


@pytest.mark.parametrize("path", sorted((DEVICES).glob("*.toml")), ids=lambda path: path.stem)
def test_a_number_of_a_device_is_changed_where_it_stands_and_no_other(path):
    device = load_device(path)
    before = dict(device.quantities())
    for name, quantity in list(before.items())[::5]:
        after = dict(changed(device, {name: 1.25 * quantity.si}).quantities())
        assert after[name].si == pytest.approx(1.25 * quantity.si)
        assert {k: q.si for k, q in after.items() if k != name} == {k: q.si for k, q in before.items() if k != name}


def test_a_number_stands_once_in_a_structure_and_a_fringe_as_often_as_there_are_some():
    number = Hypothesis("parameter", "stage:axis", path="mechanics.mass")
    assert number.beside([]) is number and number.beside([number]) is None
    cyclic = Hypothesis("cyclic", "sensor:axis", "axis")
    creep = Hypothesis("creep", "stage:axis", "axis")
    second = cyclic.beside([cyclic])
    assert second.count == 1 and cyclic.beside([cyclic, second]).count == 2 and creep.beside([creep]) is None


@pytest.mark.parametrize("excess, refitted", [(0.0, True), (1e4, False)])
def test_held_out_records_are_predicted_as_fitted_unless_noise_alone_is_left(monkeypatch, excess, refitted):
    """Where noise is left, a number that the records to fit leave open counts neither for a structure nor against it."""
    rng = np.random.default_rng(1)
    y = np.sqrt(1 + excess) * rng.standard_normal((N, 1))
    t = np.arange(N) * 1e-3
    made = [Record(role, role, t, 1e-3, y, y, False, None, np.ones((N, 1), bool)) for role in ("fit", "hold_out")]
    fitter = SimpleNamespace(
        noise=noise_of(), fit_records=made[:1], held_out_records=made[1:], predict=lambda fit, r: np.zeros((N, 1))
    )
    asked = []

    def refit(fitter, fit, steps):
        asked.append(steps)
        return HeldOutRefit(fit, penalty=3.0, log_det=2.0)

    monkeypatch.setattr(model_selection, "refit_to_held_out", refit)
    found = model_selection.scored(fitter, SimpleNamespace())
    assert asked == ([4] if refitted else []) and found.refit_penalty == (5.0 if refitted else 0.0)
    assert found.errors.is_noise == refitted
    assert found.held_out.plain_mean == pytest.approx(np.mean(y**2)) and found.fitted.n_plain.sum() == N


def test_of_a_cause_that_starts_at_nothing_an_amplitude_is_scaled_by_a_millionth_of_its_range_a_shape_by_the_whole():
    """An amplitude is expected small; a phase of zero says nothing of how far the phase may go."""
    hum = Hypothesis("vibration", "disturbance:axis", "axis")
    structure = Structure(AXIS).with_cause(hum, {"amplitude": 0.0, "frequency": 50.0, "phase": 0.0})
    size = {u.path.rpartition(".")[2]: u.size / (u.high - u.low) for u in structure.free_parameters if u.cause == 0}
    (frequency,) = (u for u in structure.free_parameters if u.path.endswith("frequency"))
    assert (size["amplitude"], size["phase"], frequency.size) == pytest.approx((1e-6, 1.0, 50.0))


@pytest.mark.parametrize("scale", [1.0, 1e6])
def test_the_sandwich_of_each_number_is_by_the_record_that_shows_it(scale):
    """Of three records one shows the first number by two channels with white residuals, one the second, each of whose residuals
    stands ten times: sqrt(10) of the deviation by curvature. A hundred blocks or so tell it to some 7 %."""
    n, rng = 4000, np.random.default_rng(2)
    J = np.zeros((4 * n, 2))
    J[: 2 * n, 0], J[3 * n :, 1] = 1.0, scale
    residual = rng.standard_normal(4 * n)
    residual[3 * n :] = np.repeat(residual[3 * n : 3 * n + n // 10], 10)
    ratio = sandwich_over_model(
        SimpleNamespace(J=J, residual=residual, shapes=((n, 2), (n, 1), (n, 1)), theta=np.zeros(2))
    )
    assert ratio == pytest.approx([1.0, np.sqrt(10)], rel=0.3)
