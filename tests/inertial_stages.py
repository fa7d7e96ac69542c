"""Stages with inertia, one of them with a lag, laws to put into them, and their scenarios."""

from __future__ import annotations

from conftest import AXIS_FILE

import ctrlgen
from ctrlgen import build_model, load_scenario, solve

MASS, DAMPING, STIFFNESS, CUBIC, FORCE, LAG = 0.5, 30.0, 2e5, 1e13, 10.0, 1e-3
TRAVEL = 100e-6
GOAL = 1e-9  # of the travel, by which a solved drive may miss the path at the samples: 0.1 pm, far below any sensor
LINE = 'kind = "line"\nstart = { axis = "-20 um" }\nend = { axis = "30 um" }\n'


def coil(limit: str = "4 V", **other):
    """The mass on its spring, the current in a coil lagging behind the voltage."""
    laws = dict(
        parameters={
            "m": "0.5 kg",
            "c": "30 N*s/m",
            "k": "0.2 N/um",
            "k3": "1e13 N/m^3",
            "f": "10 N/V",
            "tau": "1 ms",
        },
        axes={"axis": "100 um"},
        drive={"coil": limit},
        state={"current": "4 V"},
        rates=lambda u, x, p: (u.coil - x.current) / p.tau,
        force=lambda x, p: p.f * x.current,
        restoring_force=lambda d, p: p.k * d.axis + p.k3 * d.axis**3,
        damping_force=lambda v, p: p.c * v.axis,
        mass=lambda p: p.m,
    )
    return ctrlgen.user_device("coil", **(laws | other))


def stage(limit: str = "4 A"):
    """Two such axes without lag, coupled by a hundredth of their stiffness."""
    return ctrlgen.user_device(
        "stage",
        parameters={"m": "0.5 kg", "c": "30 N*s/m", "k": "0.2 N/um", "e": "2 N/mm", "f": "10 N/A"},
        axes={"x": "100 um", "y": "100 um"},
        drive={"a": limit, "b": limit},
        force=lambda u, p: [p.f * u.a, p.f * u.b],
        restoring_force=lambda d, p: [p.k * d.x + p.e * d.y, p.k * d.y + p.e * d.x],
        damping_force=lambda v, p: [p.c * v.x, p.c * v.y],
        mass=lambda p: [p.m, p.m],
    )


def scenario(folder, device, path: str, rate: str = "5 kHz", duration: str | None = "0.1 s"):
    """A scenario for a device, or for a device file with this name."""
    file = folder / "scenario.toml"
    name = device if isinstance(device, str) else device.name
    timing = "" if duration is None else f'duration = "{duration}"\n'
    file.write_text(f'title = "t"\ndevice = "{name}"\nsample_rate = "{rate}"\n{timing}[path]\n{path}\n')
    return load_scenario(folder, None if isinstance(device, str) else device)


def solved(folder, device, path: str, **timing):
    it = scenario(folder, device, path, **timing)
    return solve(it, build_model(it.device))


def with_effect(folder, kind: str, numbers: str) -> str:
    """The shipped axis with a law, as a device file."""
    text = AXIS_FILE.read_text() + f'\n[[effect]]\nkind = "{kind}"\nat = "axis"\n{numbers}\n'
    (folder / "device.toml").write_text(text)
    return "device.toml"


PATHS = {
    "circle": 'kind = "circle"\ndiameter = "60 um"\nturns = 4\nplane = ["x", "y"]',
    "circle from rest": 'kind = "circle"\ndiameter = "60 um"\nplane = ["x", "y"]\nfrom_rest = true',
    "lissajous": 'kind = "lissajous"\namplitudes = ["30 um", "20 um"]\nperiods = [3, 2]\nplane = ["x", "y"]',
    "raster": 'kind = "raster"\nlength = "40 um"\nspacing = "2 um"\nlines = 3\nplane = ["x", "y"]',
    "spiral": 'kind = "spiral"\ndiameter = "40 um"\nturns = 3\nplane = ["x", "y"]',
}


# Laws with no inverse in closed form, with memories, with dry friction
EFFECTS = {
    "stiffening": 'k3 = "2e13 N/m^3"',
    "quadratic_damping": 'damping = "300 N*s^2/m^2"',
    "saturation": 'share = "1"\nlevel = "1.5 V"',
    "resonance": 'stiffness = "0.05 N/um"\nfrequency = "300 Hz"\ndamping = "0.01"',
    "creep": 'gain = "3 %"\ntau = "0.5 s"\nslow = "30 %"',
    "coil_heating": 'rise = "0.05 1/V^2"\ntau = "0.2 s"',
    "thermal_lag": 'share = "0.2"\ntau = "0.01 s"\nsecond = "0.3"',
    "hysteresis": 'stiffness = "0.02 N/um"\nreach = "10 um"\ntaper = "0.5"',
    "drive_hysteresis": 'share = "0.1"\nreach = "1 V"\ntaper = "0.5"',
    "coulomb": 'force = "1 N"\nreach = "0.1 um"\nsmoothing = "1 um/s"',
}
