"""How far each drive takes its axis alone, what stops it before the end of its travel, and where it buckles a flexure.

An axis alone: the other drives at zero, their axes free. Along it the displacements are d_0 + v x, d_0 those under the constant loads, and
of a mechanism of second order those of `bent_reach`.
What a drive presses may buckle as what a load does (`loaded_tangent`): a push rod at 4 pi^2 EI/l^2 at the latest, between ends that do not
turn. The axes are then at a point that the linear equations still have and no mechanism.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import casadi as ca
import numpy as np

from ctrlgen.core.percent import percent
from ctrlgen.core.units import show
from ctrlgen.devices.mechanism.bent_reach import Force, bent_way, home_of, pulled_home
from ctrlgen.devices.mechanism.condensed import KEPT, Condensed, nominal
from ctrlgen.devices.mechanism.drawing import Drawing
from ctrlgen.devices.mechanism.drives import held_forces
from ctrlgen.devices.mechanism.flexures import Beam
from ctrlgen.devices.mechanism.loaded_tangent import LoadedTangent, loaded_tangent
from ctrlgen.devices.mechanism.loads import DrivenLoads
from ctrlgen.devices.mechanism.stretching import Stretching
from ctrlgen.devices.travel import ends_of
from ctrlgen.physics.screw import numbers

HARDLY, FAR = 0.1, 1e3  # of its travel: a drive that takes its axis less far, or farther, was not meant so
STRETCHED = 0.01  # of a force: where stretching makes less of it, it makes less than twice that of a stress
SMALL = 1e-3  # of a way, where the force is linear
NOTICED = 0.05  # of a reach or a stress: what stretching makes of it is told from there on
PRESSED = 1.0  # -p of a flexure: less bends no column by more than a tenth
STEPS = 30  # halvings of an interval
FLOOR = 1e-9  # of a stress limit, as in the limit itself


@dataclass(frozen=True)
class Stressed:
    """Along an axis alone the largest stress of a material [Pa], its limit, and the displacement [m] nearest home from which on it is
    above that; None where it is not, or everywhere. `home`: the stress without drives, by constant loads [Pa]."""

    material: str
    most: float
    limit: float
    met: float | None
    home: float


@dataclass(frozen=True, eq=False)
class Reach:
    """Of an axis alone, each from the lower to the upper side [m]: its `travel`, and where its drive takes it; of a mechanism of second
    order the displacements (points, n) on its `bent` way, and by how much of itself the force at its ends is `off` a linear one."""

    name: str
    travel: tuple[float, float]
    drive: tuple[float, float]
    home: np.ndarray
    way: np.ndarray
    own: int
    bent: np.ndarray | None = None
    off: float = 0.0

    @property
    def ends(self) -> tuple[float, float]:
        """As far as both travel and drive allow."""
        low, high = self.drive
        start = float(self.home[self.own])
        return min(max(low, self.travel[0]), start), max(min(high, self.travel[1]), start)

    def at(self, x: float) -> np.ndarray:
        """(n,) the displacements of all axes with its own at x."""
        if self.bent is None:
            return self.home + self.way * (x - self.home[self.own])
        return np.array([np.interp(x, self.bent[:, self.own], of_one) for of_one in self.bent.T])


@lru_cache(maxsize=KEPT)
def reaches(c: Condensed) -> tuple[Reach, ...]:
    """Of each axis of a mechanism of numbers without cubic springs, with the force that the model has."""
    straight = straight_reaches(c)
    if not (c.pushes and c.device.second_order):
        return straight
    return bent_reaches(c, straight, c.device.geometric_stiffening)


@lru_cache(maxsize=KEPT)
def bent_reaches(c: Condensed, straight: tuple[Reach, ...], stretches: bool) -> tuple[Reach, ...]:
    """With the force of second order, and of flexures that stretch; those that it does not bring to an end of their drive within ten times
    their travel stay `straight`."""
    loads = loaded_tangent(c).loads
    force = pulled_home(c, loads, Stretching(loads.s) if stretches else None)
    found = []
    for r, ends in zip(straight, held_forces(c), strict=True):
        travel, most = max(map(abs, r.travel)), max(map(abs, ends))
        home = home_of(force, r.home, most)
        sides = [] if home is None else [_side(force, home, r, push, travel) for push in ends]
        known = [side for side in sides if side is not None]
        if home is None or len(known) < len(ends):
            found.append(r)
            continue
        whole, drive = np.vstack(known), (float(known[0][-1, r.own]), float(known[1][-1, r.own]))
        way = replace(r, home=home, drive=drive, bent=whole[np.argsort(whole[:, r.own])])
        found.append(replace(way, off=max(_off(force, way, end) for end in way.ends)))
    return tuple(found)


def _side(force: Force, home: np.ndarray, r: Reach, push: float, travel: float) -> np.ndarray | None:
    return bent_way(force, home, r.own, r.way, push, travel) if push else home[None, :]


def _off(force: Force, r: Reach, end: float) -> float:
    if end == r.home[r.own]:
        return 0.0
    small = SMALL * (end - r.home[r.own])
    linear = force(r.at(r.home[r.own] + small))[r.own] / SMALL
    return float(abs(force(r.at(end))[r.own] / linear - 1))


@lru_cache(maxsize=KEPT)
def straight_reaches(c: Condensed) -> tuple[Reach, ...]:
    """Of each axis, with a linear force."""
    placed, loads = c.device.placed_actuators, loaded_tangent(c).loads
    n = len(placed)
    stiffness = numbers(c.held_stiffness) + numbers(loads.stiffness) if c.pushes else np.eye(n)
    yields = np.linalg.inv(stiffness)
    home = (yields @ numbers(loads.force)).ravel() if c.pushes else np.zeros(n)
    found, forces = [], held_forces(c)
    for i, a in enumerate(placed):
        low, high = forces[i]
        drive = (float(home[i] + yields[i, i] * low), float(home[i] + yields[i, i] * high))
        found.append(Reach(a.name, ends_of(a.section.travel), drive, home, yields[:, i] / yields[i, i], i))
    return tuple(found)


def _told(device: Drawing) -> tuple[Reach, ...]:
    c = nominal(device)
    return () if c.cubics or c.ported else reaches(c)


def reach_lines(device: Drawing) -> list[str]:
    """What `ctrlgen check` prints: where each drive takes its axis alone, and the largest stress on that way."""
    lines = []
    for r, stretched in zip(_told(device), _stretched(device), strict=True):
        parts = [f"its drive reaches {_span(r.drive)}", f"its travel is {_span(r.travel)}"]
        for s in stresses(nominal(device), r):
            beyond = "" if s.met is None else f", its limit from {show(s.met, 'um')} on"
            inside = sheared_stress(nominal(device), s.material, [r.at(end) for end in r.ends])
            more = (
                f", inside of flexures {show(inside, 'MPa')} by transverse shear"
                if inside > (1 + NOTICED) * s.most
                else ""
            )
            parts.append(
                f"stress of {s.material} on it up to {show(s.most, 'MPa')} of {show(s.limit, 'MPa')}{beyond}{more}"
            )
        lines.append(f"{r.name} alone: {'; '.join([*parts, *_left_out(nominal(device), r, stretched)])}")
    return lines


def _stretched(device: Drawing) -> tuple[Reach | None, ...]:
    """Of every axis that is told its reach with flexures that stretch, where the model has them not."""
    c = nominal(device)
    if not c.pushes or device.geometric_stiffening or not any(isinstance(e, Beam) for e in device.element):
        return (None,) * len(_told(device))
    return bent_reaches(c, straight_reaches(c), True) if _told(device) else ()


def sheared_stress(c: Condensed, material: str, places: Sequence[np.ndarray]) -> float:
    """The largest stress [Pa] inside of the sections of a material, where transverse shear is largest, with the axes at `places` (n,)."""
    return max(float(_stress(c, c.device.geometric_stiffening, True)[material](place)) for place in places)


def _sheared_off(device: Drawing) -> list[str]:
    """Materials whose limit the stress that the model has keeps, and that inside of the sections does not."""
    c, remarks = nominal(device), []
    for r in _told(device):
        for s in stresses(c, r):
            inside = sheared_stress(c, s.material, [r.at(end) for end in r.ends])
            if inside > s.limit >= s.most:
                remarks.append(
                    f"{r.name} alone shears {s.material} to {show(inside, 'MPa')} inside of a short flexure, above its limit of "
                    f"{show(s.limit, 'MPa')}; the limit of the model holds bending, tension and torsion, here {show(s.most, 'MPa')}: "
                    "make the flexure longer or thicker, or load it less"
                )
    return remarks


def _overloaded(device: Drawing) -> list[str]:
    """Materials that the constant loads alone stress beyond their limit."""
    return [
        f"the constant loads alone stress {s.material} to {show(s.home, 'MPa')}, above its limit of {show(s.limit, 'MPa')}: check the "
        "loads, gravity and the units, or make the flexures that carry them stronger"
        for r in _told(device)[:1]
        for s in stresses(nominal(device), r)
        if s.home > s.limit
    ]


def _is_stopped(c: Condensed, r: Reach, stretched: Reach) -> bool:
    """Whether stretching keeps an axis from an end that it has in the model, or takes a stress beyond its limit."""
    if stretched.off < STRETCHED:
        return False
    falls_short = any(abs(two) < (1 - NOTICED) * abs(one) for one, two in zip(r.ends, stretched.ends, strict=True))
    return falls_short or any(
        more.most > more.limit >= s.most for s, more in zip(stresses(c, r), stresses(c, stretched, True), strict=True)
    )


def _left_out(c: Condensed, r: Reach, stretched: Reach | None) -> list[str]:
    """What stretching makes of the reach of an axis and of the stress on it."""
    if stretched is None or stretched.off < STRETCHED:
        return []
    parts = []
    if any(abs(one - other) > NOTICED * abs(one) for one, other in zip(r.ends, stretched.ends, strict=True)):
        parts.append(f"its drive reaches {_span(stretched.drive)}")
    for s, more in zip(stresses(c, r), stresses(c, stretched, True), strict=True):
        if abs(more.most - s.most) > NOTICED * s.most:
            parts.append(f"stress of {s.material} up to {show(more.most, 'MPa')}")
    return [f"with flexures that stretch (geometric_stiffening = true) {', '.join(parts)}"] if parts else []


def reach_remarks(device: Drawing) -> list[str]:
    """Axes that hardly begin their travels, because of their drive or of a stress."""
    remarks = []
    for r in _told(device):
        most = max(map(abs, r.travel))
        if not HARDLY * most <= max(map(abs, r.drive)) <= FAR * most:
            remarks.append(
                f"the drive of {r.name} alone reaches {_span(r.drive)} of a travel of {_span(r.travel)}: check its gain and its range, "
                "which way the flexures are thin, their sizes and the units"
            )
        remarks += [
            f"the stress limit of {s.material} is met at {show(s.met, 'um')} of {r.name} alone, of a travel of {_span(r.travel)}: check "
            "the sizes of the flexures and the units, or move less"
            for s in stresses(nominal(device), r)
            if s.met is not None and abs(s.met) < HARDLY * most
        ]
    remarks += _overloaded(device) + _sheared_off(device)
    for r, stretched in zip(_told(device), _stretched(device), strict=True):
        if stretched is not None and _is_stopped(nominal(device), r, stretched):
            told = _left_out(nominal(device), r, stretched)
            remarks += [
                f"{r.name} alone goes less far than the model says: {what}; state it, or move less" for what in told
            ]
    return remarks


def buckling_remarks(device: Drawing) -> list[str]:
    """Axes that buckle the mechanism on their way, each side by itself."""
    found = (_buckled(nominal(device), r, end) for r in _told(device) for end in r.ends)
    return [sentence for sentence in found if sentence]


def _span(ends: tuple[float, float]) -> str:
    return f"{show(ends[0], 'um')} to {show(ends[1], 'um')}"


@lru_cache(maxsize=KEPT)
def _stress(c: Condensed, stretches: bool, sheared: bool = False) -> dict[str, ca.Function]:
    """Of each material with a limit its largest stress [Pa] with the axes at d (n,)."""
    loads, d, found = loaded_tangent(c).loads, ca.SX.sym("d", len(c.directions)), {}
    stretched = Stretching(loads.s).extra_load if stretches else None
    for m in c.device.material:
        if m.stress_limit is not None:
            floor, constant = FLOOR * m.stress_limit.si, loads.wrench if loads.there else None
            names, stress = c.stress(m.name, d, floor, stretched, constant, sheared)
            if names:
                found[m.name] = ca.Function("stress", [d], [ca.mmax(stress)])
    return found


def stresses(c: Condensed, r: Reach, stretches: bool | None = None) -> list[Stressed]:
    """Of each material with a stress limit, along an axis alone; whether flexures stretch, left out: as the model has it."""
    found, laws = [], _stress(c, c.device.geometric_stiffening if stretches is None else stretches)
    for m in c.device.material:
        if (law := laws.get(m.name)) is None:
            continue
        limit, start = m.stress_limit.si, float(r.home[r.own])
        at_ends = {end: float(law(r.at(end))) for end in r.ends}
        met = None
        home = float(law(r.home))
        if home <= limit:
            places = [_beyond(law, limit, r, start, end) for end, most in at_ends.items() if most > limit]
            met = min(places, key=abs, default=None)
        found.append(Stressed(m.name, max(home, *at_ends.values()), limit, met, home))
    return found


def _buckled(c: Condensed, r: Reach, end: float) -> str:
    """Where the mechanism buckles on the way to an end, and the flexure that is pressed most; nothing where it does not."""
    constant, start = loaded_tangent(c).loads, float(r.home[r.own])
    far = LoadedTangent(c, DrivenLoads(constant, r.at(end)))
    if end == start or all(e.tension > 0 or abs(e.p) < PRESSED for e in far.flexures):
        return ""
    near = LoadedTangent(c, DrivenLoads(constant, r.home))
    if not near.buckles_between(far, 1.0):
        return ""
    share = _first(0.0, 1.0, lambda x: near.buckles_between(far, x))
    k = min(range(len(far.flexures)), key=lambda k: far.flexures[k].tension / far.flexures[k].buckling_load)
    one, other = near.flexures[k], far.flexures[k]
    press = -(one.tension + share * (other.tension - one.tension))
    place, borne = show(start + share * (end - start), "um"), percent(press / other.buckling_load)
    return (
        f"{r.name} alone buckles the mechanism from {place} on, within its reach of {show(end, 'um')}, and the model does not know "
        f"it: {other.name} is then pressed by {show(press, 'N')}, {borne} of what it bears between ends that do not turn. Move less, or "
        "make it thicker or shorter"
    )


def _beyond(law: ca.Function, limit: float, r: Reach, start: float, end: float) -> float:
    return _first(start, end, lambda x: float(law(r.at(x))) > limit)


def _first(low: float, high: float, there: Callable[[float], bool]) -> float:
    """The place between one where it is not and one where it is."""
    for _ in range(STEPS):
        middle = (low + high) / 2
        low, high = (low, middle) if there(middle) else (middle, high)
    return high
