"""Delays and shifts of the clock between samples."""

from __future__ import annotations

import tomllib
from types import SimpleNamespace

import casadi as ca
import numpy as np
import pytest
from conftest import AXIS_FILE
from law_inputs import law_inputs
from written_terms import H

import ctrlgen.effects  # noqa: F401  fills the library
from ctrlgen import build_model, load_device, simulate
from ctrlgen.core.errors import InputError
from ctrlgen.core.files import validate
from ctrlgen.core.units import Quantity
from ctrlgen.devices import Device
from ctrlgen.effects import Effect
from ctrlgen.estimation.hypothesis import Hypothesis
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Record

SHARES = np.array([0.2, 0.5, 0.9, 1.0, 1.7, 2.5, 4.3, 5.0])


def read_late(y, samples: np.ndarray, h: float, slopes: bool) -> np.ndarray:
    """What `delay` makes of the polynomial y at 9 h, for delays of `samples` h."""
    law = Effect.library["delay"]("all", {"delay": Quantity(float(samples.max()) * h, "the longest")})
    memory = {state.name: 0.0 for state in law.kept(h, free=False)}
    for k in range(10):
        rates = {"rate": y.deriv()(k * h), "second_rate": y.deriv(2)(k * h)} if slopes else {}
        s = law_inputs(value=y(k * h), sample_time=h, **rates, **memory)
        memory |= law.update(s, None)
        s = s.with_states(memory)
    return np.array([s.value + float(ca.DM(law.term(s, SimpleNamespace(delay=D * h)))) for D in samples])


def test_a_delay_is_exact_for_polynomials_of_fourth_degree_where_the_motion_gives_slopes(rng):
    y = np.polynomial.Polynomial(rng.uniform(-1, 1, 5))
    assert read_late(y, SHARES, 0.3, True) == pytest.approx(y((9 - SHARES) * 0.3), rel=1e-12)


def test_a_delay_without_slopes_is_exact_for_parabolas_beyond_a_sample_and_lines_within_it(rng):
    y = np.polynomial.Polynomial(rng.uniform(-1, 1, 3))
    older = SHARES[SHARES >= 1]
    assert read_late(y, older, 0.3, False)[1:] == pytest.approx(y((9 - older[1:]) * 0.3), rel=1e-12)
    line = np.polynomial.Polynomial(rng.uniform(-1, 1, 2))
    assert read_late(line, SHARES, 0.3, False) == pytest.approx(line((9 - SHARES) * 0.3), rel=1e-12)


def shifted(drive, tau: float, linear: bool) -> np.ndarray:
    """The drive (n, 1) of a record of 50 samples of 10 ms under an offset of the clocks of `tau` [s]."""
    time = 0.3 + H * np.arange(50)
    u, y = drive(time)[:, None], np.zeros((50, 1))
    given = Record("fit", "fit", time, H, u, y, linear, None, np.ones(y.shape, bool))
    simulator = Simulator(load_device(AXIS_FILE), (), ("reading.axis",), H, linear)
    assert simulator.aligned(given, np.zeros(0)) is given
    clocks = Hypothesis("clock_offset", "sensor:axis", "axis")
    stated = Structure(load_device(AXIS_FILE)).with_cause(clocks, {"offset": tau}).device_with_causes
    found = Simulator(stated, (), ("reading.axis",), H, linear).aligned(given, np.zeros(0)).drive
    free = Simulator(stated, ("effect[0].offset",), ("reading.axis",), H, linear)
    assert free.aligned(given, np.array([tau])).drive == pytest.approx(found, rel=1e-12)
    return found[:, 0]


@pytest.mark.parametrize("tau", [0.0047, 0.02, 0.033])
def test_clocks_that_do_not_agree_shift_the_drive(tau, rng):
    """Exact for a cubic of a drive that is linear between samples, and for the mean over a sample of one that is held."""
    cubic, line = (np.polynomial.Polynomial(rng.uniform(-1, 1, k)) for k in (4, 2))
    at = 0.3 + H * np.arange(50) + tau
    inside = (at >= 0.3) & (at <= 0.3 + 49 * H)
    assert shifted(cubic, tau, True)[inside] == pytest.approx(cubic(at)[inside], rel=1e-9)
    assert shifted(line, tau, False)[inside] == pytest.approx(line(at)[inside], rel=1e-12)
    beyond = shifted(line, tau, False)[~inside]
    assert beyond == pytest.approx(np.full(len(beyond), line(0.3 + 49 * H)))


@pytest.mark.parametrize("samples, states", [(0.3, 6), (1.0, 6), (5.2, 21), (60.0, 183)])
def test_a_delay_keeps_as_many_samples_as_it_takes(samples, states):
    late = Effect.library["delay"]("all", {"delay": Quantity(samples * H, "")})
    assert len(late.kept(H, free=False)) == states
    assert len(late.kept(H, free=True)) >= 2 * states  # a fit may double it
    assert len(late.kept(None, free=True)) == len(late.kept(float("inf"), free=True)) == 15


def test_a_delay_of_more_samples_than_a_model_can_keep_is_refused_at_once():
    table = tomllib.loads(AXIS_FILE.read_text()) | {"effect": [{"kind": "delay", "at": "axis", "delay": "1000 s"}]}
    late = validate(Device.library["axis"], table, "late.toml")
    with pytest.raises(
        InputError, match=r"1000 s is 1000000 samples of 0.001 s.* write 1 s or less, or sample every 1 s"
    ):
        build_model(late, sample_time=1e-3)
    assert build_model(late, sample_time=100.0).x.numel() >= 3 * 10
    assert build_model(late, sample_time=1e-3, apart=(0,)).x.numel() < 3


def test_a_plant_whose_reading_is_late_by_forty_samples_is_what_it_was_forty_samples_ago():
    """Sample by sample, as the C has it."""
    table = tomllib.loads(AXIS_FILE.read_text())
    late = table | {"effect": [{"kind": "delay", "at": "axis", "delay": "400 ms"}]}
    time = H * np.arange(150)
    drive = np.sin(2 * np.pi * 3 * time)[:, None]
    plain, delayed = (
        build_model(validate(Device.library["axis"], each, "axis.toml"), sample_time=H) for each in (table, late)
    )
    assert delayed.x.numel() == plain.x.numel() + 3 * 41
    at, seen = (simulate(model, drive, H).signals["reading"][:, 0] for model in (plain, delayed))
    assert seen[40:] == pytest.approx(at[: len(at) - 40], rel=1e-9, abs=1e-12)
