"""Pose sets with memory, or where every law is a little wrong: the MEMS hexapod, and a hexapod commanded in displacement."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from battery import hexapod_cases, memory, truth
from battery.hexapod_cases import PoseBench, Rng
from battery.plant_hexapod import AXES, COMPONENTS, STAGE, Array, Hexapod, changed, cross, turn_z
from battery.size import Gauge
from plants.numbers import MEMS_HEXAPOD, read

MESO_HEXAPOD = MEMS_HEXAPOD.parent / "meso_hexapod.toml"
MESO_AXES = ("1x", "2x", "2y", "3x", "3y", "1y")
MESO_SD = {"hexapod.platform_radius": 0.003, "hexapod.base_radius": 0.003, "hexapod.height": 0.003}  # shares
FINE = 20  # instants within a dwell
CAUSES = ("drive_gain", "sensor_gain", "bow", "coupling", "heat_crosstalk", "frame_turn")
LARGEST = {
    "drive_gain": 0.3,
    "sensor_gain": 0.2,
    "bow": 0.2,
    "coupling": 0.15,
    "heat_crosstalk": 0.06,
    "frame_turn": 0.1,
}
# In the order in which laws act: what a drive gives warms the neighbours, and sensors read the turned frame
PLACES = ("drive", "heat", "stage", "frame", "pose")
KNOWN = ("drive_gain", "sensor_gain", "bow", "coupling", "stiffening")
FOREIGN = ("product", "wander", "kink", "root", "ripple", "bouc_wen_motion", "worn_play", "preisach")


@dataclass(frozen=True)
class Act:
    """One law of a pose plant: what it adds, change(x, amplitude, record), at one of the `PLACES`; the "stage" in um.

    `also`: other names of the same law on this machine.
    """

    name: str
    location: str
    at: str
    amplitude: float
    change: Callable[[Array, float, int], Array]
    shape: dict[str, Any]
    unit: float = 1.0  # of the amplitude, in SI
    also: tuple[str, ...] = ()


@dataclass(frozen=True)
class Machine:
    """A kind of hexapod: `axes`, `unit` of the drive, largest travel [um], and how numbers `n` turn drives into poses."""

    device: str
    file: Path
    axes: tuple[str, ...]
    unit: str
    deviations: dict[str, float]
    to_stage: Callable[[SimpleNamespace, Array], Array]
    to_pose: Callable[[SimpleNamespace, Array], Array]
    partner: tuple[int, ...]  # the other axis of the same stage


def meso_jacobian(n: Any) -> Array:
    """Pose (theta; u) per actuator displacement [rad/um, 1] of rigid struts on ball joints: D_i'(u + theta x A_i) = D_i' v_i.

    The stages of struts 1 and 6, 2 and 3, 4 and 5 are moved by the actuators 1x and 1y, 2x and 2y, 3x and 3y.
    """
    h = n.hexapod
    A = np.array([turn_z(t) @ [h.platform_radius, 0, -h.platform_thickness / 2] for t in h.platform_angles])
    B = np.array([turn_z(t) @ [h.base_radius, 0, -h.height] for t in h.base_angles])
    of_actuator = [int(axis[0]) - 1 for axis in MESO_AXES]
    ways = np.array([[np.cos(angle), np.sin(angle), 0] for angle in n.directions.jacobian])
    left = np.array([np.concatenate([-(d @ cross(a)), d]) for a, d in zip(A, A - B, strict=True)])
    right = np.array([[d @ ways[k] * (of_actuator[k] == STAGE[i]) for k in range(6)] for i, d in enumerate(A - B)])
    return np.linalg.solve(left, right)


MACHINES = {
    "mems": Machine(
        "mems_hexapod",
        MEMS_HEXAPOD,
        AXES,
        "W",
        hexapod_cases.SD,
        lambda n, u: (lambda p: p.displacement(p.temperature(u)))(Hexapod(n)),
        lambda n, d: Hexapod(n).pose(d),
        (1, 0, 3, 2, 5, 4),
    ),
    "meso": Machine(
        "meso_hexapod",
        MESO_HEXAPOD,
        MESO_AXES,
        "um",
        MESO_SD,
        lambda n, u: u,
        lambda n, d: d @ meso_jacobian(n).T,
        (5, 2, 1, 4, 3, 0),
    ),
}


@dataclass(frozen=True)
class Bench:
    """A machine, its pose sets (`poses.shares`: true numbers over the stated ones, less 1), and seconds per pose."""

    machine: Machine
    poses: PoseBench
    dwell: float

    def reading(self, acts: Sequence[Act], record: int, shares: dict[str, float] | None = None) -> Array:
        """Poses (n, 6) [rad, um] of record 0 (to fit) or 1 (held out), without noise."""
        n = changed(read(self.machine.file), self.poses.shares if shares is None else shares)
        x = self.poses.drives[("fit", "hold_out")[record]]
        onwards = {"heat": self.machine.to_stage, "stage": self.machine.to_pose}
        for place in PLACES:
            onward = onwards.get(place)
            x = x + sum((a.change(x, a.amplitude, record) for a in acts if a.at == place), np.zeros_like(x))
            x = onward(n, x) if onward else x
        return x


def draw_bench(rng: Rng, kind: str, messy: bool) -> Bench:
    """A machine with 40 to 80 random poses to fit and a closed curve held out, numbers off by more than stated if `messy`."""
    bench, machine = hexapod_cases.draw_bench(rng), MACHINES[kind]
    drives, sd = bench.drives, bench.sd
    if kind == "meso":
        drives = {role: np.round((u - 0.28) * 1200, 3) for role, u in drives.items()}  # um
        sd = float(10 ** rng.uniform(-6.5, -6.0)), float(10 ** rng.uniform(-1.7, -1.2))  # rad, um
    low, high = (1.2, 2.5) if messy else (0.0, 1.8)
    shares = {p: float(rng.choice([-1, 1]) * rng.uniform(low, high)) * s for p, s in machine.deviations.items()}
    phi = float(rng.uniform(0.3, 0.7)) if messy else 0.0
    noise = {}
    for role, u in drives.items():
        e = rng.standard_normal(u.shape)
        for k in range(1, len(e)):
            e[k] = phi * e[k - 1] + np.sqrt(1 - phi**2) * e[k]
        noise[role] = e * np.repeat(sd, 3)
    poses = replace(bench, drives=drives, noise=noise, shares=shares, sd=sd)
    return Bench(machine, poses, float(rng.uniform(5, 20)))


class PoseGauge(Gauge):
    """Sizes on the record to fit, after the stated numbers and a zero point per component took away what they can."""

    def __init__(self, bench: Bench) -> None:
        self.bench, self.sd = bench, np.repeat(bench.poses.sd, 3)
        self.plain = bench.reading([], 0)
        true = bench.poses.shares
        columns = []
        for path in true:
            up, down = (bench.reading([], 0, true | {path: true[path] + s}) for s in (1e-4, -1e-4))
            columns.append(((up - down) / 2e-4 / self.sd).ravel())
        self.columns = np.column_stack(columns)
        self._all = np.column_stack([self.columns, np.tile(np.eye(6), (len(self.plain), 1))])
        self._basis = np.linalg.qr(self._all / np.linalg.norm(self._all, axis=0))[0]

    def size(self, planted: Act) -> float:
        """rms of the change over the noise, all components."""
        change = ((self.bench.reading([planted], 0) - self.plain) / self.sd).ravel()
        return float(np.sqrt(np.mean((change - self._basis @ (self._basis.T @ change)) ** 2)))


def draw_act(name: str, rng: Rng, bench: Bench, gauge: PoseGauge) -> Act:
    """The law `name` on a drawn axis or component, with a first guess of its amplitude."""
    machine = bench.machine
    k, c = int(rng.integers(6)), int(rng.integers(6))
    drive, stage = f"actuator:{machine.axes[k]}", f"stage:{machine.axes[k]}"
    sensor = f"sensor:{COMPONENTS[c]}"
    n = changed(read(machine.file), bench.poses.shares)
    d = machine.to_stage(n, bench.poses.drives["fit"])
    s, width = float(np.abs(d[:, k]).max()), float(np.abs(gauge.plain[:, c]).max())
    if name in memory.FAMILIES:
        return _memory(name, rng, bench, k, s)

    def only(i: int, f: Callable[[Array], Array]) -> Callable[[Array, float, int], Array]:
        def change(x: Array, a: float, record: int) -> Array:
            out = np.zeros_like(x)
            out[:, i] = a * f(x)
            return out

        return change

    j = machine.partner[k]
    other = (c + 1 + int(rng.integers(5))) % 6
    seeds, place = rng.integers(2**31, size=2).tolist(), float(rng.uniform(-0.3, 0.3))
    across = float(np.abs(gauge.plain[:, other]).max())
    made: dict[str, tuple[str, str, Callable[[Array, float, int], Array]]] = {
        "drive_gain": (drive, "drive", only(k, lambda x: x[:, k])),
        "sensor_gain": (sensor, "pose", only(c, lambda x: x[:, c])),
        "bow": (sensor, "pose", only(c, lambda x: x[:, c] ** 2 / width)),
        "coupling": (stage, "stage", only(k, lambda x: x[:, j])),
        "stiffening": (stage, "stage", only(k, lambda x: -(x[:, k] ** 3) / s**2)),
        "heat_crosstalk": ("actuator:all", "heat", lambda x, a, r: a * (x.sum(axis=1, keepdims=True) - x)),
        "frame_turn": ("mechanism:all", "frame", lambda x, a, r: x @ (np.kron(np.eye(2), turn_z(a)) - np.eye(6)).T),
        "product": (sensor, "pose", only(c, lambda x: x[:, c] * x[:, other] / across)),
        "kink": (sensor, "pose", only(c, lambda x: np.maximum(x[:, c] - place * width, 0))),
        "root": (stage, "stage", only(k, lambda x: np.sign(x[:, k]) * np.sqrt(np.abs(x[:, k]) * s))),
        "ripple": (stage, "stage", only(k, lambda x: s * np.sin(7 * x[:, k] / s + place))),
        "wander": (sensor, "pose", lambda x, a, r: a * _wander(x.shape, c, seeds[r]) * width),
    }
    location, at, change = made[name]
    # A command in displacement that is too small and a lever that is too short are one
    if name == "drive_gain" and machine.unit == "um":
        return Act(name, f"{drive}|{stage}", at, 0.01, change, {}, also=("lever_ratio",))
    return Act(name, location, at, 0.01, change, {})


def _wander(shape: tuple[int, ...], c: int, seed: int) -> Array:
    out = np.zeros(shape)
    steps = np.random.default_rng(seed).standard_normal(shape[0])
    out[:, c] = np.cumsum(steps) / np.sqrt(shape[0])
    return out


def _memory(name: str, rng: Rng, bench: Bench, k: int, s: float) -> Act:
    """A memory of the displacement of stage axis `k`, the motion straight from pose to pose and held for the dwell."""
    family = memory.FAMILIES[name]
    shape = memory.draw_shape(name, rng, s / 2, 2 * bench.dwell)
    parts = FINE if family == "creep" else 1

    def change(x: Array, a: float, record: int) -> Array:
        out = np.zeros_like(x)
        t = np.arange(len(x) * parts) * (bench.dwell / parts)
        out[:, k] = memory.added(name, a, shape, t, np.repeat(x[:, k], parts))[parts - 1 :: parts]
        return out

    axis = bench.machine.axes[k]
    gap = family == "backlash"
    return Act(
        name, f"stage:{axis}|actuator:{axis}", "stage", 0.01 * s if gap else 0.01, change, shape, 1e-6 if gap else 1.0
    )


def shifted(rng: Rng, bench: Bench, gauge: PoseGauge, size: float) -> Bench:
    """The same bench, the zero point of each record and component off by up to `size` times the noise."""
    noise = {role: e + rng.uniform(-size, size, 6) * gauge.sd for role, e in bench.poses.noise.items()}
    return replace(bench, poses=replace(bench.poses, noise=noise))


def shares(bench: Bench, dominant: Sequence[Act], small: Sequence[Act], gauge: PoseGauge) -> dict[str, Any]:
    """What the answer says of shares, as `battery.messy.shares`."""
    true, zero = bench.poses.shares, [e.mean(axis=0) for e in bench.poses.noise.values()]
    observed = tuple((bench.reading([*dominant, *small], r) + zero[r]) / gauge.sd for r in (0, 1))

    def model(present: frozenset[int], x: Array, record: int) -> Array:
        moved = {path: true[path] + share for path, share in zip(true, x, strict=True)}
        return bench.reading([dominant[k] for k in sorted(present)], record, moved) / gauge.sd

    stated = truth.Stated(-np.array(list(true.values())), np.array([bench.machine.deviations[path] for path in true]))
    counted, free = (
        truth.attribute(observed, model, gauge.columns, stated, len(dominant), zeros) for zeros in (False, True)
    )
    return {
        "shares": counted.shares,
        "shares_varying": free.shares,
        "parts": counted.parts,
        "parts_varying": free.parts,
        "before_parts": counted.before_parts,
        "before_parts_varying": free.before_parts,
        "least_error": counted.error,
        "mismatch": counted.before,
    }


def write(folder: Path, bench: Bench, acts: Sequence[Act], dwell: bool) -> None:
    """The folder that a diagnosis reads; `dwell`: whether the recording says how long a pose was held."""
    m = bench.machine
    roles = enumerate(bench.poses.noise)
    poses = {role: bench.reading(acts, k) + bench.poses.noise[role] for k, role in roles}
    columns = {f"u_{axis}": axis for axis in m.axes}
    text = hexapod_cases.device_text(m.file, m.deviations)
    hexapod_cases.write_poses(
        folder, text, m.device, columns, m.unit, bench.poses, poses, round(bench.dwell, 2) if dwell else None
    )
