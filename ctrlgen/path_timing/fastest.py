"""The fastest path: the shortest time in which a scenario's path can be followed within all limits, and its law of time.

For a stage in balance the largest speed at each place is the answer (`maximum_velocity`), under held drives the longest step of each
sample; where the rates of drives are limited, or the stage has inertia, an optimum over the whole path is (`time_optimal_nlp`). What is
found becomes a scenario of its own, set-points at the sample rate, that the exact inverse confirms and everything else of ctrlgen reads.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from ctrlgen.budget.robust import solve
from ctrlgen.core.counts import number_of
from ctrlgen.core.errors import ExampleGiven, Fault, InputError, SolverError
from ctrlgen.core.tabular import Column, Reported, Tabular
from ctrlgen.core.units import Quantity, read_quantity, show
from ctrlgen.model.model import Model
from ctrlgen.path_timing.binding import Binding, bindings
from ctrlgen.path_timing.curve import Curve
from ctrlgen.path_timing.feasibility import Followed, fewest
from ctrlgen.path_timing.intersample_error import error_between
from ctrlgen.path_timing.optimum import Optimiser, Optimum
from ctrlgen.path_timing.repetition import Repetition, at_frequency, check_frequency
from ctrlgen.trajectory.infeasibility import check_feasible
from ctrlgen.trajectory.inverse.choice import count_faults
from ctrlgen.trajectory.inverse.clock import in_time
from ctrlgen.trajectory.scenario import Scenario, load_scenario, model_of
from ctrlgen.trajectory.solution import Solution

FEWEST = 8  # samples of the fastest motion: of fewer, nothing says where between them a limit is kept
COARSE = 32  # samples of a path, below which its set-points are few
EXAMPLES = {"--sample-rate": "10 kHz", "--frequency": "50 Hz"}
HIGHEST_RATE = 1e8  # Hz, of set-points: no controller is faster
STILL = 1e-9  # typical sizes, below which the length of a path is rounding
HELD_POINTS = 400  # at which it is looked at whether a path can be held


@dataclass(frozen=True, repr=False)
class FastestPath(Tabular, Reported):
    """The fastest motion along the path of a `scenario`.

    `optimum` in continuous time; `share` (N + 1,) of the path behind at each sample, of a closed one at its end too; `solution` of the
    set-points at the sample rate. `even` and `stated` [s]: the shortest times at even speed along the path and by the scenario's own
    law of time, under held drives; None where there is none. `between` (channels,) [SI] is the largest distance from the curve between
    set-points. `repetition` where a frequency was asked for. SI.
    """

    scenario: Scenario
    curve: Curve
    optimum: Optimum
    share: np.ndarray
    solution: Solution
    even: float | None
    stated: float | None
    between: np.ndarray
    repetition: Repetition | None
    notes: tuple[str, ...]

    def facts(self) -> dict[str, object]:
        """What it is, in a few words."""
        return {
            "scenario": self.scenario.file.title,
            "duration": f"{self.duration:.6g} s",
            "as stated": "not stated" if self.given is None else f"{self.given:.6g} s",
            "set-points": len(self.share),
        }

    def columns(self) -> tuple[Column, ...]:
        """Those of its set-points, as `Solution` has them."""
        return self.solution.columns()

    @property
    def sample_time(self) -> float:
        """Time between set-points [s]."""
        return in_time(self.solution.scenario.clock).sample_time

    @property
    def duration(self) -> float:
        """[s] from the first sample to the last, or of one period."""
        return (len(self.share) - 1) * self.sample_time

    @property
    def given(self) -> float | None:
        """[s] as the scenario states it, from its first sample to its last, or one period; None where it states none."""
        file = self.scenario.file
        if file.duration is None or file.sample_rate is None:
            return None
        return file.duration.si - (0.0 if self.curve.closed else 1 / file.sample_rate.si)

    @cached_property
    def bindings(self) -> tuple[Binding, ...]:
        """Which limit bounds the speed in which stretch of the path."""
        return bindings(self.optimum)


def fastest(
    scenario: Scenario | Path | str,
    *,
    sample_rate: str | None = None,
    frequency: str | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> FastestPath:
    """The fastest motion along the path of `scenario`, with set-points at its sample rate or at another `sample_rate`, such as
    "10 kHz"; with a `frequency`, such as "50 Hz", also the largest scale of the path that is repeated so often.

    Raises InputError for a path or device for which it is not computed, Unreachable where the path cannot even be held, and
    SolverError where nothing is found.
    """
    scenario = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
    progress("symbolic model")
    model = model_of(scenario)
    rate = _rate(scenario, sample_rate)
    wanted = None if frequency is None else _quantity("--frequency", frequency)
    if wanted is not None:
        check_frequency(rate, wanted)
    curve = Curve(scenario, model)
    if curve.length < STILL:
        what = f"is {curve.length:.1g} of the typical size of the {scenario.file.follow} long: nothing moves, and nothing bounds the speed"
        raise InputError(scenario.path, [Fault("path", f"{what}; make it longer")])
    if scenario.file.robust is not None:
        what = "asks for limits that hold at a probability, for which the fastest path is not computed; leave it out of a copy"
        raise InputError(scenario.path, [Fault("robust", what)])
    if scenario.file.shaping is not None:
        what = "asks for a shaped motion, for which the fastest path is not computed; leave it out of a copy"
        raise InputError(scenario.path, [Fault("shaping", what)])
    if scenario.file.leads_modes:
        what = 'is "modes", for which the fastest path is not computed: its law has no bodies beside the axes; leave it out of a copy'
        raise InputError(scenario.path, [Fault("feedforward", what)])
    if model.inertial and scenario.file.feedforward == "static":
        what = 'is "static", whose drives do not follow a path this fast; leave it out of a copy'
        raise InputError(scenario.path, [Fault("feedforward", what)])
    if model.clocks:
        what = "changes with time by itself, so that the fastest path depends on when it begins; leave the effect out"
        raise InputError(model.name, [Fault("effect", what)])
    if faults := count_faults(model, scenario.file.follow):
        raise InputError(scenario.path, faults)
    if not model.inertial:
        if model.redundant:
            axes = number_of(len(model.axes), "axis", "axes")
            what = f"has {model.u.numel()} drives for {axes} and no inertia, for which the fastest path is not computed"
            raise InputError(model.name, [Fault("device", what)])
        _check_held(scenario, model)
    followed = Followed.of(curve, model, rate)
    optimiser = Optimiser(followed.inverse.without_memories.model, scenario.file.follow, followed.sample_time)
    progress("fastest law of time")
    optimum = optimiser.along(curve, progress)
    progress("set-points")
    share = _sampled(optimum, followed)
    progress("even speed")
    least = max(2, int(optimum.duration * rate.si))
    even = _even(followed, least) if followed.may_be_even else None
    stated = _stated(scenario, followed, least)
    title = f"{scenario.file.title}: as fast as its limits allow"
    solution = solve(followed.scenario(share, title), model, progress)
    repetition = None
    if wanted is not None:
        progress(f"largest path at {wanted.text}")
        repetition = at_frequency(followed, optimiser, wanted, optimum, progress)
    between = error_between(curve, solution, share)
    return FastestPath(
        scenario, curve, optimum, share, solution, even, stated, between, repetition, _notes(followed, share)
    )


def _rate(scenario: Scenario, given: str | None) -> Quantity:
    if given is not None:
        rate = _quantity("--sample-rate", given)
        if rate.si > HIGHEST_RATE:
            raise InputError("--sample-rate", [Fault(given, f"is above {show(HIGHEST_RATE, 'MHz')}; give a lower one")])
        return rate
    if scenario.file.sample_rate is None:
        what = 'is missing: the fastest path is a motion in time; write sample_rate and duration, or give --sample-rate "1 kHz"'
        raise InputError(scenario.path, [Fault("sample_rate", what)])
    return scenario.file.sample_rate


def _quantity(option: str, text: str) -> Quantity:
    """The frequency that an option's `text` states. Raises InputError unless it is above zero."""
    example = f'write for example "{EXAMPLES[option]}"'
    try:
        frequency = read_quantity("Hz", text)
    except ExampleGiven as error:
        raise InputError(option, [Fault("value", str(error))]) from None
    except ValueError as error:
        raise InputError(option, [Fault("value", f"{error}; {example}")]) from None
    if frequency.si <= 0:
        raise InputError(option, [Fault("value", f"{text!r} is not above zero; {example}")])
    return frequency


def _check_held(scenario: Scenario, model: Model) -> None:
    """Raises Unreachable where the path cannot be followed however slowly."""
    still = {"sample_rate": None, "duration": None, "points": HELD_POINTS}
    held = replace(scenario, file=scenario.file.model_copy(update=still))
    check_feasible(held.bind(model))


def _sampled(optimum: Optimum, followed: Followed) -> np.ndarray:
    """The shares of the set-points, in as few samples as the exact inverse confirms. Raises SolverError."""
    begin = len(optimum.samples(followed.sample_time)) - 1
    if begin < FEWEST:
        enough = f"{np.ceil(COARSE / optimum.duration / 1e3):g} kHz"
        lasts = show(optimum.duration, "s")
        what = f'is too low: the fastest motion lasts {lasts}, which is {number_of(begin, "sample")}; give --sample-rate "{enough}"'
        if COARSE / optimum.duration > HIGHEST_RATE:
            what = f"is of no use: the path is so short that it takes {lasts}; make it longer"
        raise InputError(followed.curve.scenario.path, [Fault("sample_rate", what)])
    n = fewest(lambda n: followed.keeps(optimum.samples(followed.sample_time, n - begin)), begin)
    if n is None:
        raise SolverError(
            f"no set-points every {show(followed.sample_time, 's')} were found that keep all limits; raise the sample rate"
        )
    return optimum.samples(followed.sample_time, n - begin)


def _even(followed: Followed, least: int) -> float | None:
    """The shortest time [s] at even speed along the curve."""
    n = fewest(lambda n: followed.keeps(followed.curve.evenly(n)), least)
    return None if n is None else (len(followed.curve.evenly(n)) - 1) * followed.sample_time


def _stated(scenario: Scenario, followed: Followed, least: int) -> float | None:
    """The shortest time [s] by the scenario's own law of time."""

    def follows(n: int) -> bool:
        duration = read_quantity("s", f"{(n + (not followed.curve.closed)) / followed.rate.si!r} s")
        update = {"duration": duration, "sample_rate": followed.rate, "points": None}
        try:
            return followed.keeps_timed(replace(scenario, file=scenario.file.model_copy(update=update)))
        except InputError:  # too few samples, or not smooth enough
            return False

    n = fewest(follows, least)
    return None if n is None else n * followed.sample_time


def _notes(followed: Followed, share: np.ndarray) -> tuple[str, ...]:
    notes = []
    if len(share) - followed.curve.closed < COARSE:
        few = f"{len(share) - followed.curve.closed} set-points are few for this path"
        notes.append(f"{few}: between them the device may leave it; give a higher --sample-rate")
    if followed.inverse.without_memories is not followed.inverse:
        notes.append(
            "the law of time is the fastest without the memories of effects, slowed until limits are kept with them"
        )
    return tuple(notes)
