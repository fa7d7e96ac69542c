"""The whole MEMS hexapod as one structure: three X-Y stages, six struts, platform; six bar forces or heater powers in.

Each stage is an X axis inside a Y axis (S1 section 2.1): the X axis stands on the Y plate, whose centre lies e_8
along the stage's y, and the Y axis on ground, turned by 90 degrees (S1 section 3.4, step 4). The struts stand on the X
plates. Nothing is condensed or linearised: notches, arms, wires and rods all turn by finite angles.

Heat: the bar's force is S1 eq. (4), the temperature first order (reconstructed, the papers give no dynamics):
tau dT/dt = R P - (T - T_amb). Mechanics is quasi-static.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np

from plants.frame import Array, Equilibrium, Frame, Node
from plants.numbers import read
from plants.struts import Refinement, add_struts, geometry, wire_stress
from plants.xy_stage import Axis, Options, add_axis


def bar_force(T: Array, a: Any) -> Array:
    """F = 2 n alpha(T) (T - T_amb) E w_1 h sin(theta) [N] at `T` [degC], alpha = alpha_0 + alpha_1 T. S1 eq. (4), Table 1."""
    strain = (a.expansion + a.expansion_slope * T) * (T - a.ambient)
    return 2 * a.beams * strain * a.young * a.beam_width * a.thickness * np.sin(a.beam_angle)


def temperature_for(force: Array, a: Any) -> Array:
    """Temperature [degC] at which the bar pushes with `force` [N]: the positive root of `bar_force`."""
    scale = 2 * a.beams * a.young * a.beam_width * a.thickness * np.sin(a.beam_angle)
    b = a.expansion - a.expansion_slope * a.ambient
    c = -a.expansion * a.ambient - np.asarray(force) / scale
    return (-b + np.sqrt(b**2 - 4 * a.expansion_slope * c)) / (2 * a.expansion_slope)


def temperatures(powers: Array, dt: float, a: Any, start: Array) -> Array:
    """Temperatures (n, 6) [degC] at t_k = k dt, power `powers[k]` [W] held from t_k to t_k+1: the exact solution."""
    decay = np.exp(-dt / a.time_constant)
    T = np.empty(np.shape(powers))
    T[0] = start
    for k in range(len(T) - 1):
        steady = a.ambient + a.thermal_resistance * powers[k]
        T[k + 1] = steady + (T[k] - steady) * decay
    return T


@dataclass(frozen=True)
class Recording:
    """What the bench saw. Rows are samples.

    `time` (n,) [s], `power` (n, 6) [W], `temperature` (n, 6) [degC], `force` (n, 6) [N]; `pose` (n, 6), (theta; delta)
    [rad, um], without, and `measured` (n, 6) with the sensor's noise.
    """

    time: Array
    power: Array
    temperature: Array
    force: Array
    pose: Array
    measured: Array


@dataclass
class MemsHexapod:
    """Bar forces (1X, 1Y, 2X, 2Y, 3X, 3Y), positive along the stage's axes, to the pose of the platform.

    `options` refine the stages, `refinement` the struts.
    """

    numbers: SimpleNamespace = field(default_factory=read)
    options: Options = field(default_factory=lambda: Options(beam_elements=2))
    refinement: Refinement = field(default_factory=lambda: Refinement(wire=2, rod=1))

    def __post_init__(self) -> None:
        n, f = self.numbers, Frame()
        self.frame = f
        self.axes: list[Axis] = []
        self.parents: list[Node | None] = []  # what each axis stands on; None: ground
        plates = []
        for home in geometry(n.hexapod).plates:
            y_home = home.at(y=n.stage.centre_offset)
            y_plate, x_plate = f.node(y_home), f.node(home)
            x_axis = add_axis(f, y_plate, x_plate, home, n, self.options)
            y_axis = add_axis(f, f.ground, y_plate, y_home.at(turn_z=np.pi / 2), n, self.options)
            self.axes += [x_axis, y_axis]
            self.parents += [y_plate, None]
            plates.append(x_plate)
        self.plates = plates
        self.platform, self.struts = add_struts(f, plates, n, self.refinement)
        self._load = f.load(self.platform, self.platform.home)
        f.assemble(1e-8)

    def solve(self, forces: Array, start: Equilibrium | Array | None = None, load: Array | None = None) -> Equilibrium:
        """Equilibrium under six bar `forces` (6,) [N] and a `load` (3,) [N] on the platform."""
        loads = np.zeros((self._load + 1, 3))
        for axis, force in zip(self.axes, forces, strict=True):
            loads[axis.push, 0] = force
            if axis.react is not None:  # the beams push the bar against the Y plate they hang on
                loads[axis.react, 0] = -force
        if load is not None:
            loads[self._load] = load
        return self.frame.solve(loads, start=start)

    def pose(self, state: Equilibrium) -> Array:
        """(theta; delta) of the platform's top centre, (6,) [rad, um]; theta is the rotation vector."""
        u, theta = state.moved(self.platform)
        return np.concatenate([theta, u])

    def stage_displacements(self, state: Equilibrium) -> Array:
        """In-plane displacements of the three X plates along their stage's axes, (6,) [um]."""
        return np.concatenate([(plate.home.R.T @ state.moved(plate)[0])[:2] for plate in self.plates])

    def stress(self, state: Equilibrium) -> Array:
        """Largest von Mises stress of the wires, (6, 2) [N/um^2]."""
        return wire_stress(self.frame, self.struts, state, self.numbers.hexapod.wire_diameter)

    def path(self, forces: Array) -> list[Equilibrium]:
        """Equilibria along `forces` (n, 6) [N], each begun where the two before it lead in a straight line.

        After a corner, where the force changes its step by more than the step itself, at the last one.
        """
        states: list[Equilibrium] = []
        for k, row in enumerate(forces):
            start = states[-1].coordinates if states else None
            if k > 1:
                step = forces[k - 1] - forces[k - 2]
                if np.linalg.norm(row - forces[k - 1] - step) <= np.linalg.norm(step):
                    start = 2 * start - states[-2].coordinates
            states.append(self.solve(row, start))
        return states

    def record(
        self,
        powers: Array,
        sample_rate: float,
        heat: Literal["lag", "steady"] = "lag",
        start: Array | None = None,
        noise: tuple[float, float] = (0.0, 0.0),
        seed: int = 0,
    ) -> Recording:
        """The recording of heater `powers` (n, 6) [W] at `sample_rate` [Hz].

        Sample k is taken at t_k = k/sample_rate; power k acts from t_k to t_k+1 and is integrated exactly. `heat="steady"`
        leaves out the lag: T_k = T_amb + R P_k. `start`: temperatures at t_0 (6,) [degC], ambient if None. `noise`:
        standard deviation of the sensor, (rad, um), drawn from `seed`.
        """
        a = self.numbers.actuator
        powers = np.asarray(powers, dtype=float)
        if (powers < 0).any():
            raise ValueError("a heater can only heat: powers must be >= 0")
        begin = np.full(6, a.ambient) if start is None else np.asarray(start, dtype=float)
        steady = a.ambient + a.thermal_resistance * powers
        T = temperatures(powers, 1 / sample_rate, a, begin) if heat == "lag" else steady
        force = bar_force(T, a)
        pose = np.array([self.pose(state) for state in self.path(force)])
        sigma = np.repeat(noise, 3)
        measured = pose + np.random.default_rng(seed).standard_normal(pose.shape) * sigma
        return Recording(np.arange(len(powers)) / sample_rate, powers, T, force, pose, measured)
