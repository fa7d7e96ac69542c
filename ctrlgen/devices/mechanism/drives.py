"""What the actuators of a mechanism make of their drives: forces or displacements, with a lag or a temperature between."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace

import casadi as ca

from ctrlgen.core.units import written_unit
from ctrlgen.devices.limit import Limit
from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.devices.signal import AxisSignal, Signal
from ctrlgen.physics import thermal_actuator


@dataclass(frozen=True)
class Transduction:
    """Drive u, heat w = heat(u), states x' = rates(x, w), force(u, x) (n,) on the axes; `drive_range` and `state_range` by axis [SI].
    `power` shows the heat of heaters."""

    drive: Signal
    drive_range: tuple[tuple[float, float], ...]
    force: Callable[[ca.SX, ca.SX], ca.SX]
    force_scale: float
    state: Signal | None = None
    rest: tuple[float | ca.SX, ...] = ()
    state_range: tuple[tuple[float, float], ...] = ()
    rates: Callable[[ca.SX, ca.SX], ca.SX] = lambda x, heat: ca.SX(0, 1)
    heat: Callable[[ca.SX], ca.SX] = lambda u: u
    power: AxisSignal | None = None

    def limits(self, signal: SimpleNamespace) -> list[Limit]:
        """The ranges of drive and state, axis by axis."""
        limits = []
        for name, of, expr, ranges in (
            ("drive", self.drive, signal.drive, self.drive_range),
            ("output" if self.power is None else "temperature", self.state, signal.state, self.state_range),
        ):
            if of is not None:
                for i, (axis, unit, span) in enumerate(zip(of.channels, of.units, ranges, strict=True)):
                    limits.append(Limit(f"{name}_{axis}", f"{of.label} of {axis}", (axis,), unit, expr[i], *span))
        return limits


def transduction(c: Condensed) -> Transduction:
    """The transduction of a mechanism, whose actuators are of one kind."""
    return _heated(c) if c.device.actuator[0].kind == "thermal" else _proportional(c)


def _proportional(c: Condensed) -> Transduction:
    """Force or displacement are the drive times the gain, at once or with a lag of first order."""
    actuators = c.device.placed_actuators
    numbers, sections = [a.numbers(c.p) for a in actuators], [a.section for a in actuators]
    axes, units = tuple(a.name for a in actuators), tuple(written_unit(s.low.text) for s in sections)
    ranges = tuple((s.low.si, s.high.si) for s in sections)
    sizes = tuple(max(map(abs, span)) for span in ranges)
    gain, lags = ca.vertcat(*(q.gain for q in numbers)), [q.time_constant for q in numbers]
    drive = Signal("drive", "drive", axes, units, "u_", ca.SX.sym("u", len(axes)), sizes)
    scale = float(max(abs(s.gain.si) * size for s, size in zip(sections, sizes, strict=True)))
    if any(tau is None for tau in lags):  # all of them, or none
        return Transduction(drive, ranges, lambda u, x: gain * u, scale)
    state = Signal("state", "amplifier output", axes, units, "x_", ca.SX.sym("x", len(axes)), sizes)
    return Transduction(
        drive,
        ranges,
        lambda u, x: gain * x,
        scale,
        state,
        (0.0,) * len(axes),
        ranges,
        lambda x, u: (u - x) / ca.vertcat(*lags),
    )


def _heated(c: Condensed) -> Transduction:
    """Heater power -> temperature -> force of the beams on their bar, S1 eq. (4)."""
    actuators, n = c.device.placed_actuators, len(c.device.placed_actuators)
    axes, sections = tuple(a.name for a in actuators), [a.section for a in actuators]
    volts = sections[0].heater_resistance is not None  # of all, or of none
    heaters, nominal = _heaters(c, c.p), _heaters(c, c.device.values())
    ranges = tuple(
        thermal_actuator.drive_range(s.power_limit.si, s.heater_resistance.si if s.heater_resistance else None)
        for s in sections
    )
    label, unit, column = ("heater voltage", "V", "V_") if volts else ("heater power", "W", "P_")
    drive = Signal(
        "voltage" if volts else "power",
        label,
        axes,
        (unit,) * n,
        column,
        ca.SX.sym("u", n),
        tuple(most for _, most in ranges),
    )
    state = Signal("temperature", "actuator temperature", axes, ("degC",) * n, "T_", ca.SX.sym("T", n), (100.0,) * n)
    hottest = max(float(thermal_actuator.force(a.temperature_limit, a)) for a in nominal)

    def rates(T: ca.SX, P: ca.SX) -> ca.SX:
        return ca.vertcat(*(thermal_actuator.temperature_rate(T[i], P[i], a) for i, a in enumerate(heaters)))

    def force(u: ca.SX, T: ca.SX) -> ca.SX:
        return ca.vertcat(*(thermal_actuator.force(T[i], a) for i, a in enumerate(heaters)))

    def heat(u: ca.SX) -> ca.SX:
        return thermal_actuator.heating_power(u, ca.vertcat(*(a.heater_resistance for a in heaters)) if volts else None)

    return Transduction(
        drive,
        ranges,
        force,
        hottest,
        state,
        tuple(a.ambient for a in heaters),
        tuple((s.ambient.si, s.temperature_limit.si) for s in sections),
        rates,
        heat,
        AxisSignal("heater power", "W", "P_", max(s.power_limit.si for s in sections)),
    )


def _heaters(c: Condensed, p: SimpleNamespace) -> list[SimpleNamespace]:
    """The numbers of each heater, its beams and their material among `p`, as `physics.thermal_actuator` reads them."""
    heaters, materials = [], [m.name for m in c.device.material]
    for a in c.device.placed_actuators:
        beams = c.device.placed_elements[c.element_of(a)]
        numbers = vars(beams.numbers(p)) | vars(p.material[materials.index(beams.section.material)])
        heaters.append(SimpleNamespace(**numbers | vars(a.numbers(p))))
    return heaters
