"""Model -> the plant as freestanding C99: what `ctrlgen.model.simulation.simulate` computes, one sample a call.

    x' = step(x, z, u),  0 = g(x', z', u) by Newton's method, then every signal of (x', z', u)

with the drive u held over the sample. A stage with inertia takes the exponential steps of
`ctrlgen.model.integrators` for (x, z) instead. The memories of effects are part of x. The sensors' readings are those before
the measuring chain: its noise and its converter (`ctrlgen.model.virtual_sensors`) are not in the C.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.units import base_unit
from ctrlgen.devices import Signal
from ctrlgen.firmware.c.cprint import Kernel, Printer
from ctrlgen.firmware.c.elementary import elementary_text
from ctrlgen.firmware.c.real import Real
from ctrlgen.firmware.c.templates import ABI, write
from ctrlgen.model.assembly import build_model
from ctrlgen.model.discretisation import balanced, driven_step, one_step_map
from ctrlgen.model.model import Model
from ctrlgen.trajectory.scenario import Scenario
from ctrlgen.version import __version__, program

NEWTON_MOST = 50  # steps, as of the balance in `ctrlgen.model.simulation`
ROUNDS = 100  # of state, then displacement, on the way to an equilibrium
ARRIVED = {Real.DOUBLE: 1e-11, Real.FLOAT: 1e-5}  # of a typical size: a Newton step so short leaves rounding only


@dataclass(frozen=True)
class Plant:
    """A model sampled every `sample_time` [s]. Kernels take x (n_x,), z (n_axes,), drive (n_u,), all SI."""

    model: Model
    sample_time: float

    @property
    def signals(self) -> tuple[Signal, ...]:
        """What the plant gives: every signal of the model but the drive, which it is given."""
        return tuple(signal for role, signal in self.model.signals.items() if role != "drive")

    @property
    def inertial(self) -> bool:
        """Whether x and z advance together, from standstill, rather than z balancing the forces."""
        return self.model.inertial

    @cached_property
    def advance(self) -> ca.Function:
        """x one sample on; with inertia x and then z."""
        m = self.model
        if self.inertial:
            after = one_step_map(m, self.sample_time)
            return self._kernel("advance", ca.vertcat(after.x, after.z))
        return self._kernel("advance", driven_step(m, self.sample_time))

    @cached_property
    def balance(self) -> ca.Function:
        """z after one Newton step on 0 = g(x, z, u)."""
        return self._kernel("balance", balanced(self.model, self.model.x, self.model.u, newton_steps=1))

    @cached_property
    def rest(self) -> ca.Function:
        """x after one Newton step on dx/dt = 0, z constant; states that step once a sample take their next value, clocks stop."""
        m = self.model
        x = m.x[:]
        rows = [i for i in range(x.numel()) if i not in m.stepped and i not in m.clocks and not m.rates[i].is_zero()]
        rates, states = m.rates[rows], m.x[rows]
        x[rows] = states - ca.solve(ca.jacobian(rates, states), rates)
        for i, value in (m.stepped | m.resting).items():
            x[i] = value
        return self._kernel("rest", x)

    @cached_property
    def output(self) -> ca.Function:
        """Every component of `signals`, one after the other."""
        return self._kernel("output", ca.vertcat(*(signal.expr for signal in self.signals)))

    def _kernel(self, name: str, result: ca.SX) -> ca.Function:
        m = self.model
        result = ca.substitute(result, m.p, ca.DM(m.p_nominal)) if m.p.numel() else result
        return ca.Function(name, [m.x, m.z, m.u], [result], ["x", "z", "drive"], ["result"], {"cse": True})


def plant_of(scenario: Scenario) -> Plant:
    """The plant of a scenario's device. Raises InputError for a scenario without a sample rate."""
    if scenario.sample_time is None:
        what = 'is missing: a plant in C advances by samples; add sample_rate = "1 kHz" and duration = "1 s"'
        raise InputError(scenario.path, [Fault("sample_rate", what)])
    return Plant(build_model(scenario.device, sample_time=scenario.sample_time), scenario.sample_time)


def plant_context(scenario: Scenario, plant: Plant, real: Real, prefix: str) -> dict[str, Any]:
    """Everything the templates of the plant need."""
    m = plant.model
    printer = Printer(real, {})
    states = ", ".join(f"{name} [{unit}]" for name, unit in zip(m.x_names, m.x_units, strict=True))
    kernels: dict[str, Kernel] = {}
    if m.x.numel():
        about = f"States one sample of {plant.sample_time} s later, the drive held: {states}."
        kernels["advance"] = printer.kernel(plant.advance, "advance", about, ["x", "z"])
    if not plant.inertial:
        about = "Displacement after one Newton step z - g/(dg/dz) on the balance of forces g(x, z, drive) = 0."
        kernels["balance"] = printer.kernel(plant.balance, "balance", about, ["z"])
        if m.x.numel():
            about = "States after one Newton step on dx/dt = 0, the displacement held."
            kernels["rest"] = printer.kernel(plant.rest, "rest", about, ["x"])
    about = f"What can be read: {', '.join(signal.label for signal in plant.signals)}."
    kernels["signals"] = printer.kernel(plant.output, "signals", about)
    called = frozenset().union(*(kernel.calls for kernel in kernels.values()))
    starts = np.cumsum([0, *(len(signal.channels) for signal in plant.signals)])
    build = ABI, scenario.device_sha256, m.device.load_texts, plant.sample_time, real.value
    return {
        "prefix": prefix,
        "real": real,
        "version": __version__,
        "program": program(),
        "title": m.device.title,
        "source": m.device.source,
        "loads": m.device.load_texts,
        "device_sha256": scenario.device_sha256,
        "build": int(hashlib.sha256(repr(build).encode()).hexdigest()[:8], 16),
        "si": si_text,
        "drive": m.signals["drive"],
        "rate": 1 / plant.sample_time,
        "n": len(m.axes),
        "nx": m.x.numel(),
        "nu": m.u.numel(),
        "x_names": [f"{name} [{unit}]" for name, unit in zip(m.x_names, m.x_units, strict=True)],
        "signals": list(zip(plant.signals, map(int, starts), strict=False)),
        "width": int(starts[-1]),
        "inertial": plant.inertial,
        "constants": printer.constants,
        "laws": printer.laws_text,
        "kernels": kernels,
        "axes": m.axes,
        "elementary": elementary_text(called, real),
        "rest": m.rest,
        "z_scale": m.z_scale,
        "x_near": ARRIVED[real] * m.x_scale,
        "z_near": ARRIVED[real] * m.z_scale,
        "newton": NEWTON_MOST,
        "rounds": ROUNDS,
    }


def write_plant(scenario: Scenario, plant: Plant, real: Real, out: Path) -> str:
    """Writes `{controller}_plant_{f64, f32}.c` and `.h` to the folder `out`; their common name. Raises CtrlgenError."""
    name = f"{scenario.controller_name}_plant_{real.suffix}"
    context = plant_context(scenario, plant, real, name)
    for end in ("h", "c"):
        write(f"plant.{end}", context, out / f"{name}.{end}")
    return name


def si_text(signal: Signal) -> str:
    """'theta_x [rad], ... delta_z [m]' with the SI unit of each channel."""
    return ", ".join(f"{c} [{base_unit(u)}]" for c, u in zip(signal.channels, signal.units, strict=True))
