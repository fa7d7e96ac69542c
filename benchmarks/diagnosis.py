"""Diagnosis: the screen of 60 s of six channels, and whole diagnoses of 20 000 samples: of an axis beside its peers, and the goals."""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np
from threadpoolctl import threadpool_limits

from battery.laws import simulate
from battery.opponents import RUNNERS
from battery.plant_axis import Axis, Planted
from benchmarks.goals import goals
from benchmarks.measure import Line, Note, interleave, peak_memory, timed
from benchmarks.samples import SCENARIO, Disagreement
from ctrlgen import build_model, diagnose, load_device
from ctrlgen.diagnosis.selection.screen import Screen
from ctrlgen.estimation.fit import Fitter
from ctrlgen.estimation.hypothesis import PARAMETER, hypotheses, nominal_physics
from ctrlgen.estimation.noise import Noise, NoiseSource
from ctrlgen.estimation.simulator import Simulator, compiled_simulator
from ctrlgen.estimation.structure import Structure
from ctrlgen.model.assembly import movable
from ctrlgen.recordings.recording import Record, Recording

DEVICES = SCENARIO.parent / "devices"
H, LONG, AXIS_SAMPLES = 1e-3, 60_000, 20_000
SCREEN_AIM, DIAGNOSIS_AIM, MEMORY_AIM = 30.0, 60.0, 2048.0  # s, s, MB


def run(repeat: int) -> list[Line | Note]:
    """Seconds of a screen and of a diagnosis, and the largest memory of both."""
    found = [*_screen(repeat), *_axis(repeat)]
    peak = peak_memory()
    return [*found, Note(f"diagnosis: peak memory {peak:.0f} MB (aim: < {MEMORY_AIM:.0f} MB)"), *goals()]


def _screen(repeat: int) -> list[Line | Note]:
    """The library at all places of the MEMS hexapod, with a stage that yields by 5 % of its travel with time."""
    device = load_device(DEVICES / "mems_hexapod.toml")
    model = build_model(device)
    channels = tuple(f"reading.{name}" for name in model.signals["reading"].channels)
    physics = nominal_physics(device)
    open_ = [
        h for h in hypotheses(device, physics, channels, H, False) if h.effect != PARAMETER or h.path in movable(device)
    ]
    creep = next(h for h in open_ if (h.effect, h.at) == ("creep", "1X"))
    plant = Structure(device).with_cause(creep, {"gain": 0.05, "tau": 5.0, "slow": 0.0}).device_with_causes
    t = H * np.arange(LONG)[:, None]
    slow, fast = 0.3 + 0.07 * np.arange(6), 7.0 + 1.3 * np.arange(6)
    u = model.u_scale * (0.4 + 0.15 * np.sin(2 * np.pi * slow * t) + 0.06 * np.sin(2 * np.pi * fast * t))
    blank = Record("fit", "fit", t[:, 0], H, u, np.zeros((LONG, 6)), False, None, np.ones((LONG, 6), bool))
    y = Simulator(plant, (), channels, H, False).simulate(blank, np.zeros(0))
    sd = np.ptp(y, axis=0) / 1000
    noisy = y + sd * np.random.default_rng(1).standard_normal(y.shape)
    record = Record("fit", "fit", t[:, 0], H, u, noisy, False, None, blank.valid)
    units = ("rad",) * 3 + ("m",) * 3
    recording = Recording("bench", device.name, "series", channels, units, (None,) * 6, (record,), ())
    fitter = Fitter(recording, Noise(sd, (np.zeros(0),) * 6, (NoiseSource.STATED,) * 6, ("",) * 6, np.full(6, np.inf)))
    fit = fitter.fit(Structure(device))
    columns: list[int] = []

    def ours() -> None:
        compiled_simulator.cache_clear()
        with threadpool_limits(1):  # as `diagnose` does
            screened = Screen(fitter, open_).run(fit)
        if not any(s.hypothesis == creep for s in screened.suspects[:5]):
            raise Disagreement(f"the screen does not suspect {creep.effect} at {creep.location}")
        columns.append(len(screened.cosine))

    nominal = Simulator(device, (), channels, H, False)
    seconds = interleave({"ours": timed(ours), "peer": timed(lambda: nominal.simulate(record, np.zeros(0)))}, repeat)
    each = [s * columns[0] for s in seconds["peer"]]
    what = f"screen, hexapod, {LONG} samples x 6, {columns[0]} columns"
    return [Line(what, seconds["ours"], "a simulation a column", each, SCREEN_AIM)]


def _axis(repeat: int) -> list[Line | Note]:
    """An axis with a cubic spring of the battery's own plant, one record to fit and one held out."""
    device = load_device(DEVICES / "flexure_axis.toml")
    axis = Axis(0.5, 30.0, 2e5, 10.0, 1e-4, 3.0)
    law = Planted("stiffening", 2e4, {"scale": 6e-5, "quintic": 0.0})
    t, rng, noise = H * np.arange(AXIS_SAMPLES), np.random.default_rng(2), 5e-9
    records, series = [], {}
    for role, slow, fast in (("fit", 2.3, 13.1), ("hold_out", 1.7, 9.7)):
        u = 1.4 * np.sin(2 * np.pi * slow * t) + 0.3 * np.sin(2 * np.pi * fast * t + 1)
        y = simulate(axis, u, [law], noise=noise * rng.standard_normal(AXIS_SAMPLES))
        valid = np.ones((AXIS_SAMPLES, 1), bool)
        records.append(Record(role, role, t, H, u[:, None], y[:, None], False, None, valid))
        series[role] = (u, y * 1e6)
    recording = Recording("bench", device.name, "series", ("reading.axis",), ("um",), (noise,), tuple(records), ())

    def ours() -> None:
        found = diagnose(device, recording)
        if [c.effect for c in found.search.chosen.fit.structure.causes] != ["stiffening"]:
            raise Disagreement(f"the diagnosis says {found.verdict}, not stiffening alone")

    contenders, results = {"ours": timed(ours)}, []
    for name, (package, runner) in RUNNERS.items():
        if package and not find_spec(package):
            results.append(Note(f"{name} did not run: pip install 'ctrlgen[opponents]'"))
        else:
            contenders[name] = timed(lambda runner=runner: runner(axis, series, False))
    seconds = interleave(contenders, repeat)
    what = f"diagnosis, axis, 2 x {AXIS_SAMPLES} samples, one effect"
    return [*results, *(Line(what, seconds["ours"], n, s, DIAGNOSIS_AIM) for n, s in seconds.items() if n != "ours")]
