"""Draws hexapod cases: pose sets of the MEMS hexapod with one fault, and the folder a diagnosis reads."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from battery.plant_hexapod import AXES, COMPONENTS, Array, Faults, Hexapod, changed
from plants.numbers import MEMS_HEXAPOD, read

Rng = np.random.Generator
# Shares, stated in the device file
SD = {
    "hexapod.platform_radius": 0.003,
    "hexapod.base_radius": 0.003,
    "hexapod.height": 0.003,
    "actuator.thermal_resistance": 0.02,
    "stage.half_stage_stiffness": 0.03,
}
SECTION = {"hexapod": "mechanism", "actuator": "actuator", "stage": "stage"}


@dataclass(frozen=True)
class Fault:
    """What the answer says: `name`, `location`, `amplitude` in SI; `faults` and `shares` go into the plant."""

    name: str
    location: str
    amplitude: float
    faults: Faults
    shares: dict[str, float]


def _one(k: int, value: float) -> Array:
    out = np.zeros(6)
    out[k] = value
    return out


def _signed(rng: Rng, low: float, high: float) -> float:
    return float(rng.choice([-1, 1]) * rng.uniform(low, high))


def _on_axis(name: str, attribute: str, place: str, low: float, high: float) -> Callable[[Rng], Fault]:
    def draw(rng: Rng) -> Fault:
        k, a = int(rng.integers(6)), _signed(rng, low, high)
        return Fault(name, f"{place}:{AXES[k]}", a, Faults(**{attribute: _one(k, a)}), {})

    return draw


def _on_sensor(name: str, attribute: str, low: float, high: float) -> Callable[[Rng], Fault]:
    def draw(rng: Rng) -> Fault:  # the three displacements: what is drawn is in um
        k, a = int(rng.integers(3, 6)), _signed(rng, low, high)
        si = {"offset": 1e-6, "bow": 1e6}.get(attribute, 1.0)
        return Fault(name, f"sensor:{COMPONENTS[k]}", a * si, Faults(**{attribute: _one(k, a)}), {})

    return draw


def _swapped(rng: Rng) -> Fault:
    i, j = sorted(rng.choice(6, 2, replace=False).tolist())
    order = np.arange(6)
    order[[i, j]] = j, i
    return Fault("swapped", f"actuator:{AXES[i]}|actuator:{AXES[j]}", 1.0, Faults(order=order), {})


def _parameter(rng: Rng) -> Fault:
    path = str(rng.choice([p for p in SD if p.startswith("hexapod")]))
    a = _signed(rng, 6, 10) * SD[path]
    section, name = path.split(".")
    return Fault("parameter", f"{SECTION[section]}:{name}", a, Faults(), {path: a})


FAULTS: dict[str, Callable[[Rng], Fault]] = {
    "drive_gain": _on_axis("drive_gain", "drive", "actuator", 0.02, 0.15),
    "stiffness": _on_axis("stiffness", "stiffness", "stage", 0.03, 0.15),
    "coupling": _on_axis("coupling", "coupling", "stage", 0.003, 0.03),
    "sensor_gain": _on_sensor("sensor_gain", "gain", 0.01, 0.05),
    "home_offset": _on_sensor("home_offset", "offset", 0.1, 2.0),
    "bow": _on_sensor("bow", "bow", 2e-4, 2e-3),
    "swapped": _swapped,
    "parameter": _parameter,
    "heat_crosstalk": lambda rng: (lambda a: Fault("heat_crosstalk", "actuator:all", a, Faults(crosstalk=a), {}))(
        float(rng.uniform(0.004, 0.03))
    ),
    "frame_turn": lambda rng: (lambda a: Fault("frame_turn", "mechanism:all", a, Faults(turn=a), {}))(
        _signed(rng, 0.003, 0.03)
    ),
    "finite_rotation": lambda rng: Fault("finite_rotation", "mechanism:all", 1.0, Faults(finite=1.0), {}),
}


@dataclass(frozen=True)
class PoseBench:
    """Pose sets: `drives` [W] and `noise` (theta; u) [rad, um] per role; the plant's own `shares` off nominal."""

    drives: dict[str, Array]
    noise: dict[str, Array]
    shares: dict[str, float]
    sd: tuple[float, float]
    noise_stated: bool


def draw_bench(rng: Rng) -> PoseBench:
    """40 to 80 random poses to fit; held out: a walk along closed curves in the drives, another class."""
    n, m = int(rng.integers(40, 80)), int(rng.integers(24, 40))
    phase = 2 * np.pi * np.arange(m)[:, None] / m
    curve = 0.28 + 0.15 * np.sin(phase + np.arange(6)) + 0.08 * np.cos(2 * phase + 2 * np.arange(6))
    drives = {"fit": rng.uniform(0.05, 0.5, (n, 6)), "hold_out": np.clip(curve, 0.03, 0.52)}
    drives = {role: np.round(u, 6) for role, u in drives.items()}
    sd = float(10 ** rng.uniform(-6.3, -5.7)), float(10 ** rng.uniform(-2.3, -1.7))  # rad, um
    noise = {role: rng.standard_normal(u.shape) * np.repeat(sd, 3) for role, u in drives.items()}
    shares = {path: s * float(np.clip(rng.standard_normal(), -1.8, 1.8)) for path, s in SD.items()}
    return PoseBench(drives, noise, shares, sd, bool(rng.uniform() < 0.5))


def readings(bench: PoseBench, fault: Fault | None) -> dict[str, Array]:
    """Poses (n, 6) per role, with noise."""
    shares = dict(bench.shares) | (fault.shares if fault else {})
    plant = Hexapod(changed(read(), shares), fault.faults if fault else None)
    return {role: plant.settled(u) + bench.noise[role] for role, u in bench.drives.items()}


def size(bench: PoseBench, fault: Fault) -> float:
    """rms of the fault's change over the noise, in its largest component; no refit: faults are nominal numbers here."""
    change = (readings(bench, fault)["fit"] - readings(bench, None)["fit"]) / np.repeat(bench.sd, 3)
    return float(np.sqrt(np.mean(change**2, axis=0)).max())


def device_text(file: Path = MEMS_HEXAPOD, deviations: dict[str, float] = SD) -> str:
    """The device of `file`, with standard deviations (shares) where the battery moves a number."""
    text = file.read_text()
    for path, sd in deviations.items():
        name = path.split(".")[1]
        text, count = re.subn(
            rf'^({name}\s*=\s*{{ value = "([\d.]+) ([^"]+)")',
            lambda m, sd=sd: f'{m[1]}, sd = "{float(m[2]) * sd:.4g} {m[3]}"',
            text,
            flags=re.MULTILINE,
        )
        if count != 1:
            raise ValueError(f"{file}: {name} is not written the way the battery expects")
    return text


def write_bench(folder: Path, bench: PoseBench, fault: Fault | None) -> None:
    """device.toml, recording.toml and a CSV per role."""
    columns = {f"P_{axis}": axis for axis in AXES}
    write_poses(folder, device_text(), "mems_hexapod", columns, "W", bench, readings(bench, fault))


def write_poses(
    folder: Path,
    text: str,
    device: str,
    columns: dict[str, str],
    unit: str,
    bench: PoseBench,
    read: dict[str, Array],
    dwell: float | None = None,
    period: float | None = None,
) -> None:
    """The device's `text`, recording.toml and a CSV per role with drives in `columns` (name: axis) and the poses `read`.

    `dwell` [s] of a settled pose; `period` [s] of a series whose drive is linear between samples.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "device.toml").write_text(text)
    noise = [f'"{bench.sd[0] * 1e6:.3g} urad"'] * 3 + [f'"{bench.sd[1] * 1e3:.3g} nm"'] * 3
    kind, title = ("series", "Series of poses") if period else ("poses", "Settled poses")
    lines = [f'title = "{title}"', f'device = "{device}"', 'source = "bench"', f'kind = "{kind}"', "", "[columns]"]
    lines += [f'"drive.{axis}" = {{ column = "{name}", unit = "{unit}" }}' for name, axis in columns.items()]
    for name, sd in zip(COMPONENTS, noise, strict=True):
        angle = "urad" if name.startswith("theta") else "um"
        stated = f", noise = {sd}" if bench.noise_stated else ""
        lines.append(f'"reading.{name}" = {{ column = "{name}", unit = "{angle}"{stated} }}')
    header = ",".join([*columns, *COMPONENTS])
    for k, (role, y) in enumerate(read.items()):
        table = np.column_stack([bench.drives[role], y * np.repeat([1e6, 1.0], 3)])
        formats = ["%.6f"] * 6 + ["%.5f"] * 3 + ["%.6f"] * 3
        np.savetxt(folder / f"record_{k + 1}.csv", table, fmt=formats, delimiter=",", header=header, comments="")
        lines += ["", "[[record]]", f'file = "record_{k + 1}.csv"', f'role = "{role}"']
        lines += [f'dwell = "{dwell:g} s"'] if dwell else []
        lines += [f'sample_rate = "{1 / period:g} Hz"', 'between_samples = "linear"'] if period else []
    (folder / "recording.toml").write_text("\n".join(lines) + "\n")


def describe(bench: PoseBench) -> dict[str, Any]:
    """What the answer keeps of the bench."""
    return {"shares": bench.shares, "noise": {"sd": list(bench.sd), "phi": 0.0}}
