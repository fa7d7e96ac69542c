"""What the actuators of a mechanism make of their drives: forces or displacements, with a lag or a temperature between."""

from __future__ import annotations

from types import SimpleNamespace

import casadi as ca

from ctrlgen.devices.driven import Transduction, proportional
from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.devices.signal import AxisSignal, Signal
from ctrlgen.physics import thermal_actuator


def transduction(c: Condensed) -> Transduction:
    """The transduction of a mechanism, whose actuators are of one kind."""
    return _heated(c) if c.device.actuator[0].kind == "thermal" else _proportional(c)


def held_forces(c: Condensed) -> list[tuple[float, float]]:
    """Of each axis of a mechanism of numbers the least and the most that its drive does for good: force with the axis held at home [N],
    or displacement [m]; of a heater as hot as its power and its limit of temperature let it be."""
    placed = c.device.placed_actuators
    if placed[0].section.kind == "thermal":
        hottest = (min(a.temperature_limit, a.ambient + a.thermal_resistance * a.power_limit) for a in _heaters(c, c.p))
        return [(0.0, float(thermal_actuator.force(T, a))) for T, a in zip(hottest, _heaters(c, c.p), strict=True)]
    low_high = ([a.section.gain.si * q.si for q in (a.section.low, a.section.high)] for a in placed)
    return [(min(ends), max(ends)) for ends in low_high]


def _proportional(c: Condensed) -> Transduction:
    """Force or displacement are the drive times the gain, at once or with a lag of first order."""
    placed = c.device.placed_actuators
    numbers, sections = [a.numbers(c.p) for a in placed], [a.section for a in placed]
    gains, lags = [q.gain for q in numbers], [q.time_constant for q in numbers]
    return proportional(tuple(a.name for a in placed), sections, gains, [s.gain.si for s in sections], lags)


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
