"""Mechanisms of flexures that yield at points, with bodies at finite rotations: energy and travels by rotation matrices, equilibria by
Newton's method. Of `ctrlgen` only the compliances and the frames of the drawing are read."""

from __future__ import annotations

import casadi as ca
import numpy as np
from mechanism_files import HEAD, dm, place

from ctrlgen.devices.mechanism.condensed import Condensed


def jointed() -> str:
    """Two bodies on two such flexures, askew; one is pushed from the ground, the other from the first."""
    text = HEAD + '[[body]]\nname = "a"\n[[body]]\nname = "b"\n'
    for name, first, to, at, along in (
        ("k_a", "ground", "a", [3e-3, 1e-3, 2e-3], [1, 0.3, 0.2]),
        ("k_b", "a", "b", [14e-3, 2e-3, -3e-3], [0.4, 1, -0.3]),
    ):
        text += f'[[element]]\nkind = "compliance"\nname = "{name}"\nfrom = "{first}"\nto = "{to}"\nat = {place(at)}\n'
        text += f"along = {along}\nacross = [0, 0, 1]\n"
        text += "".join(f'theta_{x}_per_M_{x} = "{v} rad/(N*m)"\n' for x, v in zip("xyz", (3, 1, 2), strict=True))
        text += "".join(f'delta_{x}_per_F_{x} = "{v} um/N"\n' for x, v in zip("xyz", (90, 150, 60), strict=True))
    for name, against, on, at, along in (
        ("one", "ground", "a", [8e-3, -4e-3, 5e-3], [0.3, 1, 0.4]),
        ("two", "a", "b", [21e-3, 6e-3, -2e-3], [-0.5, 0.3, 1]),
    ):
        text += f'[[actuator]]\nname = "{name}"\nkind = "force"\non = "{on}"\nagainst = "{against}"\nat = {place(at)}\nalong = {along}\n'
        text += 'gain = "1 N/V"\nlow = "-9 V"\nhigh = "9 V"\ntravel = "50 um"\n'
    return text + '[output]\nbody = "b"\nat = ["0 mm", "0 mm", "0 mm"]\nchannels = ["delta_x", "delta_z"]\n'


def rotation(theta: ca.SX) -> ca.SX:
    """exp(theta x) (3, 3) to the fifth order of the angle [rad]."""
    S, a2 = ca.skew(theta), ca.sumsqr(theta)
    return ca.DM.eye(3) + (1 - a2 / 6 + a2**2 / 120) * S + (1 / 2 - a2 / 24) * ca.mtimes(S, S)


def relative(first: ca.SX, second: ca.SX, point: ca.SX, halfway: bool) -> ca.SX:
    """Rotation vector of the second body and displacement of its `point` seen from the first, or from axes `halfway` between both."""
    R, S = rotation(first[:3]), rotation(second[:3])
    Q = ca.mtimes(R.T, S)
    sine = ca.vertcat(Q[2, 1] - Q[1, 2], Q[0, 2] - Q[2, 0], Q[1, 0] - Q[0, 1]) / 2  # of the angle, along the axis
    turn = sine * (1 + ca.sumsqr(sine) / 6 + 3 * ca.sumsqr(sine) ** 2 / 40)  # its arc
    apart = ca.mtimes(R.T, ca.mtimes(S, point) + second[3:] - ca.mtimes(R, point) - first[3:])
    return ca.vertcat(turn, ca.mtimes(rotation(-turn / 2), apart) if halfway else apart)


class ExactJoints:
    """Such a mechanism of two bodies; q (12,) are their rotation vectors and displacements."""

    def __init__(self, c: Condensed) -> None:
        self.q, n = ca.SX.sym("q", 12), len(c.directions)
        at = [self.q[:6], self.q[6:], ca.SX.zeros(6)]  # the last is that of the ground
        strains, seen = [], []
        for e, R, end in zip(c.elements, c.frames, c.ends, strict=True):
            for halfway, found in ((True, strains), (False, seen)):
                motion = relative(at[e.first], at[e.second], end, halfway)
                found += [ca.mtimes(R.T, motion[:3]), ca.mtimes(R.T, motion[3:])]
        self.strain, self.seen = ca.vertcat(*strains), ca.vertcat(*seen)
        self.K = ca.diagcat(*(np.linalg.inv(dm(C))[[3, 4, 5, 0, 1, 2]] for C in c.compliances))  # moments, then forces
        self.travel = ca.vertcat(
            *(
                ca.dot(along, relative(at[a.first], at[a.second], c.point(a), halfway=False)[3:])
                for a, along in zip(c.device.placed_actuators, c.directions, strict=True)
            )
        )
        V, d, f = ca.mtimes([self.strain.T, self.K, self.strain]) / 2, ca.SX.sym("d", n), ca.SX.sym("f", n)
        rest, unknown = (
            ca.vertcat(ca.gradient(V - ca.dot(f, self.travel), self.q), self.travel - d),
            ca.vertcat(self.q, f),
        )
        self.newton = ca.Function("newton", [unknown, d], [unknown - ca.solve(ca.jacobian(rest, unknown), rest)])
        self.energy = ca.Function("V", [self.q], [V])

    def held(self, d: np.ndarray) -> tuple[np.ndarray, float]:
        """q and the energy [J] in equilibrium with the axes at d (n,)."""
        unknown = np.zeros(12 + len(d))
        for _ in range(12):
            unknown = self.newton(unknown, d).full().ravel()
        return unknown[:12], float(self.energy(unknown[:12]))

    def orders(self, d: np.ndarray) -> tuple[list[np.ndarray], list[float]]:
        """First and second order of q, and second to fourth order of the energy [J], in the direction d (n,): from equilibria at shares of
        it of both signs."""
        share = np.array([0.25, 0.5, 0.75, 1.0])
        found = [[self.held(sign * k * d) for k in share] for sign in (1, -1)]
        q, V = (np.array([[x[i] for x in side] for side in found]) for i in (0, 1))

        def lowest(values: np.ndarray, powers: list[int]) -> np.ndarray:
            return np.linalg.solve(share[:, None] ** powers, values)[0]

        odd, even = ([(v[0] + sign * v[1]) / 2 for v in (q, V)] for sign in (-1, 1))
        second, fourth = np.linalg.solve(share[:, None] ** [2, 4, 6, 8], even[1])[:2]
        motions = [lowest(odd[0], [1, 3, 5, 7]), lowest(even[0], [2, 4, 6, 8])]
        return motions, [second, lowest(odd[1], [3, 5, 7, 9]), fourth]

    def of_third_order(self, q: np.ndarray, forces: np.ndarray) -> float:
        """W . (e_3 - theta x (theta x delta)/8) - f . a_3 [J] of the motion q (12,) of first order under the `forces` f (n,), e_3, a_3 of
        what is seen of a flexure from its first body, and of travels. An expansion to deformations and travels of second order leaves
        this of the energy of fourth order out, the eighth where the axes halfway are those of the deformation to second order."""
        s = ca.SX.sym("s")
        orders = [ca.substitute(ca.vertcat(self.seen, self.travel), self.q, s * ca.DM(q))]
        for _ in range(3):
            orders.append(ca.jacobian(orders[-1], s))
        first, third = (ca.DM(ca.evalf(ca.substitute(orders[k], s, 0))).full().ravel() for k in (1, 3))
        m, third = self.seen.numel(), third / 6
        for k in range(0, m, 6):
            turn = first[k : k + 3]
            third[k + 3 : k + 6] -= np.cross(turn, np.cross(turn, first[k + 3 : k + 6])) / 8
        return float(first[:m] @ dm(self.K) @ third[:m] - forces @ third[m:])
