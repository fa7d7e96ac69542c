"""Tables of a random mechanism: every kind of element, actuator and reading that a drawing may have, from a seed."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

KINDS = ("force", "force", "force", "displacement", "thermal")  # of actuators, as often as they are drawn


class Drawing:
    """Tables of a device file, drawn with the random numbers of a seed; lengths in m."""

    def __init__(self, seed: list[int]) -> None:
        self.rng = np.random.default_rng(seed)
        self.tables: list[str] = []
        self.moved: list[str] = []  # the bodies, as readings name them
        self.where: list[str] = []  # what was drawn, for messages
        self.count = itertools.count(1)
        self.size = 10 ** self.rng.uniform(-2.7, -0.9)
        self.acting = str(self.rng.choice(KINDS))
        self.inertial = self.acting == "force" and self.chance(0.35)
        self.unit = str(self.rng.choice(["V", "A"]))
        self.high = float(self.rng.choice([1.0, 3.5, 10.0, 150.0]))
        self.low = 0.0 if self.chance(0.4) else -self.high
        self.lag = self.acting != "thermal" and self.chance(0.4)
        self.bends = self.rng.choice(["", "second", "stiffening", "cubic"], p=[0.5, 0.2, 0.15, 0.15])
        if self.acting == "displacement" and self.bends == "stiffening":
            self.bends = "second"
        self.table(
            "material",
            name="metal",
            young=f"{self.between(60, 400):.4g} GPa",
            poisson=f"{self.between(0.2, 0.4):.3g}",
            stress_limit="STRESS",
            **({"density": "4000 kg/m^3"} if self.inertial or self.chance(0.3) else {}),
            **({"expansion": "4e-6 1/K", "expansion_slope": "1e-9 1/K^2"} if self.acting == "thermal" else {}),
        )

    def chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)

    def between(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def table(self, what: str, **values: Any) -> None:
        lines = [
            f"[[{what}]]",
            *(f"{key.rstrip('_')} = {toml(value)}" for key, value in values.items() if value is not None),
        ]
        self.tables.append("\n".join(lines) + "\n")

    def body(self, name: str, pattern: str = "", copies: int = 0, at: Any = (0, 0, 0), share: float = 1.0) -> str:
        if self.inertial or self.chance(0.3):
            mass = 3000 * (share * self.size) ** 3 * self.between(0.3, 1.0)
            inertia = mass * (share * self.size) ** 2 * np.array([1.0, 1.2, 1.7]) * self.between(0.1, 0.4)
            self.table(
                "body",
                name=name,
                pattern=pattern,
                mass=f"{mass:.6g} kg",
                centre=place(at),
                inertia=[f"{i:.6g} kg*m^2" for i in inertia],
            )
        else:
            self.table("body", name=name, pattern=pattern)
        self.moved += [f"{name}_{k + 1}" for k in range(copies)] or [name]
        return name

    def flexure(
        self,
        first: str,
        to: str,
        at: Any,
        along: Any,
        length: float,
        across: Any = None,
        pattern: str = "",
        kinds: str = "",
    ) -> str:
        """Any element that holds and bends, of about a `length`, its thin direction `across`."""
        kind = str(self.rng.choice((kinds or "blade blade wire strut hinge compliance matrix").split()))
        name = f"{kind}{next(self.count)}"
        ends = {
            "name": name,
            "from_": first,
            "to": to,
            "at": place(at),
            "along": list(map(float, along)),
            "pattern": pattern,
        }
        if across is not None:
            ends["across"] = list(map(float, across))
        thick, wide, material = (
            length * self.between(0.012, 0.05),
            length * self.between(0.1, 0.8),
            {"material": "metal"},
        )
        beam = {"geometric_stiffening": True} if self.bends == "stiffening" and self.chance(0.6) else {}
        beam |= {"slender": True} if self.chance(0.3) else {}
        self.where.append(kind)
        if kind == "blade":
            self.table(
                "element",
                kind=kind,
                **ends,
                **material,
                **beam,
                length=mm(length),
                thickness=mm(thick),
                width=mm(max(wide, thick)),
            )
        elif kind == "wire":
            self.table("element", kind=kind, **ends, **material, **beam, length=mm(length), diameter=mm(2 * thick))
        elif kind == "strut":
            self.table(
                "element",
                kind=kind,
                **ends,
                **material,
                **beam,
                length=mm(length),
                wire_length=mm(0.2 * length),
                wire_diameter=mm(thick),
                rod_diameter=mm(4 * thick),
            )
        elif kind == "hinge":
            R = length / 2
            shape = f'{{ kind = "circular", R = "{mm(R)}", t = "{mm(R * self.between(0.08, 0.4))}", b = "{mm(max(wide, length * 0.3))}" }}'
            self.table("element", kind=kind, **ends, **material)
            self.tables[-1] += f"hinge = {shape}\n" + ('rotation_limit = "40 deg"\n' if self.chance(0.3) else "")
        else:
            self._stated(kind, ends, length, 2 * thick)
        return name

    def _stated(self, kind: str, ends: dict[str, Any], l: float, d: float) -> None:
        """A round beam, from a table of finite elements as it were."""
        E, I, A = 1e11, np.pi * d**4 / 64, np.pi * d**2 / 4
        turn, twist, push, across = l / E / I, l * 1.3 / E / I, l / E / A, l**3 / 3 / E / I
        couple = l**2 / 2 / E / I
        if kind == "compliance":
            turns = {
                f"theta_{a}_per_M_{a}": f"{v:.7g} rad/(N*m)" for a, v in zip("xyz", (twist, turn, turn), strict=True)
            }
            shifts = {
                f"delta_{a}_per_F_{a}": f"{v:.7g} m/N" for a, v in zip("xyz", (push, across, across), strict=True)
            }
            self.table(
                "element",
                kind=kind,
                **ends,
                **turns,
                **shifts,
                theta_z_per_F_y=f"{couple:.7g} rad/N",
                theta_y_per_F_z=f"{-couple:.7g} rad/N",
            )
            return
        C = np.zeros((6, 6))  # twist per wrench
        C[[0, 1, 2, 3, 4, 5], [3, 4, 5, 0, 1, 2]] = twist, turn, turn, push, across, across
        C[2, 1] = C[4, 5] = couple
        C[1, 2] = C[5, 4] = -couple
        if self.chance(0.3):
            C[2, 1] *= 1.002  # as printed with three digits
        self.table("element", kind=kind, **ends, compliance_si=C.tolist())

    def spring(self, to: str, pattern: str = "", cubic: bool = False, k: float | None = None) -> None:
        """A spring from the ground, beside flexures."""
        k = self.size * 10 ** self.between(4, 6) if k is None else k
        given = {"F_x_per_delta_x": f"{k:.6g} N/m"} | ({"F_x_per_delta_x3": f"CUBIC*{k:.6g}"} if cubic else {})
        self.table(
            "element",
            kind="spring",
            name=f"spring{next(self.count)}",
            from_="ground",
            to=to,
            pattern=pattern,
            at=place(self.size * self.rng.uniform(-0.5, 0.5, 3)),
            along=direction(self.rng),
            **given,
        )
        self.where.append("cubic spring" if cubic else "spring")

    def actuator(self, body: str, at: Any, along: Any, pattern: str = "") -> str:
        """What moves a body: a force on it, or with an element of its own a stroke or a heater."""
        name = f"a{next(self.count)}"
        if self.acting == "thermal":
            on, L = f"chevron{next(self.count)}", self.size / 4
            self.table(
                "element",
                kind="bent_beam",
                name=on,
                from_="ground",
                to=body,
                at=place(at),
                along=list(map(float, along)),
                pattern=pattern,
                beams=str(self.rng.integers(1, 6)),
                beam_length=mm(L),
                beam_width=mm(L / 30),
                beam_gap=mm(L / 8),
                bar_width=mm(L / 20),
                bar_half_height=mm(L / 15),
                beam_angle=f"{self.between(2, 8):.3g} deg",
                thickness=mm(L / 15),
                material="metal",
            )
            self.table(
                "actuator",
                name=name,
                kind="thermal",
                on=on,
                ambient="300 K",
                temperature_limit="650 K",
                thermal_resistance="2000 K/W",
                time_constant="20 ms",
                power_limit="0.2 W",
                heater_resistance="100 ohm" if self.unit == "V" else None,
                travel="TRAVEL",
                pattern=pattern,
            )
            return name
        common = {
            "gain": f"GAIN/{self.unit}",
            "low": f"{self.low!r} {self.unit}",
            "high": f"{self.high!r} {self.unit}",
            "travel": "TRAVEL",
            "pattern": pattern,
            "along": list(map(float, along)),
        }
        common |= {"time_constant": "LAG"} if self.lag else {}
        common |= {"rate": f"RATE {self.unit}/s"} if self.chance(0.3) else {}
        if self.acting == "displacement":
            common["on"] = self.flexure(
                "ground", body, at, along, self.size / 2, pattern=pattern, kinds="matrix compliance blade wire"
            )
            self.table("actuator", name=name, kind="displacement", **common)
            return name
        stack = {"stiffness": f"{self.size * 10 ** self.between(4, 7):.4g} N/m"} if self.chance(0.3) else {}
        self.table("actuator", name=name, kind="force", on=body, at=place(at), **common, **stack)
        return name

    def readings(self) -> None:
        for k in range(int(self.rng.integers(0, 3))):
            body, against = str(self.rng.choice(self.moved)), str(self.rng.choice(["ground", *self.moved]))
            if body == against:
                continue
            seen = (
                {"about": direction(self.rng)}
                if self.chance(0.4)
                else {"at": place(self.size * self.rng.uniform(-1, 1, 3)), "along": direction(self.rng)}
            )
            self.table("reading", name=f"r{k + 1}", body=body, against=against, **seen)

    def lever(self, to: str, at: Any, along: Any, side: Any, pattern: str = "", copies: int = 0) -> None:
        """A lever that turns on a notch or a blade and pushes a body through a wire or a chain of two notches."""
        at, along, side, L = np.array(at, float), np.array(along, float), np.array(side, float), self.size / 3
        beam = self.body(f"lever{next(self.count)}", pattern, copies, at, 0.3)
        tip = at - L * along
        pivot = tip - L * self.between(0.6, 1.2) * side
        self.flexure("ground", beam, pivot, side, L / 6, across=along, pattern=pattern, kinds="hinge blade")
        if self.chance(0.5):
            self.flexure(beam, to, at, along, L, pattern=pattern, kinds="wire strut")
        else:
            link = self.body(f"link{next(self.count)}", pattern, copies, (at + tip) / 2, 0.15)
            self.flexure(beam, link, tip + L / 4 * along, along, L / 4, across=side, pattern=pattern, kinds="hinge")
            self.flexure(link, to, at, along, L / 4, across=side, pattern=pattern, kinds="hinge")
        self.actuator(beam, pivot + self.between(0.2, 0.6) * (tip - pivot), along, pattern)
        self.where.append("lever")


def mm(x: float) -> str:
    return f"{x * 1e3:.7g} mm"


def place(at: Any) -> list[str]:
    return [mm(x) for x in np.ravel(at)]


def direction(rng: np.random.Generator) -> list[float]:
    """A direction: an axis, or any."""
    v = np.eye(3)[rng.integers(3)] * rng.choice([-1, 1]) if rng.random() < 0.4 else rng.normal(size=3)
    return [float(x) for x in v / np.linalg.norm(v)]


def toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return f"[{', '.join(map(toml, value))}]"
    return f'"{value}"' if isinstance(value, str) else repr(float(value))
