"""Writes commented device and scenario files; what is written passes `ctrlgen check`, or nothing is."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from ctrlgen.app.new_files.questions import KINDS, Answer, answers
from ctrlgen.core.compiled_templates import environment
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.files import write_text
from ctrlgen.core.names import C_NAME, checked, meant
from ctrlgen.core.units import from_si, same_dimension
from ctrlgen.devices import load_device
from ctrlgen.model.assembly import build_model
from ctrlgen.model.effect_terms import available
from ctrlgen.model.model import Model
from ctrlgen.trajectory.workspace import Workspace, middle_pose

# of the way from the middle to the nearest end of the device's range: room for what the path needs beyond its poses
SHARE = 0.5
# what is written as a number of a path: two digits, rounded toward zero
DIGITS = 2
PATHS = ("circle", "line", "raster", "spiral")


def write_device(file: Path, kind: str, name: str | None = None, given: Mapping[str, str] | None = None) -> None:
    """A device file of a kind of `KINDS`, with the numbers `given` by key and the rest as assumed.

    Raises InputError for an unknown kind or key, a number of another dimension, a name that is no identifier, an existing file, and
    for numbers that make no such device.
    """
    if kind not in KINDS:
        raise InputError("--kind", [Fault(kind, f"is not a kind; {meant(kind, KINDS)}")])
    _absent(file)
    if file.suffix != ".toml":
        raise InputError("new device", [Fault(str(file), "must end in .toml")])
    chosen = _identifier(file.stem) if name is None else name
    try:
        checked(chosen, C_NAME)
    except ValueError as error:
        raise InputError("--name", [Fault("name", str(error))]) from None
    numbers = answers(kind, given or {})
    text = _render(f"{kind}.toml.j2", name=chosen, title=KINDS[kind].title, sizes=Sizes(numbers))
    with TemporaryDirectory() as folder:  # read back before it is put in place
        draft = Path(folder) / file.name
        draft.write_text(text, encoding="utf-8")
        try:
            build_model(load_device(draft))
        except InputError as error:
            raise InputError("new device", error.faults) from None
    write_text(file, text)


class Sizes:
    """The answers, as a template writes them."""

    def __init__(self, numbers: Mapping[str, Answer]) -> None:
        self.numbers = numbers

    def __getitem__(self, key: str) -> str:
        """The line's right side: value and where it comes from."""
        answer = self.numbers[key]
        source = "stated" if answer.given else "assumed: replace it by yours"
        return f'{{ value = "{answer.text}", source = "{source}" }}'

    def plain(self, key: str) -> str:
        """The answer as it was written."""
        return self.numbers[key].text

    def si(self, key: str) -> float:
        """The answer in SI."""
        return self.numbers[key].si

    @staticmethod
    def number(si: float, unit: str) -> str:
        """An SI number in `unit`, with four digits."""
        return f"{float(f'{from_si(si, unit):.4g}'):g} {unit}"

    def chord(self, radius: str, half_angle: float) -> str:
        """The distance between two points at twice the half angle on the circle of a radius."""
        return self.number(2 * self.si(radius) * math.sin(half_angle), "mm")

    def strut_length(self) -> str:
        """Of a strut, from the base at its half angle before 240 deg to the platform at its own beyond 180 deg."""
        angle = math.pi / 3 - self.si("platform_half_angle") - self.si("base_half_angle")
        a, b, rise = (
            self.si("platform_radius"),
            self.si("base_radius"),
            self.si("height") - self.si("platform_thickness") / 2,
        )
        return self.number(math.sqrt(a * a + b * b - 2 * a * b * math.cos(angle) + rise * rise), "mm")

    @staticmethod
    def degrees(radians: float) -> str:
        """An angle in degrees, with six digits."""
        return f"{float(f'{math.degrees(radians):.6g}'):g} deg"


def _identifier(text: str) -> str:
    """The name of a device from that of its file."""
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_") or "stage"


def write_scenario(folder: Path, device: Path, path: str | None = None) -> None:
    """`folder`/scenario.toml: a path of one of `PATHS` in the middle of what the device can reach, half as large as would fit.

    Raises InputError for a device without an actuator or whose range cannot be told, an unknown path, a path of two directions for one, an
    existing folder.
    """
    if path is not None and path not in PATHS:
        raise InputError("--path", [Fault(path, f"is not a path; {meant(path, PATHS)}")])
    file = folder / "scenario.toml"
    _absent(file)
    described = load_device(device)
    model = build_model(described)
    if "actuator" not in available(described.physics(described.values())):
        raise InputError(
            "--device", [Fault(model.name, "has no actuator: another machine moves it, along no path of its own")]
        )
    reach = reachable(model)
    plane = reach.plane()
    path = path or ("circle" if len(plane) > 1 else "line")
    if path != "line" and len(plane) < 2:
        what = (
            f"needs two directions of one unit, and {model.name} has {', '.join(reach.channels)}; --path line has one"
        )
        raise InputError("--path", [Fault(path, what)])
    text = _render(
        "scenario.toml.j2", reach=reach, plane=plane, path=path, device=_from(folder, device), name=model.name
    )
    write_text(file, text)


@dataclass(frozen=True)
class Reach:
    """A pose in the middle of a device's range and, by channel, how far it goes from there to either side at least; SI."""

    channels: tuple[str, ...]
    units: tuple[str, ...]
    middle: tuple[float, ...]
    half: tuple[float, ...]

    def plane(self) -> tuple[int, ...]:
        """The channels of a path: the first two lengths, or else the first two angles, or else the first channel."""
        lengths = tuple(i for i, unit in enumerate(self.units) if same_dimension(unit, "m"))
        angles = tuple(i for i in range(len(self.units)) if i not in lengths)
        alike = next((group for group in (lengths, angles) if len(group) > 1), (0,))
        return alike[:2]

    def centre(self, without: tuple[int, ...] = ()) -> str:
        """The middle as a table of a scenario."""
        parts = [
            f'{name} = "{self.text(i, value)}"'
            for i, (name, value) in enumerate(zip(self.channels, self.middle, strict=True))
            if i not in without and self.text(i, value) != f"0 {self.units[i]}"
        ]
        return "{ " + ", ".join(parts) + " }" if parts else ""

    def along(self, i: int, share: float) -> str:
        """The middle, moved by a share of the half range of channel i, as a table of a scenario."""
        moved = list(self.middle)
        moved[i] += share * self.half[i]
        parts = [
            f'{name} = "{self.text(k, value)}"'
            for k, (name, value) in enumerate(zip(self.channels, moved, strict=True))
            if k == i or self.text(k, value) != f"0 {self.units[k]}"
        ]
        return "{ " + ", ".join(parts) + " }"

    def size(self, plane: tuple[int, ...], share: float) -> str:
        """A share of what fits to both sides in the plane."""
        return self.text(plane[0], share * min(self.half[i] for i in plane))

    def tolerance(self, i: int) -> str:
        """A thousandth of the half range, with one digit."""
        return f"{float(f'{from_si(1e-3 * self.half[i], self.units[i]):.1g}'):g} {self.units[i]}"

    def text(self, i: int, si: float) -> str:
        """An SI number of channel i in its unit, toward zero at two digits of the range."""
        value, span = from_si(si, self.units[i]), from_si(self.half[i], self.units[i])
        step = 10.0 ** (math.floor(math.log10(span)) - DIGITS + 1) if span > 0 else 1.0
        return f"{float(f'{math.trunc(value / step + 1e-9 * math.copysign(1, value)) * step:.6g}'):g} {self.units[i]}"


def reachable(model: Model) -> Reach:
    """The middle of the poses that a device can hold, and its half ranges there. Raises InputError where a drive has no bounds."""
    workspace, pose = Workspace(model), model.signals["pose"]
    middle = middle_pose(model)
    ends = np.array(workspace.ranges(middle))
    half = SHARE * np.min(np.abs(ends - middle[:, None]), axis=1)
    return Reach(pose.channels, pose.units, tuple(middle), tuple(half))


def _render(template: str, **values: object) -> str:
    # TOML, unescaped: every value is a number with a unit or an identifier
    templates = environment(
        Path(__file__).resolve().parent, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True
    )
    return templates.get_template(template).render(**values)


def _absent(file: Path) -> None:
    if file.exists():
        raise InputError("new", [Fault(str(file), "exists; name another file, or move it away")])


def _from(folder: Path, device: Path) -> str:
    """The device file as seen from the folder."""
    return Path(os.path.relpath(device.resolve(), folder.resolve())).as_posix()
