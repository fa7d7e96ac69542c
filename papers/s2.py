"""Printed numbers of S2: the sensors of its Appendix A and the hinge coefficients of its Appendix C."""

from __future__ import annotations

from math import pi

import numpy as np

from ctrlgen.core.units import parse, to_si
from ctrlgen.physics.sensor_models import SENSORS, Interferometer, Sensor

from . import s2_hinges
from .row import PrintedNumber, no_number
from .sensor_calibration import find_fringes, max_deviation, record

UNPUBLISHED = "measured; the recordings behind it are not published"
NM, UM = 1e9, 1e6

# S2 Table A.1 (recordings kept, standard deviation, maximum deviation), A.5.1 and Table A.2, as printed
TABLE_A1 = {
    "3316": ("21", "10.264", "0.0022", "0.04"),
    "3317": ("22", "10.099", "0.0206", "0.41"),
    "3338": ("25", "10.184", "0.0015", "0.03"),
    "fibre": ("25", "11.770", "0.0045", "0.08"),
}
# ADC, noise with filter, noise without [nm]; measuring range [um]
RESOLUTIONS = {
    "3316": ("3.13", "18.5", "51", "102.6"),
    "3317": ("3.08", "10.1", "35", "101.0"),
    "3338": ("3.10", "15.3", "51", "101.8"),
    "fibre": ("3.59", "3.5", "47", "11.77"),
}
OFFSETS = {"3316": "89", "3317": "82", "3338": "159"}  # mV per degC
NOISE = {"3316": ("1.8", "5"), "3317": ("1.0", "3.5"), "3338": ("1.5", "5"), "fibre": ("0.3", "4")}  # mV

SET_UP = "scheme or photograph of the set-up"
REDRAWN = "redrawn on the page from simulated recordings; its numbers are those of Table A.1"
FIGURES = (
    ("Fig. A.1", SET_UP),
    ("Fig. A.2", "left out of the source, which refers to the print copy"),
    ("Fig. A.3", REDRAWN),
    ("Fig. A.4", SET_UP),
    ("Fig. A.5", SET_UP),
    ("Fig. A.6", UNPUBLISHED),
    ("Fig. A.7", UNPUBLISHED),
    ("Fig. A.8", REDRAWN),
    ("Fig. A.9", REDRAWN),
    ("Fig. A.10", "redrawn on the page from the printed offset rates"),
    ("Appendix B", "left out of the source, which refers to the print copy"),
)
WRONG_DIGIT = "10.184 um/V times 20 V/2^16 is 3.108 nm; the print has cut the digit off"


def rows() -> list[PrintedNumber]:
    """Every printed number of S2 beside ours."""
    return [*_adc_and_noise(), *_statistics(), *_ranges(), _fringes(), *s2_hinges.rows(), *_coefficients(), *_figures()]


def _adc_and_noise() -> list[PrintedNumber]:
    found = []
    for name, (adc, filtered, unfiltered, _) in RESOLUTIONS.items():
        sensor = SENSORS[name]
        found += [
            _row("A.5.1.1, eq. (A.2)", name, adc, "nm", sensor.resolution_adc() * NM, WRONG_DIGIT),
            _row("A.5.1.2, filtered", name, filtered, "nm", sensor.resolution_noise(filtered=True) * NM),
            _row("A.5.1.2, unfiltered", name, unfiltered, "nm", sensor.resolution_noise(filtered=False) * NM),
        ]
        for what, printed in zip(("filtered", "unfiltered"), NOISE[name], strict=True):
            found.append(PrintedNumber("S2", f"A.5.1.2, V_pp {what}, {name}", printed, "mV", None, UNPUBLISHED))
    return found


def _statistics() -> list[PrintedNumber]:
    found = []
    for name, (size, mean, sd, deviation) in TABLE_A1.items():
        for what, printed, unit in (("sample size", size, "1"), ("mean", mean, "um/V"), ("std. dev.", sd, "um/V")):
            found.append(PrintedNumber("S2", f"Table A.1, {what}, {name}", printed, unit, None, UNPUBLISHED))
        ours = 100 * max_deviation(parse(f"{mean} um/V", "m/V"), parse(f"{sd} um/V", "m/V"))
        found.append(_row("Table A.1 and A.2, eq. (A.3)", name, deviation, "%", ours))
    manufacturer = parse("12.046 um/V", "m/V")  # A.3.3, calibrated by the manufacturer in 2002
    change = (manufacturer - SENSORS["fibre"].sensitivity) * UM
    found.append(_row("A.4.2, change since the manufacturer's calibration", "fibre", "0.3", "um/V", change))
    found.append(
        PrintedNumber("S2", "A.3.3, near side, manufacturer", "12.046", "um/V", None, "the manufacturer's figure")
    )
    found.append(
        PrintedNumber("S2", "A.3.3, far side, manufacturer", "-116", "um/V", None, "the manufacturer's figure")
    )
    return found


def _ranges() -> list[PrintedNumber]:
    found = [
        _row("Table A.2, measuring range", name, printed, "um", SENSORS[name].usable_range() * UM)
        for name, (*_, printed) in RESOLUTIONS.items()
    ]
    found += [
        PrintedNumber("S2", f"A.6.2, offset rate, {name}", printed, "mV/degC", None, UNPUBLISHED)
        for name, printed in OFFSETS.items()
    ]
    sensor, warm = SENSORS["3316"], to_si(25.0, "degC")
    found += [
        _row("A.7, starting voltage at 25 degC", "3316", "0.267", "V", sensor.offset(warm)),
        _row("A.7, eq. (A.4) at 25 degC", "3316", "99.9", "um", sensor.usable_range(warm) * UM),
        _row("A.4.2, range of 1.5 V to 2.5 V", "fibre", "12", "um", SENSORS["fibre"].usable_range() * UM),
    ]
    about = "printed as approximate"
    for name in ("3316", "3317", "3338"):
        safe = parse("7 V", "V") * SENSORS[name].sensitivity * UM
        found.append(
            PrintedNumber("S2", f"A.6.2, range of 1.5 V to 8.5 V, {name}", "70", "um", safe, about, tolerance=5.0)
        )
        volts = _bare_voltage(SENSORS[name])
        found.append(
            PrintedNumber("S2", f"A.1, 100 um before the amplifier, {name}", "1", "V", volts, about, tolerance=0.5)
        )
    return found


def _fringes() -> PrintedNumber:
    """Eq. (A.1) on a simulated record: counted in fringes, less what the target moved; its ends fall between two extrema."""
    laser, distance = Interferometer(), 20e-6
    run = record(SENSORS["3316"], laser, distance, 10e-6, np.random.default_rng(0))
    counted = find_fringes(run.photodiode).distance(laser.wavelength)
    reason = "20 um counted in fringes of a simulated record; allowed: a quarter wave at each end and one for the first crossing"
    return PrintedNumber("S2", "eq. (A.1)", "20", "um", counted * UM, reason, 3 * laser.wavelength / 4 * UM)


def _figures() -> list[PrintedNumber]:
    return [no_number("S2", figure, reason) for figure, reason in FIGURES]


def _bare_voltage(sensor: Sensor) -> float:
    return 100e-6 / sensor.bare_sensitivity


def _coefficients() -> list[PrintedNumber]:
    limit = 1 + pi / 2  # of pi (R/t)^(1/2) minus C.3 as t/R -> 0
    return [
        _row("C.7, constant", "Paros and Weisbord", "2.57", "1", limit),
        _row("C.8, constant", "Paros and Weisbord", "2.57", "1", limit),
        _row("C.17, 1 - nu^2 for nu = 0.333", "Tseytlin", "0.889", "1", 1 - 0.333**2),
        _row(
            "below C.15, coefficient",
            "Tseytlin",
            "0.1984",
            "1",
            0.1986,
            "the equation itself has 0.1986; alpha_z/M_z changes by 0.03 %",
        ),
    ]


def _row(where: str, what: str, printed: str, unit: str, ours: float, reason: str = "") -> PrintedNumber:
    return PrintedNumber("S2", f"{where}, {what}", printed, unit, ours, reason).without_needless_reason()
