"""Random valid mechanisms and paths for them: every kind of element, actuator and reading that a drawing may have, from a seed.

A mechanism is drawn twice. The first drawing has no travel, gain or stress limit yet; what it makes of its actuators sets those of the
second, so that its path lies within its limits whatever was drawn.
"""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from mechanism_files import HEAD, dm, loaded
from random_drawings import Drawing, direction, place, toml

from ctrlgen import InputError, build_model
from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.devices.mechanism.modes import guyan_modes
from ctrlgen.model.simulation import simulate
from ctrlgen.physics.screw import TWIST

USED = (
    0.35  # of the half of a drive's range that a path uses to both sides: the rest is for lags, inertia and bent forces
)
APART = (
    1e4  # of the condition of what actuators make of channels in a tree: no stage is built that moves them less apart
)
BENT_APART = 30.0  # the same where they bend: less apart, what is of second order is more than what is of first
LONGEST = 1e9  # s; any heater has settled


def guided(d: Drawing) -> list[str]:
    """A stage between parallel blades, perhaps on another such stage, pushed straight or by a lever."""
    L, n = d.size, 2 if d.chance(0.5) else 1
    below, axes = "ground", [(1, 0, 0), (0, 1, 0)]
    for k in range(n):
        across = np.array(axes[k], float)
        along = np.array(axes[1 - k], float) * (1 if d.chance(0.5) else -1)
        stage = d.body(f"stage{k + 1}", share=0.8)
        for side in (-1, 1):
            d.flexure(
                below,
                stage,
                side * L / 2 * across,
                along,
                0.6 * L,
                across=across,
                kinds="blade blade blade hinge matrix",
            )
        below = stage
    for k in range(n):
        if d.chance(0.5):
            d.lever(f"stage{k + 1}", -np.array(axes[k]) * L / 2, axes[k], axes[1 - k])
        else:
            d.actuator(f"stage{k + 1}", -np.array(axes[k]) * L / 2 + [0, 0, d.between(-0.1, 0.1) * L], axes[k])
    if d.bends == "cubic" or d.chance(0.2):
        d.spring(f"stage{n}", cubic=d.bends == "cubic")
    return ["delta_x", "delta_y"][:n]


def tripod(d: Drawing) -> list[str]:
    """A platform on three legs of a pattern: out of its plane or in it, pushed straight or by levers."""
    d.table("pattern", name="leg")
    d.tables[-1] += "times = 3\n"
    L, platform = d.size, d.body("platform")
    tall = d.chance(0.5)
    if tall:  # tangential wires leave tip, tilt and piston
        d.flexure("ground", platform, (L, 0, 0), (0, 1, 0), 0.6 * L, pattern="leg", kinds="wire wire strut blade")
        push, side, channels = (0, 0, 1), (0, 1, 0), ["theta_x", "theta_y", "delta_z"]
    else:
        d.flexure("ground", platform, (L, 0, 0), (0, 0, 1), 0.6 * L, pattern="leg", kinds="wire wire strut compliance")
        push, side, channels = (0, 1, 0), (1, 0, 0), ["delta_x", "delta_y", "theta_z"]
    if d.chance(0.4):
        d.lever(platform, (L, 0, 0), push, side, "leg", 3)
    else:
        d.actuator(platform, (0.8 * L, 0, 0), push, "leg")
    if d.bends == "cubic" or d.chance(0.3):
        d.spring(platform, pattern="leg" if d.chance(0.5) and d.bends != "cubic" else "", cubic=d.bends == "cubic")
    return channels


def amplifier(d: Drawing) -> list[str]:
    """Two halves of a mirror pattern: blocks that are pushed, and links that turn their motion across."""
    d.table("pattern", name="half", mirror="x")
    L, table = d.size, d.body("table")
    block = d.body("block", "half", 2, (L / 2, 0, 0), 0.4)
    for side in (-1, 1):
        d.flexure(
            "ground", block, (L, side * L / 6, 0), (0, -side, 0), L / 2, across=(1, 0, 0), pattern="half", kinds="blade"
        )
    link = d.body("link", "half", 2, (L / 4, L / 4, 0), 0.2)
    d.flexure(block, link, (L / 2, L / 8, 0), (-1, 0, 0), L / 8, across=(0, 1, 0), pattern="half", kinds="hinge blade")
    d.flexure(link, table, (L / 8, L / 3, 0), (-1, 0, 0), L / 8, across=(0, 1, 0), pattern="half", kinds="hinge blade")
    d.flexure("ground", table, (0, L / 2, 0), (1, 0, 0), L / 2, across=(0, 1, 0), kinds="blade")
    d.actuator(block, (L / 2, 0, 0), (-1, 0, 0), "half")
    return ["delta_y", "theta_z"] if d.chance(0.5) else ["delta_y", "delta_x"]


def hexapod(d: Drawing) -> list[str]:
    """Six struts from stages that are pushed."""
    d.table("pattern", name="third")
    d.tables[-1] += "times = 3\n"
    L, platform = d.size, d.body("platform")
    foot = d.body("foot", "third", 3, (L, 0, -L / 2), 0.3)
    d.flexure("ground", foot, (L, 0, -L / 2), (0, 0, 1), L / 4, pattern="third", kinds="wire compliance matrix")
    for side in (-1, 1):
        d.flexure(
            foot,
            platform,
            (0.5 * L, side * 0.4 * L, 0),
            (-0.5, side * 0.35, 0.5),
            0.8 * L,
            pattern="third",
            kinds="strut wire",
        )
        d.actuator(foot, (L, side * 0.1 * L, -L / 2), (0, 1, 0) if side < 0 else (1, 0, 0), "third")
    return list(TWIST)


def anything(d: Drawing) -> list[str]:
    """A chain or tree of bodies, joined and pushed at random; as many actuators as come."""
    L, n = d.size, int(d.rng.integers(1, 5))
    for k in range(n):
        body = d.body(f"b{k + 1}", at=L * d.rng.uniform(-0.5, 0.5, 3))
        for _ in range(int(d.rng.integers(1, 4))):
            below = str(d.rng.choice(["ground", *d.moved[:-1]])) if k else "ground"
            d.flexure(below, body, L * d.rng.uniform(-1, 1, 3), direction(d.rng), L * d.between(0.2, 0.8))
    for _ in range(int(d.rng.integers(1, 5))):
        d.actuator(str(d.rng.choice(d.moved)), L * d.rng.uniform(-0.5, 0.5, 3), direction(d.rng))
    if d.bends == "cubic" or d.chance(0.3):
        d.spring(str(d.rng.choice(d.moved)), cubic=d.bends == "cubic")
    return []


FAMILIES = (guided, guided, tripod, tripod, amplifier, hexapod, anything, anything)


class RandomMechanism:
    """The mechanism and the path of a `seed`, written into a folder; what is drawn at random until its actuators move channels apart."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.folder, self.device = folder, None
        attempts = itertools.count()
        while self.device is None:
            self._draw(seed, next(attempts))
        self._sized()
        self.scenario = folder / "scenario.toml"
        self.scenario.write_text(self._scenario())

    def _draw(self, seed: int, attempt: int) -> None:
        self.drawing = Drawing([seed, attempt])
        d, family = self.drawing, FAMILIES[seed % len(FAMILIES)]
        self.channels, self.duration = family(d), 10 ** d.between(-2, 0)
        self.body = (
            str(d.rng.choice(d.moved))
            if family is anything
            else next(b for b in ("table", "platform", "stage2", "stage1") if b in d.moved)
        )
        d.readings()
        kinds = [family.__name__, d.acting, *(["inertia"] if d.inertial else []), d.bends, *d.where]
        self.what = f"seed {seed}: {' '.join(kinds)}"
        order = 'kinematics = "second_order"\n' if d.bends == "second" else ""
        dynamics = '[dynamics]\ndamping_ratio = "2 %"\n' if d.inertial else ""
        self.text = HEAD + order + "\n".join(d.tables) + dynamics
        self.numbers = {
            "GAIN": "1e-6 m" if d.acting == "displacement" else "1 N",
            "TRAVEL": f"{d.size * 1e-4:.6g} m",
            "STRESS": "1e6 GPa",
            "LAG": f"{self.duration * 0.02:.4g} s",
            "RATE": f"{d.high * 30 / self.duration:.4g}",
        }
        try:
            self.device = self._first()
        except InputError as error:  # a reading of what stands still
            if {fault.where for fault in error.faults} != {"reading"}:
                raise

    def _loaded(self, channels: list[str], cubic: float = 0.0) -> Any:
        """The device as it is known so far."""
        lines = []
        for line in self.text.splitlines():
            if "CUBIC" in line:
                if not cubic:
                    continue
                k = float(line.split("CUBIC*")[1].strip('"'))
                line = f'F_x_per_delta_x3 = "{cubic * k:.6g} N/m^3"'
            for key, value in self.numbers.items():
                line = line.replace(key, value)
            lines.append(line)
        at = place(self.drawing.size * np.array([0.1, 0.2, 0.05]))
        output = f'[output]\nbody = "{self.body}"\nat = {toml(at)}\nchannels = {toml(channels)}\n'
        return loaded(self.folder, "\n".join(lines) + "\n" + output)

    def _first(self) -> Any:
        """With channels that its actuators move apart: of a tree that was drawn at random, those that they move most."""
        if self.channels:
            return self._loaded(self.channels)
        n = self.text.count("[[actuator]]")
        for channels in itertools.permutations(TWIST, n):
            try:
                device = self._loaded(list(channels))
            except InputError as error:
                if {fault.where for fault in error.faults} != {"output.channels"}:
                    raise
                continue
            c = Condensed(device, device.values())
            moved = dm(c.output_motion)[:, :n] * np.array([[self.drawing.size]] * 3 + [[1.0]] * 3)
            rows = moved / np.maximum(np.linalg.norm(moved, axis=1, keepdims=True), 1e-3 * np.abs(moved).max())
            conditions = {k: float(np.linalg.cond(rows[list(k)])) for k in itertools.combinations(range(6), n)}
            chosen = min(conditions, key=conditions.__getitem__)
            if conditions[chosen] > (BENT_APART if self.drawing.bends else APART):
                return None
            self.channels = [TWIST[k] for k in chosen]
            return self._loaded(self.channels)
        return None

    def _sized(self) -> None:
        """Gain, travel, cubic springs and largest stress from what the first drawing does."""
        d, n = self.drawing, len(self.channels)
        c = Condensed(self.device, self.device.values())
        self.per_force = np.eye(n) if d.acting == "displacement" else np.linalg.inv(dm(c.held_stiffness))
        reach = np.abs(self.per_force).sum(axis=1).max()
        amplitude = d.size * 10 ** d.between(-5, -3.6 if d.bends in ("stiffening", "cubic") else -2.8)
        if d.acting == "thermal":
            model = build_model(self.device)
            hot = simulate(model, np.array([model.u_bounds[1]]), LONGEST)
            amplitude = float(np.abs(hot.z[-1]).max())
        else:
            gain = amplitude / d.high / reach
            self.numbers["GAIN"] = f"{gain:.9g} {'m' if d.acting == 'displacement' else 'N'}"
            self.gain = gain
        self.numbers["TRAVEL"] = f"{1.5 * amplitude:.6g} m"
        cubic = d.between(0.05, 0.3) / amplitude**2
        self.device = self._loaded(self.channels, cubic)
        c = Condensed(self.device, self.device.values())
        ends = self.displacement(2 * np.array(list(itertools.product((-1.0, 1.0), repeat=n))))
        stresses = [dm(c.stress("metal", ca.DM(end), 1.0)[1]) for end in ends]
        most = max((float(s.max()) for s in stresses if s.size), default=1e9)
        self.numbers["STRESS"] = f"{d.between(1.5, 4) * most:.6g} Pa"
        self.device = self._loaded(self.channels, cubic)

    def displacement(self, s: np.ndarray) -> np.ndarray:
        """(m, n) [m] of the axes with the drives at the shares `s` (m, n) of what a path uses, 0 the middle; of the linear mechanism."""
        d = self.drawing
        if d.acting == "thermal":
            model = build_model(self.device)
            middle = model.u_bounds[1] / 2
            return np.array([simulate(model, (middle * (1 + USED * row))[None], LONGEST).z[-1] for row in s])
        middle, half = (d.low + d.high) / 2, (d.high - d.low) / 2
        return self.gain * (middle + USED * half * s) @ self.per_force.T

    def _scenario(self) -> str:
        """A line between two random places, or a circle or a listed path where the channels allow one; static, or in time."""
        d, n, model = self.drawing, len(self.channels), build_model(self.device)
        pose = ca.Function("pose", [model.z], [model.signals["pose"].expr])

        def at(s: np.ndarray) -> np.ndarray:
            return pose(self.displacement(s[None])[0]).full().ravel()

        def point(values: np.ndarray) -> str:
            units = ["rad" if name.startswith("theta") else "m" for name in self.channels]
            return (
                "{ "
                + ", ".join(f'{name} = "{v:.12g} {u}"' for name, v, u in zip(self.channels, values, units, strict=True))
                + " }"
            )

        start, end, home = at(d.rng.uniform(-1, 1, n)), at(d.rng.uniform(-1, 1, n)), at(np.zeros(n))
        plane = next(
            ([i, k] for i, k in itertools.combinations(range(n), 2) if self.channels[i][0] == self.channels[k][0]), None
        )
        shape, samples = f'kind = "line"\nstart = {point(start)}\nend = {point(end)}\n', int(d.rng.integers(60, 200))
        if plane is not None and d.chance(0.6):
            slope = np.column_stack([(at(0.1 * e) - home) / 0.1 for e in np.eye(n)])
            radius = float((1 / np.linalg.norm(np.linalg.inv(slope)[:, plane], axis=1)).min())
            unit, names = (
                "rad" if self.channels[plane[0]].startswith("theta") else "m",
                [self.channels[k] for k in plane],
            )
            shape = f'kind = "circle"\ndiameter = "{2 * radius:.9g} {unit}"\nplane = {toml(names)}\ncentre = {point(home)}\n'
        if not d.inertial and "RATE" not in self.text and d.chance(0.25):
            return f'title = "t"\ndevice = "device.toml"\npoints = {samples}\n[path]\n{shape}'
        if d.inertial:
            slowest = float(guyan_modes(self.device).frequencies.min())
            self.duration, samples = d.between(20, 60) / slowest, 2 * samples
        if d.acting == "thermal":
            self.duration = d.between(0.4, 1.0)
        timing = f'sample_rate = "{samples / self.duration:.9g} Hz"\nduration = "{self.duration:.9g} s"\n'
        return f'title = "t"\ndevice = "device.toml"\n{timing}[path]\n{shape}'
