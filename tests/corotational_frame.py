"""Plane frames of corotational beams, on their own: finite rotations, stretching and bending of straight elements, by Newton's method.

Source: M. A. Crisfield, Non-linear Finite Element Analysis of Solids and Structures 1 (1991), chapter 7.
"""

from __future__ import annotations

import numpy as np


class Frame:
    """`nodes` (n, 2) [m], `beams` of (node, node, EA [N], EI [N m^2]), `held` the numbers 3 node + (0: x, 1: y, 2: turn) that are zero."""

    def __init__(self, nodes, beams, held) -> None:
        self.X, self.beams = np.array(nodes, float), beams
        self.free = np.setdiff1d(np.arange(3 * len(self.X)), held)

    def forces(self, q):
        """Forces (3 n,), tangent (3 n, 3 n), and (axial load, moments at both ends) of every beam in the displacements `q`."""
        f, K, loads = np.zeros(len(q)), np.zeros((len(q), len(q))), []
        for i, j, EA, EI in self.beams:
            of = np.r_[3 * i : 3 * i + 3, 3 * j : 3 * j + 3]
            u = q[of]
            X = self.X[j] - self.X[i]
            x = X + u[3:5] - u[:2]
            L, l = np.hypot(*X), np.hypot(*x)
            alpha = np.arctan2(X[0] * x[1] - X[1] * x[0], X @ x)
            c, s = x / l
            N, (t1, t2) = EA * (l - L) / L, (u[2] - alpha, u[5] - alpha)
            M1, M2 = 2 * EI / L * (2 * t1 + t2), 2 * EI / L * (t1 + 2 * t2)
            r, z = np.array([-c, -s, 0, c, s, 0]), np.array([s, -c, 0, -s, c, 0])
            B = np.array([r, np.eye(6)[2] - z / l, np.eye(6)[5] - z / l])
            f[of] += B.T @ [N, M1, M2]
            D = np.array([[EA / L, 0, 0], [0, 4 * EI / L, 2 * EI / L], [0, 2 * EI / L, 4 * EI / L]])
            geometric = N / l * np.outer(z, z) + (M1 + M2) / l**2 * (np.outer(r, z) + np.outer(z, r))
            K[np.ix_(of, of)] += B.T @ D @ B + geometric
            loads.append((N, M1, M2))
        return f, K, loads

    def moved(self, driven: int, by: float, load=None, steps: int = 20):
        """Force that moves the number `driven` by `by` [m] in `steps`, with `load` (3 n,) on all, the displacements, the beams' loads."""
        q, rest = np.zeros(3 * len(self.X)), np.setdiff1d(self.free, [driven])
        load = np.zeros(len(q)) if load is None else load
        for _ in range(steps):
            # The others go along first: beams that one node stretches alone lead Newton's method anywhere
            _, K, _ = self.forces(q)
            q[rest] -= np.linalg.solve(K[np.ix_(rest, rest)], K[rest, driven]) * by / steps
            q[driven] += by / steps
            for _ in range(40):
                f, K, _ = self.forces(q)
                change = np.linalg.solve(K[np.ix_(rest, rest)], (load - f)[rest])
                q[rest] += change
                if np.abs(change).max() < 1e-13:
                    break
            else:
                raise AssertionError("Newton's method does not converge: more steps are needed")
        f, _, loads = self.forces(q)
        return f[driven] - load[driven], q, loads

    def stiffness(self, driven: int, load) -> float:
        """Change of the force [N/m] that holds the number `driven` at home under a `load` (3 n,), the others free."""
        _, q, _ = self.moved(driven, 0.0, load, steps=1)
        _, K, _ = self.forces(q)
        rest = np.setdiff1d(self.free, [driven])
        return K[driven, driven] - K[driven, rest] @ np.linalg.solve(K[np.ix_(rest, rest)], K[rest, driven])


def line(start, end, parts: int):
    """The nodes of a straight piece, both ends among them."""
    return [np.array(start) + (np.array(end) - start) * k / parts for k in range(parts + 1)]
