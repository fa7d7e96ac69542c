"""Mechanisms that others published, as device files, and what they found of them beside ours.

Of each: who, where, whether the numbers are finite elements, measurements or a closed form, and rows of (quantity, theirs, ours).
Closed forms are of slender beams: their blades are `slender` here too, and their dimensions are our choice.
Their sources are partly from memory, and were not checked against the papers.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from conftest import DEVICE
from mechanism_files import HEAD, dm, loaded, number, place, vector, with_values
from paper_mechanisms import meso_hexapod_text, rrr_text

from ctrlgen import load_device
from ctrlgen.devices.mechanism.condensed import Condensed
from ctrlgen.devices.mechanism.modes import natural_frequencies
from ctrlgen.devices.mechanism.point_compliance import point_compliance
from ctrlgen.devices.mechanism.second_order import SecondOrder
from ctrlgen.physics.rigid_bodies import GROUND
from ctrlgen.physics.screw import TWIST
from papers.s0_data import load_paper_recordings
from papers.s1_notch import hinge_equations

NEAR = 0.05  # of theirs: more has a reason


@dataclass(frozen=True)
class Row:
    """A `quantity` [unit] as it is published and as the device file has it; `reason` of a difference above `NEAR`."""

    quantity: str
    unit: str
    published: float
    ours: float
    reason: str = ""

    @property
    def off(self) -> float:
        """Ours less theirs as a share of theirs; of a published zero, ours itself."""
        return self.ours / self.published - 1 if self.published else self.ours


@dataclass(frozen=True)
class Published:
    """A mechanism, its `source`, what its numbers are (`kind`), and its rows, computed in a folder."""

    name: str
    kind: str
    source: str
    rows: Callable[[Path], list[Row]]


@dataclass(frozen=True)
class Beams:
    """Blades in the x-y plane, of one section: `young` [Pa], `thickness` in the plane and `width` across it [m]."""

    young: float
    thickness: float
    width: float
    poisson: float = 0.3
    slender: bool = True
    density: float | None = None

    @property
    def EI(self) -> float:
        """Bending stiffness in the plane [N m^2], of a slender beam."""
        return self.young * self.width * self.thickness**3 / 12

    @property
    def EA(self) -> float:
        """Stiffness along it times its length [N]."""
        return self.young * self.width * self.thickness

    def material(self) -> str:
        """Its table in a device file."""
        dense = f"density = {number(self.density, 'kg/m^3')}\n" if self.density else ""
        return f'[[material]]\nname = "m"\nyoung = {number(self.young, "Pa")}\npoisson = "{self.poisson}"\n{dense}'

    def blade(self, name: str, first: str, second: str, start: Any, end: Any) -> str:
        """A blade from `start` (2,) on the body `first` to `end` on `second` [m]."""
        span = np.subtract(end, start).astype(float)
        return (
            f'[[element]]\nkind = "blade"\nname = "{name}"\nfrom = "{first}"\nto = "{second}"\nat = {place([*end, 0.0])}\n'
            f"along = {vector([*span, 0.0])}\nacross = {vector([-span[1], span[0], 0.0])}\n"
            f"length = {number(np.linalg.norm(span), 'm')}\nthickness = {number(self.thickness, 'm')}\n"
            f'width = {number(self.width, "m")}\nmaterial = "m"\n' + ("slender = true\n" if self.slender else "")
        )


def pushed(body: str, at: Any, along: Any, output: Any, channel: str) -> str:
    """A force of up to 1 N on a body, and what is followed of it."""
    return (
        f'[[actuator]]\nname = "push"\nkind = "force"\non = "{body}"\nat = {place([*at, 0.0])}\nalong = {vector([*along, 0.0])}\n'
        'gain = "1 N/V"\nlow = "-1 V"\nhigh = "1 V"\ntravel = "1 mm"\n'
        f'[output]\nbody = "{body}"\nat = {place([*output, 0.0])}\nchannels = ["{channel}"]\n'
    )


def bodies(*names: str) -> str:
    """Bodies without mass."""
    return "".join(f'[[body]]\nname = "{name}"\n' for name in names)


def second_order(device: Any) -> tuple[np.ndarray, np.ndarray]:
    """(6,) of the output point's twist per displacement of the one axis, and per its square."""
    c = Condensed(*with_values(device))
    second = SecondOrder(c).seen(GROUND, device.bodies.index(device.output.body), c.output_point)
    return dm(c.output_motion)[:, 0], dm(second)[:, 0]


def slope(device: Any) -> float:
    """[N/m] of the force that pulls the one axis home, constant loads included."""
    d = ca.SX.sym("d", 1)
    force = device.physics(device.values()).restoring_force(d)
    return float(ca.Function("slope", [d], [ca.jacobian(force, d)])(0.0))


def parallelogram(folder: Path) -> list[Row]:
    """Two blades of 250 x 50 x 5 mm, 150 mm apart. Loads are counted in EI/L^2 and EI/L, displacements in L."""
    beams, L, half = Beams(210e9, 5e-3, 50e-3, slender=False), 0.25, 0.075
    text = HEAD + beams.material() + bodies("stage")
    text += "".join(beams.blade(f"b{k}", "ground", "stage", (0, y), (L, y)) for k, y in enumerate((half, -half)))
    text += pushed("stage", (L, 0), (0, 1), (L, 0), "delta_y")
    device = loaded(folder, text)
    C, force, moment = point_compliance(device).compliance, beams.EI / L**2, beams.EI / L
    first, square = second_order(device)
    pulled = loaded(
        folder,
        text
        + f'[[load]]\nname = "pull"\non = "stage"\nat = {place([L, 0, 0])}\nforce = {place([force, 0, 0]).replace(" m", " N")}\n',
    )
    mutual = (
        "reciprocity: turn per A_y and u_y/L per B are equal; 9.8e-5 and 8.9e-5 in these finite elements, whose force acts on the one "
        "node that is read; 9.2e-5 here"
    )
    return [
        Row("u_y/L under A_y = 0.5", "1", 0.02006232, C[4, 1] * 0.5 * force / L),
        Row("turn under A_y = 0.5", "rad", 4.8967e-5, C[2, 1] * 0.5 * force, mutual),
        Row("u_x/L under A_x = 2", "1", 3.435728e-5, C[3, 0] * 2 * force / L),
        Row("turn under B = 1", "rad", 1.837729e-4, C[2, 5] * moment),
        Row("u_y/L under B = 3", "1", 2.671484e-4, C[4, 5] * 3 * moment / L),
        Row("u_x L/u_y^2 under A_y = 0.5", "1", -2.430464e-4 / 0.02006232**2, square[3] / first[4] ** 2 * L),
        Row("stiffness with A_x = 1 over without", "1", 0.02006232 / 0.01913616, slope(pulled) / slope(device)),
    ]


def folded_flexure(folder: Path) -> list[Row]:
    """A shuttle on eight beams of 500 x 2 um and two trusses, polysilicon 5 um thick, pushed along x."""
    beams, L, inner, outer = Beams(160e9, 2e-6, 5e-6, 0.22, density=2330.0), 500e-6, 30e-6, 60e-6
    M_p, M_t = 2e-9, 2e-10  # kg: shuttle; both trusses
    text = HEAD + beams.material()
    for name, m in (("shuttle", M_p), ("upper", M_t / 2), ("lower", M_t / 2)):
        inertia = ", ".join([number(m * outer**2, "kg*m^2")] * 3)
        text += f'[[body]]\nname = "{name}"\nmass = {number(m, "kg")}\ninertia = [{inertia}]\n'
    for truss, y in (("upper", L), ("lower", -L)):
        for side in (-1, 1):
            text += beams.blade(f"{truss}_out_{side + 1}", "ground", truss, (side * outer, 0), (side * outer, y))
            text += beams.blade(f"{truss}_in_{side + 1}", truss, "shuttle", (side * inner, y), (side * inner, 0))
    device = loaded(folder, text + pushed("shuttle", (0, 0), (1, 0), (0, 0), "delta_x"))
    C, E, b, h = point_compliance(device).compliance, beams.young, beams.thickness, beams.width
    M_b = 8 * 2330.0 * L * b * h
    stiffness = 2 * E * h * b**3 / L**3
    f = np.sqrt(stiffness / (M_p + M_t / 4 + 12 / 35 * M_b)) / (2 * np.pi)
    modes = natural_frequencies(device)
    return [
        Row("k_x = 2 E h b^3/L^3", "N/m", stiffness, 1 / C[3, 0]),
        Row("k_y = 2 E h b/L", "N/m", 2 * E * h * b / L, 1 / C[4, 1]),
        Row("first mode along x, 12/35 of the beams' mass", "Hz", f, modes[np.argmin(np.abs(modes - f))]),
    ]


def crossing(share: float, half_angle: float, folder: Path) -> tuple[float, float, float]:
    """Turning stiffness [EI/L], shift of the crossing point [L theta^2] of two blades that cross at a `share` of their length from the
    moved body, and the cosine of the half angle."""
    beams, L = Beams(200e9, 20e-6, 5e-3), 20e-3
    text = HEAD + beams.material() + bodies("arm")
    for k, side in enumerate((1, -1)):
        u = np.array([np.cos(half_angle), side * np.sin(half_angle)])
        text += beams.blade(f"b{k}", "ground", "arm", -(1 - share) * L * u, share * L * u)
    device = loaded(folder, text + pushed("arm", (100 * L, 0), (0, 1), (0, 0), "theta_z"))
    first, square = second_order(device)
    shift = np.hypot(square[3], square[4]) / first[2] ** 2 / L
    return L / beams.EI / point_compliance(device).compliance[2, 5], shift, np.cos(half_angle)


def crossed_pivot(folder: Path) -> list[Row]:
    """Two blades that cross at right angles in their middles."""
    stiffness, shift, cosine = crossing(0.5, np.pi / 4, folder)
    return [
        Row("k L/(E I)", "1", 2.0, stiffness),
        Row("shift/(L theta^2) = 1/(12 cos alpha)", "1", 1 / 12 / cosine, shift),
    ]


def generalised_pivot(folder: Path) -> list[Row]:
    """Two blades that cross where their shift vanishes, and at a third of their length, 30 degrees to both sides."""
    rows, best = [], (1 - np.sqrt(5) / 3) / 2
    for share, name in ((best, "0.1273"), (1 / 3, "1/3")):
        stiffness, shift, cosine = crossing(share, np.pi / 6, folder)
        form = 9 * share**2 - 9 * share + 1
        theirs = 0.0 if share == best else abs(form) / (15 * cosine)
        rows += [
            Row(f"k L/(E I) at lambda = {name}", "1", 8 * (3 * share**2 - 3 * share + 1), stiffness),
            Row(f"shift/(L theta^2) at lambda = {name}", "1", theirs, shift),
        ]
    return rows


def remote_pivot(folder: Path) -> list[Row]:
    """Two blades that point to a centre half of their length before their fixed ends."""
    stiffness, _, _ = crossing(-0.5, np.pi / 6, folder)
    return [Row("k L/(E I) = 8 (1 + 3 p + 3 p^2), p = d/L = 0.5", "1", 8 * (1 + 1.5 + 0.75), stiffness)]


def cartwheel(folder: Path) -> list[Row]:
    """Four blades of length L from a hub, two to the ground and two to the arm."""
    beams, L = Beams(200e9, 20e-6, 5e-3), 20e-3
    text = HEAD + beams.material() + bodies("hub", "arm")
    for k, side in enumerate((1, -1)):
        u = L * np.array([np.sqrt(0.5), side * np.sqrt(0.5)])
        text += beams.blade(f"g{k}", "ground", "hub", -u, (0, 0)) + beams.blade(f"a{k}", "hub", "arm", (0, 0), u)
    device = loaded(folder, text + pushed("arm", (100 * L, 0), (0, 1), (0, 0), "theta_z"))
    first, square = second_order(device)
    shift = np.hypot(square[3], square[4]) / first[2] ** 2 / L
    return [
        Row("k L/(E I)", "1", 4.0, L / beams.EI / point_compliance(device).compliance[2, 5]),
        Row("shift/(L theta^2), of two pivots with lambda = 0", "1", 2 / 4 / 15 * np.sqrt(2), shift),
    ]


def notch_guide(folder: Path) -> list[Row]:
    """A parallelogram of four circular notches, R = 2 mm, t = 0.2 mm, b = 10 mm, its links 40 mm long, of aluminium."""
    E, R, t, b, link, half = 70e9, 2e-3, 0.2e-3, 10e-3, 40e-3, 20e-3
    text = HEAD + Beams(E, t, b).material() + bodies("left", "right", "stage")
    hinge = (
        f'{{ kind = "circular", R = {number(R, "m")}, t = {number(t, "m")}, b = {number(b, "m")}, outside = "accept" }}'
    )
    for name, x in (("left", -half), ("right", half)):
        for end, first, second, y in (("low", "ground", name, R), ("high", name, "stage", link + R)):
            text += (
                f'[[element]]\nkind = "hinge"\nname = "{name}_{end}"\nfrom = "{first}"\nto = "{second}"\nat = {place([x, y, 0])}\n'
                f'along = [0, 1, 0]\nacross = [-1, 0, 0]\nhinge = {hinge}\nmaterial = "m"\n'
            )
    device = loaded(folder, text + pushed("stage", (0, link / 2), (1, 0), (0, link / 2), "delta_x"))
    theirs = 4 * 2 * E * b * t**2.5 / (9 * np.pi * np.sqrt(R)) / link**2
    return [Row("k = 4 k_theta/l^2, k_theta = 2 E b t^2.5/(9 pi R^0.5)", "N/mm", theirs / 1e3, slope(device) / 1e3)]


def bent_beams(folder: Path) -> list[Row]:
    """A shuttle between two beams of 500 x 6 um, 12 um thick, inclined by 6 degrees."""
    beams, L, angle = Beams(160e9, 6e-6, 12e-6), 500e-6, np.radians(6)
    text = HEAD + beams.material() + bodies("shuttle")
    for name, side in (("left", -1), ("right", 1)):
        root = np.array([side * L * np.cos(angle), -L * np.sin(angle)])
        text += beams.blade(name, "ground", "shuttle", root, (0, 0))
    device = loaded(folder, text + pushed("shuttle", (0, 0), (0, 1), (0, 0), "delta_y"))
    theirs = 2 * (beams.EA / L * np.sin(angle) ** 2 + 12 * beams.EI / L**3 * np.cos(angle) ** 2)
    return [Row("k = 2 [E A/L sin^2 + 12 E I/L^3 cos^2]", "N/m", theirs, slope(device))]


def rrr_stage(folder: Path) -> list[Row]:
    """S3's stage, case 2, as a mechanism of seven rigid bodies and nine notches, with the two lengths that S3's own matrices tell."""
    text = (DEVICE.parent / "rrr_case2.toml").read_text()
    for name, metres in (("l1", "47.900 mm"), ("l2", "22.170 mm")):
        text, times = re.subn(rf'^({name} *= .*?value = )"[^"]*"', rf'\1"{metres}"', text, flags=re.M)
        assert times == 1
    (folder / "special.toml").write_text(text)
    c = Condensed(*with_values(loaded(folder, rrr_text(load_device(folder / "special.toml")))))
    C_in, J, C_o = np.linalg.inv(dm(c.stiffness)), dm(c.jacobian), dm(c.output_compliance)
    rigid = "S3's own model of rigid links and hinge equations, case 2, is off by +6.2 % here and by +8 to +13 % in J"
    return [
        Row("C_in,Fin (1,1)", "um/N", 0.182, C_in[0, 0] * 1e6),
        Row("C_in,Fin (1,2)", "um/N", -0.024, C_in[0, 1] * 1e6),
        Row("C_o,Fo (1,1)", "um/N", 11.498, C_o[3, 0] * 1e6, rigid),
        Row("C_o,Fo (3,3)", "urad/(N m)", 27966, C_o[2, 5] * 1e6),
        Row("displacement per input 1", "1", float(np.hypot(4.259, 3.897)), float(np.hypot(J[0, 0], J[1, 0])), rigid),
    ]


def mems_notch(folder: Path) -> list[Row]:
    """S1's notch of silicon, R = 40 um, t = 7 um, b = 30 um."""
    C = hinge_equations(load_device(DEVICE))
    beam = "beams load the whole of every section at once, which solids do not where the notch opens; own solids agree within 3 %"
    entries = {
        "theta_z/M_z": ("rad/(N um)", 0.178, C[2, 5] * 1e-6),
        "delta_y/F_y": ("um/N", 301.0, C[4, 1] * 1e6),
        "delta_x/F_x": ("um/N", 1.51, C[3, 0] * 1e6),
        "theta_y/M_y": ("rad/(N um)", 2.01e-2, C[1, 4] * 1e-6),
        "theta_x/M_x": ("rad/(N um)", 9.12e-2, C[0, 3] * 1e-6),
        "delta_z/F_z": ("um/N", 42.6, C[5, 2] * 1e6),
    }
    return [Row(what, unit, theirs, float(ours), beam) for what, (unit, theirs, ours) in entries.items()]


def meso_hexapod(folder: Path) -> list[Row]:
    """NIST's hexapod with the numbers its authors calculated with: the rows of its Jacobian against those that they measured."""
    special = load_device(DEVICE.parent / "meso_hexapod_as_calculated.toml")
    J = dm(Condensed(*with_values(loaded(folder, meso_hexapod_text(special)))).jacobian)
    measured = load_paper_recordings(special).J_c
    built = "a built specimen against its drawing, which is why S0 calibrates it"
    return [
        Row(
            f"{name} of all six actuators, root of squares",
            unit,
            float(np.linalg.norm(theirs)) * size,
            float(np.linalg.norm(ours)) * size,
            built,
        )
        for name, unit, size, theirs, ours in zip(
            TWIST, ["mrad/mm"] * 3 + ["1"] * 3, [1.0] * 6, measured, J, strict=True
        )
    ]


PUBLISHED = (
    Published(
        "parallelogram guide",
        "finite elements",
        "H.-J. Su et al., An open source hierarchical multi-fidelity modeling stack, ASME IDETC 2026, DETC2026-19401, its data "
        "(github.com/haijunsu-osu/parallelogram_model_comparison, fea_models/3d): solids of second order, finite rotations",
        parallelogram,
    ),
    Published(
        "3-RRR stage", "finite elements", "S3, Table 5: plane stress, eight-node elements (ANSYS PLANE82)", rrr_stage
    ),
    Published("circular notch", "finite elements", "S1, eq. (7): solids (Abaqus)", mems_notch),
    Published(
        "meso-scale hexapod", "measured", "S0, eq. (15): Jacobian calibrated with 54 measured poses", meso_hexapod
    ),
    Published(
        "folded flexure",
        "closed form",
        "R. Legtenberg, A. W. Groeneveld, M. Elwenspoek, J. Micromech. Microeng. 6 (1996) 320, stiffness; W. C. Tang, thesis, "
        "Berkeley 1990, mass",
        folded_flexure,
    ),
    Published(
        "crossed-flexure pivot",
        "closed form",
        "W. H. Wittrick, Aust. J. Sci. Res. A 1 (1948) 121; J. A. Haringx, Appl. Sci. Res. A 1 (1949) 313",
        crossed_pivot,
    ),
    Published("pivot without shift", "closed form", "W. H. Wittrick, Aeronaut. Q. 2 (1951) 272", generalised_pivot),
    Published(
        "pivot with a remote centre",
        "closed form",
        "S. Henein, Conception des guidages flexibles, Lausanne 2001",
        remote_pivot,
    ),
    Published("cartwheel hinge", "closed form", "S. Bi, H. Zhao, J. Yu, J. Mech. Des. 131 (2009) 061010", cartwheel),
    Published(
        "guide with four notches",
        "closed form",
        "J. M. Paros, L. Weisbord, Machine Design 37 (1965) 151; S. T. Smith, Flexures, 2000",
        notch_guide,
    ),
    Published(
        "bent-beam shuttle",
        "closed form",
        "L. Que, J.-S. Park, Y. B. Gianchandani, J. Microelectromech. Syst. 10 (2001) 247",
        bent_beams,
    ),
)


def table(rows: dict[Published, list[Row]]) -> str:
    """The table of docs/published_mechanisms.md."""
    lines = ["| mechanism | quantity | published | ours | off | reason |", "|---|---|---|---|---|---|"]
    for mechanism, found in rows.items():
        for k, row in enumerate(found):
            name = f"{mechanism.name}, {mechanism.kind}" if not k else ""
            unit = "" if row.unit == "1" else f" {row.unit}"
            off = f"{100 * row.off:+.1f} %" if row.published else ""
            reason = row.reason if abs(row.off) > NEAR else ""
            lines.append(
                f"| {name} | {row.quantity} | {row.published:.4g}{unit} | {row.ours:.4g}{unit} | {off} | {reason} |"
            )
    return "\n".join(lines)
