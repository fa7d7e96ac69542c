"""A structure with more modes than axes as a linear model: what a device's own model, condensed to its axes, leaves out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.linalg

from ctrlgen.core.units import show

TOLD = 4  # modes in a sentence
NEAR = 0.01  # of a response: closer than a drawing's masses and damping are known
FAINT = 0.01  # of a channel's largest static response: what is below it is not seen beside the rest
SPAN, POINTS = 100, 60  # frequencies below the highest, beside the resonances


@dataclass(frozen=True, eq=False)
class StructuralModel:
    """M q'' + D q' + K q = (f, 0), q = (d, eta): displacements of the n axes, on which the forces f act, and amplitudes of modes with
    the axes held (n + m, n + m); pose = `output` (channels, n + m) q. Without eta it is the device's own model. SI, `damping_ratio` of
    every mode. The readings are `readings` (channels + readings, n + m) q and `per_acceleration` (channels + readings, n) d'':
    in a load what the modes that are left out would add at rest.

    Source: R. R. Craig, M. C. C. Bampton, AIAA J. 6 (1968) 1313.
    """

    mass: np.ndarray
    stiffness: np.ndarray
    output: np.ndarray
    axes: int
    damping_ratio: float
    readings: np.ndarray | None = None
    per_acceleration: np.ndarray | None = None

    @cached_property
    def frequencies(self) -> np.ndarray:
        """Natural frequencies [Hz], ascending."""
        return np.sqrt(scipy.linalg.eigh(self.stiffness, self.mass, eigvals_only=True)) / (2 * np.pi)

    def at(self, stiffness: np.ndarray) -> StructuralModel:
        """The same with that `stiffness` (n, n) of the axes, as at another pose."""
        K = self.stiffness.copy()
        K[: self.axes, : self.axes] = stiffness
        return replace(self, stiffness=K)

    @property
    def condensed(self) -> StructuralModel:
        """The same without eta."""
        n = self.axes
        return StructuralModel(self.mass[:n, :n], self.stiffness[:n, :n], self.output[:, :n], n, self.damping_ratio)

    def sentence(self) -> str:
        """Its first modes beside those of the device's own model."""
        first, own = (", ".join(show(f, "Hz") for f in m.frequencies[:TOLD]) for m in (self, self.condensed))
        return f"The first modes of the bodies are {first}; the model that trajectories and the C follow, condensed to the axes, has {own}."

    @cached_property
    def damping(self) -> np.ndarray:
        """D (n + m, n + m) of one damping ratio."""
        squares, V = scipy.linalg.eigh(self.stiffness, self.mass)
        return np.asarray(self.mass @ V @ np.diag(2 * self.damping_ratio * np.sqrt(squares)) @ V.T @ self.mass)

    def receptance(self, omega: np.ndarray, readings: bool = False) -> np.ndarray:
        """(channels, n, k) pose per force, or what is read of it, at the angular frequencies `omega` (k,), by its modes."""
        squares, V = scipy.linalg.eigh(self.stiffness, self.mass)
        per_mode = 1 / (squares - omega[:, None] ** 2 + 2j * self.damping_ratio * np.sqrt(squares) * omega[:, None])
        forced, seen = V[: self.axes], self.output
        if readings and self.readings is not None:
            seen = self.readings
        found = np.asarray(np.einsum("cm,km,nm->cnk", seen @ V, per_mode, forced))
        if readings and self.per_acceleration is not None:
            more = np.einsum("cm,km,nm->cnk", self.per_acceleration @ forced, per_mode, forced)
            found = found - omega**2 * more
        return found

    def is_near(self, whole: StructuralModel, highest: float) -> bool:
        """Whether its frequency response is within `NEAR` of that of the `whole` model up to `highest` [Hz], resonances included."""
        own = whole.frequencies
        hertz = np.unique(np.concatenate([np.geomspace(highest / SPAN, highest, POINTS), own[own < highest]]))
        exact, static = (whole.receptance(2 * np.pi * f) for f in (hertz, np.zeros(1)))
        floor = FAINT * np.abs(static).max(axis=1, keepdims=True)
        off = np.abs(self.receptance(2 * np.pi * hertz) - exact)
        return bool(np.all(off <= NEAR * np.maximum(np.abs(exact), floor)))

    def response(self, force: np.ndarray, step: float, held: bool) -> np.ndarray:
        """(k, channels) pose under the forces (k, n), `step` [s] apart, which are `held` or linear between, from rest under the first."""
        return np.asarray(self.motion(force, step, held) @ self.output.T)

    def at_rest(self, force: np.ndarray) -> np.ndarray:
        """(channels,) pose under the forces (n,) that do not change."""
        return np.asarray(self.output @ np.linalg.solve(self.stiffness, np.eye(len(self.mass))[:, : self.axes] @ force))

    def motion(
        self, force: np.ndarray, step: float, held: bool, closed: bool = False, before: np.ndarray | None = None
    ) -> np.ndarray:
        """(k, n + m) q under the same, or from rest under the forces `before` (n,); of `closed` forces, which repeat, the periodic one."""
        from scipy.signal import lsim  # takes long to import

        k, n = len(self.mass), self.axes
        inverse = np.linalg.inv(self.mass)
        A = np.block([[np.zeros((k, k)), np.eye(k)], [-inverse @ self.stiffness, -inverse @ self.damping]])
        B = np.vstack([np.zeros((k, n)), inverse[:, :n]])
        forces = np.vstack([force, force[:1]]) if closed else force
        time, system = step * np.arange(len(forces)), (A, B, np.eye(2 * k), np.zeros((2 * k, n)))
        first = force[0] if before is None else before
        x = np.concatenate([np.linalg.solve(self.stiffness, np.eye(k)[:, :n] @ first), np.zeros(k)])
        if closed:
            end = lsim(system, forces, time, 0 * x, interp=not held)[2][-1]
            x = np.linalg.solve(np.eye(2 * k) - scipy.linalg.expm(A * time[-1]), end)
        return np.reshape(lsim(system, forces, time, x, interp=not held)[2], (len(forces), 2 * k))[: len(force), :k]
