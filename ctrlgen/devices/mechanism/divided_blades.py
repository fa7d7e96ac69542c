"""Blades that a drawing divides, as for a taper or for the modes between their ends: pieces of one blade, held at its two ends alone.

A piece joins the next at a body that has no mass and that nothing but these two holds, moves or loads, in line with it and with its thin
side the same way: there is no clamp that could forbid it to contract, curve or warp. What its ends forbid (`physics.held_flexure`) is
then that of a blade as long as all pieces together, with the section of each, so that equal pieces are exactly as stiff as the whole. Of
pieces of unlike thickness bending is right to 1.5 % beside Kirchhoff plates of finite elements, torsion to 11 % where the blade is no
wider than long and no piece half as thick again as another (`tests/test_divided_blades.py`); that of wide ones is stiffer, as the thicker
strips hold the others.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ctrlgen.core.units import show
from ctrlgen.devices.mechanism.copies import Placed
from ctrlgen.devices.mechanism.drawing import Drawing
from ctrlgen.devices.mechanism.flexures import Blade
from ctrlgen.devices.mechanism.overlaps import SKEW, SLIGHT, Box, boxes
from ctrlgen.physics.rigid_bodies import GROUND

NAMED = 4  # pieces in a line
TAPERED = 1.5  # thickest over thinnest piece up to which torsion was compared with plates, of blades that are no wider than long
ALIKE = 1.05


def blade_runs(device: Drawing, placed: Sequence[Placed]) -> tuple[tuple[int, ...], ...]:
    """The numbers of the elements that are pieces of one blade, for each blade that is divided."""
    joined: list[set[int]] = [{k} for k in range(len(placed))]
    for one, other in _joints(device, placed):
        if joined[one] is not joined[other]:
            joined[one] |= joined[other]
            for k in joined[one]:
                joined[k] = joined[one]
    return tuple(sorted({tuple(sorted(run)) for run in joined if len(run) > 1}))


def with_runs(placed: Sequence[Placed], runs: Sequence[Sequence[int]]) -> tuple[Placed, ...]:
    """The elements, every piece with all pieces of its blade in `run`."""
    found = list(placed)
    for run in runs:
        for k in run:
            found[k] = replace(placed[k], run=tuple(placed[i] for i in run))
    return tuple(found)


def _joints(device: Drawing, placed: Sequence[Placed]) -> list[tuple[int, int]]:
    """The pairs of elements that are two pieces of one blade."""
    touching: dict[int, list[int]] = defaultdict(list)
    for k, e in enumerate(placed):
        for body in (e.first, e.second):
            touching[body].append(k)
    named = {device.output.body} | {port.body for part in device.super_element for port in part.port}
    named |= {getattr(x, key, None) for x in (*device.actuator, *device.load) for key in ("on", "against")}
    found = []
    for body, at in touching.items():
        if body == GROUND or len(at) != 2 or not all(isinstance(placed[k].section, Blade) for k in at):
            continue
        drawn = device.placed_bodies[body]
        if drawn.section.mass is None and not {drawn.name, drawn.section.name} & named:
            one, other = (boxes([placed[k]])[0] for k in at)
            if _in_line(one, placed[at[0]].second == body, other, placed[at[1]].second == body):
                found.append((at[0], at[1]))
    return found


def _in_line(a: Box, a_free: bool, b: Box, b_free: bool) -> bool:
    """Whether two go on from one another at the named end of each, along one line and with one thin direction."""
    (a_here, a_far), (b_here, b_far) = (
        (x.free, x.fixed) if free else (x.fixed, x.free) for x, free in ((a, a_free), (b, b_free))
    )
    along = (a_here - a_far) / a.length
    return (
        float(np.linalg.norm(a_here - b_here)) < SLIGHT * min(a.length, b.length)
        and float(along @ (b_far - b_here)) > b.length * (1 - SKEW**2)
        and float(np.linalg.norm(np.cross(a.frame[:, 1], b.frame[:, 1]))) < SKEW
    )


def divided(device: Drawing) -> list[tuple[Placed, ...]]:
    """The pieces of every blade that is divided and not slender."""
    found = {
        tuple(piece.name for piece in e.run): e.run for e in device.placed_elements if e.run and not e.section.slender
    }
    return list(found.values())


def divided_lines(device: Drawing) -> list[str]:
    """What `ctrlgen check` prints: which elements count as one blade, and how long it is."""
    what = "held at its ends, not where it is divided"
    return [f"{_named(run)} are pieces of one blade of {show(_length(run), 'mm')}: {what}" for run in divided(device)]


def divided_remarks(device: Drawing) -> list[str]:
    """Tapers whose torsion is not known."""
    remarks = []
    for run in divided(device):
        thick, wide = ([getattr(piece.section, key).si for piece in run] for key in ("thickness", "width"))
        taper, width = max(thick) / min(thick), max(wide) / _length(run)
        if max(wide) / min(wide) > ALIKE:
            remarks.append(f"{_named(run)}: pieces of unlike width, which were not compared with finite elements")
        elif taper > ALIKE and (taper > TAPERED or width > 1):
            remarks.append(
                f"{_named(run)}: thicknesses of {taper:.2g} to 1 on a blade {width:.2g} times as wide as long: plates of finite "
                f"elements are up to twice as stiff in torsion beyond {TAPERED:g} to 1 or once as wide; bending is right to 1.5 %"
            )
    return remarks


def _named(run: Sequence[Placed]) -> str:
    more = f" and {len(run) - NAMED} more" if len(run) > NAMED else ""
    return ", ".join(piece.name for piece in run[:NAMED]) + more


def _length(run: Sequence[Placed]) -> float:
    return float(sum(piece.section.length.si for piece in run))
