"""uncertainty.toml: the standard deviations of what is not known exactly, each with its source."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from ctrlgen.budget.deviation import Deviation, parse_share
from ctrlgen.budget.sensor_statement import SensorSection, stated_sensor
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.files import read_text, read_toml, validate
from ctrlgen.core.names import meant
from ctrlgen.core.units import (
    is_share,
    parse_difference,
    same_dimension,
    share_of,
    shown_difference_unit,
    to_si,
    written_unit,
)
from ctrlgen.devices.quantities import shared_path
from ctrlgen.devices.section import Section
from ctrlgen.model.model import Model
from ctrlgen.model.read_poses import ReadPoses, sensor_numbers
from ctrlgen.trajectory.playback import ANGLE_TOLERANCE, length_tolerance, playback_tolerance
from ctrlgen.trajectory.scenario import Input, Scenario

FILE = "uncertainty.toml"
AMBIENT = ".ambient"  # how the path of a temperature to which heaters cool ends
FROM_DEVICE = "sd in the device file"
SINGULAR = 1e-9  # of an eigenvalue of a matrix of correlations, below zero: rounding


class NumberDeviation(Deviation):
    """A standard uncertainty of a number of the device."""

    independent: bool = True
    """Of a number in a table that a `[[pattern]]` copies: whether it deviates in each copy by itself. With `false` all copies deviate
    together, as the thickness of blades that are cut from one sheet."""


class Converter(Section):
    """The digital-to-analogue converter that makes the drives."""

    bits: Annotated[int, Field(ge=4, le=32)]
    """Its resolution; its 2^bits - 1 steps span the limits of the drive, and each drive is rounded to the nearest."""
    source: str
    """Where the resolution comes from."""


class DriveChain(Section):
    """What stands between the computed drives and the actuators."""

    gain: Deviation | None = None
    """Gain that all drives share, such as that of the supply or the reference voltage; sd as a share, "0.2 %"."""
    channel_gain: Deviation | None = None
    """Gain of each channel by itself, the same sd for all, independent of each other."""
    converter: Converter | None = None
    """Resolution of the converter: an error of LSB/sqrt(12) in each drive, independent from sample to sample."""
    jitter: Deviation | None = None
    """By how much the moments at which the drives change scatter, independent from sample to sample; for all channels the same."""
    arithmetic: Literal["double", "float"] = "double"
    """In which the drives are computed; `float` rounds each of them to 24 bits."""
    player: bool = False
    """Whether the drives are replayed from the player's tables, which may move the followed signal by 0.1 nm, or a ten-thousandth of
    its typical size where that is less, and 1e-8 rad; left out: they are as solved."""


class Correlation(Section):
    """Two numbers whose deviations depend on one another."""

    between: tuple[str, str]
    """Two names of `[numbers]`."""
    coefficient: Annotated[float, Field(ge=-1, le=1)]
    """Their coefficient of correlation, GUM 5.2.2."""
    source: str
    """Where it comes from."""


class UncertaintyFile(Section):
    """What is not known exactly of a device that follows a path, with standard deviations and their sources.

    A number of the device file that states its own `sd` counts too; what stands here replaces that.
    """

    title: str
    """What the file describes, in words."""
    numbers: dict[str, NumberDeviation] = {}
    """By the path of a number of the device, such as `"actuator.young"`; `"hexapod.base_angles[*]"` is each of a list, independent
    of each other, as are the copies of a `[[pattern]]`."""
    surroundings: Deviation | None = None
    """Temperature of what the heaters cool to, and of what effects call the surroundings, over the described one; the temperature at
    which the actuators are without force stays as described."""
    drive: DriveChain | None = None
    """What stands between the computed drives and the actuators."""
    sensor: SensorSection | None = None
    """How well the sensor is known with which runs are learnt from and specimens are calibrated."""
    correlation: tuple[Correlation, ...] = ()
    """`[[correlation]]` tables; all other deviations are independent."""


@dataclass(frozen=True)
class Uncertain:
    """One line of the budget: `paths` of numbers of the device, each with the standard deviation of `sds` [SI, or a share for
    a gain], independent of each other.

    `per` is the step for which a sensitivity is shown: its text, such as "1 %", and its sizes [as `sds`].
    """

    name: str
    kind: Literal["number", "surroundings", "gain", "channel_gain", "sensor_scale", "sensor_zero", "sensor_law"]
    paths: tuple[str, ...]
    sds: tuple[float, ...]
    text: str
    source: str
    per: tuple[str, tuple[float, ...]]


@dataclass(frozen=True)
class Uncertainties:
    """What is uncertain: `lines` with `correlation` (m, m), m the paths of all lines in their order, and the drive's own: steps of
    the converter `lsb` (n_u,) [SI] or None, `jitter` [s], whether `single` precision, whether from the `player`; `texts` and `sources`
    of those four."""

    lines: tuple[Uncertain, ...]
    correlation: np.ndarray
    bits: int | None
    jitter: float
    single: bool
    texts: dict[str, str]
    sources: dict[str, str]
    inputs: dict[str, Input]
    player: bool = False

    @property
    def sds(self) -> np.ndarray:
        """(m,) standard deviations of all columns."""
        return np.array([sd for line in self.lines for sd in line.sds])

    @property
    def covariance(self) -> np.ndarray:
        """(m, m) covariance of all columns."""
        return self.correlation * np.outer(self.sds, self.sds)


def load_uncertainties(scenario: Scenario, model: Model, path: Path | str | None = None) -> Uncertainties:
    """What is uncertain of `scenario` with its `model`: its device's stated sds, and the file at `path`, by default uncertainty.toml
    beside the scenario where there is one. Raises InputError listing every fault."""
    if scenario.file.leads_modes:
        what = (
            'is "modes", and what is uncertain of bodies beside the axes is not in an error budget; draw it up for a copy without '
            "this line, which has that of the model condensed to its axes"
        )
        raise InputError(scenario.path, [Fault("feedforward", what)])
    beside = scenario.path.parent / FILE
    file_path = Path(path) if path is not None else beside if beside.is_file() else None
    file, inputs = UncertaintyFile(title=""), dict[str, Input]()
    if file_path is not None:
        file = validate(UncertaintyFile, read_toml(file_path), file_path)
        inputs["uncertainty"] = Input(file_path, read_text(file_path))
    read = _Reader(scenario, model, file)
    if read.faults:
        raise InputError(file_path or scenario.path, read.faults)
    drive = file.drive or DriveChain()
    if not (read.lines or drive.converter or drive.jitter or drive.arithmetic == "float" or drive.player):
        of = next((n for n, q in scenario.device.quantities() if q.si and not q.whole), "")
        shown = f'[numbers]\n"{of}" = {{ sd = "5 %", source = "spread of five specimens" }}'
        what = f"is not stated of anything: no number of {scenario.device.name} has an sd; write {beside} with, for example,\n{shown}"
        raise InputError(file_path or scenario.path, [Fault("uncertainty", what)])
    correlation = read.correlation(file_path or scenario.path)
    tolerance = length_tolerance(model.signals[scenario.file.follow])
    player = f"{1e9 * tolerance / 3**0.5:.3g} nm, {1e9 * ANGLE_TOLERANCE / 3**0.5:.3g} nrad"
    texts = {"arithmetic": "float", "player": player}
    sources = {
        "arithmetic": "IEEE 754, round to nearest",
        "player": "tolerance of the player's tables, uniform within it",
    }
    if drive.converter is not None:
        texts["converter"], sources["converter"] = f"{drive.converter.bits} bit", drive.converter.source
    if drive.jitter is not None:
        texts["jitter"], sources["jitter"] = drive.jitter.sd, drive.jitter.source
    bits, single = None if drive.converter is None else drive.converter.bits, drive.arithmetic == "float"
    lines = tuple(read.lines)
    return Uncertainties(lines, correlation, bits, read.jitter, single, texts, sources, inputs, drive.player)


class _Reader:
    """The lines of a file and of the device's own sds, with all faults."""

    def __init__(self, scenario: Scenario, model: Model, file: UncertaintyFile) -> None:
        self.device, self.numbers = model.device, dict(model.device.quantities())
        self.file, self.drive = file, file.drive or DriveChain()
        self.faults: list[Fault] = []
        self.lines: list[Uncertain] = []
        self._taken: dict[str, str] = {}
        for name, number_stated in file.numbers.items():
            self._number(name, number_stated)
        for path, number in self.numbers.items():
            if number.sd and path not in self._taken:
                self._add(path, (path,), (number.sd,), "", number.source or FROM_DEVICE)
        self.lines = [self._of_sensor_law(scenario, line) for line in self.lines]
        if file.surroundings is not None:
            sd = self._absolute("surroundings.sd", file.surroundings.sd, "degC", "1 K")
            stated = file.surroundings
            self.lines.append(
                Uncertain("surroundings", "surroundings", ("",), (sd,), stated.sd, stated.source, ("1 K", (1.0,)))
            )
        kinds: tuple[Literal["gain", "channel_gain"], ...] = ("gain", "channel_gain")
        for kind in kinds:
            if (gain := getattr(self.drive, kind)) is not None:
                share = self._share(f"drive.{kind}.sd", gain.sd)
                of = model.signals["drive"].channels if kind == "channel_gain" else ("all",)
                name, per = f"drive.{kind}", ("1 %", (0.01,) * len(of))
                self.lines.append(Uncertain(name, kind, of, (share,) * len(of), gain.sd, gain.source, per))
        self._sensor(scenario, model)
        self.jitter = (
            0.0 if self.drive.jitter is None else self._absolute("drive.jitter.sd", self.drive.jitter.sd, "s", "1 us")
        )
        self._check_drive(scenario, model)
        self._check_correlations()

    def _of_sensor_law(self, scenario: Scenario, line: Uncertain) -> Uncertain:
        """The line, told apart where its numbers are of sensor laws: they move no open-loop drive, but drives learnt and numbers calibrated
        with the sensor carry their error. A law of something else than the pose leaves it as it is."""
        if scenario.file.follow != "pose" or not sensor_numbers(self.device).issuperset(line.paths):
            return line
        try:
            ReadPoses(self.device, line.paths, pose_alone=True)
        except InputError:
            return line
        return replace(line, kind="sensor_law")

    def _sensor(self, scenario: Scenario, model: Model) -> None:
        """What drives learnt and numbers calibrated with the sensor carry of its error: a share of each channel, and its zero."""
        signal = model.signals[scenario.file.follow]
        try:
            stated = stated_sensor(self.file.sensor, signal, scenario.path)
        except InputError as error:  # told with the other faults of the file
            self.faults += error.faults
            return
        if stated.scale is not None and stated.scale.sd:
            n, scale = len(signal.channels), stated.scale
            per = "1 %", (0.01,) * n
            sds = (scale.sd,) * n
            line = Uncertain("sensor.scale", "sensor_scale", signal.channels, sds, scale.text, scale.source, per)
            self.lines.append(line)
        for channel, zero in stated.zero.items():
            unit = shown_difference_unit(signal.units[signal.channels.index(channel)])
            per_unit = f"1 {unit}", (to_si(1.0, unit) - to_si(0.0, unit),)
            name = f"sensor.zero.{channel}"
            if zero.sd:
                self.lines.append(
                    Uncertain(name, "sensor_zero", (channel,), (zero.sd,), zero.text, zero.source, per_unit)
                )

    def _number(self, name: str, stated: NumberDeviation) -> None:
        where = f'numbers."{name}"'
        pattern = re.escape(name).replace(re.escape("[*]"), r"\[\d+\]")
        paths = tuple(path for path in self.numbers if re.fullmatch(pattern, path))
        if not paths:
            hint = meant(name, self.numbers, "ctrlgen check DEVICE lists them")
            self.faults.append(Fault(where, f"is not a number of the device; {hint}"))
            return
        sds = []
        for path in paths:
            if path in self._taken:
                self.faults.append(Fault(where, f"states {path} again, after {self._taken[path]!r}; leave one out"))
            self._taken[path] = name
            number = self.numbers[path]
            if number.whole:
                self.faults.append(Fault(where, "is a count, which has no standard deviation; leave it out"))
                return
            unit = written_unit(number.text)
            if is_share(stated.sd, number.text):
                try:
                    sds.append(share_of(stated.sd.strip(), number.si, number.text))
                except ValueError as error:
                    self.faults.append(Fault(where, str(error)))
                    return
                if not sds[-1] > 0:
                    self.faults.append(
                        Fault(f"{where}.sd", f"{stated.sd!r} must be above zero; leave out what is known exactly")
                    )
            else:
                sds.append(
                    self._absolute(f"{where}.sd", stated.sd, unit, f"1 {shown_difference_unit(unit)}".replace(" 1", ""))
                )
        self._add(name, paths, tuple(sds), stated.sd, stated.source, stated.independent)

    def _add(
        self,
        name: str,
        paths: tuple[str, ...],
        sds: tuple[float, ...],
        text: str,
        source: str,
        independent: bool = True,
    ) -> None:
        """A line of numbers; of those that are copied one for each copy, where they are `independent`."""
        unit = written_unit(self.numbers[paths[0]].text)
        each = [(independent and self.device.copies(path)) or (path,) for path in paths]
        sds = tuple(sd for sd, copies in zip(sds, each, strict=True) for _ in copies)
        paths = tuple(path for copies in each for path in copies)
        values = [abs(self.numbers[shared_path(path)].si) for path in paths]
        if to_si(0.0, unit):
            per = "1 K", (1.0,) * len(paths)
        elif same_dimension(unit, "rad"):
            per = "1 mrad", (1e-3,) * len(paths)
        elif min(values) > 0:
            per = "1 %", tuple(0.01 * value for value in values)
        else:
            per = f"1 {unit}", (to_si(1.0, unit),) * len(paths)
        shown = text or f"{100 * sds[0] / values[0]:.3g} %" if values[0] else text or f"{sds[0]:.3g} (SI)"
        self.lines.append(Uncertain(name, "number", paths, sds, shown, source, per))

    def _share(self, where: str, text: str) -> float:
        """A share such as "5 %" or 0.05, as a number; NaN with a fault where it is none."""
        return self._positive(where, text, parse_share, "0.5 %")

    def _absolute(self, where: str, text: str, unit: str, example: str) -> float:
        return self._positive(where, text, partial(parse_difference, unit=unit), example)

    def _positive(self, where: str, text: str, read: Callable[[str], float], example: str) -> float:
        try:
            value = read(text)
        except ValueError as error:
            self.faults.append(Fault(where, f'{error}; an sd is a difference, such as "{example}"'))
            return math.nan
        if value <= 0:
            self.faults.append(Fault(where, f"{text!r} must be above zero; leave out what is known exactly"))
        return value

    def _check_drive(self, scenario: Scenario, model: Model) -> None:
        """Faults of what is stated of a drive or of surroundings that have no such thing."""
        low, high = model.u_bounds
        if self.drive.converter is not None and not np.all(np.isfinite(high - low)):
            what = (
                "needs a range, but the drive has no limits of its own; state them in the device file, or leave it out"
            )
            self.faults.append(Fault("drive.converter", what))
        if self.drive.jitter is not None and scenario.sample_time is None:
            what = "is for motion in time, but the scenario is a row of equilibria; leave it out"
            self.faults.append(Fault("drive.jitter", what))
        if self.drive.player and not playback_tolerance(model.signals[scenario.file.follow]).any():
            what = "has no effect: its tolerance is one of lengths and angles, and the followed signal has neither; leave it out"
            self.faults.append(Fault("drive.player", what))
        heated = model.n_states > 0 and any(path.endswith(AMBIENT) for path in self.numbers)
        if (
            self.file.surroundings is not None
            and not heated
            and not any("ambient" in e.requires for e in model.device.effect)
        ):
            what = "have no effect: no heater of this device cools to them, and no law reads their temperature; leave them out"
            self.faults.append(Fault("surroundings", what))

    def _check_correlations(self) -> None:
        numbers = ("number", "sensor_law")
        single = {line.name for line in self.lines if len(line.paths) == 1 and line.kind in numbers}
        for k, pair in enumerate(self.file.correlation):
            for name in pair.between:
                if name not in single:
                    what = f"{name!r} is not a single number of which an sd is stated"
                    if self.numbers.keys() & {name} and self.device.copies(name):
                        what += "; it is one of each copy: state it with independent = false"
                    self.faults.append(Fault(f"correlation[{k}].between", what))
            if pair.between[0] == pair.between[1]:
                self.faults.append(Fault(f"correlation[{k}].between", "names one number twice"))

    def correlation(self, path: Path) -> np.ndarray:
        """(m, m) coefficients of correlation. Raises InputError where no deviations can have them."""
        columns = [line.name for line in self.lines for _ in line.paths]
        matrix = np.eye(len(columns))
        for pair in self.file.correlation:
            i, j = (columns.index(name) for name in pair.between)
            matrix[i, j] = matrix[j, i] = pair.coefficient
        if np.linalg.eigvalsh(matrix).min(initial=0.0) < -SINGULAR:
            what = "contradict one another: no deviations can have these coefficients together; lower some of them"
            raise InputError(path, [Fault("correlation", what)])
        return matrix
