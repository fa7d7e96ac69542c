"""A recording of a hexapod whose heaters lag by a closed form, and its device file."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
from conftest import SCENARIOS

from ctrlgen import build_model, load_device
from ctrlgen.controller.kernels import ControllerKernels
from ctrlgen.model.simulation import trace

DEVICE = SCENARIOS / "devices" / "mems_hexapod_run_time.toml"
RECORDING = SCENARIOS / "hexapod_specimen"


def record_lag(folder: Path, tau: float, resistance: float, seed: int) -> tuple[Path, Path]:
    """A device file with two constants, and a recording in which the temperatures are those of the closed form of a lag,
    T_k+1 = T_k e^(-h/tau) + R P (1 - e^(-h/tau)), written here; the poses are the model's equilibria at these temperatures."""
    ambient = '    { number = "actuator.ambient", low = "10 degC", high = "40 degC" },\n'
    text = DEVICE.read_text()
    assert ambient in text
    (folder / "device.toml").write_text(text.replace(ambient, "").replace('input = "actuator.ambient"', ""))
    model = build_model(load_device(folder / "device.toml"))
    settle = ControllerKernels(model, "pose", None).static.settle
    rng, decay, noise = np.random.default_rng(seed), np.exp(-1e-3 / tau), np.array([1e-6] * 3 + [5e-9] * 3)
    for role in ("fit", "hold_out"):
        powers = np.repeat(rng.uniform(0, 0.29, (20, 6)), 10, axis=0)
        rise = [np.zeros(6)]
        for power in powers[:-1]:
            rise.append(rise[-1] * decay + resistance * power * (1 - decay))
        T = model.rest + np.array(rise)
        z = settle.map(len(T))(T.T, np.full((6, len(T)), 1e-5), powers.T).full().T
        pose = trace(model, np.zeros(len(T)), T, z, powers).signals["pose"]
        rows = np.hstack([powers, (pose + rng.standard_normal(pose.shape) * noise) * ([1e6] * 3 + [1e9] * 3)])
        head = ",".join([*(f"P_{axis}" for axis in model.axes), *model.signals["pose"].channels])
        np.savetxt(folder / f"{role}.csv", rows, "%.9g", ",", header=head, comments="")
    shutil.copy(RECORDING / "recording.toml", folder)
    return folder / "device.toml", folder
