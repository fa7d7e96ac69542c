"""What constant loads do to a mechanism, for the reader: faults, and the lines of `ctrlgen check`."""

from __future__ import annotations

import casadi as ca
import numpy as np

from ctrlgen.core.errors import Fault
from ctrlgen.core.percent import percent
from ctrlgen.core.units import show
from ctrlgen.devices.mechanism.condensed import Condensed, nominal
from ctrlgen.devices.mechanism.drawing import Drawing
from ctrlgen.devices.mechanism.loaded_tangent import PressedFlexure, loaded_tangent
from ctrlgen.devices.mechanism.loads import Loads
from ctrlgen.devices.mechanism.second_order import SecondOrder
from ctrlgen.physics.screw import TWIST, inverse_adjoint

STILL = 1e-6  # of the largest component of a motion, below which it is rounding of a symmetric drawing
SLIGHT = 0.1  # |p| of a flexure that is hardly pressed: its stiffness changes by a hundredth
HOLDS = 0.01  # of the stiffness of an axis: what it may be off by under the loads without a word


def load_faults(device: Drawing) -> list[Fault]:
    """Loads that the model cannot hold: beside cubic springs, masses on bodies without one, and those that buckle the mechanism."""
    if not (device.load or device.gravity):
        return []
    heavy = [
        x.name
        for x in device.placed_loads
        if x.section.mass is not None and device.placed_bodies[x.second].section.mass is None
    ]
    if heavy:
        return [Fault("load", f"{', '.join(heavy)}: give mass and inertia to the body that carries it")]
    c = nominal(device)
    if c.ported:
        what = "constant loads beside a super-element: what they make of its stiffness is not in its matrices; leave out one of them"
        return [Fault("load", what)]
    if c.cubics:
        return [Fault("load", "constant loads beside cubic springs are not held by the model; leave out one of them")]
    tangent = loaded_tangent(c)
    faults = [Fault("load", _buckled(e)) for e in tangent.flexures if e.buckles]
    K = ca.DM(ca.evalf(ca.SX(c.held_stiffness))).full() + ca.DM(tangent.loads.stiffness).full()
    if not faults and (np.linalg.eigvalsh((K + K.T) / 2).min() <= 0 or tangent.buckles):
        faults.append(Fault("load", "the loads buckle the mechanism: make it stiffer, or load it less"))
    return faults


def _buckled(e: PressedFlexure) -> str:
    """Of a flexure that no bodies could hold."""
    return (
        f"{e.name} is pressed by {show(-e.tension, 'N')} and buckles at {show(e.buckling_load, 'N')} even between ends that do not "
        "turn (4 pi^2 EI/l^2 where it is uniform): make it thicker or shorter, or load it less"
    )


def load_remarks(device: Drawing) -> list[str]:
    """Axes whose stiffness under the constant loads the model has to worse than `HOLDS`, by how much, and up to which loads it holds."""
    if not (device.load or device.gravity):
        return []
    c = nominal(device)
    tangent = loaded_tangent(c)
    if not c.pushes or np.abs(off := tangent.off()).max() <= HOLDS or not tangent.flexures:
        return []
    most, pressed = max(tangent.flexures, key=lambda e: abs(e.p)), ""
    if abs(most.p) > SLIGHT:
        word = "pressed" if most.tension < 0 else "pulled"
        pressed = (
            f"{most.name} is {word} by {show(abs(most.tension), 'N')}, p = N l^2/EI = {float(f'{most.p:.2g}'):g}: "
        )
    axes = ", ".join(
        f"{a.name} by {percent(x, sign=True)}"
        for a, x in zip(device.placed_actuators, off, strict=True)
        if abs(x) > HOLDS
    )
    return [
        f"under the constant loads {pressed}the stiffness that they leave, which the model has to first order in them, is off ({axes} of "
        f"what beam-columns have); it is right to {percent(HOLDS)} up to {percent(tangent.holds_to(HOLDS))} of these loads"
    ]


def load_lines(device: Drawing) -> list[str]:
    """What `ctrlgen check` prints of them: forces, where the output goes, what they do to the stiffness of the axes."""
    c = nominal(device)
    loads = Loads(c, SecondOrder(c))
    if not loads.there:
        return []
    at, body = inverse_adjoint(None, c.output_point), device.bodies.index(device.output.body)
    added = np.zeros((len(loads.sag), 1)) if not c.pushes else _with_stacks(c, loads)
    free = ca.DM(loads.held[body]).full() + ca.DM(loads.s.first_order[body]).full() @ added
    lines = [f"loads move the output point, drives at zero: {_motion(ca.DM(at).full() @ free)}"]
    if not c.pushes:
        return lines
    lines[0] += f"; the axes held: {_motion(ca.DM(at).full() @ ca.DM(loads.held[body]).full())}"
    K, K_F = (ca.DM(ca.evalf(ca.SX(x))).full() for x in (c.held_stiffness, loads.stiffness))
    for i, a in enumerate(device.placed_actuators):
        if not (float(loads.force[i]) or K_F[i, i]):
            continue
        share = percent(K_F[i, i] / K[i, i], sign=True)
        lines.append(f"loads push {a.name} by {show(float(loads.force[i]), 'N')} and change its stiffness by {share}")
    return lines


def _with_stacks(c: Condensed, loads: Loads) -> np.ndarray:
    """(n, 1) how far the axes go, held by the stiffness of their actuators too."""
    K, K_F, f = (ca.DM(ca.evalf(ca.SX(x))).full() for x in (c.held_stiffness, loads.stiffness, loads.force))
    return np.linalg.solve(K + K_F, f)


def _motion(twist: np.ndarray) -> str:
    """A twist (6, 1) in words, without what is rounding."""
    parts = []
    for rows, unit in ((slice(0, 3), "urad"), (slice(3, 6), "um")):
        values, names = twist[rows, 0], TWIST[rows]
        parts += [
            f"{n} {show(float(v), unit)}"
            for n, v in zip(names, values, strict=True)
            if abs(v) > STILL * np.abs(values).max()
        ]
    return ", ".join(parts) or "not at all"
