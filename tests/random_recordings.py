"""Folders of cheap recordings: a device of any kind, random causes or none, noise stated rightly or not, spikes, gaps, a reader's units.

Causes are laws of the library at random places and sizes, or what no law describes. Series are of half a second to a second, pose sets of
some dozen poses, so that a diagnosis among a few laws takes seconds.
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from conftest import AXIS_FILE, DEVICES, MESO_FILE

from ctrlgen.core.files import validate
from ctrlgen.core.units import difference, from_si
from ctrlgen.devices import Device, DevicePhysics
from ctrlgen.estimation.device_with_causes import device_with_causes
from ctrlgen.estimation.hypothesis import PARAMETER, DataHints, Hypothesis, hypotheses, nominal_physics, numbers
from ctrlgen.estimation.simulator import Simulator
from ctrlgen.recordings.recording import Record

Rng = np.random.Generator
H = 1e-3  # s
TRIES = 4  # of an amplitude, by secants
SERVO = 'kind = "servo"\nname = "servo"\ntitle = "a table"\nsource = "an example"\ntravel = "{}"\n'
PIEZO = SERVO + '[transducer]\ngain = {{ value = "10 um/V", sd = "0.5 um/V" }}\ndrive_limit = "10 V"\n'
FORCE = """kind = "tested_axis"
name = "tested"
title = "a tested axis"
source = "an example"
[mechanics]
"""
ALONG = 'mass = {value = "20 kg", sd = "2 kg"}\ndamping = {value = "200 N*s/m", sd = "50 N*s/m"}\nstiffness = "0.002 N/um"\n'
ALONG += 'stroke = "20 mm"\nspeed = "400 mm/s"\nforce = "100 N"\n'
ABOUT = (
    'mass = {value = "2e-3 kg*m^2", sd = "2e-4 kg*m^2"}\ndamping = {value = "0.02 N*m*s/rad", sd = "0.005 N*m*s/rad"}\n'
)
ABOUT += 'stiffness = "0.5 N*m/rad"\nstroke = "2 rad"\nspeed = "40 rad/s"\nforce = "2 N*m"\n'
KINDS = {
    "axis": (AXIS_FILE.read_text(),),
    "servo": (SERVO.format("90 deg"), SERVO.format("25 mm")),
    "piezo": (PIEZO.format("100 um"), PIEZO.format("100 um") + '[machine]\nactuator = "piezo stack"\n'),
    "force": (FORCE + ALONG, FORCE + ABOUT),
    "servo poses": (SERVO.format("90 deg"), SERVO.format("25 mm")),
    "mirror poses": ((DEVICES / "tip_tilt_mirror.toml").read_text(),),
    "hexapod poses": (MESO_FILE.read_text(),),
}
OFTEN = (0.28, 0.15, 0.15, 0.15, 0.12, 0.09, 0.06)
READERS = {
    "um": ("nm", "um", "mm"),
    "mm": ("um", "mm"),
    "urad": ("urad", "mrad", "deg"),
    "mrad": ("urad", "mrad", "deg"),
    "deg": ("mrad", "deg"),
    "rad": ("rad", "deg"),
    "N": ("mN", "N"),
    "N*m": ("mN*m", "N*m"),
}


@dataclass(frozen=True)
class Drawn:
    """What stands in a folder: the kind of device, what was planted, and the laws that a diagnosis may use."""

    kind: str
    planted: tuple[str, ...]
    laws: tuple[str, ...]


def draw(seed: int, folder: Path) -> Drawn:
    """Writes device.toml, recording.toml and its columns of a seed."""
    rng = np.random.default_rng([seed, 2801])
    kind = str(rng.choice(list(KINDS), p=OFTEN))
    text = KINDS[kind][int(rng.integers(len(KINDS[kind])))]
    table = tomllib.loads(text)
    (folder / "device.toml").write_text(text)
    scene = Scene(rng, kind, validate(Device.library[table["kind"]], table, "device"))
    planted = scene.plant(int(rng.choice([0, 1, 2, 3], p=[0.2, 0.45, 0.25, 0.1])))
    laws = {c.effect for c in scene.causes if c.effect != PARAMETER} if rng.random() < 0.75 else set()
    known = sorted({c.effect for c in scene.offered if c.effect != PARAMETER})
    laws |= set(rng.choice(known, min(len(known), int(rng.integers(1, 5))), replace=False).tolist())
    scene.write(folder)
    return Drawn(kind, tuple(planted), tuple(sorted(laws)))


class Scene:
    """A device on the bench, with its drives and what it does."""

    def __init__(self, rng: Rng, kind: str, device: Device) -> None:
        self.rng, self.kind, self.device = rng, kind, device
        self.physics: DevicePhysics = nominal_physics(device)
        self.poses = kind.endswith("poses")
        self.linear = kind == "force" or (not self.poses and bool(rng.random() < 0.5))
        self.channels = tuple(f"reading.{name}" for name in self.physics.readings[0])
        self.records = self._records()
        step = None if self.poses else H
        self.offered = hypotheses(device, self.physics, self.channels, step, False)
        self.causes: tuple[Hypothesis, ...] = ()
        self.true = device
        self.readings = self.simulated(device)
        size = np.sqrt(np.mean(np.vstack(list(self.readings.values())) ** 2, axis=0))
        self.noise = np.maximum(size, 1e-3 * np.array(self.physics.readings[2])) * 10 ** rng.uniform(-4, -2.3)

    def simulated(self, device: Device) -> dict[str, np.ndarray]:
        """The readings (n, n_y) [SI] of every record."""
        first = next(iter(self.records.values()))
        simulator = Simulator(device, (), self.channels, first.sample_time, self.linear)
        return {name: simulator.simulate(record, np.zeros(0)) for name, record in self.records.items()}

    def plant(self, count: int) -> list[str]:
        """Puts `count` random causes in, and sometimes what no law describes; their names."""
        told = []
        for _ in range(count):
            cause = self.offered[int(self.rng.integers(len(self.offered)))]
            if (grown := self._grown(cause, 10 ** self.rng.uniform(-0.3, 2.3))) is not None:
                self.true, self.readings = grown
                self.causes = (*self.causes, cause)
                told.append(f"{cause.effect} at {cause.location}")
        if self.rng.random() < 0.2:
            size = self.noise * 10 ** self.rng.uniform(0.3, 2)
            self.readings = {name: y + size * _foreign(self.rng, y) for name, y in self.readings.items()}
            told.append("what no law describes")
        return told

    def _grown(self, cause: Hypothesis, size: float) -> tuple[Device, dict[str, np.ndarray]] | None:
        """The device and its readings with the cause so large that it changes them by `size` times the noise, as far as its bounds let."""
        if cause.effect == PARAMETER:
            nominal = next(q.si for path, _, q in numbers(self.device) if path == cause.path)
            low, high, off, shape, name = -0.5 * abs(nominal), 0.5 * abs(nominal), nominal, {}, "value"
            low, high = nominal + low, nominal + high
        else:
            channel, p = cause.channel_on(self.device), cause.law.amplitude()
            shapes = cause.shapes(channel, self._hints(cause))
            if not shapes:
                return None
            shape, name = shapes[int(self.rng.integers(len(shapes)))], p.name
            (low, high), off = cause.bounds(p, channel), channel.si(p.off or 0.0, p)
        end = high if high - off >= off - low else low
        amplitude = off + 1e-3 * (end - off)
        for _ in range(TRIES):
            try:
                device = device_with_causes(self.true, [cause], [{**shape, name: amplitude}])
                readings = self.simulated(device)
            except (ValueError, ArithmeticError, RuntimeError):
                return None
            change = np.vstack([(readings[r] - self.readings[r]) / self.noise for r in readings])
            if not np.isfinite(change).all():
                return None
            now = float(np.sqrt(np.mean(change**2, axis=0).max()))
            if now == 0 or abs(np.log(now / size)) < 0.3:
                break
            amplitude = float(np.clip(off + (amplitude - off) * size / now, min(low, high), max(low, high)))
        return (device, readings) if now > 0.1 else None

    def _hints(self, cause: Hypothesis) -> DataHints:
        channel, r = cause.channel_on(self.device), self.rng
        lasts = max(len(u.time) for u in self.records.values()) * H
        peaks = {"channel": channel.scale, "travel": channel.travel_scale, "s": lasts / 12}
        peaks["travel/s"] = channel.travel_scale / 0.05
        travel = channel.travel_scale
        suggested = {
            "moments": (float(r.uniform(0.1, 0.4)),),
            "lines": (float(r.uniform(8, 80)),),
            "spatial_periods": (float(travel * r.uniform(0.05, 0.4)),),
            "jump_positions": (float(travel * r.uniform(-0.3, 0.3)),),
        }
        return DataHints(peaks, suggested)

    def _records(self) -> dict[str, Record]:
        """One or two records to fit, one or two held out, sometimes a rest."""
        most, r = np.asarray(self.physics.drive.scale), self.rng
        roles = ["fit"] * int(r.integers(1, 3)) + ["hold_out"] * int(r.integers(1, 3))
        if self.poses:
            low = np.zeros(len(most)) if not self.physics.bipolar or self.kind == "mirror poses" else -most
            drives = [low + (most - low) * r.uniform(0.1, 0.9, (int(r.integers(18, 40)), len(most))) for _ in roles]
        elif self.kind == "force":
            drives = [_imposed(r, most) for _ in roles]
        else:
            drives = [0.5 * most * _motion(r)[:, None] for _ in roles]
            if r.random() < 0.4:
                roles, drives = [*roles, "rest"], [*drives, np.zeros((300, len(most)))]
        records, h, begin = {}, np.inf if self.poses else H, 0.0
        for k, (role, u) in enumerate(zip(roles, drives, strict=True)):
            time = begin + np.arange(len(u)) * (1.0 if self.poses else H)
            begin += 0.0 if self.poses else len(u) * H + 1.0
            y = np.zeros((len(u), len(self.channels)))
            records[f"{role}{k}"] = Record(f"{role}{k}", role, time, h, u, y, self.linear, None, y == 0)
        return records

    def write(self, folder: Path) -> None:
        """recording.toml and a file a record, in units of the reader."""
        r, signal = self.rng, self.physics.drive
        units = [_read_in(r, unit) for unit in self.physics.readings[1]]
        drive_units = list(signal.units) if self.kind == "force" else [_read_in(r, unit) for unit in signal.units]
        named = zip(signal.channels, drive_units, strict=True)
        columns = [f'"drive.{c}" = {{ column = "u{i}", unit = "{u}" }}' for i, (c, u) in enumerate(named)]
        stated = r.choice([1.0, 0.5, 1.5, 0.0], p=[0.4, 0.15, 0.1, 0.35])
        tolerance = 10 ** r.uniform(0, 2) if r.random() < 0.1 else 0.0
        for i, (channel, unit) in enumerate(zip(self.channels, units, strict=True)):
            sd = float(self.noise[i] * difference(1.0, unit))
            more = f', noise = "{stated * sd:.6g} {unit}"' if stated else ""
            more += f', tolerance = "{tolerance * sd:.6g} {unit}"' if tolerance else ""
            columns.append(f'"{channel}" = {{ column = "y{i}", unit = "{unit}"{more} }}')
        faults = Faults(r.random() < 0.25, r.random() < 0.2 and not self.poses, _colour(r))
        tables = [self._write_record(folder, name, units, drive_units, faults) for name in self.records]
        kind = "poses" if self.poses else "series"
        top = f'title = "a random case"\ndevice = "{self.device.name}"\nkind = "{kind}"\n[columns]\n'
        (folder / "recording.toml").write_text(top + "\n".join(columns) + "\n" + "".join(tables))

    def _write_record(
        self, folder: Path, name: str, units: Sequence[str], drive_units: Sequence[str], faults: Faults
    ) -> str:
        """Writes the rows of a record, noisy; its table of recording.toml."""
        r, record, y = self.rng, self.records[name], self.readings[name]
        y = y + self.noise * _coloured(r, y.shape, faults.colour)
        kept = np.ones(len(y), bool)
        if record.role != "rest" and faults.spikes:
            y = y + (r.random(y.shape) < 0.01) * self.noise * r.uniform(8, 60) * r.choice([-1, 1], y.shape)
        if record.role != "rest" and faults.gaps:
            kept[5:-5] = r.random(len(y) - 10) > 0.01
        rows = [record.time, *(from_si(u, unit) for u, unit in zip(record.drive.T, drive_units, strict=True))]
        rows += [from_si(v, unit) for v, unit in zip(y.T, units, strict=True)]
        head = ",".join(["t", *(f"u{i}" for i in range(len(drive_units))), *(f"y{i}" for i in range(len(units)))])
        np.savetxt(folder / f"{name}.csv", np.column_stack(rows)[kept], "%.12g", ",", header=head, comments="")
        clock = "" if self.poses else 'time = { column = "t", unit = "s" }\n'
        held = 'between_samples = "linear"\n' if self.linear else ""
        return f'[[record]]\nfile = "{name}.csv"\nrole = "{record.role}"\n{clock}{held}'


@dataclass(frozen=True)
class Faults:
    """What is wrong with the readings: spikes of one in a hundred, rows that are missing, the pole of the noise."""

    spikes: bool
    gaps: bool
    colour: float


def _read_in(rng: Rng, unit: str) -> str:
    return str(rng.choice(READERS.get(unit, (unit,))))


def _colour(rng: Rng) -> float:
    return float(rng.uniform(0.3, 0.8)) if rng.random() < 0.2 else 0.0


def _imposed(rng: Rng, most: Sequence[float]) -> np.ndarray:
    """Position, velocity and acceleration within the first two of their sizes."""
    x = _motion(rng, smooth=True)
    v = np.gradient(x, H)
    size = min(0.9 * most[0], 0.9 * most[1] / np.abs(v).max())
    return size * np.column_stack([x, v, np.gradient(v, H)])


def _motion(rng: Rng, smooth: bool = False) -> np.ndarray:
    """From zero, within one: sines that no period joins, or levels with short ramps between."""
    n = int(rng.integers(400, 900))
    t = np.arange(n) * H
    if rng.random() < 0.25 and not smooth:
        levels = np.repeat(np.concatenate([[0.0], rng.uniform(-1, 1, n // 80 + 1)]), 80)[:n]
        return np.convolve(levels, np.hanning(21) / np.hanning(21).sum(), "same")
    most = 1.0 if smooth else 1.6
    parts = [(10.0 ** rng.uniform(0.1, most), rng.uniform(0.2, 1), rng.uniform(0, 6)) for _ in range(5)]
    x = sum(a * np.sin(2 * np.pi * f * t + p) for f, a, p in parts)
    return (x - x[0]) / np.abs(x - x[0]).max()


def _foreign(rng: Rng, y: np.ndarray) -> np.ndarray:
    """Of size one: a walk, a kink of the reading, or a product of two readings."""
    scaled = y / np.maximum(np.abs(y).max(axis=0), 1e-300)
    walk = np.cumsum(rng.standard_normal(y.shape), axis=0) / np.sqrt(len(y))
    kink = 3 * np.maximum(scaled - 0.3, 0)
    product = 3 * scaled * np.roll(scaled, 1, axis=1) ** 2
    return (walk, kink, product)[int(rng.integers(3))]


def _coloured(rng: Rng, shape: tuple[int, ...], phi: float) -> np.ndarray:
    e = rng.standard_normal(shape)
    for k in range(1, len(e)):
        e[k] = phi * e[k - 1] + np.sqrt(1 - phi**2) * e[k]
    return e
