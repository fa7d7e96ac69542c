"""A scenario: a device and the path that it is to follow, at what rate."""

from __future__ import annotations

import hashlib
import re
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from pathlib import Path

import casadi as ca
import numpy as np

from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.files import read_text, read_toml, validate
from ctrlgen.core.units import Quantity, read_quantity, show, written_unit
from ctrlgen.devices import Device, files_of, load_device
from ctrlgen.effects import Place
from ctrlgen.model.assembly import build_model
from ctrlgen.model.inverse_dynamics import inverse_dynamics, relative_degrees
from ctrlgen.model.model import Model
from ctrlgen.model.quasi_static import natural_modes
from ctrlgen.trajectory.frame import Frame
from ctrlgen.trajectory.inverse.motion import Command, Motion
from ctrlgen.trajectory.paths import PathKind, Poses
from ctrlgen.trajectory.scenario_file import MOST_SAMPLES, ScenarioFile
from ctrlgen.trajectory.shaping import Shaper, Shaping
from ctrlgen.trajectory.shaping import shaper as make_shaper

FILE = "scenario.toml"
WHOLE = 1e-6  # of the number of samples, by which rate times duration may be off a whole one: durations are written with six digits
SMOOTHER = 1  # derivatives more than the drive follows: it then starts without a bend too
LEAST_CLOSED = 3  # samples of a closed motion: of two, drives that change at each of them show nothing of one between
RESOLVED = 0.5  # of the largest value of a derivative, by which it may change from one listed sample to the next


@dataclass(frozen=True)
class Input:
    """One file that a scenario was read from, with its `text`; `path` as it was given, or beside the scenario."""

    path: Path
    text: str

    @property
    def sha256(self) -> str:
        """SHA-256 of the text as UTF-8."""
        return hashlib.sha256(self.text.encode()).hexdigest()


@dataclass(frozen=True)
class Scenario:
    """A scenario ready to be solved. `file` is what scenario.toml says; `name` the folder's name as a C identifier.

    `inputs`: the "scenario" itself, its "device" (with "device_code" where that names a Python file) and, where a path is read from
    a file, its "poses"; of a robust one that is solved its "uncertainty". `home` [SI] is by how much the path is moved, by channel.
    """

    name: str
    path: Path
    file: ScenarioFile
    device: Device
    inputs: dict[str, Input]
    home: Mapping[str, float] = field(default_factory=dict)

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
        """SHA-256 of the device's description: of its file, followed by the Python file that it names, if any."""
        texts = [read.text for name, read in self.inputs.items() if name in ("device", "device_code")]
        return hashlib.sha256("".join(texts).encode()).hexdigest()

    @property
    def sample_time(self) -> float | None:
        """Seconds between samples; None for a static scenario, whose samples are separate equilibria."""
        return None if self.file.sample_rate is None else 1 / self.file.sample_rate.si

    @property
    def closed(self) -> bool:
        """Whether the path is periodic: its first sample follows the last one."""
        return self.sample_time is not None and self.file.path.closed

    def slowed(self, model: Model) -> Callable[[float], Command] | None:
        """How many times as long -> the target of the same path; None for one that is not shaped by a formula."""
        if isinstance(self.file.path, Poses) or self.file.duration is None or self.file.sample_rate is None:
            return None
        n, rate = self._sample_count(self.file.sample_rate, self.file.duration), self.file.sample_rate
        given, most = self._shaping_as_given(model), MOST_SAMPLES - self._longer(self.shaper(model))

        def target(times: float) -> Command:
            samples = min(round(times * n), most)
            longer = read_quantity("s", f"{samples / rate.si!r} s")
            return replace(self, file=self.file.model_copy(update={"duration": longer} | given)).target(model)

        return target

    def command(self, model: Model) -> np.ndarray:
        """The commanded samples (n, channels) of the followed signal, SI. Raises InputError."""
        samples = self._on_path(model, lambda path, frame, n: path.samples(frame, n))
        samples = samples + self._moved_by(model) if self.file.shaping is None else self._positions(model, len(samples))
        if self.sample_time and len(samples) < 2:
            what = "has one sample, but motion in time needs two or more; for one pose leave out sample_rate"
            raise InputError(self.path, [Fault("path", what)])
        return samples

    def geometry(self, model: Model, order: int, share: np.ndarray) -> np.ndarray:
        """(order + 1, len(share), channels) [SI, per share^k]: the curve of the path alone, where the `share` of it, 0 ... 1, is behind.
        Raises InputError."""
        return self._on_path(model, lambda path, frame, n: path.geometry(frame, order, share))

    def corners(self, model: Model) -> np.ndarray:
        """The shares of the path at which it begins, has corners, and ends; a closed one has none. Raises InputError."""
        return self._on_path(model, lambda path, frame, n: path.corners_at(frame))

    def target(self, model: Model) -> Command:
        """What is to be followed: the samples, with their derivatives where the model has inertia. Raises InputError."""
        return self.motion(model) if model.inertial else self.command(model)

    def positions(self, model: Model, after: float) -> np.ndarray:
        """(n, channels) [SI] of the followed signal so many samples `after` each sample; before it where negative."""
        n = len(self._on_path(model, lambda path, frame, n: path.samples(frame, n)))
        return self._positions(model, n, after)

    def _positions(self, model: Model, n: int, after: float = 0.0) -> np.ndarray:
        """(n, channels) [SI] of the path of `n` samples, or shaped as many more as that takes, so many samples `after` each."""
        order = (
            1 if isinstance(self.file.path, Poses) else 0
        )  # listed samples are joined by cubic splines, and not by lines
        shaper = self.shaper(model)
        longer = self._longer(shaper)
        if shaper is not None and n + longer > MOST_SAMPLES:
            what = f"of {show(shaper.frequency, 'Hz')} makes the path {longer:.6g} samples longer, but at most {MOST_SAMPLES} are possible"
            raise InputError(self.path, [Fault("shaping.frequency", f"{what}: raise it, or lower sample_rate")])
        return self._tables(model, order, np.arange(n + longer) + after, shaper)[0]

    def _longer(self, shaper: Shaper | None) -> int:
        """By how many samples a path is longer that is shaped."""
        return 0 if shaper is None else shaper.samples(self.sample_time or 0.0)

    def _tables(self, model: Model, order: int, at: np.ndarray, shaper: Shaper | None) -> np.ndarray:
        """(order + 1, len(at), channels) [SI, per sample^k] of the path, shaped where there is a shaper."""
        impulses = [(1.0, 0.0)] if shaper is None else list(zip(shaper.amplitudes, shaper.times, strict=True))
        rate = 1 / (self.sample_time or 1.0)
        parts = []
        for amplitude, time in impulses:
            evaluate = partial(_derivatives_at, order=order, at=at - time * rate)
            parts.append(amplitude * self._on_path(model, evaluate))
        tables = np.sum(parts, axis=0)
        tables[0] += self._moved_by(model)
        return np.asarray(tables)

    def shaper(self, model: Model) -> Shaper | None:
        """The impulses with which the path is convolved; None where it is not shaped. Raises InputError for a closed path, for a
        frequency too high for the samples, and where the model has no mode and none is stated."""
        given = self.file.shaping
        if given is None:
            return None
        if self.closed:
            what = "leaves a mode at rest where a path ends, but this one is periodic: write from_rest = true in path, or leave it out"
            raise InputError(self.path, [Fault("shaping", what)])
        if given.frequency is not None:
            fastest = 0.5 / (self.sample_time or np.inf)
            if given.frequency.si > fastest:
                what = f"is above half the sample_rate, {show(fastest, 'Hz', 6)}, where shaping does nothing; lower it or raise sample_rate"
                raise InputError(self.path, [Fault("shaping.frequency", what)])
            return make_shaper(
                given.kind, given.frequency.si, 0.0 if given.damping_ratio is None else given.damping_ratio.si
            )
        end = self._on_path(model, lambda path, frame, n: path.samples(frame, n))[-1]
        mode = least_damped_mode(model, self.file.follow, tuple(end)) if model.inertial else None
        if mode is None:
            why = "no mode that vibrates" if model.inertial else "no inertia, so that no mode vibrates"
            what = f'is missing: the model of {model.name} has {why}; write that of the device, frequency = "100 Hz", or leave out shaping'
            raise InputError(self.path, [Fault("shaping.frequency", what)])
        ratio = mode[1] if given.damping_ratio is None else given.damping_ratio.si
        return make_shaper(given.kind, mode[0], ratio)

    def _shaping_as_given(self, model: Model) -> dict[str, Shaping]:
        """The table of a shaped scenario with its numbers written out."""
        if (used := self.shaper(model)) is None or self.file.shaping is None:
            return {}
        numbers = {"frequency": f"{used.frequency!r} Hz", "damping_ratio": repr(used.damping_ratio)}
        table = {"kind": used.kind} | numbers
        return {"shaping": Shaping.model_validate(table)}

    def motion(self, model: Model, at: np.ndarray | None = None) -> Motion:
        """The path with as many derivatives by time as the drive of a `model` with inertia needs, at the samples or at the positions
        `at`, counted in samples. Raises InputError where the path has fewer, or has no sample time."""
        if self.sample_time is None:
            what = f'is missing: {model.name} has inertia, what it needs depends on time; write sample_rate = "1 kHz" and duration'
            raise InputError(self.path, [Fault("sample_rate", what)])
        samples, order = self.command(model), max(relative_degrees(model, self.file.follow))
        least = LEAST_CLOSED if self.closed else order + 1
        if len(samples) < least:
            what = f"has {len(samples)} samples; {model.name}, which has inertia, takes {least} or more"
            raise InputError(self.path, [Fault("path", f"{what}: raise sample_rate, or make the path longer")])
        self._check_smoothness(model, samples, order)
        places = np.arange(len(samples)) if at is None else at
        tables = self._tables(model, order, places, self.shaper(model))
        rates = self.sample_time ** -np.arange(1.0, order + 1)
        return Motion(tables[0], tables[1:] * rates[:, None, None])

    def _moved_by(self, model: Model) -> np.ndarray:
        """(channels,) by how much the path is moved."""
        return np.array([self.home.get(channel, 0.0) for channel in model.signals[self.file.follow].channels])

    def _check_smoothness(self, model: Model, samples: np.ndarray, order: int) -> None:
        """Refuses a path whose derivative of this order jumps, so that the drive would."""
        path = self._path(model)
        if isinstance(path, Poses):
            rest = (samples[:1].repeat(order + 1, axis=0), samples[-1:].repeat(order + 1, axis=0))
            before, after = (samples, samples) if self.closed else rest
            still = np.vstack([before[-order - 1 :], samples, after[: order + 1]])
            largest, change = (np.abs(np.diff(still, k, axis=0)).max(axis=0) for k in (order, order + 1))
            if np.any(change > RESOLVED * largest):
                what = (
                    f"is too coarse or not smooth: its {order}. derivative, which the drive of {model.name} follows, changes by more "
                    "than half from one sample to the next; begin and end at rest, and give smoother or more samples with all digits"
                )
                raise InputError(self.path, [Fault("path", what)])
        elif path.continuous < order:
            key = "even" if getattr(path, "even", False) else "smooth"
            remedy = "leave it out" if key == "even" else f"write smooth = {order} or more, or leave it out"
            what = f"makes derivative {path.continuous + 1} jump at rest points; the drive of {model.name} follows {order}: {remedy}"
            raise InputError(self.path, [Fault(f"path.{key}", what)])

    def _path(self, model: Model) -> PathKind:
        """The path, where it leaves that open as smooth as the drive of the device needs."""
        path = self.file.path
        if isinstance(path, Poses):
            return path.model_copy(update={"folder": self.path.parent})
        if model.inertial and path.smooth is None:
            return path.model_copy(update={"smooth": max(relative_degrees(model, self.file.follow)) + SMOOTHER})
        return path

    def _on_path(self, model: Model, evaluate: Callable[[PathKind, Frame, int], np.ndarray]) -> np.ndarray:
        """What `evaluate` (path, frame, number of samples) gives, the path's faults with their places in the file."""
        signal = model.signals[self.file.follow]
        n = self.file.points or 0
        if self.file.sample_rate and self.file.duration:
            n = self._sample_count(self.file.sample_rate, self.file.duration)
        try:
            return evaluate(self._path(model), Frame(signal.channels, signal.units), n)
        except InputError as error:
            if error.source != "path":
                raise
            raise InputError(self.path, [Fault(f"path.{f.where}", f.what) for f in error.faults]) from None

    def _sample_count(self, rate: Quantity, duration: Quantity) -> int:
        """Rate times duration as a whole number. Raises InputError where it is none, or not one that a path can have."""
        samples = rate.si * duration.si
        n, what = round(samples), ""
        if not 2 <= samples <= MOST_SAMPLES:
            what = f"gives {samples:.6g} samples; between 2 and {MOST_SAMPLES} are possible: change duration or sample_rate"
        elif abs(samples - n) > WHOLE * samples:
            near = [show(k / rate.si, written_unit(duration.text), 7) for k in (int(samples), int(samples) + 1)]
            what = f'gives {samples:.7g} samples, which is no whole number; write duration = "{near[0]}" or "{near[1]}"'
        if what:
            raise InputError(self.path, [Fault("duration", what)])
        return n


def check_tightened(scenario: Scenario, model: Model) -> None:
    """Refuses the model of a device as described where the scenario asks for limits that hold for what is not known exactly. Raises
    InputError."""
    if scenario.file.robust is not None and model.probability is None:
        what = (
            "asks for tightened limits, which ctrlgen run, solve, check and budget compute alone: leave it out of a copy of the "
            "scenario (in Python take ctrlgen.solve, and the model of the solution)"
        )
        raise InputError(scenario.path, [Fault("robust", what)])


def model_of(scenario: Scenario) -> Model:
    """The model that is led along the path: without laws of readings that look back by samples (delay, clock offset), which change no
    drive; a warning names them. Raises InputError where a feedback loop reads what they do, so that they do change its drive."""
    device = scenario.device
    late = [effect for effect in device.effect if "sample_time" in effect.requires and effect.place is Place.SENSOR]
    model = build_model(device.model_copy(update={"effect": tuple(e for e in device.effect if e not in late)}))
    if not late:
        return model
    kinds = ", ".join(sorted({effect.kind for effect in late}))
    if model.held.numel() and _read_by_the_loop(build_model(device, sample_time=scenario.sample_time or 1.0)):
        what = (
            f"has {kinds} in the reading of its feedback loop, which is not inverted yet: leave it out to follow a path"
        )
        raise InputError(device.name, [Fault("effect", what)])
    warnings.warn(f"{device.name}: {kinds} is of the reading and changes no drive along a path; left out", stacklevel=2)
    return model


def _read_by_the_loop(model: Model) -> bool:
    """Whether states that change once a sample, as those of late readings do, act on the output of the feedback loop."""
    return bool(ca.depends_on(model.held_value, model.x[list(model.stepped)]))


def _derivatives_at(path: PathKind, frame: Frame, n: int, order: int, at: np.ndarray) -> np.ndarray:
    return path.derivatives(frame, n, order, at)


@lru_cache(maxsize=8)  # a scenario asks for it whenever it is sampled
def least_damped_mode(model: Model, follow: str, target: tuple[float, ...]) -> tuple[float, float] | None:
    """(undamped natural frequency [Hz], damping ratio) of the mode damped least at rest at `target` (channels,) [SI] of the signal
    `follow`; None where none vibrates."""
    dynamics = inverse_dynamics(model, follow)
    still = np.column_stack([np.array(target), np.zeros((len(target), dynamics.order))])
    x, z, u = (v.full().ravel() for v in dynamics.kernel(still))
    modes = natural_modes(model, x, z, u)
    return modes[0] if modes else None


def motion_targets(scenario: Scenario, model: Model) -> np.ndarray:
    """(n, channels * (order + 1)) what the online controller of a device with inertia is given to follow the scenario: position, then
    derivatives, at the middle of the time for which each drive is held. Raises InputError."""
    samples = np.arange(len(scenario.command(model)))
    motion = scenario.motion(model, samples + 0.5)
    return np.hstack([motion.position, *motion.derivatives])


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
    file = validate(ScenarioFile, table, file_path)
    inputs = {"scenario": Input(file_path, read_text(file_path))}
    if not isinstance(device, Device):
        device_path = file_path.parent / file.device if device is None else Path(device)
        device = load_device(device_path)
        names = ("device", "device_code")  # the second where a file names another one
        inputs |= {n: Input(p, read_text(p)) for n, p in zip(names, files_of(device_path), strict=False)}
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
    name = file_path.resolve().parent.name if file_path.name == FILE else file_path.stem
    return Scenario(_identifier(name), file_path, file, device, inputs)


def _identifier(name: str) -> str:
    """`name` as a C identifier, which becomes the prefix of the generated functions: 'my circle-1' -> 'my_circle_1'."""
    cleaned = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")
    return cleaned if cleaned[:1].isalpha() else f"s_{cleaned}"
