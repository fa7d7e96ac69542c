"""What is to be followed by which model: the path of a scenario in the followed signal of a model, sample by sample."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from pathlib import Path

import casadi as ca
import numpy as np

from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import Fault, InputError
from ctrlgen.core.units import Quantity, read_quantity, show, written_unit
from ctrlgen.devices import Signal
from ctrlgen.model.inverse_dynamics import inverse_dynamics, relative_degrees
from ctrlgen.model.led_modes import MORE, led
from ctrlgen.model.model import Model
from ctrlgen.model.quasi_static import natural_modes, quasi_static
from ctrlgen.physics.pivot import about
from ctrlgen.physics.screw import FULL_TURN, TWIST
from ctrlgen.trajectory.frame import Frame
from ctrlgen.trajectory.inverse.choice import choose_inverse
from ctrlgen.trajectory.inverse.clock import Clock, Sampled, Settled, in_time
from ctrlgen.trajectory.inverse.motion import Motion
from ctrlgen.trajectory.inverse.path_inverse import PathInverse
from ctrlgen.trajectory.paths import PathKind, Poses
from ctrlgen.trajectory.scenario_file import MOST_SAMPLES, ScenarioFile
from ctrlgen.trajectory.shaping import Shaper
from ctrlgen.trajectory.shaping import shaper as make_shaper

WHOLE = 1e-6  # of the number of samples, by which rate times duration may be off a whole one: durations are written with six digits
SMOOTHER = 1  # derivatives more than the drive follows: it then starts without a bend too
LEAST_CLOSED = 3  # samples of a closed motion: of two, drives that change at each of them show nothing of one between
RESOLVED = 0.5  # of the largest value of a derivative, by which it may change from one listed sample to the next


@dataclass(frozen=True, eq=False)
class PathProblem:
    """The path of the scenario `file` that was read from `source`, moved by `home` [SI] by channel, to be followed by a `model`. What it
    gives raises InputError where the file or the model does not determine it. `given_shaper` shapes the path instead of what the file and
    the model determine; None where these do."""

    source: Path
    file: ScenarioFile
    model: Model
    home: Mapping[str, float]
    given_shaper: Shaper | None = None

    @property
    def follow(self) -> str:
        """The name of the followed signal."""
        return self.file.follow

    @property
    def signal(self) -> Signal:
        """The signal that the scenario follows."""
        return self.model.signals[self.file.follow]

    @property
    def clock(self) -> Clock:
        """When the samples are: settled one by one, or in time."""
        return self.file.clock

    @property
    def closed(self) -> bool:
        """Whether the path is periodic: its first sample follows the last one."""
        return self.file.closed

    @cached_property
    def in_balance(self) -> PathProblem:
        """The same samples for the device as if it stood in balance: what the path leaves open is written out as inertia has it. Raises
        InputError for a device without inertia, and one whose static drive depends on the motion."""
        if not self.order:
            what = "is static, but the device has no inertia"
        elif isinstance(self.clock, Settled):
            what = "is of motions: give sample_rate and duration"
        else:
            file = self.file.model_copy(update={"path": self._path})
            return replace(self, file=file, model=quasi_static(self.model), given_shaper=self.shaper)
        raise InputError(self.source, [Fault("feedforward", f"{what}; leave it out")])

    @cached_property
    def inverse(self) -> PathInverse:
        """The inverse of the model along such paths."""
        return choose_inverse(self.model, self.follow, self.clock)

    @cached_property
    def order(self) -> int:
        """How many derivatives of the path by time the drive follows: none in balance, else the largest relative degree."""
        return max(relative_degrees(self.model, self.follow)) if self.model.inertial else 0

    @cached_property
    def samples(self) -> np.ndarray:
        """(n, channels) [SI] the samples that the model follows: those that are asked for, or where modes of the bodies are led, those of
        the model condensed to its axes."""
        return self.asked if self._led is None else self.motion.position

    @cached_property
    def asked(self) -> np.ndarray:
        """(n, channels) [SI] the samples that the scenario asks for."""
        samples = self._unshaped if self.file.shaping is None else self._positions(len(self._unshaped), 0.0)
        if isinstance(self.clock, Sampled) and len(samples) < 2:
            what = "has one sample, but motion in time needs two or more; for one pose leave out sample_rate"
            raise InputError(self.source, [Fault("path", what)])
        return samples

    @cached_property
    def _unshaped(self) -> np.ndarray:
        """(n, channels) [SI] the samples of the path that is not shaped, of the point that the signal states, from `home`."""
        return self._about(self._on_path(lambda path, frame, n: path.samples(frame, n))[None])[0] + self._moved

    @cached_property
    def motion(self) -> Motion:
        """The samples with as many derivatives by time as the drive follows."""
        return self.motion_after(0.0)

    def motion_after(self, after: float) -> Motion:
        """The same so many samples `after` each sample; before it where negative."""
        if not self.order:
            return Motion.of_samples(self.positions(after) if after else self.samples, self.closed)
        if not isinstance(self.clock, Sampled):
            what = f'is missing: {self.model.name} has inertia, what it needs depends on time; write sample_rate = "1 kHz" and duration'
            raise InputError(self.source, [Fault("sample_rate", what)])
        n, order = len(self.asked), self._followed
        least = LEAST_CLOSED if self.closed else order + 1
        if n < least:
            what = f"has {number_of(n, 'sample')}; {self.model.name}, which has inertia, takes {least} or more"
            raise InputError(self.source, [Fault("path", f"{what}: raise sample_rate, or make the path longer")])
        self._check_smoothness(order)
        asked = self.asked_after(after)
        if self._led is None:
            return asked
        led = np.stack([self._led(target).full() for target in asked.stacked()])
        return Motion(led[:, :, 0], np.moveaxis(led[:, :, 1:], -1, 0), self.closed)

    def asked_after(self, after: float) -> Motion:
        """The motion that the scenario asks for, with as many derivatives as the controller takes, so many samples `after` each: with
        `feedforward = "modes"` not that of the condensed model, which `motion_after` gives."""
        order = self._followed
        tables = self._tables(order, np.arange(len(self.asked)) + after)
        rates = in_time(self.clock).sample_time ** -np.arange(1.0, order + 1)
        return Motion(tables[0], tables[1:] * rates[:, None, None], self.closed)

    @property
    def _followed(self) -> int:
        """How many derivatives of the asked path the drive follows."""
        return self.order if self._led is None else self.order + MORE

    @cached_property
    def _led(self) -> ca.Function | None:
        """The target of the condensed model of the asked one; None where they are the same."""
        return led(self.model, self.follow, self.order) if self.file.leads_modes else None

    @cached_property
    def targets(self) -> np.ndarray:
        """(n, channels * (order + 1)) what the online controller is given: with inertia position, then derivatives, at the middle of the
        time for which each drive is held; in balance the samples."""
        motion = self.asked_after(0.5) if self.order else self.motion
        return np.hstack([motion.position, *motion.derivatives])

    def positions(self, after: float) -> np.ndarray:
        """(n, channels) [SI] of the followed signal so many samples `after` each sample; before it where negative."""
        return self._positions(len(self._unshaped), after)

    def geometry(self, order: int, share: np.ndarray) -> np.ndarray:
        """(order + 1, len(share), channels) [SI, per share^k]: the curve of the path alone, where the `share` of it, 0 ... 1, is
        behind."""
        return self._about(self._on_path(lambda path, frame, n: path.geometry(frame, order, share)))

    @property
    def corners(self) -> np.ndarray:
        """The shares of the path at which it begins, has corners, and ends; a closed one has none."""
        return self._on_path(lambda path, frame, n: path.corners_at(frame))

    @cached_property
    def slowed(self) -> Callable[[float], Motion] | None:
        """How many times as long -> the motion along the same path; None for one that is not shaped by a formula."""
        if isinstance(self.file.path, Poses) or self.file.duration is None or self.file.sample_rate is None:
            return None
        n, rate = self._sample_count(self.file.sample_rate, self.file.duration), self.file.sample_rate
        shaper, most = self.shaper, MOST_SAMPLES - self._longer

        def motion(times: float) -> Motion:
            samples = min(round(times * n), most)
            longer = read_quantity("s", f"{samples / rate.si!r} s")
            return replace(self, file=self.file.model_copy(update={"duration": longer}), given_shaper=shaper).motion

        return motion

    @cached_property
    def shaper(self) -> Shaper | None:
        """The impulses with which the path is convolved; None where it is not shaped. Raises InputError for a closed path, for a
        stated frequency too high for the samples, and where the model has no mode and none is stated."""
        if self.given_shaper is not None:
            return self.given_shaper
        given = self.file.shaping
        if given is None or not isinstance(self.clock, Sampled):
            return None
        if self.closed:
            what = "leaves a mode at rest where a path ends, but this one is periodic: write from_rest = true in path, or leave it out"
            raise InputError(self.source, [Fault("shaping", what)])
        if given.frequency is not None:
            fastest = 0.5 / self.clock.sample_time
            if given.frequency.si > fastest:
                what = f"is above half the sample_rate, {show(fastest, 'Hz', 6)}, where shaping does nothing; lower it or raise sample_rate"
                raise InputError(self.source, [Fault("shaping.frequency", what)])
            ratio = 0.0 if given.damping_ratio is None else given.damping_ratio.si
            return make_shaper(given.kind, given.frequency.si, ratio)
        mode = least_damped_mode(self.model, self.follow, tuple(self._unshaped[-1])) if self.order else None
        if mode is None:
            name = self.model.name
            why = "no mode that vibrates" if self.order else "no inertia, so that no mode vibrates"
            what = f'is missing: the model of {name} has {why}; write that of the device, frequency = "100 Hz", or leave out shaping'
            raise InputError(self.source, [Fault("shaping.frequency", what)])
        ratio = mode[1] if given.damping_ratio is None else given.damping_ratio.si
        return make_shaper(given.kind, mode[0], ratio)

    @property
    def _longer(self) -> int:
        """The number of samples by which shaping makes the path longer."""
        if self.shaper is None or not isinstance(self.clock, Sampled):
            return 0
        return self.shaper.samples(self.clock.sample_time)

    def _positions(self, n: int, after: float) -> np.ndarray:
        """(n, channels) [SI] of the path of `n` samples, or shaped as many more as that takes, so many samples `after` each."""
        # listed samples are joined by cubic splines, and not by lines
        order = 1 if isinstance(self.file.path, Poses) else 0
        if self.shaper is not None and n + self._longer > MOST_SAMPLES:
            frequency = show(self.shaper.frequency, "Hz")
            what = f"of {frequency} makes the path {self._longer:.6g} samples longer, but at most {MOST_SAMPLES} are possible"
            raise InputError(self.source, [Fault("shaping.frequency", f"{what}: raise it, or lower sample_rate")])
        return self._tables(order, np.arange(n + self._longer) + after)[0]

    def _tables(self, order: int, at: np.ndarray) -> np.ndarray:
        """(order + 1, len(at), channels) [SI, per sample^k] of the path, shaped where there is a shaper."""
        delays = [(1.0, 0.0)]
        if self.shaper is not None and isinstance(self.clock, Sampled):
            rate = 1 / self.clock.sample_time
            delays = [(a, t * rate) for a, t in zip(self.shaper.amplitudes, self.shaper.times, strict=True)]
        parts = [
            amplitude * self._about(self._on_path(partial(_derivatives_at, order=order, at=at - samples)))
            for amplitude, samples in delays
        ]
        tables = np.sum(parts, axis=0)
        tables[0] += self._moved
        return np.asarray(tables)

    def _about(self, tables: np.ndarray) -> np.ndarray:
        """`tables` (order + 1, n, channels) of the scenario's pivot and its derivatives, of the point that the signal states."""
        if self.file.pivot is None:
            return tables
        channels = self.signal.channels
        turn = np.linalg.norm(tables[0][:, [k for k, name in enumerate(channels) if name in TWIST[:3]]], axis=1).max()
        if turn > FULL_TURN:
            what = (
                f"turns by {show(turn, 'deg')}, and a pose about a pivot by at most {show(FULL_TURN, 'deg')}; turn less"
            )
            raise InputError(self.source, [Fault("path", what)])
        return about(channels, tables, np.array([x.si for x in self.file.pivot]))

    @property
    def _moved(self) -> np.ndarray:
        """The shift (channels,) [SI] of the path that `home` states."""
        return np.array([self.home.get(channel, 0.0) for channel in self.signal.channels])

    def _check_smoothness(self, order: int) -> None:
        """Refuses a path whose derivative of this order jumps, so that the drive would."""
        path, samples, name = self._path, self.asked, self.model.name
        if isinstance(path, Poses):
            rest = (samples[:1].repeat(order + 1, axis=0), samples[-1:].repeat(order + 1, axis=0))
            before, after = (samples, samples) if self.closed else rest
            still = np.vstack([before[-order - 1 :], samples, after[: order + 1]])
            largest, change = (np.abs(np.diff(still, k, axis=0)).max(axis=0) for k in (order, order + 1))
            if np.any(change > RESOLVED * largest):
                what = (
                    f"is too coarse or not smooth: its {order}. derivative, which the drive of {name} follows, changes by more "
                    "than half from one sample to the next; begin and end at rest, and give smoother or more samples with all digits"
                )
                raise InputError(self.source, [Fault("path", what)])
        elif path.continuous < order:
            key = "even" if getattr(path, "even", False) else "smooth"
            remedy = "leave it out" if key == "even" else f"write smooth = {order} or more, or leave it out"
            what = f"makes derivative {path.continuous + 1} jump at rest points; the drive of {name} follows {order}: {remedy}"
            raise InputError(self.source, [Fault(f"path.{key}", what)])

    @property
    def _path(self) -> PathKind:
        """The path, where it leaves that open as smooth as the drive of the device needs."""
        path = self.file.path
        if isinstance(path, Poses):
            return path.model_copy(update={"folder": self.source.parent})
        if path.smooth is None and self.order:
            return path.model_copy(update={"smooth": self._followed + SMOOTHER})
        return path

    def _on_path(self, evaluate: Callable[[PathKind, Frame, int], np.ndarray]) -> np.ndarray:
        """What `evaluate` (path, frame, number of samples) gives, the path's faults with their places in the file."""
        n = self.file.points or 0
        if self.file.sample_rate and self.file.duration:
            n = self._sample_count(self.file.sample_rate, self.file.duration)
        try:
            return evaluate(self._path, Frame(self.signal.channels, self.signal.units, self.file.angles), n)
        except InputError as error:
            if error.source != "path":
                raise
            raise InputError(self.source, [Fault(f"path.{f.where}", f.what) for f in error.faults]) from None

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
            raise InputError(self.source, [Fault("duration", what)])
        return n


def _derivatives_at(path: PathKind, frame: Frame, n: int, order: int, at: np.ndarray) -> np.ndarray:
    return path.derivatives(frame, n, order, at)


@lru_cache(maxsize=8)  # many problems of one model ask for it, those of slower paths among them
def least_damped_mode(model: Model, follow: str, target: tuple[float, ...]) -> tuple[float, float] | None:
    """(undamped natural frequency [Hz], damping ratio) of the mode damped least at rest at `target` (channels,) [SI] of the signal
    `follow`; None where none vibrates."""
    dynamics = inverse_dynamics(model, follow)
    still = np.column_stack([np.array(target), np.zeros((len(target), dynamics.order))])
    x, z, u = (v.full().ravel() for v in dynamics.kernel(still))
    modes = natural_modes(model, x, z, u)
    return modes[0] if modes else None
