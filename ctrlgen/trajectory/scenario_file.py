"""scenario.toml: what a scenario states, its units checked; `ctrlgen.trajectory.scenario` makes a path of it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from ctrlgen.core.names import CName
from ctrlgen.core.units import In, Quantity, read_probability
from ctrlgen.devices.load import Gravity, Load
from ctrlgen.devices.place import Place
from ctrlgen.devices.section import Section
from ctrlgen.physics.euler_angles import Order
from ctrlgen.trajectory.correction_section import CorrectionSection
from ctrlgen.trajectory.inverse.clock import Clock, Sampled, Settled
from ctrlgen.trajectory.paths import PathKind, Poses
from ctrlgen.trajectory.shaping import Shaping

MOST_SAMPLES = 1_000_000  # of one path: what memory holds


class Expectation(Section):
    """One `[[expect]]` table: a value that the solution must have, named as `trajectory.metrics.metric` reads it."""

    value: str
    """What is expected: SIGNAL.CHANNEL.min, .max, .rms or .abs, SIGNAL.CHANNEL[sample], or margin.LIMIT."""
    range: tuple[str, str]
    """Smallest and largest value that pass, with units."""
    source: str = ""
    """Where the expected value comes from."""


class Robust(Section):
    """Limits that hold for what is not known exactly: the standard deviations of uncertainty.toml beside the scenario and those of the
    device file."""

    probability: str
    """With which all limits hold along the whole path, such as "99.9 %"."""
    home: tuple[str, ...] = ()
    """Channels of the followed signal along which the whole path may be moved; of the places where the limits hold, that with the
    smallest expected error is taken."""

    @model_validator(mode="after")
    def _meaning(self) -> Robust:
        if not 0.5 <= self.chance < 1:
            raise ValueError(
                f'probability = "{self.probability}" must be at least 50 % and below 100 %, such as "99.9 %"'
            )
        if len(set(self.home)) < len(self.home):
            raise ValueError(f"home names a channel twice: {', '.join(self.home)}; name each once")
        return self

    @property
    def chance(self) -> float:
        """The probability as a number, 0.999 for "99.9 %"."""
        return read_probability(self.probability)


class ScenarioFile(Section):
    """A path for a device to follow.

    With `sample_rate` the path is followed in time; without it the scenario is static, a row of separate equilibria.
    """

    title: str
    """The scenario in words, for reports."""
    device: str
    """The device file, relative to this one."""
    controller: CName | None = None
    """C name of the online controller and of the plant, a C identifier in lower case. Left out: the device's name. Controllers of one
    device at two rates need two names to be linked into one program.
    """
    checksum: bool = False
    """`true`: the C has a second interface to the controller, `..._checked`, with a CRC-32 over its state and run-time constants, which
    finds bits that flipped in memory; what it costs is in the README of the C. Left out: it has not.
    """
    follow: Literal["pose", "displacement"] = "pose"
    """The signal that the path commands: the platform's pose, or the stages' displacements."""
    angles: Order | None = None
    """theta_x, theta_y and theta_z of stated poses are angles about x, y and z in this order: "xyz intrinsic" about axes that turn with the
    body, "xyz extrinsic" about those that stay. Left out: they are the components of a rotation vector, as of every pose of a result.
    """
    pivot: Place | None = None
    """The path is that of this point of the body, whose place at home is seen from the point that the pose states: about a point 20 mm
    below turns ["0 mm", "0 mm", "-20 mm"]. Results state the pose of the device's own point. Left out: so does the path."""
    sample_rate: Annotated[Quantity, In("Hz", positive=True)] | None = None
    """Samples a second of a motion in time. Left out: the scenario is static, and its samples are separate equilibria.
    """
    sample_times: (
        tuple[Annotated[Quantity, In("s", positive=True)], Annotated[Quantity, In("s", positive=True)]] | None
    ) = None
    """Shortest and longest time between two calls of the C, such as ["0.5 ms", "2 ms"] around a `sample_rate` of 1 kHz: it then has
    `..._step_after`, which takes how long ago the last call was and when the next one will be. Of devices in balance whose states have a
    lag each; refused for others, with the reason. Left out: the C is called at its sample rate alone."""
    duration: Annotated[Quantity, In("s", positive=True)] | None = None
    """Length of the motion; with `sample_rate` it gives the number of samples."""
    points: Annotated[int, Field(ge=2, le=MOST_SAMPLES)] | None = None
    """Number of samples of a static scenario; not needed for a list of poses."""
    path: PathKind
    """The commanded path; its `kind` chooses the shape."""
    shaping: Shaping | None = None
    """`[shaping]`: the path is shaped so that it leaves a mode of the device at rest. Left out: it is not."""
    feedforward: Literal["inertia", "modes", "static"] = "inertia"
    """Of a device with inertia. `inertia`: the drives that move its masses along the path. `modes`: of a mechanism with [dynamics], those
    that bend its bodies beside its axes too, to the fourth derivative of the path, which the C takes with its target. `static`: those
    that would if it stood in balance at every moment, without inertia and damping; it then follows as well as it does, and vibrates.
    """
    fixed_point: bool = False
    """Whether the C has a third online controller, in integers of 32 bits with a proven error, for cores without a floating-point unit
    (Cortex-M0+). For actuators with a lag whose displacements are linear in the target; refused for others, with the reason."""
    correction: tuple[CorrectionSection, ...] = ()
    """`[[correction]]` tables: the C has a library beside the controller, `..._corrected`, that adds a bounded correction to the commanded
    channels and learns it from measured runs: cogging, the pitch of a screw or an encoder. Left out: it has not."""
    outcome: Literal["solved", "unreachable"] = "solved"
    """Whether a trajectory is expected to exist; `unreachable` passes where none does."""
    load: tuple[Load, ...] = ()
    """`[[load]]` tables: what acts on the device all the time along this path, beside what its file states; one of the same name takes
    the place of that. They are compiled into the C."""
    gravity: Gravity | None = None
    """Acceleration of what falls, such as ["0 m/s^2", "0 m/s^2", "-9.81 m/s^2"], in place of the device's. Left out: as its file states."""
    robust: Robust | None = None
    """Left out: the limits hold for the device as described, and may be broken by one whose numbers differ."""
    expect: tuple[Expectation, ...] = ()
    """`[[expect]]` tables: values that the solution must have."""

    @property
    def leads_modes(self) -> bool:
        """Whether the drives lead modes of the bodies beside the axes."""
        return self.feedforward == "modes"

    @property
    def clock(self) -> Clock:
        """When the samples are: settled one by one, or in time."""
        return Settled() if self.sample_rate is None else Sampled(1 / self.sample_rate.si)

    @property
    def closed(self) -> bool:
        """Whether the path is periodic: its first sample follows the last one."""
        return self.sample_rate is not None and self.path.closed

    @model_validator(mode="after")
    def _robust_feedforward(self) -> ScenarioFile:
        if self.robust is not None and self.feedforward == "static":
            raise ValueError(
                'robust solves for drives that keep the path, which feedforward = "static" does not; leave out one of them'
            )
        if self.robust is not None and self.leads_modes:
            raise ValueError(
                'robust judges the model condensed to its axes, whose path feedforward = "modes" does not keep; leave out one of them'
            )
        return self

    @model_validator(mode="after")
    def _integers(self) -> ScenarioFile:
        if self.fixed_point and self.correction:
            raise ValueError(
                "fixed_point has no [[correction]]: the controller in integers would follow targets that nothing is added to; leave out "
                "one of them"
            )
        return self

    @model_validator(mode="after")
    def _varied(self) -> ScenarioFile:
        if self.sample_times is None:
            return self
        low, high = self.sample_times
        if self.sample_rate is None:
            raise ValueError(
                "sample_times are of motions in time: give sample_rate, which lies between them, or leave them out"
            )
        if not low.si <= 1 / self.sample_rate.si * (1 + 1e-9) <= high.si * (1 + 2e-9) or low.si == high.si:
            raise ValueError(
                f'sample_times = ["{low.text}", "{high.text}"] must be the shortest and the longest, with that of sample_rate '
                f'between them: "{self.sample_rate.text}" is one sample every {1 / self.sample_rate.si:g} s'
            )
        others = {
            "shaping": self.shaping is not None,
            "fixed_point": self.fixed_point,
            'feedforward = "modes"': self.leads_modes,
        }
        if other := next((name for name, kept in others.items() if kept), None):
            raise ValueError(
                f"sample_times cannot be kept with {other}, whose numbers are those of one sample time; leave one of them out"
            )
        return self

    @model_validator(mode="after")
    def _timing(self) -> ScenarioFile:
        if self.sample_rate is None:
            if self.duration is not None:
                raise ValueError(
                    "duration is given without sample_rate; add sample_rate, or leave both out for a static scenario"
                )
            if self.shaping is not None:
                raise ValueError("shaping is of motions in time: give sample_rate and duration, or leave it out")
            if isinstance(self.path, Poses) and self.path.periodic:
                raise ValueError("path.periodic is of motions in time: give sample_rate, or leave it out")
            if self.points is None and not isinstance(self.path, Poses):
                raise ValueError(
                    'a static scenario needs points = N; for motion in time give sample_rate = "1 kHz" and duration'
                )
        elif isinstance(self.path, Poses):
            if self.duration is not None or self.points is not None:
                raise ValueError("a list of poses already fixes the number of samples; leave out duration and points")
        elif self.duration is None or self.points is not None:
            raise ValueError('with sample_rate give duration = "1 s" (and no points)')
        return self
