"""What flexures do along a path that was solved with a linear force.

A mechanism whose file states no `geometric_stiffening` pulls home linearly, with its `kinematics` of second order quadratically. Here
the displacements of the solved path are put into the same device with the stretching and turning of its flexures: the force that
they take, and the stress there.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ctrlgen.core.percent import percent
from ctrlgen.core.units import show
from ctrlgen.devices import Device
from ctrlgen.model.assembly import build_model
from ctrlgen.model.model import Model
from ctrlgen.model.simulation import Trace
from ctrlgen.trajectory.inverse.violations import limited_values

NOTICED = 0.01  # of the largest force along the path: what `ctrlgen check` calls off by 1 %, and less than a drawing knows its thickness


@dataclass(frozen=True)
class UnstatedStretching:
    """The largest force [N] that a path takes of an `axis`, as the model has it and with what it leaves out, at the sample where they
    differ most; `stress`: the label of the limit that changes most, its value as the model has it, with it, and the bound [Pa]."""

    axis: str
    linear: float
    force: float
    stress: tuple[str, float, float, float] | None

    def sentence(self) -> str:
        """What is left out, by how much, and what to do."""
        share = f" ({percent(self.force / self.linear - 1, 3, sign=True)})" if self.linear else ""
        stress = ""
        if self.stress is not None:
            label, linear, whole, bound = self.stress
            stress = (
                f", {label} {show(whole, 'MPa')} where the model has {show(linear, 'MPa')} (limit {show(bound, 'MPa')})"
            )
        return (
            f"stretching of the flexures is left out: where it counts most {self.axis} takes {show(self.force, 'N')}, not "
            f"{show(self.linear, 'N')}{share}{stress}. Write geometric_stiffening = true at an element, or move less"
        )


def unstated_stretching(model: Model, trace: Trace, drive: np.ndarray) -> UnstatedStretching | None:
    """What stretching does along a solved path, its `trace` of n samples and `drive` (n, drives), SI; None where the model has it, the
    device cannot stretch, or where it is nothing."""
    device = model.device.with_unstated_stretching()
    if device is None:
        return None
    linear, whole = (_forces(of, trace.z) for of in (model.device, device))
    off = np.abs(whole - linear)
    sample, axis = np.unravel_index(int(np.argmax(off)), off.shape)
    if off.max() <= NOTICED * np.abs(linear).max():
        return None
    stretched, worst, stress = build_model(device), 0.0, None
    tables = (limited_values(of, trace.x, trace.z, drive) for of in (model, stretched))
    for (limit, before), (_, after) in zip(*tables, strict=True):
        share = (after - before) / limit.span if limit.name.startswith("stress_") else np.zeros(1)
        if share.max() > worst:
            at = np.unravel_index(int(np.argmax(after)), after.shape)
            worst, stress = share.max(), (limit.label, before.max(), after[at], limit.described(limit.bounds[1]))
    return UnstatedStretching(
        model.axes[axis], abs(float(linear[sample, axis])), abs(float(whole[sample, axis])), stress
    )


def _forces(device: Device, z: np.ndarray) -> np.ndarray:
    """(n, axes) restoring forces [N] at the displacements (n, axes)."""
    d = ca.SX.sym("d", z.shape[1])
    force = ca.Function("force", [d], [device.physics(device.values()).restoring_force(d)])
    return np.asarray(force.map(len(z))(z.T).full().T)
