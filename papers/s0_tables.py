"""The printed numbers of S0 Tables 2 and 3 and of its section 5.2, digit by digit."""

from __future__ import annotations

import numpy as np

from ctrlgen.core.units import to_si

from .row import PrintedNumber, half_unit

UNITS = ("deg",) * 3 + ("um",) * 3
SCALE = np.array([to_si(1.0, unit) for unit in UNITS])
DIGITS = 3  # of Tables 2 and 4
HALF_J_CUBE = np.repeat([0.5e-2, 0.5e-5], 18)  # eq. (14) has five decimals in rad/mm and mm/mm; here rad/m and 1

# Table 2: measured motion of the cube for the commands 0.1 deg and 100 um, one axis a line. The scan scatters it;
# which number stands where follows from Table 4.
TABLE_2 = """
     9.72E-02  2.21E-04 -4.38E-04  2.31E+00  4.58E+01  2.83E+00
    -1.43E-03  9.50E-02 -1.94E-03 -5.83E+01  5.58E+00 -2.42E+00
     2.20E-03  1.83E-03  9.97E-02 -2.62E+00  9.27E+00 -1.69E+00
    -1.75E-06  1.94E-04  9.51E-04  9.91E+01 -2.21E+00 -6.18E-01
    -6.44E-05  8.25E-05  5.83E-05  3.74E+00  9.88E+01  5.78E-01
     3.56E-04  1.13E-03  1.28E-03  4.92E+00  3.38E-01  9.59E+01
"""
COMMANDS_2 = (0.1, 0.1, 0.1, 100.0, 100.0, 100.0)

TABLE_3 = {
    "max": ("0.00127", "0.00105", "0.00235", "3.34041", "2.27184", "0.11"),
    "min": ("-0.00119", "-0.002", "-0.0009", "-2.1961", "-1.50408", "-1.82"),
    "standard deviation": ("0.000276979", "0.000387935", "0.00046507", "0.686572", "0.570813", "0.410767"),
}

NORMS = (
    ("kinematic model, largest rotation error", "0.0126", "deg"),
    ("kinematic model, mean rotation error", "0.0037", "deg"),
    ("calibrated model, largest rotation error", "0.0030", "deg"),
    ("calibrated model, mean rotation error", "0.0009", "deg"),
    ("kinematic model, largest translation error", "19.91", "um"),
    ("kinematic model, mean translation error", "9.33", "um"),
    ("calibrated model, largest translation error", "3.95", "um"),
    ("calibrated model, mean translation error", "1.60", "um"),
)

EXTREMES = (
    ("section 5.2, largest mean |error| of a rotation axis", "0.001", "deg"),
    ("section 5.2, largest mean |error| of a translation axis", "1", "um"),
    ("section 5.2, largest |error| of a rotation axis", "0.0024", "deg"),
    ("section 5.2, largest |error| of a translation axis", "3.34", "um"),
    ("section 5.2, largest standard deviation of a rotation axis", "0.000465", "deg"),
    ("section 5.2, largest standard deviation of a translation axis", "0.686572", "um"),
    ("abstract, largest |error| of a rotation axis", "0.002", "deg"),
    ("abstract, largest |error| of a translation axis", "3.3", "um"),
    ("conclusion, largest |error| of a rotation axis", "0.0024", "deg"),
    ("conclusion, largest |error| of a translation axis", "3.34", "um"),
)


def s0_row(where: str, printed: str, unit: str, ours: float, *, extra: float = 0.0, reason: str = "") -> PrintedNumber:
    """A printed number; `extra` is what rounded data add to half a unit of the print. A reason is kept where it is needed."""
    tolerance = half_unit(printed) + extra if extra else None
    row = PrintedNumber("S0", where, printed, unit, float(ours), reason, tolerance)
    needed = extra or abs(row.difference or 0.0) > row.allowed * (1 + 1e-9)
    return row if needed else PrintedNumber("S0", where, printed, unit, float(ours))
