"""A fit depends on its arguments alone: whatever was fitted or simulated before changes no bit of it."""

from __future__ import annotations

import pickle
from dataclasses import replace
from itertools import product

import casadi as ca
import numpy as np
import pytest
from axis_records import AXIS, BACKLASH, H, axis_fitter
from conftest import AXIS_FILE, DEVICE, SCENARIOS

from ctrlgen import build_model, load_device, user_device
from ctrlgen.devices.changed_numbers import changed
from ctrlgen.estimation.hypothesis import PARAMETER, Hypothesis, nominal_physics
from ctrlgen.estimation.simulator import compiled_simulator
from ctrlgen.estimation.structure import Structure
from ctrlgen.recordings.recording import Record, Timing

HEXAPOD = load_device(DEVICE)
CREEP = Hypothesis("creep", "stage:axis", "axis")
MASS = Hypothesis(PARAMETER, "stage:mass", path="mechanics.mass")
STIFFER = Hypothesis("stiffening", "stage:axis", "axis")
CAUSES = {  # with two starting values each, far apart
    (): [(), ()],
    (BACKLASH,): [({"gap": 2e-8},), ({"gap": 8e-8},)],
    (MASS,): [({"value": 0.4},), ({"value": 0.7},)],
    (CREEP,): [({"gain": 0.1, "tau": tau, "slow": 0.1},) for tau in (0.02, 2.0)],
    (STIFFER, MASS): [({"k3": k3}, {"value": 0.5}) for k3 in (1e12, 3e13)],
}


def structures() -> list[Structure]:
    """Two devices with every set of causes from either start."""
    devices = (AXIS, changed(AXIS, {"mechanics.stiffness": 0.97 * 2e5}))
    return [Structure(d, causes, start) for d, (causes, starts) in product(devices, CAUSES.items()) for start in starts]


def alone(fitter, structure: Structure, steps: int) -> list[np.ndarray]:
    """What a structure reads as it begins, where its fit ends in so many steps, what that leaves, and what it foresees."""
    record = fitter.fit_records[0]
    read = fitter.simulator(structure, record).simulate(record, structure.start)
    fit = fitter.fit(structure, steps=steps)
    return [read, fit.theta, fit.residual, fit.J, fitter.predict(fit, fitter.held_out_records[0])]


@pytest.mark.long
def test_any_order_of_any_fits_gives_the_same_bits():
    fitter, every = axis_fitter(n=150), structures()
    wanted = {}
    for k, s in enumerate(every):
        compiled_simulator.cache_clear()
        wanted[k] = alone(fitter, s, steps=1)
    for seed in range(3):
        compiled_simulator.cache_clear()
        for k in np.random.default_rng(seed).permutation(len(every)):
            assert all(map(np.array_equal, alone(fitter, every[k], steps=1), wanted[k])), every[k]


def test_where_a_fit_begins_changes_nothing_that_a_simulator_is_expanded_about():
    """Begun elsewhere, a structure is the same model: a fit of no step from the same numbers leaves the same."""
    fitter = axis_fitter(n=150)
    structure = Structure(AXIS).with_cause(MASS, {"value": 0.4})
    elsewhere = structure.restarted(0, {"value": 0.7})
    theta = structure.start
    assert elsewhere.start[-1] == 0.7 and structure.expanded_at == elsewhere.expanded_at
    first, second = (fitter.fit(s, theta, steps=0) for s in (structure, elsewhere))
    assert np.array_equal(first.residual, second.residual)
    # expanded about 0.7 kg the steps of the integrator are others
    third = fitter.fit(replace(elsewhere, expansion=None), theta, steps=0)
    assert not np.array_equal(first.residual, third.residual)


def test_a_device_with_another_modulus_reads_otherwise():
    """Young's modulus of the beams 3 % lower, after the first device was simulated by the same fitter."""
    softer = changed(HEXAPOD, {"actuator.young": 0.97 * 130e9})
    channels = tuple(f"reading.{name}" for name in build_model(HEXAPOD).signals["reading"].channels)
    t = H * np.arange(40)
    u = 0.3 * np.ones((len(t), 6)) * np.array([1.0, 0.5, 0.0, 0.2, 0.0, 0.7])
    record = Record("fit", "fit", t, H, u, np.zeros((len(t), 6)), False, None, np.ones((len(t), 6), bool))
    first, second = (Structure(d).simulator(channels, record.timing) for d in (HEXAPOD, softer))
    y, other = (s.simulate(record, Structure(d).start) for s, d in ((first, HEXAPOD), (second, softer)))
    fresh = compiled_simulator.__wrapped__(softer, first.free, channels, record.timing)
    assert np.array_equal(other, fresh.simulate(record, Structure(softer).start))
    assert np.sqrt(np.mean((other - y)[:, 3:] ** 2)) > 100e-9


def test_a_simulator_is_found_by_the_value_of_each_of_its_arguments():
    given = {"device": AXIS, "free": (), "channels": ("reading.axis",), "timing": Timing(H)}
    first = compiled_simulator(*given.values())
    assert compiled_simulator(*(given | {"device": load_device(AXIS_FILE)}).values()) is first
    for other in (
        {"device": changed(AXIS, {"mechanics.mass": 0.51})},
        {"free": ("mechanics.mass",)},
        {"channels": ("displacement.axis",)},
        {"timing": Timing(H, linear=True)},
    ):
        assert compiled_simulator(*(given | other).values()) is not first


def test_devices_and_effects_are_equal_by_value():
    start = {"gap": 5e-8}
    first, again = (Structure(load_device(AXIS_FILE)).with_cause(BACKLASH, start).expanded_device for _ in range(2))
    other = Structure(AXIS).with_cause(BACKLASH, {"gap": 6e-8}).expanded_device
    assert first == again and hash(first) == hash(again) and first != other


def push(u, p):
    """The force [N] of a piezo under u [V]."""
    return p.gain * u.piezo


def pull(d, p):
    """The force [N] of a flexure at d [m]."""
    return p.k * d.flexure


def test_a_device_in_python_is_equal_to_what_another_process_gets_of_it():
    """Its class is made anew there."""
    words = {"drive": {"piezo": "100 V"}, "axes": {"flexure": "25 um"}, "force": push, "restoring_force": pull}
    device = user_device("lever", parameters={"k": "2 N/um", "gain": "0.5 N/V"}, **words)
    sent = pickle.loads(pickle.dumps(device))
    assert type(sent) is not type(device) and sent == device and hash(sent) == hash(device)
    assert changed(device, {"mechanism.k": 1e6}) != device
    u, d, p = ca.SX.sym("u"), ca.SX.sym("d"), ca.SX.sym("p", 2)
    laws = {
        "force": ca.Function("F", [u, p], [p[1] * u], ["u", "p"], ["F"]),
        "restoring_force": ca.Function("R", [d, p], [p[0] * d], ["d", "p"], ["R"]),
    }
    of_functions = user_device("lever", parameters={"k": "2 N/um", "gain": "0.5 N/V"}, **words | laws)
    one, other = (pickle.loads(pickle.dumps(of_functions)) for _ in range(2))
    assert one == of_functions == other == one and nominal_physics(one) is nominal_physics(other)
    again = user_device("lever", parameters={"k": "2 N/um", "gain": "0.5 N/V"}, **words)
    assert again != device, "what a function reads may have changed between two calls"


def test_a_copy_of_a_mechanism_depends_on_its_arguments_alone():
    """Typical sizes stay those of the device that the file describes, all else is that of the copy, whatever was asked for before."""
    fresh, asked = (load_device(SCENARIOS / "devices" / "parallelogram.toml") for _ in range(2))
    sizes = asked.channel_scale, asked.reading_scale, asked.size
    other = {"actuator[0].travel": 1.25 * asked.placed_actuators[0].section.travel.si}
    copies = [changed(device, other) for device in (fresh, asked)]
    assert copies[0] == copies[1] and copies[0] != asked
    for copy in copies:
        assert (copy.channel_scale, copy.reading_scale, copy.size) == sizes
        assert copy.placed_actuators[0].section.travel.si == pytest.approx(other["actuator[0].travel"])
    written = type(asked).model_validate({key: getattr(copies[0], key) for key in type(asked).model_fields})
    assert written != copies[0] and written.channel_scale != copies[0].channel_scale
