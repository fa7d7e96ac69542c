"""S2 Figs. A.3, A.8, A.9 and A.10 from simulated recordings of its sensors, as SVG."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ctrlgen.core.units import from_si, to_si
from ctrlgen.physics.sensor_models import SENSORS, Interferometer
from ctrlgen.reporting.line_patterns import dashes, mark
from ctrlgen.reporting.plots import COLOURS, STYLE, svg

from .sensor_calibration import calibrate_sensor, find_fringes, record

SECONDS = 12.0  # of a recording; the printed ones are not published
TEMPERATURES = (19.0, 26.0)  # degC
SHARE = 0.95  # of the range is travelled, to stay clear of its ends


def figures() -> dict[str, str]:
    """Name -> SVG text. The noise is the same on every run."""
    with plt.rc_context(STYLE):
        return {
            "Figs. A.8 and A.9, sensitivity curves from simulated recordings": svg(draw_sensitivities()),
            "Figs. A.3 and A.10, interference fringes and temperature effects": svg(draw_fringes_and_offsets()),
        }


def draw_sensitivities() -> Figure:
    """Displacement counted in fringes against sensor voltage, and the sensitivity that a recording gives back."""
    laser = Interferometer()
    figure, panels = plt.subplots(1, 2, figsize=(8.2, 3.6), width_ratios=(1.6, 1))
    for k, (name, sensor) in enumerate(SENSORS.items()):
        distance = SHARE * sensor.usable_range()
        run = record(sensor, laser, distance, distance / SECONDS, np.random.default_rng(k))
        fringes, slope = find_fringes(run.photodiode), calibrate_sensor(run, laser.wavelength)
        counted = np.arange(fringes.at.size) * laser.wavelength / 4
        volts = np.interp(fringes.at, np.arange(run.sensor.size), run.sensor)
        found = f"{name}: {from_si(slope.sensitivity, 'um/V'):.3f} um/V"
        panels[int(name == "fibre")].plot(
            volts, from_si(counted, "um"), mark(k), ms=2, color=COLOURS[2 * k % 6 + k // 3], label=found
        )
    for panel in panels:
        panel.set_xlabel("sensor voltage [V]")
        panel.set_ylabel("displacement counted in fringes [um]")
        panel.legend(fontsize=8, markerscale=3)
    return figure


def draw_fringes_and_offsets() -> Figure:
    """The photodiode over the first micrometre with the extrema found, and each sensor's thermal offset."""
    laser, sensor = Interferometer(), SENSORS["3316"]
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.2, 3.4))
    run = record(sensor, laser, 1.5e-6, 1e-6, np.random.default_rng(0))
    fringes = find_fringes(run.photodiode)
    displacement = np.arange(run.photodiode.size) / run.rate * 1e-6
    left.plot(from_si(displacement, "um"), run.photodiode, color=COLOURS[0], lw=0.6)
    for at in fringes.at:
        left.axvline(from_si(np.interp(at, np.arange(displacement.size), displacement), "um"), color=COLOURS[2], lw=1)
    left.set_title("red: extrema found, a quarter wave apart", fontsize=8)
    left.set_xlabel("displacement [um]")
    left.set_ylabel("photodiode [V]")
    for k, name in enumerate(("3316", "3317", "3338")):
        offsets = [from_si(SENSORS[name].offset(to_si(T, "degC")), "V") for T in TEMPERATURES]
        right.plot(TEMPERATURES, offsets, color=COLOURS[2 * k], ls=dashes(k), label=name)
    right.set_xlabel("room temperature [degC]")
    right.set_ylabel("thermal offset of the reading [V]")
    right.legend(fontsize=8)
    return figure
