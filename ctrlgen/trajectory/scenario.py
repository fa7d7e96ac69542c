"""A scenario: a device and the path that it is to follow, at what rate."""

from __future__ import annotations

import hashlib
import re
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import casadi as ca

from ctrlgen.core.edited_toml import value_text
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.file_format import in_this_format, refuse_another_kind
from ctrlgen.core.files import decoded, encoded, read_bytes, read_text, read_toml, validate
from ctrlgen.core.names import C_NAME, checked
from ctrlgen.core.shown import Shown
from ctrlgen.devices import Device, files_of, load_device
from ctrlgen.effects import Place
from ctrlgen.model.assembly import build_model
from ctrlgen.model.effect_terms import LOOKS_BACK
from ctrlgen.model.model import Model
from ctrlgen.physics.pivot import can_turn
from ctrlgen.trajectory.inverse.clock import Clock, Sampled
from ctrlgen.trajectory.paths import Poses
from ctrlgen.trajectory.problem import PathProblem
from ctrlgen.trajectory.scenario_file import ScenarioFile

FILE = "scenario.toml"


@dataclass(frozen=True)
class Input:
    """One file that a scenario was read from, with its `text`; `path` as it was given, or beside the scenario.

    Bytes that are no UTF-8, such as those of a matrix in .npy, stand in the text as lone surrogates (PEP 383).
    """

    path: Path
    text: str

    @property
    def sha256(self) -> str:
        """SHA-256 of the text as UTF-8."""
        return hashlib.sha256(encoded(self.text)).hexdigest()


def device_inputs(path: Path, name: str = "device") -> dict[str, Input]:
    """The file of a device as the input `name`, a Python file that it names as "NAME_code", and those of its matrices, "NAME_matrix_1" ...
    Raises InputError."""
    own, *more = files_of(path)
    inputs = {name: Input(own, read_text(own))}
    for k, file in enumerate(more, 1):
        if file.suffix == ".py":
            inputs[f"{name}_code"] = Input(file, read_text(file))
        else:
            inputs[f"{name}_matrix_{k}"] = Input(file, decoded(read_bytes(file)))
    return inputs


@dataclass(frozen=True, repr=False)
class Scenario(Shown):
    """A scenario ready to be solved. `file` is what scenario.toml says; `name` the folder's name as a C identifier.

    `inputs`: the "scenario" itself, its "device" (with those that it names, as `device_inputs`) and, where a path is read from
    a file, its "poses"; of a robust one that is solved its "uncertainty". `home` [SI] is by how much the path is moved, by channel.
    """

    name: str
    path: Path
    file: ScenarioFile
    device: Device
    inputs: dict[str, Input]
    home: Mapping[str, float] = field(default_factory=dict)

    def facts(self) -> dict[str, object]:
        """What it is, in a few words."""
        return {
            "title": self.file.title,
            "device": self.device.name,
            "path": self.file.path.kind,
            "clock": "settled poses" if self.sample_time is None else f"{1 / self.sample_time:g} Hz",
        }

    @property
    def controller_name(self) -> str:
        """What the C that knows no trajectory, online controller and plant, is named after: by default the device."""
        return self.file.controller or self.device.name

    @property
    def digest(self) -> dict[str, str]:
        """The SHA-256 of each input."""
        return {name: read.sha256 for name, read in self.inputs.items()}

    @property
    def device_sha256(self) -> str:
        """SHA-256 of the device's description: of its file, followed by those that it names, if any."""
        texts = [read.text for name, read in self.inputs.items() if name == "device" or name.startswith("device_")]
        return hashlib.sha256(encoded("".join(texts))).hexdigest()

    @property
    def clock(self) -> Clock:
        """When the samples are: settled one by one, or in time."""
        return self.file.clock

    @property
    def sample_time(self) -> float | None:
        """Seconds between samples; None for a static scenario, whose samples are separate equilibria."""
        return None if self.file.sample_rate is None else 1 / self.file.sample_rate.si

    @property
    def sample_times(self) -> tuple[float, float] | None:
        """Shortest and longest time [s] between calls of the C; None where it is called at its sample rate alone."""
        times = self.file.sample_times
        return None if times is None else (times[0].si, times[1].si)

    @property
    def closed(self) -> bool:
        """Whether the path is periodic: its first sample follows the last one."""
        return self.file.closed

    def on(self, device: Device) -> Scenario:
        """The same on another device, with the loads of this scenario. Raises InputError where it cannot have them."""
        check_pivot(device, self.file, self.path)
        return replace(self, device=loaded(device, self.file, self.path))

    def bind(self, model: Model) -> PathProblem:
        """What of it a `model` is to follow."""
        return PathProblem(self.path, self.file, model, self.home)


def loaded(device: Device, file: ScenarioFile, path: Path) -> Device:
    """The device with the loads of a scenario's `file`, read from `path`. Raises InputError where it cannot have them."""
    if not file.load and file.gravity is None:
        return device
    try:
        return device.loaded(file.load, file.gravity)
    except ValueError as error:
        raise InputError(path, [Fault("load", str(error))]) from None


def check_pivot(device: Device, file: ScenarioFile, path: Path) -> None:
    """Raises InputError where what a scenario's `file`, read from `path`, has followed cannot turn about its pivot."""
    if file.pivot is None:
        return
    pose = device.told_physics(device.values()).components
    if file.follow != "pose" or not can_turn(pose):
        followed = f"the pose {', '.join(pose)}" if file.follow == "pose" else f"the {file.follow}"
        what = f"turns a pose about a point, and what is followed is {followed}; leave it out"
        raise InputError(path, [Fault("pivot", what)])


def check_tightened(scenario: Scenario, model: Model) -> None:
    """Refuses the model of a device as described where the scenario asks for limits that hold for what is not known exactly. Raises
    InputError."""
    if scenario.file.robust is not None and model.probability is None:
        what = (
            "asks for tightened limits, which solving the path computes: leave it out of a copy of the scenario (in Python take "
            "ctrlgen.solve, and the model of the solution)"
        )
        raise InputError(scenario.path, [Fault("robust", what)])


def model_of(scenario: Scenario) -> Model:
    """The model that is led along the path: without laws of readings that look back by samples (delay, clock offset), which change no
    drive; a warning names them. Of a drive whose rate is limited it has the limit, not the ramp within a sample: a warning says by how
    much that is late. Raises InputError where a feedback loop reads what late readings do, so that they do change its drive."""
    device = scenario.device
    _warn_of_ramps(scenario)
    late = [effect for effect in device.effect if LOOKS_BACK in effect.requires and effect.place is Place.SENSOR]
    model = build_model(device.model_copy(update={"effect": tuple(e for e in device.effect if e not in late)}))
    if not late:
        return model
    kinds = ", ".join(sorted({effect.kind for effect in late}))
    if model.held.numel() and _read_by_the_loop(_with_late_readings(scenario)):
        what = (
            f"has {kinds} in the reading of its feedback loop, which is not inverted yet: leave it out to follow a path"
        )
        raise InputError(device.name, [Fault("effect", what)])
    warnings.warn(f"{device.name}: {kinds} is of the reading and changes no drive along a path; left out", stacklevel=2)
    return model


def _warn_of_ramps(scenario: Scenario) -> None:
    """Says what a path leaves out of an amplifier that slews. A change c of the drive takes c/R of a sample h, h at most within the limit;
    its mean over the sample is that of a step that comes c/(2 R) <= h/2 later."""
    kinds = ", ".join(sorted({effect.kind for effect in scenario.device.effect if effect.limits_rate}))
    if kinds and isinstance(scenario.clock, Sampled):
        late = value_text(scenario.clock.sample_time / 2, "ms", 3)
        what = f"{kinds} limits how fast the drive changes; within a sample the drive is taken as a step, while the amplifier ramps"
        warnings.warn(f"{scenario.device.name}: {what}: it acts up to {late} late", stacklevel=3)


def _with_late_readings(scenario: Scenario) -> Model:
    """The model of all of the device; of a static scenario, in which nothing is late, at any sample time."""
    clock = scenario.clock
    return build_model(scenario.device, sample_time=clock.sample_time if isinstance(clock, Sampled) else 1.0)


def _read_by_the_loop(model: Model) -> bool:
    """Whether states that change once a sample, as those of late readings do, act on the output of the feedback loop."""
    return bool(ca.depends_on(model.held_value, model.x[list(model.stepped)]))


def load_scenario(path: Path | str, device: Device | Path | str | None = None) -> Scenario:
    """The scenario in a folder (its scenario.toml) or in a TOML file, with its device. Raises InputError.

    Another `device` is used instead of the one that the scenario names: a device file, or one made in Python, whose name the
    scenario's `device` then is.
    """
    path = Path(path)
    file_path = path / FILE if path.is_dir() else path
    table = read_toml(file_path)
    if "record" in table:
        raise InputError(file_path, [Fault("file", "describes a recording; name a scenario, or diagnose it")])
    if "kind" in table and "device" not in table:
        what = 'describes a device; name a scenario, or write one that has device = "..." with this file\'s path'
        raise InputError(file_path, [Fault("file", what)])
    refuse_another_kind(table, file_path, "scenario", "name a scenario")
    file = validate(ScenarioFile, in_this_format(table, file_path), file_path)
    inputs = {"scenario": Input(file_path, read_text(file_path))}
    if not isinstance(device, Device):
        device_path = file_path.parent / file.device if device is None else Path(device)
        device = load_device(device_path)
        inputs |= device_inputs(device_path)
    elif file.device != device.name:
        raise InputError(
            file_path, [Fault("device", f"{file.device!r} is not {device.name!r}, the device given; write its name")]
        )
    else:
        numbers = "\n".join(f"{path} = {number.text}" for path, number in device.quantities())
        inputs["device"] = Input(file_path.parent / f"{_identifier(device.name)}.txt", numbers)
    if isinstance(file.path, Poses) and file.path.file:
        poses = file_path.parent / file.path.file
        inputs["poses"] = Input(poses, read_text(poses))
    check_pivot(device, file, file_path)
    name = file_path.resolve().parent.name if file_path.name == FILE else file_path.stem
    try:
        return Scenario(_identifier(name), file_path, file, loaded(device, file, file_path), inputs)
    except ValueError as error:
        what = f"gives the C its name, but {error}"
        raise InputError(file_path, [Fault("the folder" if file_path.name == FILE else "the file", what)]) from None


def _identifier(name: str) -> str:
    """`name` as a C identifier, which becomes the prefix of the generated functions: 'my circle-1' -> 'my_circle_1'. Raises ValueError
    where it is too long."""
    cleaned = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
    return checked(cleaned if cleaned[:1].isalpha() else f"s_{cleaned}", C_NAME)
