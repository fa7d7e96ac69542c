"""Calibrates a displacement sensor against a Michelson interferometer: fringes -> distance -> sensitivity -> uncertainty. Source: S2 A.

python scenarios/sensor_calibration/calibrate.py [RECORD.csv]

The record has a row a sample, two columns [V]: sensor, photodiode. The target moves in one direction.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from importlib import import_module
from math import sqrt
from pathlib import Path

import numpy as np

from ctrlgen.core.shipped_files import shipped_package

HERE = Path(__file__).parent
SENSORS = import_module(f"{shipped_package('papers').__name__}.sensor_calibration")
RATE = 1000.0  # Hz, of the record
WAVELENGTH = 632.8e-9  # m, S2 A.3.4
WAVELENGTH_SD = 1e-6  # relative: free-running HeNe laser, and pressure, temperature and humidity of the room
TILT = 2e-3  # rad, between beam and motion; the beam's way is longer by 1 - cos


@dataclass(frozen=True)
class Result:
    """Sensitivity [m/V] with its standard uncertainties: of the fit, of the wavelength, of the tilt; fringes and rest of the fit [V]."""

    sensitivity: float
    fit: float
    wavelength: float
    tilt: float
    distance: float
    extrema: int
    residual: float

    @property
    def sd(self) -> float:
        """Combined standard uncertainty [m/V]."""
        return sqrt(self.fit**2 + self.wavelength**2 + self.tilt**2)


def calibrate(path: Path) -> Result:
    """The sensitivity that the record in `path` tells. Raises ValueError where its photodiode shows too few fringes."""
    sensor, photodiode = np.loadtxt(path, delimiter=",", skiprows=1, unpack=True)
    run = SENSORS.CalibrationRun(sensor, photodiode, RATE)
    fringes, slope = SENSORS.find_fringes(photodiode), SENSORS.calibrate_sensor(run, WAVELENGTH)
    return Result(
        slope.sensitivity,
        slope.sd,
        slope.sensitivity * WAVELENGTH_SD,
        slope.sensitivity * TILT**2 / 2 / sqrt(3),  # 1 - cos of a tilt anywhere up to TILT, GUM 4.3.7
        fringes.distance(WAVELENGTH),
        fringes.at.size,
        slope.residual,
    )


def main() -> None:
    """Prints the calibration of the file given, or of the shipped record."""
    found = calibrate(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE / "record.csv")
    print(f"{found.extrema} extrema, {1e6 * found.distance:.3f} um")
    print(f"sensitivity {1e6 * found.sensitivity:.5f} um/V, standard uncertainty {1e6 * found.sd:.2g} um/V")
    for name, sd in (("fit", found.fit), ("wavelength", found.wavelength), ("tilt of the beam", found.tilt)):
        print(f"  {name}: {1e6 * sd:.2g} um/V")
    print(f"rest of the fit {1e3 * found.residual:.3f} mV")


if __name__ == "__main__":
    main()
