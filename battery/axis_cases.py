"""Draws one axis: its true and its stated numbers, drives, noise, records; and writes the folder a diagnosis reads."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.signal import chirp, lfilter

from battery.laws import simulate
from battery.plant_axis import Array, Axis, Loop, Planted, Scene

Rng = np.random.Generator
STATED_SD = {"mass": 0.02, "damping": 0.08, "stiffness": 0.03, "force_constant": 0.02}
UNITS = {"mass": "kg", "damping": "N*s/m", "stiffness": "N/m", "force_constant": "N/V"}


@dataclass(frozen=True)
class Take:
    """One record: role, command (n,) [V, or m with a loop], noise (n,) [m], ambient (n,) [K] and its begin on the clock [s]."""

    role: str
    drive: Array
    noise: Array
    ambient: Array | None
    start: float


@dataclass(frozen=True)
class Bench:
    """An axis on the bench: `axis` true, `stated` by its maker, `scene`, the takes, and how the files are written."""

    axis: Axis
    stated: Axis
    scene: Scene
    takes: tuple[Take, ...]
    linear: bool
    noise_stated: bool
    noise_kind: dict[str, Any] = field(default_factory=dict)

    @property
    def fit(self) -> Take:
        """The record of role fit."""
        return next(take for take in self.takes if take.role == "fit")


def draw_axis(rng: Rng, loop: bool) -> tuple[Axis, Axis]:
    """True numbers, and those its maker states: off by the stated standard deviation."""
    if loop:
        true = Axis(
            float(rng.uniform(60, 120)),
            float(rng.uniform(150, 300)),
            0.0,
            float(rng.uniform(25, 40)),
            0.3,
            10.0,
            Loop(160.0, 243.0),
        )
    else:
        mass, f_0, ratio = rng.uniform(0.2, 1.0), rng.uniform(40, 120), rng.uniform(0.04, 0.3)
        w = 2 * np.pi * f_0
        true = Axis(
            float(mass), float(2 * ratio * w * mass), float(mass * w * w), float(rng.uniform(5, 20)), 1e-4, 10.0
        )
    error = {name: 1 + sd * float(np.clip(rng.standard_normal(), -1.8, 1.8)) for name, sd in STATED_SD.items()}
    stated = {name: float(f"{getattr(true, name) * factor:.4g}") for name, factor in error.items()}
    return true, replace(true, **stated)


def multisine(rng: Rng, n: int, dt: float, low: float, high: float) -> Array:
    """Random-phase multisine of unit peak, lines at multiples of 1/(n dt), falling by 1/sqrt(f) above 10 Hz."""
    f = np.fft.rfftfreq(n, dt)
    lines = (f >= low) & (f <= high)
    spectrum = np.where(lines, 1 / np.sqrt(1 + f / 10), 0) * np.exp(2j * np.pi * rng.uniform(size=len(f)))
    u = np.fft.irfft(spectrum, n)
    return u / np.abs(u).max()


def filtered_noise(rng: Rng, n: int, dt: float, high: float) -> Array:
    """Gaussian noise through two poles at `high` [Hz], unit peak."""
    d = np.exp(-2 * np.pi * high * dt)
    u = lfilter([1 - d], [1, -d], lfilter([1 - d], [1, -d], rng.standard_normal(n)))
    return u / np.abs(u).max()


def steps_and_sweep(rng: Rng, n: int, dt: float, high: float) -> Array:
    """Random levels held for 0.2 to 0.6 s, then a sine swept to `high` [Hz]; unit peak."""
    u = np.zeros(n)
    k, half = int(0.1 / dt), int(0.65 * n)
    while k < half:
        dwell = int(rng.uniform(0.2, 0.6) / dt)
        u[k : min(k + dwell, half)] = rng.uniform(-1, 1)
        k += dwell
    t = np.arange(n - half) * dt
    u[half:] = rng.uniform(0.4, 0.9) * chirp(t, 1.0, t[-1], high, method="logarithmic", phi=-90)
    return u / np.abs(u).max()


def moves(rng: Rng, n: int, dt: float, reach: float, pace: float) -> Array:
    """A reference [m]: fifth-order moves between random places within +-`reach`, mean speed about `pace` [m/s]."""
    r, k, at = np.zeros(n), int(0.1 / dt), 0.0
    while k < n:
        to = float(rng.uniform(-reach, reach))
        m = max(int(abs(to - at) / pace / dt), int(0.15 / dt))
        s = np.linspace(0, 1, m)
        part = at + (to - at) * (10 * s**3 - 15 * s**4 + 6 * s**5)
        r[k : k + m] = part[: max(0, n - k)]
        rest = int(rng.uniform(0.05, 0.3) / dt)
        r[k + m : k + m + rest] = to
        k, at = k + m + rest, to
    return r


def draw_noise(rng: Rng, sd: float, phi: float, n: int) -> Array:
    """White (phi = 0) or first-order autoregressive noise of standard deviation `sd`."""
    e = rng.standard_normal(n + 200)
    return sd * np.sqrt(1 - phi**2) * lfilter([1], [1, -phi], e)[200:]


def draw_ambient(rng: Rng, n: int, dt: float) -> Array:
    """A room [K]: 0.3 K of slow wander and the air conditioning's swing."""
    t = np.arange(n) * dt
    swing = 0.2 * np.sin(2 * np.pi * t / rng.uniform(2, 6) + rng.uniform(0, 6.28))
    walk = np.cumsum(rng.standard_normal(n)) * 0.1 / np.sqrt(n)
    return 295.15 + rng.uniform(-0.5, 0.5) + swing + walk


def _drives(rng: Rng, axis: Axis, stated: Axis, counts: tuple[int, int], dt: float) -> tuple[Array, Array]:
    """Fit and held-out commands, scaled so that the axis as stated stays within its stroke and its drive."""
    if axis.loop:
        fit = moves(rng, counts[0], dt, 0.1, 0.12)
        t = np.arange(counts[1]) * dt
        held = 0.02 * chirp(t, 0.3, t[-1], 3.0, phi=-90) * np.minimum(t / 0.3, 1)
        return fit, held
    own = np.sqrt(axis.stiffness / axis.mass) / 2 / np.pi
    noise_like = rng.uniform() < 0.3
    shapes = [
        filtered_noise(rng, counts[0], dt, own) if noise_like else multisine(rng, counts[0], dt, 0.2, 2 * own),
        steps_and_sweep(rng, counts[1], dt, 1.5 * own),
    ]
    scaled = []
    reach = rng.uniform(0.4, 0.75) * stated.stroke
    for shape in shapes:
        peak = np.abs(simulate(axis, shape, scene=Scene(axis, sample_time=dt).rough)).max()
        scaled.append(shape * min(0.9 * axis.drive_limit, reach / peak))
    return scaled[0], scaled[1]


def draw_bench(rng: Rng, seconds: float = 6.0, loop: bool = False, ambient: bool | None = None) -> Bench:
    """A bench with fit (`seconds` long), held-out and perhaps rest records; white or AR noise."""
    dt = 1e-3
    axis, stated = draw_axis(rng, loop)
    counts = int(seconds / dt), int(0.8 * seconds / dt)
    fit, held = _drives(rng, axis, stated, counts, dt)
    noise = float(10 ** rng.uniform(-6, -5.3) if loop else 10 ** rng.uniform(-8.6, -7.9))
    phi = float(rng.choice([0.0, rng.uniform(0.3, 0.85)]))
    takes, clock = [], 0.0
    commands = [("rest", np.zeros(1500))] if rng.uniform() < 0.6 else []
    has_ambient = bool(rng.uniform() < 0.3) if ambient is None else ambient
    for role, drive in [*commands, ("fit", fit), ("hold_out", held)]:
        n = len(drive)
        takes.append(
            Take(role, drive, draw_noise(rng, noise, phi, n), draw_ambient(rng, n, dt) if has_ambient else None, clock)
        )
        clock += n * dt + 0.5
    scene = scene_of(axis, fit, noise, clock - 0.5, dt)
    return Bench(
        axis,
        stated,
        scene,
        tuple(takes),
        bool(rng.uniform() < 0.25),
        bool(rng.uniform() < 0.5),
        {"sd": noise, "phi": phi},
    )


def scene_of(axis: Axis, fit: Array, noise: float, span: float, dt: float) -> Scene:
    """The sizes of the motion under the drive `fit`."""
    q = simulate(axis, fit, scene=Scene(axis, sample_time=dt).rough)
    v = np.gradient(q, dt)
    drive_peak = float(np.abs(fit).max()) if axis.loop is None else 5.0
    return Scene(axis, float(q.std()), float(v.std()), float(np.abs(q).max()), drive_peak, span, noise, dt)


def with_spikes(rng: Rng, bench: Bench) -> Bench:
    """The same bench with three to eight wild readings a record."""
    takes = []
    for take in bench.takes:
        noise = take.noise.copy()
        at = rng.integers(0, len(noise), int(rng.integers(3, 9)))
        noise[at] += rng.choice([-1, 1], len(at)) * rng.uniform(20, 100, len(at)) * bench.scene.noise
        takes.append(replace(take, noise=noise))
    return replace(bench, takes=tuple(takes))


def readings(bench: Bench, planted: list[Planted]) -> list[Array]:
    """The reading (n,) [m] of each take."""
    return [
        simulate(bench.axis, t.drive, planted, bench.scene, t.start, t.ambient, t.noise, bench.linear)
        for t in bench.takes
    ]


def device_text(stated: Axis) -> str:
    """device.toml as a maker would write it."""
    entry = {}
    for name, share in STATED_SD.items():
        value, unit = getattr(stated, name), UNITS[name]
        entry[name] = (
            f'{name} = {{ value = "{value:.6g} {unit}", sd = "{share * value:.3g} {unit}", source = "data sheet" }}'
        )
    if stated.stiffness == 0:
        entry["stiffness"] = 'stiffness = "0 N/um"'
    lines = [
        'kind = "axis"',
        'name = "stage"',
        'title = "A stage on one axis"',
        'source = "data sheet"',
        "",
        "[mechanics]",
        entry["mass"],
        entry["damping"],
        entry["stiffness"],
        f'stroke = "{stated.stroke * 1e6:g} um"',
        "",
        "[actuator]",
        entry["force_constant"],
        f'drive_limit = "{stated.drive_limit:g} V"',
    ]
    if stated.loop:
        g = stated.loop
        lines += [
            "",
            "[loop]",
            'measures = "displacement"',
            f'position_gain = "{g.position_gain:g} 1/s"',
            f'velocity_gain = "{g.velocity_gain:g} V/(m/s)"',
            f'integral_gain = "{g.integral_gain:g} V/(m*s)"',
        ]
    return "\n".join(lines) + "\n"


def write_bench(
    folder: Path,
    bench: Bench,
    planted: list[Planted],
    device: str | None = None,
    length: bool = False,
    stated: float = 1.0,
) -> None:
    """device.toml (as text, else of the axis), recording.toml and one CSV per take.

    `length`: the command is one; `stated`: the stated noise over the true one.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "device.toml").write_text(device or device_text(bench.stated))
    drive_unit, factor = ("um", 1e6) if length or bench.axis.loop is not None else ("V", 1.0)
    noise = f', noise = "{bench.scene.noise * stated * 1e9:.3g} nm"' if bench.noise_stated else ""
    lines = [
        'title = "Recording of a stage"',
        'device = "stage"',
        'source = "bench"',
        'kind = "series"',
        "",
        "[columns]",
        f'"drive.axis" = {{ column = "u", unit = "{drive_unit}" }}',
        f'"reading.axis" = {{ column = "y", unit = "um"{noise} }}',
    ]
    dt = bench.scene.sample_time
    for k, (take, y) in enumerate(zip(bench.takes, readings(bench, planted), strict=True)):
        name = f"record_{k + 1}.csv"
        columns = [np.arange(len(y)) * dt, take.drive * factor, y * 1e6]
        if take.ambient is not None:
            columns.append(take.ambient - 273.15)
        header = "t,u,y" + (",T" if take.ambient is not None else "")
        formats = ["%.4f", "%.9g", "%.6f", "%.4f"][: len(columns)]
        np.savetxt(folder / name, np.column_stack(columns), fmt=formats, delimiter=",", header=header, comments="")
        lines += [
            "",
            "[[record]]",
            f'file = "{name}"',
            f'role = "{take.role}"',
            'time = { column = "t", unit = "s" }',
            f'start = "{take.start:g} s"',
            f'between_samples = "{"linear" if bench.linear else "held"}"',
        ]
        if take.ambient is not None:
            lines.append('conditions = { ambient = { column = "T", unit = "degC" } }')
    (folder / "recording.toml").write_text("\n".join(lines) + "\n")


def describe(bench: Bench) -> dict[str, Any]:
    """What the answer keeps of the bench."""
    return {"true": asdict(bench.axis), "stated": asdict(bench.stated), "noise": bench.noise_kind}
