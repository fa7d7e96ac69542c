"""The plant of a device with any effect of the library: it is printed as C, and comes to rest, where it stays."""

from __future__ import annotations

import numpy as np
import pytest
from effect_cases import SAMPLE_TIME, device_of, every_effect, place_of, shapes, size, written

from ctrlgen import build_model
from ctrlgen.firmware.c.cprint import Printer
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.fmi.plant import Plant
from ctrlgen.model.model import Model

FEW = 10  # rounds to rest: of a state, then of the displacement
NEWTON_STEPS = 20
STILL = 1e-9  # of a typical size: rounding of a balance


def with_effect(effect) -> Model:
    """Of the first device that has a place for the effect, modest, in the middle of its grid."""
    table, places = place_of(effect)
    where = places[len(places) // 2]
    shape = shapes(effect, where)
    values = {**shape[len(shape) // 2], effect.amplitude().name: size(effect, where, np.random.default_rng(3))}
    return build_model(device_of(table, written(effect, where, values)), sample_time=SAMPLE_TIME)


@pytest.mark.long
@every_effect
def test_a_plant_is_printed_and_rests_in_few_rounds_where_the_drive_stands(effect):
    """What counts time goes on: such a plant is printed alone."""
    plant = Plant(with_effect(effect), SAMPLE_TIME)
    m, printer = plant.model, Printer(Real.DOUBLE, {})
    kernels = [plant.output, *([plant.advance] if m.x.numel() else [])]
    if not plant.inertial:
        kernels += [plant.balance, *([plant.rest] if m.x.numel() else [])]
    assert all(printer.kernel(kernel, kernel.name(), "Printed.", []).text for kernel in kernels)
    if plant.inertial or m.clocks:
        return
    x, z, u = m.rest, 0 * m.z_scale, 0.3 * m.u_scale
    for _ in range(FEW):
        x, z = balanced(plant, plant.rest(x, z, u).full().ravel() if m.x.numel() else x, z, u)
    read = plant.output(x, z, u).full().ravel()
    for _ in range(20):
        x, z = balanced(plant, plant.advance(x, z, u).full().ravel() if m.x.numel() else x, z, u)
    scale = np.concatenate([signal.scale for signal in plant.signals])
    moved = np.abs(plant.output(x, z, u).full().ravel() - read) / scale
    assert moved.max() < STILL


def balanced(plant: Plant, x: np.ndarray, z: np.ndarray, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """x, and the displacement that balances with it, from z."""
    for _ in range(NEWTON_STEPS):
        z = plant.balance(x, z, u).full().ravel()
    return x, z
