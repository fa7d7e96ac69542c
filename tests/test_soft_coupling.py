"""A load behind a soft coupling of a servo: found with its frequency and its damping, from the drive and the reading of the load."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from axis_records import record
from scipy.signal import lsim

from ctrlgen.core.files import validate
from ctrlgen.devices import Device
from ctrlgen.diagnosis.diagnose import diagnose_recording
from ctrlgen.estimation.hypothesis import hypotheses, nominal_physics
from ctrlgen.recordings.recording import Recording

H, NOISE = 2e-3, 5e-7
SERVO = {"kind": "servo", "name": "table", "title": "a table", "source": "round numbers", "travel": "40 mm"}
TABLE = validate(Device.library["servo"], SERVO, "device")
LAWS = ("soft_coupling", "low_pass", "delay", "drift", "vibration", "notch", "amplifier_lag", "cyclic", "home_offset")


def followed(u, frequency, damping):
    """The load (n,) [m] on a spring that follows `u`, linear between samples, at rest where that begins: exact."""
    w = 2 * np.pi * frequency
    return lsim(([w**2], [1, 2 * damping * w, w**2]), u, H * np.arange(len(u)))[1]


def recorded(frequency, damping, n=1500):
    rng, parts = np.random.default_rng(2), []
    for k, role in enumerate(("fit", "hold_out")):
        t = H * np.arange(n)
        u = 4e-3 * np.sin(2 * np.pi * (1.1 + 0.4 * k) * t) + 4e-4 * np.sin(2 * np.pi * (9 - 2 * k) * t + k)
        u = u * np.minimum(t / 0.1, 1.0)
        parts.append(
            record(u, followed(u, frequency, damping) + NOISE * rng.standard_normal(n), role, first=4.0 * k, h=H)
        )
    parts = [replace(p, linear=True) for p in parts]
    return Recording("t", TABLE.name, "series", ("reading.axis",), ("um",), (NOISE,), tuple(parts), ())


@pytest.mark.parametrize("frequency, damping", [(31.0, 0.05), (60.0, 0.02), (12.0, 0.2)])
def test_a_load_that_rings_behind_a_servo_is_found_with_its_frequency(frequency, damping):
    found = diagnose_recording(TABLE, recorded(frequency, damping), jobs=0, laws=LAWS)
    first = found.findings[0]
    assert first.effect == "soft_coupling" and first.share.value > 0.95
    numbers = first.parameters
    assert numbers["frequency"].value == pytest.approx(frequency, rel=0.01)
    assert numbers["damping"].value == pytest.approx(damping, rel=0.1)
    held = found.held_out["reading.axis"]
    assert held.rms_after < 1.1 * held.noise_floor  # noise: 1500 samples tell it to 2 %


def test_it_is_not_offered_for_settled_poses():
    offered = {h.effect for h in hypotheses(TABLE, nominal_physics(TABLE), ("reading.axis",), H, False)}
    poses = {h.effect for h in hypotheses(TABLE, nominal_physics(TABLE), ("reading.axis",), None, False)}
    assert "soft_coupling" in offered and "soft_coupling" not in poses
